"""The command that measures what programs withstand."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.text import Text

from pipelines.options import PROGRAM_HELP, HomeDir, JsonFile

if TYPE_CHECKING:
    from pipelines.disturbing import Measured
    from pipelines.home import Home

PROGRAMS_HELP = f"{PROGRAM_HELP}; several are drawn side by side"
app = typer.Typer()
console = Console(highlight=False)


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

    from pipelines.disturbing import check_suffix, draw
    from pipelines.home import Home
    from roboscribe.io.atomic import indented_json, write_file

    if out is not None:
        check_suffix(out)
    measured: dict[str, tuple[Measured, ...]] = {}
    for name in programs:
        label = Path(name).resolve().name
        measured[label] = _measure(name, kind or (), seed, episodes, Home(home))
        _show(label, measured[label])
    if out is not None:
        write_file(out, draw(measured))
        console.print(Text(str(out)), soft_wrap=True)
    if json is not None:
        told = {name: [asdict(each) for each in found] for name, found in measured.items()}
        write_file(json, indented_json({"episodes": episodes, "seed": seed, "programs": told}).encode())


def _measure(name: str, kinds: Sequence[str], seed: int, episodes: int, home: Home) -> tuple[Measured, ...]:
    """Measure one program under a bar."""
    from pipelines.bar import Bar
    from pipelines.disturbing import possible, sweep
    from pipelines.programs import open_program, program_directory
    from stages.progress import episode_watch

    with program_directory(name, home.mlruns) as directory, Bar(console) as bar:
        opened, where = open_program(directory, None, "stable", "fast")
        task = where.make()
        told = partial(episode_watch, total=episodes, report=bar.watch)
        return sweep(opened, task, possible(task, kinds), seed, episodes, told)


def _show(label: str, found: Sequence[Measured]) -> None:
    """Print a program's table."""
    from rich.table import Table

    from pipelines.disturbing import lines

    table = Table("disturbance", "strength", "success, 95 % interval", box=None, padding=(0, 2, 0, 0))
    for line in lines(found):
        table.add_row(*map(Text, line))
    console.print(Text(label, style="bold"))
    console.print(table)
