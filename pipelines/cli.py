"""The command line. Heavy packages are imported by the commands that need them, so that `--help` is quick."""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import TextIOWrapper
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.text import Text

from roboscribe.defaults import CONTACT, EVALUATION_EPISODES, N_DEMONSTRATIONS, TIMING
from roboscribe.errors import RoboScribeError
from roboscribe.pipelines.commands import baseline, data, inspection, synthesis
from roboscribe.pipelines.commands import disturb as disturb_command
from roboscribe.pipelines.commands.options import PROGRAM_HELP, HomeDir, JsonFile, Quiet
from roboscribe.pipelines.commands.output import FAIL, announce, console, make_room, refuse, say, write_result
from roboscribe.pipelines.interrupts import INTERRUPTED, Interrupts
from roboscribe.pipelines.paper.commands import paper

if TYPE_CHECKING:
    from roboscribe.stages.runtime.progress import ProgressCallback
    from roboscribe.world.layout import ObjectType

RESUMED = ("synthesize", "baseline", "paper")
"""Commands that go on where they were interrupted."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""One thread each: small matrices gain nothing from more, and results stay the same."""

EXAMPLES = """Examples:
\b
roboscribe evaluate tower-5                   measure a shipped program
roboscribe render tower-5 --failing           film an episode that it fails
roboscribe synthesize pick-place-1 --out DIR  learn a program
roboscribe show RUN                           tell how a run went
roboscribe ui                                 look at all runs in MLflow
"""
app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
app.add_typer(data.demonstrations, name="demos")
app.add_typer(paper, name="paper")


def _version(asked: bool) -> None:
    """Say which version this is.

    Raises:
        Exit: it was asked for.
    """
    if asked:
        from importlib.metadata import version

        from roboscribe.pipelines.source_commit import checkout_commit

        say(" ".join(filter(None, ("roboscribe", version("roboscribe"), checkout_commit()[:12]))))
        raise typer.Exit


TaskName = Annotated[str, typer.Argument(help="a name that `roboscribe tasks` lists", metavar="TASK")]
TaskOption = Annotated[str | None, typer.Option("--task", help="a task's name; left out: the program's own")]
STYLE_HELP = "default, brisk, slow, topdown, pauses, detours, clumsy, stop (at success), linger (after it) or mixed"
HORIZON_HELP = "control steps of an episode; left out: as many as when the program was made, in another task its own"
DISTURB_HELP = "noise=M (of positions, m), delay=STEPS, push=M/S, slip=PER_SECOND, knock=BLOCKS, friction=TIMES, "
DISTURB_HELP += "mass=TIMES or size=TIMES; repeatable"
ProgramName = Annotated[str, typer.Argument(help=PROGRAM_HELP, metavar="PROGRAM")]
Seed = Annotated[int, typer.Option(min=0, help="decides everything random")]
CONTACT_HELP = "contact model: stable or paper"
TIMING_HELP = "simulator timing: fast (10 x 4 ms) or faithful (20 x 2 ms)"
AS_MADE = "; left out: as when the program was made"
Contact = Annotated[str, typer.Option(help=CONTACT_HELP)]
Timing = Annotated[str, typer.Option(help=TIMING_HELP)]
OwnContact = Annotated[str | None, typer.Option("--contact", help=CONTACT_HELP + AS_MADE)]
OwnTiming = Annotated[str | None, typer.Option("--timing", help=TIMING_HELP + AS_MADE)]
Horizon = Annotated[int | None, typer.Option(min=1, help=HORIZON_HELP)]


@app.callback(epilog=EXAMPLES)
def start(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="say which version this is, and end")
    ] = False,
) -> None:
    """From demonstrations to readable robot programs."""


@app.command()
def tasks() -> None:
    """List the tasks with their objects, goals and horizon."""
    from rich.table import Table

    table = Table(box=None, padding=(0, 2, 0, 0))
    for title in ("task", "objects", "goals", "horizon"):
        table.add_column(title, overflow="fold")
    with console.status("gathering the tasks"):
        from roboscribe.envs.catalogue import make_task, task_names

        for name in task_names():
            task = make_task(name)
            objects = ", ".join(task.layout.names)
            goals = ", ".join(_goals(task.layout.entities)) or "none"
            table.add_row(Text(name), Text(objects), Text(goals), f"{task.horizon} steps, {task.frequency:g} Hz")
    console.print(table)


