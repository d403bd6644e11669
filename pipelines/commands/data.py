"""Commands that bring demonstrations in and out, and that look at them: ingest, export, demos check, info and replay.

`roboscribe demos TASK --out FILE` collects, as it did before there was anything else to do with demonstrations: the
group takes whatever is no command of its own for the arguments of `collect`.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table
from rich.text import Text
from typer.core import TyperGroup

from roboscribe.pipelines.commands.options import JsonFile
from roboscribe.pipelines.commands.output import console, make_room, refuse, say, write_result

if TYPE_CHECKING:
    from roboscribe.io.atomic import Json
    from roboscribe.io.formats.transfer import Transferred
    from roboscribe.world import Task

COLLECT = "collect"
FORMATS_HELP = "lerobot (v3), robomimic, minari, csv or npz; left out: told from the file"
TASK_HELP = "a name that `roboscribe tasks` lists; left out: what the file says"


class _CollectsByDefault(TyperGroup):
    """A group in which what is no command stands for the arguments of `collect`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:  # noqa: ANN401 - typer names the context's type in private only
        """Put `collect` before arguments that begin with no command."""
        known = not args or args[0] in self.commands or args[0] == "--help"
        return super().parse_args(ctx, args if known else [COLLECT, *args])


app = typer.Typer()
demonstrations = typer.Typer(
    cls=_CollectsByDefault,
    no_args_is_help=True,
    help="Collect demonstrations (`roboscribe demos TASK --out FILE`), check a file of them, describe or film it.",
)
Format = Annotated[str | None, typer.Option("--format", help=FORMATS_HELP)]
TaskOption = Annotated[str | None, typer.Option("--task", help=TASK_HELP)]
OurFile = Annotated[Path, typer.Argument(help="demonstrations in our Parquet", metavar="FILE")]


@app.command()
def ingest(
    file: Annotated[Path, typer.Argument(help="file or directory of another program", metavar="FILE")],
    task: Annotated[str, typer.Option("--task", help="what is shown: a name that `roboscribe tasks` lists")],
    out: Annotated[Path | None, typer.Option("--out", help="Parquet file to write")] = None,
    mapping: Annotated[
        Path | None, typer.Option("--map", help="TOML that says which columns hold what; left out: told by their names")
    ] = None,
    kind: Format = None,
    suggest: Annotated[
        bool, typer.Option("--suggest", help="write a first mapping, to --map or else here, and nothing else")
    ] = False,
    episode: Annotated[
        str | None,
        typer.Option(help="with --suggest: column of episode numbers in csv and npz; empty: all rows are one episode"),
    ] = None,
) -> None:
    """Turn demonstrations of another program into ours: `--suggest` writes a mapping, then `--map` uses it."""
    from roboscribe.io.formats.transfer import format_of
    from roboscribe.io.formats.transfer import ingest as read_in

    shown, chosen = _task(task), format_of(file, kind)
    if suggest:
        _write_suggestion(file, shown, chosen.name, mapping, episode)
        return
    if out is None:
        raise typer.Exit(refuse("--out is missing: the Parquet file to write"))
    make_room(out)
    done = read_in(file, shown, chosen, mapping, out)
    _report(done, shown, out)


@app.command()
def export(
    file: OurFile,
    out: Annotated[Path, typer.Option("--out", help="file or directory to write")],
    kind: Annotated[str, typer.Option("--format", help="lerobot (v3), robomimic, minari, csv or npz")],
    task: TaskOption = None,
) -> None:
    """Write demonstrations in the format of another program; what it cannot hold is said."""
    from roboscribe.io.formats.transfer import export as write_out
    from roboscribe.io.formats.transfer import format_of

    chosen, shown = format_of(file, kind), _task_of(file, task)
    make_room(out)
    _report(write_out(file, shown, chosen, out), shown, out)


@demonstrations.command()
def check(file: OurFile, task: TaskOption = None) -> None:
    """Find everything that is wrong with a file at once, with the metadata that would be right, ready to paste."""
    from roboscribe.io.inspection import inspect

    found = inspect(file, _task_of(file, task))
    for line in (*found.problems, *found.remarks):
        say(line)
    if found.metadata:
        say(f"\nThis gives the file the metadata that it should have:\n\n{found.recipe(file)}")
    if found.problems:
        many = "s" * (len(found.problems) > 1)
        raise typer.Exit(refuse(f"{file}: {len(found.problems)} problem{many}"))
    say(f"{file}: nothing is wrong with it")


