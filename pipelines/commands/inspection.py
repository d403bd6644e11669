"""Commands that look at what was done: runs, show, diff, report."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table
from rich.text import Text

from roboscribe.pipelines.commands.options import RUN_HELP, HomeDir, JsonFile
from roboscribe.pipelines.commands.output import console, say, write_result

app = typer.Typer()
RunName = Annotated[str, typer.Argument(help=RUN_HELP, metavar="RUN")]
RunNames = Annotated[list[str], typer.Argument(help=f"{RUN_HELP}; several are shown side by side", metavar="RUN...")]


@app.command()
def runs(json: JsonFile = None, home: HomeDir = Path()) -> None:
    """List the syntheses of this home, the latest first; other commands take any unique beginning of a run's name."""
    from roboscribe.pipelines.runs.lookup import list_runs
    from roboscribe.pipelines.runs.table import columns, summary
    from roboscribe.pipelines.workspace import Workspace

    found = [summary(run) for run in list_runs(Workspace(home))]
    for line in columns(found) if found else [f"no runs in {Workspace(home).data}"]:
        say(line)
    write_result(json, [dict(row) for row in found])


@app.command()
def show(run: RunName, home: HomeDir = Path()) -> None:
    """Tell how a run went: what was tried, how often it succeeded, which subgoals were chosen and why."""
    from roboscribe.pipelines.console import SynthesisConsole
    from roboscribe.pipelines.report.chapters import read_chapters
    from roboscribe.pipelines.report.figures import figures
    from roboscribe.pipelines.runs.lookup import open_run
    from roboscribe.pipelines.workspace import Workspace

    with open_run(run, Workspace(home)) as found:
        if found.account is None:
            console.print(Text("how this program was found is not known here; the program as it is:\n"))
            program = found.program.program_text if found.program is not None else ""
            console.print(Text(program, style="bold"), soft_wrap=True)
        else:
            with SynthesisConsole(console) as output:
                for entry in found.account.entries:
                    output.on_event(entry.event)
        table = Table(box=None, padding=(0, 2, 0, 0), show_header=False)
        for name, value in figures(found, read_chapters(found.account)).items():
            table.add_row(Text(name), Text(value, overflow="fold"))
        console.print(table)


@app.command()
def diff(one: RunName, other: RunName, home: HomeDir = Path()) -> None:
    """Compare two runs or programs: program text line by line, configuration and figures where they differ."""
    from roboscribe.pipelines.runs.comparison import compared
    from roboscribe.pipelines.runs.lookup import open_run
    from roboscribe.pipelines.workspace import Workspace

    with open_run(one, Workspace(home)) as first, open_run(other, Workspace(home)) as second:
        for line, style in compared(first, second):
            console.print(Text(line, style=style), soft_wrap=True)


@app.command()
def report(
    run: RunNames,
    out: Annotated[Path, typer.Option("--out", help="page to write, .html")],
    films: Annotated[int, typer.Option(min=0, max=9, help="failing episodes to film of each program that failed")] = 1,
    home: HomeDir = Path(),
) -> None:
    """Write one self-contained page about a run, or about several side by side."""
    with ExitStack() as stack, console.status("writing the report"):
        from roboscribe.pipelines.report.write import check_suffix, write_report
        from roboscribe.pipelines.runs.lookup import open_run
        from roboscribe.pipelines.workspace import Workspace

        check_suffix(out)
        found = [stack.enter_context(open_run(name, Workspace(home))) for name in run]
        write_report(found, out, films)
    say(f"{out}: {out.stat().st_size / 1e6:.1f} MB, open it in a browser")