@data.demonstrations.command(data.COLLECT)
def demos(
    task: TaskName,
    out: Annotated[Path, typer.Option("--out", help="Parquet file to write")],
    episodes: Annotated[int, typer.Option(min=1, help="demonstrations to collect")] = N_DEMONSTRATIONS,
    seed: Seed = 0,
    style: Annotated[str, typer.Option(help=STYLE_HELP)] = "default",
    failing: Annotated[float, typer.Option(min=0, max=0.5, help="share of them that ends without success")] = 0.0,
    contact: Contact = CONTACT,
    timing: Timing = TIMING,
) -> None:
    """Collect noisy scripted demonstrations into a Parquet file."""
    from roboscribe.stages.collect import Config, collect
    from roboscribe.stages.runtime.task_config import TaskConfig

    config = Config(TaskConfig(task, contact, timing), episodes, seed, style, failing)
    make_room(out)
    with _bar() as report:
        digest = collect(config, out, report)
    say(f"{episodes} demonstrations of {task} in {out}, SHA-256 {digest}")


@app.command()
def adapt(
    program: ProgramName,
    demos: Annotated[Path, typer.Option(help="demonstrations of the order that is wanted, in Parquet")],
    out: Annotated[Path, typer.Option("--out", help="directory for the adapted program")],
    task: Annotated[str | None, typer.Option(help="the task that they show; left out: what the file says")] = None,
    home: HomeDir = Path(),
) -> None:
    """Learn only the guards of a program's loops again, from demonstrations of another order."""
    from roboscribe.errors import Fail
    from roboscribe.pipelines.adaptation import adapt_saved, save
    from roboscribe.pipelines.workspace import Workspace
    from roboscribe.programs import program_directory

    make_room(out)
    with program_directory(program, Workspace(home).mlruns) as directory:
        adaptation = adapt_saved(directory, demos, task)
        if isinstance(adaptation, Fail):
            say(f"FAIL: {adaptation.reason}")
            raise typer.Exit(FAIL)
        save(adaptation, out, directory)
    for old, new in adaptation.loops:
        say(f"old guard: {old}\nnew guard: {new}")
    say(f"program {out}, for {adaptation.task}; no control step was taken, evaluate measures it")


@app.command()
def evaluate(
    program: ProgramName,
    task: TaskOption = None,
    episodes: Annotated[int, typer.Option(min=1, help="episodes to run")] = EVALUATION_EPISODES,
    seed: Seed = 0,
    disturb: Annotated[list[str] | None, typer.Option(help=DISTURB_HELP, metavar="KIND=STRENGTH")] = None,
    json: JsonFile = None,
    contact: OwnContact = None,
    timing: OwnTiming = None,
    horizon: Horizon = None,
    quiet: Quiet = False,
    home: HomeDir = Path(),
) -> None:
    """Measure a program's success with its 95 % Wilson interval, undisturbed or under disturbances."""
    from roboscribe.evaluation import format_success
    from roboscribe.pipelines.programs import evaluation, load_with_task
    from roboscribe.pipelines.workspace import Workspace
    from roboscribe.programs import program_directory
    from roboscribe.stages.evaluate import Config

    with program_directory(program, Workspace(home).mlruns) as directory, _bar() as report:
        opened, where = load_with_task(directory, task, contact, timing, horizon)
        result = evaluation(opened, Config(where, seed, episodes), report, disturb or ())
    say(f"{where.name}: success {format_success(result)} of {result['episodes']} episodes, 95 % interval")
    say(f"{result['env_steps']} control steps, {result['wall_seconds']} s")
    failing = result["failing"]
    assert isinstance(failing, list)
    if failing:
        listed = ", ".join(map(str, failing[:20])) + ", …" * (len(failing) > 20)
        options = {"task": task, "contact": contact, "timing": timing, "horizon": horizon, "seed": seed or None}
        same = "".join(f" --{name} {value}" for name, value in options.items() if value is not None)
        hint = f" (to see one: roboscribe render {program}{same} --episode {failing[0]})" * (not disturb)
        say(f"failing episodes: {listed}{hint}")
    write_result(json, result)