@demonstrations.command()
def info(file: OurFile, task: TaskOption = None, json: JsonFile = None) -> None:
    """Say what a file holds: task, episodes, lengths, objects, the range of every column, where it comes from."""
    from roboscribe.io.inspection import describe_file

    found = describe_file(file, _task_of(file, task))
    _show(found)
    make_room(json)
    write_result(json, found)


@demonstrations.command()
def replay(
    file: OurFile,
    out: Annotated[
        Path | None, typer.Option("--out", help="film, .mp4 or .gif; left out: named after the file")
    ] = None,
    episode: Annotated[int, typer.Option(min=0, help="number of the first one that is shown")] = 0,
    grid: Annotated[str, typer.Option(help="demonstrations at once, columns x rows, for instance 3x3")] = "1x1",
    slow: Annotated[bool, typer.Option("--slow", help="at a quarter of the speed")] = False,
    task: TaskOption = None,
) -> None:
    """Film demonstrations as they were recorded."""
    out = out or Path(f"{file.stem}.mp4")
    with console.status(f"filming {file}"):
        from roboscribe.envs.render import check_suffix
        from roboscribe.io.demonstrations import read_demonstrations
        from roboscribe.pipelines.demonstration_films import film_demonstrations
        from roboscribe.pipelines.film_selection import grid as cells

        columns, rows = cells(grid)
        check_suffix(out)
        make_room(out)
        shown, numbers = _task_of(file, task), range(episode, episode + columns * rows)
        path = film_demonstrations(read_demonstrations(file, shown), shown, numbers, columns, out, slow)
    some = f"s {episode} to {numbers.stop - 1}" if len(numbers) > 1 else f" {episode}"
    say(f"{path}: demonstration{some} of {file}")


def _show(found: dict[str, Json]) -> None:
    """Print a file's description as two tables."""
    plain = Table(box=None, padding=(0, 2, 0, 0), show_header=False)
    for name, value in found.items():
        if name not in ("columns", "remarks"):
            plain.add_row(Text(name.replace("_", " ")), Text("none" if value is None else str(value), overflow="fold"))
    console.print(plain)
    columns, remarks = found["columns"], found["remarks"]
    assert isinstance(columns, dict)
    assert isinstance(remarks, list)
    table = Table(box=None, padding=(0, 2, 0, 0))
    for title in ("column", "unit", "least", "greatest"):
        table.add_column(title)
    for name, column in columns.items():
        assert isinstance(column, dict)
        table.add_row(*map(Text, (name, str(column["unit"]), _numbers(column["min"]), _numbers(column["max"]))))
    console.print(table)
    for remark in remarks:
        say(str(remark))


def _numbers(values: Json) -> str:
    """Spell the numbers of a column."""
    assert isinstance(values, list)
    return ", ".join("none" if value is None else f"{value:.4g}" for value in values)


def _write_suggestion(file: Path, task: Task, kind: str, mapping: Path | None, episode: str | None) -> None:
    """Write a first mapping to a new file, or to standard output."""
    from roboscribe.io.atomic import write_file
    from roboscribe.io.formats.table import FORMATS
    from roboscribe.io.formats.transfer import suggest_mapping

    text = suggest_mapping(file, task, FORMATS[kind], episode)
    if mapping is None:
        sys.stdout.write(text)
        return
    if mapping.exists():
        raise typer.Exit(
            refuse(f"{mapping}: exists already, expected a new file; a mapping may have been corrected by hand")
        )
    make_room(mapping)
    write_file(mapping, text.encode())
    say(f"{mapping}: look it through, then: roboscribe ingest {file} --task {task.name} --map {mapping} --out FILE")


def _report(done: Transferred, task: Task, out: Path) -> None:
    """Say what was written, and what is odd about it."""
    for remark in done.remarks:
        say(remark)
    digest = f", SHA-256 {done.digest}" if done.digest else ""
    say(f"{done.episodes} demonstrations of {task.name} ({done.frames} frames) in {out}{digest}")


def _task(name: str) -> Task:
    """Build a task by its name."""
    from roboscribe.stages.runtime.task_config import TaskConfig

    return TaskConfig(name).make()


def _task_of(file: Path, name: str | None) -> Task:
    """Build the task that is named, or else the one that a file says it shows."""
    from roboscribe.io.demonstrations import task_of

    return _task(task_of(file) if name is None else name)
