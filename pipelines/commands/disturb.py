"""The command that measures what programs withstand."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.text import Text

from roboscribe.pipelines.commands.options import PROGRAM_HELP, HomeDir, JsonFile
from roboscribe.pipelines.commands.output import console, make_room, say, write_result

if TYPE_CHECKING:
    from roboscribe.io.atomic import Json
    from roboscribe.pipelines.disturbing import Measured
    from roboscribe.pipelines.workspace import Workspace

PROGRAMS_HELP = f"{PROGRAM_HELP}; several are drawn side by side"
app = typer.Typer()


@app.command()
def disturb(
    programs: Annotated[list[str], typer.Argument(help=PROGRAMS_HELP, metavar="PROGRAM...")],
    kind: Annotated[list[str] | None, typer.Option(help="of disturbance, repeatable; left out: all")] = None,
    episodes: Annotated[int, typer.Option(min=1, help="episodes at each strength")] = 100,
    seed: Annotated[int, typer.Option(min=0, help="decides everything random")] = 0,
    out: Annotated[Path | None, typer.Option("--out", help="figure to write, .png")] = None,
    json: JsonFile = None,
    home: HomeDir = Path(),
) -> None:
    """Measure success against the strength of what disturbs: noise, delay, pushes, slips, knocks, other physics."""
    from dataclasses import asdict

    from roboscribe.io.atomic import write_file
    from roboscribe.pipelines.disturbing import check_suffix, draw
    from roboscribe.pipelines.workspace import Workspace

    if out is not None:
        check_suffix(out)
    make_room(out, json)
    measured: dict[str, tuple[Measured, ...]] = {}
    for name in programs:
        label = Path(name).resolve().name
        measured[label] = _measure(name, kind or (), seed, episodes, Workspace(home))
        _show(label, measured[label])
    if out is not None:
        write_file(out, draw(measured))
        say(str(out))
    told: Json = {name: [asdict(each) for each in found] for name, found in measured.items()}
    write_result(json, {"episodes": episodes, "seed": seed, "programs": told})


def _measure(name: str, kinds: Sequence[str], seed: int, episodes: int, workspace: Workspace) -> tuple[Measured, ...]:
    """Measure one program under a bar."""
    from roboscribe.pipelines.disturbing import possible, sweep
    from roboscribe.pipelines.programs import load_with_task
    from roboscribe.pipelines.progress_bar import ProgressBar
    from roboscribe.programs import program_directory
    from roboscribe.stages.runtime.progress import episode_progress

    with program_directory(name, workspace.mlruns) as directory, ProgressBar(console) as bar:
        opened, where = load_with_task(directory, None)
        task = where.make()
        told = partial(episode_progress, total=episodes, report=bar.on_progress)
        return sweep(opened, task, possible(task, kinds), seed, episodes, told)


def _show(label: str, found: Sequence[Measured]) -> None:
    """Print a program's table."""
    from rich.table import Table

    from roboscribe.pipelines.disturbing import lines

    table = Table("disturbance", "strength", "success, 95 % interval", box=None, padding=(0, 2, 0, 0))
    for line in lines(found):
        table.add_row(*map(Text, line))
    console.print(Text(label, style="bold"))
    console.print(table)