@app.command()
def render(
    program: ProgramName,
    out: Annotated[Path | None, typer.Option("--out", help="video, .mp4 or .gif; left out: named after it")] = None,
    task: TaskOption = None,
    episode: Annotated[int | None, typer.Option(min=0, help="number of the episode; left out: the first")] = None,
    failing: Annotated[bool, typer.Option("--failing", help="film episodes that fail, from --episode on")] = False,
    grid: Annotated[str, typer.Option(help="episodes at once, columns x rows, for instance 3x3")] = "1x1",
    slow: Annotated[bool, typer.Option("--slow", help="at a quarter of the world's speed")] = False,
    seed: Seed = 0,
    contact: OwnContact = None,
    timing: OwnTiming = None,
    horizon: Horizon = None,
    home: HomeDir = Path(),
) -> None:
    """Film episodes, as `evaluate` numbers them: the scene beside the program with the line that acts."""
    from roboscribe.envs.render import check_suffix
    from roboscribe.pipelines import film_selection
    from roboscribe.pipelines.programs import load_with_task
    from roboscribe.pipelines.workspace import Workspace
    from roboscribe.programs import program_directory
    from roboscribe.stages.film import FilmOptions

    columns, rows = film_selection.grid(grid)
    first, count = episode or 0, columns * rows
    out = out or Path(f"{Path(program).resolve().name}.mp4")
    check_suffix(out)
    make_room(out)
    with program_directory(program, Workspace(home).mlruns) as directory, _bar() as report:
        opened, where = load_with_task(directory, task, contact, timing, horizon)
        episodes = list(range(first, first + count))
        if failing:
            episodes = film_selection.failing_episodes(opened, where, seed, count, first, report)
        if not episodes:
            say(f"none of the episodes {first} to {first + film_selection.SEARCHED - 1} fails; nothing is filmed")
            return
        shooting = FilmOptions(columns, rows, slow)
        path, solved = film_selection.film_episodes(opened, where, seed, episodes, out, shooting)
    say(f"{path}: episode{'s' * (len(episodes) > 1)} {', '.join(map(str, episodes))}, {len(solved)} solved")


@app.command()
def programs() -> None:
    """List the shipped programs; success as measured when they were made, with its 95 % Wilson interval."""
    from roboscribe.evaluation import format_success
    from roboscribe.pipelines.runs.table import columns
    from roboscribe.programs import shipped_programs

    rows = []
    for shipped in shipped_programs():
        made = {entry: str(shipped.manifest[entry]) for entry in ("task", "seed", "profile")}
        success, size = format_success(shipped.manifest["figures"]), f"{shipped.size / 1000:.0f} kB"
        rows.append({"program": shipped.name, **made, "success": success, "size": size})
    for line in columns(rows):
        say(line)


@app.command()
def serve(home: HomeDir = Path()) -> None:
    """Offer the scheduled runs of the paper's experiments to a Prefect server, one at a time, until interrupted."""
    announce("offering scheduled runs, until interrupted")
    from roboscribe.pipelines.paper.schedule import serve_schedules

    serve_schedules(home)


@app.command()
def ui(
    port: Annotated[int, typer.Option(min=1, max=65535, help="port on the loopback address")] = 5000,
    home: HomeDir = Path(),
) -> None:
    """Show what was tracked in MLflow's interface, on 127.0.0.1 only."""
    from roboscribe.pipelines import mlflow_server
    from roboscribe.pipelines.workspace import Workspace

    say(f"http://127.0.0.1:{port}")
    mlflow_server.serve(Workspace(home), port)


for commands in (synthesis, baseline, disturb_command, inspection, data):
    app.registered_commands += commands.app.registered_commands


def main() -> None:
    """Run a command; bad input ends in one line and exit code 2, an interrupt in exit code 130."""
    logging.basicConfig(level=logging.WARNING, format="%(message)s")
    console.quiet = console.stderr = False
    for name in THREADS:
        os.environ.setdefault(name, "1")
    os.environ.setdefault("GIT_PYTHON_REFRESH", "quiet")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # terminals that cannot show μ are told so
    goes_on = sys.argv[1:2] and sys.argv[1] in RESUMED
    interrupts = Interrupts("interrupted" + "; the same command goes on from here" * bool(goes_on))
    try:
        code = app(standalone_mode=False)
    except typer.exceptions.TyperException as error:
        code = refuse(error.format_message())
    except (RoboScribeError, OSError) as error:
        code = refuse(str(error))
    if code == INTERRUPTED:
        sys.stdout.flush()
        interrupts.end()
    sys.exit(code)


def _goals(entities: Sequence[ObjectType]) -> list[str]:
    """Name the goals of entities."""
    return [f"g({kind.name}): {', '.join(a.name for a in kind.goal)}" for kind in dict.fromkeys(entities) if kind.goal]


@contextmanager
def _bar() -> Iterator[ProgressCallback]:
    """Show a progress bar; yields the callback that moves it."""
    from roboscribe.pipelines.progress_bar import ProgressBar

    with ProgressBar(console) as bar:
        yield bar.on_progress


if __name__ == "__main__":
    main()
