"""What a controller sees: the objects among its arguments and the differences of their positions, nothing else.

That is what lets a skill learned on five blocks work on nine. A spec names attributes, not columns, so it outlives
the layout it was built on; `Encoder` binds it to one layout.

Extension point: where an `until` predicate quantifies over a type none of whose entities is an argument, further
slots (the nearest such entities, chosen per state) would be appended to the entities given to `Encoder`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import assert_never

import numpy as np
from numpy.typing import NDArray

from roboscribe.dsl.fields import same_measure
from roboscribe.dsl.rewrite import run_variables
from roboscribe.dsl.syntax import Goal, Object, Robot, Run, Var
from roboscribe.errors import ArtifactError
from roboscribe.world.layout import ROBOT, Attribute, FloatArray, IntArray, Layout
from roboscribe.world.units import PER_SECOND, in_si, is_angle, is_length, is_speed

FINE_SCALES = (0.1, 0.05, 0.025, 0.0125)
"""Scales in metres of the clipped copies of small differences; four cloned better than two from few demonstrations."""
FINE_CLIP = 2.0
"""Bound of a fine copy, in its scale: the next coarser copy tells apart what is further off."""
PLANAR = 2
"""Components of a difference as seen from above."""
TURNED_SCALES = (0.1, 0.025)
"""Scales in metres of the copies of differences along and across others."""
LEAST_LENGTH = 1e-3
"""A difference shorter than this has no direction, m."""
NEARBY = 0.2
"""How near the robot sees where it may have to leave, m; from further off that says nothing about its way."""
CLIP = 4.0
"""Bound of a normalised input, in standard deviations: what no demonstration came near must not drown the rest."""
LEAST_LENGTH_SPREAD, LEAST_ANGLE_SPREAD, LEAST_SPREAD = 0.01, 0.1, 1e-3
"""Least standard deviations by which lengths (m), angles (rad) and other numbers are divided: what hardly varies in
demonstrations must not explode."""
STILL = 0.5
"""Share of those least spreads below which what varies of an entity is an accident, a degree of tilt for instance."""


@dataclass(frozen=True)
class Part:
    """One attribute that is seen.

    Args:
        slot: ROBOT, or the rank of the variable among the controller's distinct variables.
        attribute: its name.
        goal: whether it is the goal's.
    """

    slot: int
    attribute: str
    goal: bool = False


@dataclass(frozen=True)
class ObservationSpec:
    """Which numbers a controller sees, and how they are normalised.

    Args:
        types: type of each bound entity, by slot.
        parts: attributes looked at.
        pairs: ranks of parts of which the difference is seen instead of themselves.
        fine: scales of the fine copies of those differences, m.
        mean: of attributes and differences, in their units; empty before `fitted`.
        std: as `mean`.
        turned: ranks of pairs; of the first difference its parts along and across the second are seen, from above.
        nearby: ranks of pairs whose difference fades with its length, and is not seen from `NEARBY` on.
    """

    types: tuple[str, ...]
    parts: tuple[Part, ...]
    pairs: tuple[tuple[int, int], ...]
    fine: tuple[float, ...] = FINE_SCALES
    mean: tuple[float, ...] = ()
    std: tuple[float, ...] = ()
    turned: tuple[tuple[int, int], ...] = ()
    nearby: tuple[int, ...] = ()

    @property
    def alone(self) -> tuple[int, ...]:
        """Ranks of the parts that are seen themselves: those of which no difference is."""
        paired = {rank for pair in self.pairs for rank in pair}
        return tuple(rank for rank in range(len(self.parts)) if rank not in paired)

    def fitted(self, layout: Layout, states: FloatArray, entities: IntArray) -> ObservationSpec:
        """Return the spec with mean and spread taken from states (R, F) and entities (R, n); of none, 0 and 1."""
        encoder = Encoder(self, layout)
        raw = encoder.raw(states, entities)
        if not len(raw):  # a skill that no demonstration shows and that no episode reaches
            return replace(self, mean=(0.0,) * raw.shape[1], std=(1.0,) * raw.shape[1])
        spread = np.maximum(raw.std(axis=0), encoder.least_spread)
        return replace(self, mean=tuple(raw.mean(axis=0).tolist()), std=tuple(spread.tolist()))

    def without_still(self, layout: Layout, states: FloatArray, entities: IntArray) -> ObservationSpec:
        """Leave out what is seen of entities alone and hardly varies in demonstrated states (R, F), entities (R, n).

        Nothing that was shown depends on it, and where it is another, as the tilt of a block that fell over, a clone
        would do what nobody showed.
        """
        encoder = Encoder(self, layout)
        varied = encoder.raw(states, entities).std(axis=0) > STILL * encoder.least_spread
        still, start = set(), 0
        for rank in self.alone:
            stop = start + encoder.columns[rank][1].shape[1]
            if self.parts[rank].slot != ROBOT and not varied[start:stop].any():
                still.add(rank)
            start = stop
        kept = [rank for rank in range(len(self.parts)) if rank not in still]
        pairs = tuple((kept.index(i), kept.index(j)) for i, j in self.pairs)
        return replace(self, parts=tuple(self.parts[rank] for rank in kept), pairs=pairs)

    def to_json(self) -> dict[str, object]:
        """Return plain lists, numbers and strings."""
        parts = [[part.slot, part.attribute, part.goal] for part in self.parts]
        pairs = [list(pair) for pair in self.pairs]
        turned = [list(pair) for pair in self.turned]
        numbers = {"fine": list(self.fine), "mean": list(self.mean), "std": list(self.std)}
        ranks = {"turned": turned, "nearby": list(self.nearby)}
        return {"types": list(self.types), "parts": parts, "pairs": pairs, **ranks, **numbers}

    @staticmethod
    def from_json(data: Mapping[str, object]) -> ObservationSpec:
        """Read what `to_json` wrote.

        Raises:
            ArtifactError: a field is missing or of another kind.
        """
        try:
            found = ObservationSpec(
                types=tuple(str(kind) for kind in _rows(data["types"])),
                parts=tuple(_part(row) for row in _rows(data["parts"])),
                pairs=tuple(_pair(row) for row in _rows(data["pairs"])),
                turned=tuple(_pair(row) for row in _rows(data.get("turned", []))),
                nearby=tuple(_rank(row) for row in _rows(data.get("nearby", []))),
                fine=_numbers(data["fine"]),
                mean=_numbers(data["mean"]),
                std=_numbers(data["std"]),
            )
            found.check_ranks()
        except (KeyError, TypeError, ValueError) as error:
            msg = f"observation spec cannot be read: {error!r}; expected types, parts, pairs, fine, mean, std"
            raise ArtifactError(msg) from error
        return found

    def check_ranks(self) -> None:
        """Raise ValueError where `turned` or `nearby` name a pair that is not there."""
        named = {*self.nearby, *(rank for pair in self.turned for rank in pair)}
        if not named <= {*range(len(self.pairs))}:
            msg = f"expected ranks of {len(self.pairs)} pairs, found {sorted(named)}"
            raise ValueError(msg)


def _rows(value: object) -> list[object]:
    if not isinstance(value, list):
        msg = f"expected a list, found {type(value).__name__}"
        raise TypeError(msg)
    return value


def _part(row: object) -> Part:
    slot, attribute, goal = _rows(row)
    if not isinstance(slot, int) or not isinstance(attribute, str) or not isinstance(goal, bool):
        msg = f"expected [slot, attribute, goal], found {row}"
        raise TypeError(msg)
    return Part(slot, attribute, goal)


def _pair(row: object) -> tuple[int, int]:
    left, right = _rows(row)
    if not isinstance(left, int) or not isinstance(right, int):
        msg = f"expected two ranks, found {row}"
        raise TypeError(msg)
    return left, right


def _rank(value: object) -> int:
    if not isinstance(value, int):
        msg = f"expected a rank, found {value}"
        raise TypeError(msg)
    return value


def _numbers(value: object) -> tuple[float, ...]:
    numbers = [number for number in _rows(value) if isinstance(number, int | float)]
    if len(numbers) != len(_rows(value)) or not np.isfinite(numbers).all():
        msg = f"expected finite numbers, found {value}"
        raise ValueError(msg)
    return tuple(float(number) for number in numbers)


def observation_spec(
    run: Run,
    types: Mapping[str, str],
    layout: Layout,
    *,
    goals: bool = False,
    near: bool = False,
    speeds: bool = False,
) -> ObservationSpec:
    """Build the spec of a controller from its arguments; `fitted` completes it.

    Args:
        run: its arguments are μ, variables and goals of variables.
        types: type of each variable.
        layout: declares the attributes.
        goals: whether the goals of entities among the arguments are seen, too, by the robot alone: where it is to
            leave is not to be confused with where an entity shall go.
        near: whether it sees these from near by alone.
        speeds: whether all speeds are seen, too, instead of the robot's velocity alone, which was measured to lift
            clones from 96 to 99 %.

    Returns:
        Attributes in order of the arguments, quaternions and flags aside, and the difference of every two lengths named
        alike; of every two that can be seen from above, how one lies to the other.
    """
    names = run_variables(run)
    further = [Goal(Var(name)) for name in names if goals and layout.types[types[name]].goal]
    seen: list[tuple[Part, Attribute, bool]] = []
    for arg in dict.fromkeys((*run.args, *further)):
        slot, goal = _slot(arg, names)
        kind = layout.robot if slot == ROBOT else layout.types[types[names[slot]]]
        shown = [a for a in kind.described(goal) if _is_seen(a, moving=speeds, robot=slot == ROBOT)]
        seen += [(Part(slot, a.name, goal), a, arg in run.args) for a in shown]
    alike = [
        (i, j)
        for (i, (part, a, _)), (j, (_, b, argument)) in combinations(enumerate(seen), 2)
        if same_measure(a, b) and is_length(a.unit) and (argument or part.slot == ROBOT)
    ]
    nearby = tuple(rank for rank, (i, j) in enumerate(alike) if near and not (seen[i][2] and seen[j][2]))
    planar = [rank for rank, (i, _) in enumerate(alike) if seen[i][1].width >= PLANAR and rank not in nearby]
    turned = tuple((one, along) for one in planar for along in planar if one != along)
    kinds, parts = tuple(types[name] for name in names), tuple(part for part, *_ in seen)
    return ObservationSpec(kinds, parts, tuple(alike), turned=turned, nearby=nearby)


def _is_seen(attribute: Attribute, *, moving: bool, robot: bool) -> bool:
    """Tell whether a controller sees an attribute, of the robot or of anything else."""
    velocity = is_speed(attribute.unit) and is_length(attribute.unit.removesuffix(PER_SECOND))
    return attribute.is_place or (moving and is_speed(attribute.unit)) or (robot and velocity)


def _slot(arg: Object, names: Sequence[str]) -> tuple[int, bool]:
    """Return ROBOT or the rank of an argument's variable among `names`, and whether it is the variable's goal."""
    match arg:
        case Robot():
            return ROBOT, False
        case Var(name):
            return names.index(name), False
        case Goal(of):
            return names.index(of.name), True
        case _:
            assert_never(arg)


def _least_spread(unit: str) -> float:
    least = LEAST_LENGTH_SPREAD if is_length(unit) else LEAST_ANGLE_SPREAD if is_angle(unit) else LEAST_SPREAD
    return least / in_si(unit)


@dataclass(frozen=True, eq=False)
class Encoder:
    """A spec bound to one layout: turns states and entities into network inputs."""

    spec: ObservationSpec
    layout: Layout

    @cached_property
    def columns(self) -> tuple[tuple[int, IntArray], ...]:
        """Slot of each part, and its columns for every entity, (N, w); for the robot (1, w)."""
        found = []
        for part in self.spec.parts:
            if part.slot == ROBOT:
                place = self.layout.columns[ROBOT, part.attribute, part.goal]
                found.append((ROBOT, np.arange(place.start, place.stop)[None]))
            else:
                starts = self.layout.starts(part.attribute, part.goal)
                found.append((part.slot, starts[:, None] + np.arange(self._attribute(part).width)))
        return tuple(found)

    @cached_property
    def least_spread(self) -> FloatArray:
        """Least standard deviation of each column of `raw`, (W + D,)."""
        ranks = (*self.spec.alone, *(rank for rank, _ in self.spec.pairs))
        seen = [self._attribute(self.spec.parts[rank]) for rank in ranks]
        least = [_least_spread(attribute.unit) for attribute in seen]
        return np.repeat(least, [attribute.width for attribute in seen])

    @cached_property
    def metres(self) -> FloatArray:
        """How many metres one unit of each difference is, (D,)."""
        of = [self._attribute(self.spec.parts[i]) for i, _ in self.spec.pairs]
        return np.repeat([in_si(attribute.unit) for attribute in of], [attribute.width for attribute in of])

    def _attribute(self, part: Part) -> Attribute:
        kind = self.layout.robot if part.slot == ROBOT else self.layout.types[self.spec.types[part.slot]]
        return next(a for a in kind.described(part.goal) if a.name == part.attribute)

    @cached_property
    def size(self) -> int:
        """Count of network inputs."""
        widths = [table.shape[1] for _, table in self.columns]
        differences = sum(widths[i] for i, _ in self.spec.pairs)
        turned = PLANAR * (len(self.spec.turned) * len(TURNED_SCALES) + len(self._directions))
        return sum(widths[i] for i in self.spec.alone) + differences * (1 + len(self.spec.fine)) + turned

    @cached_property
    def _directions(self) -> tuple[int, ...]:
        """Ranks of the pairs along which others are seen."""
        return tuple(sorted({along for _, along in self.spec.turned}))

    @cached_property
    def _differences(self) -> dict[int, slice]:
        """Where each pair's difference lies among the differences."""
        widths = [self.columns[i][1].shape[1] for i, _ in self.spec.pairs]
        starts = np.cumsum([0, *widths])
        return {rank: slice(starts[rank], starts[rank + 1]) for rank in range(len(widths))}

    @cached_property
    def _planar(self) -> dict[int, slice]:
        """Where the horizontal components of each pair's difference lie among the differences."""
        return {rank: slice(at.start, at.start + PLANAR) for rank, at in self._differences.items()}

    def _turned(self, differences: FloatArray) -> list[FloatArray]:
        """Return how differences (R, D), in metres, lie to each other, in several scales, and the directions."""
        flat = {rank: differences[:, columns] for rank, columns in self._planar.items()}
        lengths = {rank: np.linalg.norm(flat[rank], axis=1, keepdims=True) for rank in self._directions}
        ahead = {rank: flat[rank] / np.maximum(lengths[rank], LEAST_LENGTH) for rank in self._directions}
        seen = []
        for rank, along in self.spec.turned:
            (x, y), (u, v) = flat[rank].T, ahead[along].T
            seen.append(np.column_stack([x * u + y * v, x * v - y * u]))
        parts = np.concatenate([np.zeros((len(differences), 0)), *seen], axis=1)
        return [*(np.clip(parts / scale, -FINE_CLIP, FINE_CLIP) for scale in TURNED_SCALES), *ahead.values()]

    def _seen(self, lengths: FloatArray) -> FloatArray:
        """Return the share of each difference (R, D), in metres, that is seen, (R, D)."""
        shares = np.ones_like(lengths)
        for rank in self.spec.nearby:
            columns = self._differences[rank]
            length = np.linalg.norm(lengths[:, columns], axis=1, keepdims=True)
            shares[:, columns] = np.clip(1.0 - length / NEARBY, 0.0, 1.0)
        return shares

    def _split(self, states: FloatArray, entities: IntArray) -> tuple[FloatArray, FloatArray]:
        """Gather attributes (R, W) and differences (R, D)."""
        rows = np.arange(len(states))[:, None]
        at = [table if slot == ROBOT else table[entities[:, slot]] for slot, table in self.columns]
        values = [states[rows, columns] for columns in at]
        differences = [values[i] - values[j] for i, j in self.spec.pairs]
        alone = [values[i] for i in self.spec.alone]
        none = np.zeros((len(states), 0))
        return np.concatenate([none, *alone], axis=1), np.concatenate([none, *differences], axis=1)

    def raw(self, states: FloatArray, entities: IntArray) -> FloatArray:
        """Return attributes and differences (R, W + D) in their units."""
        return np.concatenate(self._split(states, entities), axis=1)

    def __call__(self, states: FloatArray, entities: IntArray) -> NDArray[np.float32]:
        """Encode states (R, F) with bound entities (R, n) as network inputs (R, size)."""
        values, differences = self._split(states, entities)
        raw = np.concatenate([values, differences], axis=1)
        normal = (raw - np.asarray(self.spec.mean)) / np.asarray(self.spec.std)
        lengths = differences * self.metres
        coarse = np.clip(normal, -CLIP, CLIP)
        fine = [np.clip(lengths / scale, -FINE_CLIP, FINE_CLIP) for scale in self.spec.fine]
        if self.spec.nearby:
            share = self._seen(lengths)
            coarse[:, values.shape[1] :] *= share
            fine = [copy * share for copy in fine]
        seen = [coarse, *fine, *self._turned(lengths)]
        inputs: NDArray[np.float32] = np.concatenate(seen, axis=1).astype(np.float32)
        return inputs
