"""Every format by name."""

from __future__ import annotations

from roboscribe.io.formats import csv_file, lerobot, minari, npz, robomimic
from roboscribe.io.formats.foreign import Format

FORMATS: dict[str, Format] = {
    kind.name: kind for kind in (lerobot.FORMAT, robomimic.FORMAT, minari.FORMAT, csv_file.FORMAT, npz.FORMAT)
}
