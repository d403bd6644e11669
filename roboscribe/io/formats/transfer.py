"""Demonstrations in and out: from a file of another program to ours by a mapping, and from ours to another format."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from roboscribe.errors import DemonstrationError
from roboscribe.io.episodes import EpisodeFile, Header, open_episodes, write_episodes
from roboscribe.io.formats.apply import check_widths, trajectory_of
from roboscribe.io.formats.foreign import SNAPSHOT, Format, Shown, Source
from roboscribe.io.formats.mapping import Absent, ColumnMapping, Draft, check_mapping, parse_mapping
from roboscribe.io.formats.provenance import Provenance, place_of, read_provenance, write_provenance
from roboscribe.io.formats.suggest import spell_suggestion, suggest
from roboscribe.io.formats.table import FORMATS
from roboscribe.world import Task, Trajectory


@dataclass(frozen=True)
class Transferred:
    """What came of reading or writing another format.

    Args:
        episodes: count of demonstrations.
        frames: count of their frames.
        digest: SHA-256 of our file.
        remarks: what is odd but no error, or was left out.
    """

    episodes: int
    frames: int
    digest: str
    remarks: tuple[str, ...]


def format_of(path: Path, asked: str | None = None) -> Format:
    """Choose the format by its name, or by what lies at a path.

    Raises:
        DemonstrationError: there is no such format, or nothing there is of one.
    """
    if asked is not None:
        if asked not in FORMATS:
            msg = f"unknown format {asked!r}: expected one of {', '.join(FORMATS)}"
            raise DemonstrationError(msg)
        return FORMATS[asked]
    signs = {
        "lerobot": (path / "meta" / "info.json").is_file(),
        "minari": any((path / place / "metadata.json").is_file() for place in ("data", ".")),
        "robomimic": path.suffix in (".hdf5", ".h5"),
        "csv": path.suffix == ".csv",
        "npz": path.suffix == ".npz",
    }
    found = [name for name, there in signs.items() if there]
    if not found:
        expected = "; ".join(f"{name}: {kind.spelling}" for name, kind in FORMATS.items())
        msg = f"{path}: of no known format, name it with --format; {expected}"
        raise DemonstrationError(msg)
    return FORMATS[found[0]]


def suggest_mapping(path: Path, task: Task, kind: Format, episode: str | None = None) -> str:
    """Write a first mapping for a file, as TOML.

    Raises:
        DemonstrationError: the file cannot be read.
    """
    with kind.open(path, episode) as source:
        return spell_suggestion(suggest(source.contents, task), task, kind.name, path.name, episode)


def ingest(path: Path, task: Task, kind: Format, mapping: Path | None, out: Path) -> Transferred:
    """Read demonstrations of another program and write them as one of our files.

    Args:
        path: file or directory of the format.
        task: what the demonstrations show.
        kind: the format.
        mapping: which columns hold what; left out: those that are named as the task names them.
        out: our file; its directory must exist.

    Raises:
        DemonstrationError: the mapping's problems, one line each; damage; a number that cannot be right.
        ArtifactError: the system refused the write.
    """
    origin = read_provenance(path)
    draft = None if mapping is None else _draft(mapping)
    with kind.open(path, None if draft is None else draft.text("episode")) as source:
        chosen = _checked(draft, source, task, path, mapping)
        header = _header(path, task, kind, source, chosen, origin)
        shown = _trajectories(source, chosen, task, str(path))
        digest = write_episodes(out, header, shown)
    remarks = () if origin else (f"{path}: nothing guards it against damage, no {place_of(path).name} is there",)
    return Transferred(len(header.lengths), sum(header.lengths), digest, remarks)


def export(path: Path, task: Task, kind: Format, out: Path) -> Transferred:
    """Write one of our files in the format of another program.

    The file is read twice, an episode at a time: once to check it, once to write.

    Raises:
        DemonstrationError: the file is damaged, or none of its episodes can be held.
        ArtifactError: the system refused the write.
    """
    with open_episodes(path, task) as file:
        shown, left_out = _shown(file, task, kind, path)
        place_of(out).unlink(missing_ok=True)
        kind.write(out, shown)
        write_provenance(out, shown.header)
    return Transferred(len(shown.header.lengths), sum(shown.header.lengths), "", (*file.remarks, *left_out))


def _draft(mapping: Path) -> Draft:
    """Read a mapping."""
    try:
        text = mapping.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not UTF-8"
        msg = f"{mapping}: cannot be read ({reason}), expected a mapping as `roboscribe ingest --suggest` writes it"
        raise DemonstrationError(msg) from error
    draft = parse_mapping(text, str(mapping))
    if isinstance(draft, str):
        raise DemonstrationError(draft)
    return draft


def _checked(draft: Draft | None, source: Source, task: Task, path: Path, mapping: Path | None) -> ColumnMapping:
    """Return a mapping that fits, or raise with all of its problems."""
    said = suggest(source.contents, task).draft() if draft is None else draft
    found = check_mapping(said, source.contents, task, str(mapping or path))
    if isinstance(found, ColumnMapping):
        return found
    advice = f"write a mapping with: roboscribe ingest {path} --task {task.name} --suggest > mapping.toml"
    raise DemonstrationError("\n".join(found if draft is not None else (*found, advice)))


def _header(
    path: Path, task: Task, kind: Format, source: Source, mapping: ColumnMapping, origin: Provenance | None
) -> Header:
    """Say of our file what it holds; an exported one gets back what made it."""
    generator = origin.generator if origin else f"{kind.name} {path.name}"
    seed = origin.seed if origin else None
    snapshots = not isinstance(mapping.origins[SNAPSHOT], Absent)
    return Header(task.name, task.layout, task.frequency, generator, seed, source.contents.lengths, snapshots)


def _trajectories(source: Source, mapping: ColumnMapping, task: Task, name: str) -> Iterator[tuple[int, Trajectory]]:
    """Read the trajectories of a file of another program."""
    lengths = source.contents.lengths
    for episode, recording in enumerate(source.recordings(mapping.columns)):
        check_widths(recording, source.contents, episode=episode, source=name)
        yield episode, trajectory_of(recording, mapping, task, length=lengths[episode], episode=episode, source=name)


def _shown(file: EpisodeFile, task: Task, kind: Format, path: Path) -> tuple[Shown, tuple[str, ...]]:
    """Look through a file once; returns what is to be written, and what is left out."""
    held: dict[int, int] = {}
    actions, size, last = False, 0, -1
    for last, trajectory in file.trajectories():
        if len(trajectory) >= kind.least_frames:
            held[last] = len(trajectory)
            actions = actions or trajectory.actions is not None
            size = size if trajectory.snapshots is None else trajectory.snapshots.shape[1]
    if not held:
        msg = f"{path}: no episode of at least {kind.least_frames} frames, there is nothing to export"
        raise DemonstrationError(msg)
    count = max(len(file.header.lengths), last + 1)
    left_out = [i for i in range(count) if i not in held]
    listed = ", ".join(map(str, left_out))
    remarks = f"{kind.name} cannot hold episode {listed} (too few frames); left out, others move up"
    header = replace(file.header, lengths=tuple(held.values()), snapshots=size > 0)

    def kept() -> Iterator[Trajectory]:
        return (trajectory for number, trajectory in file.trajectories() if number in held)

    return Shown(task, header, actions, size, kept), (remarks,) if left_out else ()
