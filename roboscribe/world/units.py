"""Units of attributes: which are lengths or angles, and how much of the SI unit one of them is."""

from __future__ import annotations

from math import pi

LENGTHS = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 1e-3, "um": 1e-6, "km": 1e3, "in": 0.0254, "ft": 0.3048}
"""Metres in one unit of length."""
ANGLES = {"rad": 1.0, "deg": pi / 180}
"""Radians in one unit of angle."""
PER_SECOND = "/s"
"""What a unit of speed ends with."""


def is_length(unit: str) -> bool:
    """Whether it measures lengths."""
    return unit in LENGTHS


def is_angle(unit: str) -> bool:
    """Whether it measures angles."""
    return unit in ANGLES


def is_speed(unit: str) -> bool:
    """Whether it measures how fast something changes."""
    return unit.endswith(PER_SECOND)


def in_si(unit: str) -> float:
    """Return how many metres or radians one unit is, or metres or radians per second; of other units 1."""
    of = unit.removesuffix(PER_SECOND)
    return LENGTHS.get(of, ANGLES.get(of, 1.0))


def turn(unit: str) -> float:
    """Return a full turn in a unit of angle."""
    return 2 * pi / ANGLES[unit]
