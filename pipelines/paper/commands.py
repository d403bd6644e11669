"""`roboscribe paper`: the paper's experiments from the command line."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from roboscribe.defaults import EVALUATION_EPISODES
from roboscribe.pipelines.commands.options import PROGRAM_HELP, HomeDir
from roboscribe.pipelines.commands.output import FAIL, announce, console, make_directory, say

if TYPE_CHECKING:
    from roboscribe.pipelines.paper.experiment import ExperimentContext, ExperimentResult, Options

T = TypeVar("T")
paper = typer.Typer(help="Experiments of the paper, beside its results.", no_args_is_help=True)


class EngineName(StrEnum):
    """What runs the cells."""

    prefect = "prefect"
    local = "local"


class RunnerName(StrEnum):
    """What runs cells side by side."""

    one = "one"
    dask = "dask"


Tasks = Annotated[list[str] | None, typer.Option("--task", help="a task instead of the paper's; repeatable")]
Methods = Annotated[
    list[str] | None, typer.Option("--method", help="roboscribe or a baseline; repeatable; left out: all")
]
Profiles = Annotated[list[str] | None, typer.Option("--profile", help="what programs may be learned from; repeatable")]
Seeds = Annotated[int, typer.Option(min=1, help="seeds, from 0")]
Episodes = Annotated[int, typer.Option(min=1, help="episodes of each final evaluation")]
Budget = Annotated[str, typer.Option(help="default, paper (where the axis of Fig. 19 ends), or control steps")]
Quick = Annotated[bool, typer.Option("--quick", help="minutes instead of hours; not a result")]
EngineOption = Annotated[EngineName, typer.Option("--engine", help="what runs the cells")]
Out = Annotated[Path | None, typer.Option("--out", help="directory for the report; left out: data/paper/NAME")]
RunnerOption = Annotated[RunnerName, typer.Option("--runner", help="cells one by one, or side by side on Dask")]
Workers = Annotated[int, typer.Option(min=1, help="processes of --runner dask on this machine")]
Address = Annotated[str, typer.Option("--dask-address", help="a Dask scheduler whose workers see the same home")]
Programs = Annotated[
    list[str] | None, typer.Option("--program", help=f"measure this, synthesize none: {PROGRAM_HELP}; repeatable")
]


@paper.command()
def curves(
    task: Tasks = None,
    method: Methods = None,
    profile: Profiles = None,
    seeds: Seeds = 5,
    episodes: Episodes = EVALUATION_EPISODES,
    budget: Budget = "default",
    quick: Quick = False,
    engine: EngineOption = EngineName.prefect,
    runner: RunnerOption = RunnerName.one,
    workers: Workers = 2,
    dask_address: Address = "",
    out: Out = None,
    home: HomeDir = Path(),
) -> None:
    """Draw success over control steps by task and method (Fig. 19); it goes on where it was interrupted."""
    announce("success over control steps")
    from roboscribe.pipelines.paper.curves import draw_curves

    options = _options(task, method, profile, seeds, episodes, budget, quick=quick)
    _end(draw_curves(options, _desk(home, engine, runner, workers, dask_address, out), console))


@paper.command()
def table1(
    task: Tasks = None,
    profile: Profiles = None,
    seeds: Seeds = 5,
    episodes: Episodes = EVALUATION_EPISODES,
    budget: Budget = "default",
    quick: Quick = False,
    engine: EngineOption = EngineName.prefect,
    runner: RunnerOption = RunnerName.one,
    workers: Workers = 2,
    dask_address: Address = "",
    out: Out = None,
    home: HomeDir = Path(),
) -> None:
    """Count the refinements of the syntheses of `paper curves` (Table 1)."""
    announce("refinements")
    from roboscribe.pipelines.paper.curves import make_table1

    options = _options(task, None, profile, seeds, episodes, budget, quick=quick)
    _end(make_table1(options, _desk(home, engine, runner, workers, dask_address, out), console))


@paper.command()
def demos(
    task: Tasks = None,
    profile: Profiles = None,
    seeds: Seeds = 5,
    episodes: Episodes = EVALUATION_EPISODES,
    budget: Budget = "default",
    quick: Quick = False,
    engine: EngineOption = EngineName.prefect,
    runner: RunnerOption = RunnerName.one,
    workers: Workers = 2,
    dask_address: Address = "",
    out: Out = None,
    home: HomeDir = Path(),
) -> None:
    """Synthesize from few and many demonstrations, of several styles (Sec. 5.1)."""
    announce("few and many demonstrations")
    from roboscribe.pipelines.paper.demos import draw_demos

    options = _options(task, None, profile, seeds, episodes, budget, quick=quick)
    _end(draw_demos(options, _desk(home, engine, runner, workers, dask_address, out), console))


@paper.command()
def towers(
    task: Tasks = None,
    method: Methods = None,
    profile: Profiles = None,
    seeds: Seeds = 5,
    trained: Annotated[
        list[int] | None, typer.Option(help="blocks of a tower to synthesize for; repeatable; left out: 4 and 5")
    ] = None,
    contact: Annotated[
        list[str] | None, typer.Option(help="contact model to measure under; repeatable; left out: stable and paper")
    ] = None,
    episodes: Episodes = EVALUATION_EPISODES,
    budget: Budget = "default",
    quick: Quick = False,
    program: Programs = None,
    engine: EngineOption = EngineName.prefect,
    runner: RunnerOption = RunnerName.one,
    workers: Workers = 2,
    dask_address: Address = "",
    out: Out = None,
    home: HomeDir = Path(),
) -> None:
    """Measure how programs for one tower build others (Fig. 21)."""
    announce("towers")
    from roboscribe.pipelines.paper.towers import Experiment, measure_towers

    options = _options(task, method, profile, seeds, episodes, budget, quick=quick, programs=program)
    usual = Experiment()
    experiment = Experiment(_several(trained, usual.trained), _several(contact, usual.contacts))
    _end(measure_towers(experiment, options, _desk(home, engine, runner, workers, dask_address, out), console))


@paper.command()
def confined(
    method: Methods = None,
    profile: Profiles = None,
    seeds: Seeds = 5,
    episodes: Episodes = EVALUATION_EPISODES,
    budget: Budget = "default",
    quick: Quick = False,
    program: Programs = None,
    engine: EngineOption = EngineName.prefect,
    runner: RunnerOption = RunnerName.one,
    workers: Workers = 2,
    dask_address: Address = "",
    out: Out = None,
    home: HomeDir = Path(),
) -> None:
    """Learn only the guards of Push-3's programs again, for goals where the order matters (Sec. 5.3)."""
    announce("guards learned again")
    from roboscribe.pipelines.paper.confined import Confinement, measure_confined

    options = _options(None, method, profile, seeds, episodes, budget, quick=quick, programs=program)
    _end(measure_confined(Confinement(), options, _desk(home, engine, runner, workers, dask_address, out), console))


@paper.command(name="all")
def everything(
    task: Tasks = None,
    method: Methods = None,
    profile: Profiles = None,
    seeds: Seeds = 5,
    episodes: Episodes = EVALUATION_EPISODES,
    budget: Budget = "default",
    quick: Quick = False,
    engine: EngineOption = EngineName.prefect,
    runner: RunnerOption = RunnerName.one,
    workers: Workers = 2,
    dask_address: Address = "",
    out: Out = None,
    home: HomeDir = Path(),
) -> None:
    """Do all experiments, cheapest first."""
    announce("all experiments")
    from roboscribe.pipelines.paper.everything import do_everything, expectation

    options = _options(task, method, profile, seeds, episodes, budget, quick=quick)
    say(expectation(options))
    done = do_everything(options, _desk(home, engine, runner, workers, dask_address, out), console)
    for name, each in done.items():
        say(f"paper {name}: {each.directory or 'no report'}")
        for task_name in each.missing:
            say(f"  {task_name} not built yet")
        for failure in each.failures:
            say(f"  FAIL: {failure}")
    if any(each.failures for each in done.values()):
        raise typer.Exit(FAIL)


@paper.command()
def results(
    out: Annotated[Path, typer.Option("--out", help="directory of the page")] = Path("docs"), home: HomeDir = Path()
) -> None:
    """Put the reports in data/paper on one page, with the commands that complete them."""
    announce("all reports on one page")
    from roboscribe.pipelines.paper.results import write_results
    from roboscribe.pipelines.workspace import Workspace

    say(str(write_results(Workspace(home).data / "paper", out)))


def _options(
    task: Sequence[str] | None,
    method: Sequence[str] | None,
    profile: Sequence[str] | None,
    seeds: int,
    episodes: int,
    budget: str,
    *,
    quick: bool,
    programs: Sequence[str] | None = None,
) -> Options:
    """Gather the options of a command.

    Raises:
        TaskError: an unknown method, profile or budget.
    """
    from roboscribe.pipelines.paper.experiment import Options
    from roboscribe.pipelines.paper.methods import check_method, check_profile

    methods = tuple(check_method(name) for name in _several(method, ()))
    profiles = tuple(check_profile(name) for name in _several(profile, ()))
    tasks, given = _several(task, ()), _several(programs, ())
    return Options(tasks, methods, profiles, seeds, episodes, budget, quick, given)


def _desk(
    home: Path, engine: EngineName, runner: RunnerName, workers: int, address: str, out: Path | None
) -> ExperimentContext:
    """Say where and how the work is done."""
    from roboscribe.pipelines.paper.cell_runner import Runner
    from roboscribe.pipelines.paper.experiment import ExperimentContext
    from roboscribe.pipelines.workspace import Workspace

    if out is not None:
        make_directory(out)
    parallel = runner is RunnerName.dask or bool(address)
    chosen = Runner("local" if engine is EngineName.local else "prefect", workers * parallel, address)
    return ExperimentContext(Workspace(home), chosen, out)


def _end(done: ExperimentResult) -> None:
    """Print what was found; exit code 3 where a synthesis found no program."""
    if done.summary:
        say(done.summary)
    else:
        for task in done.missing:
            say(f"{task} not built yet")
    for failure in done.failures:
        say(f"FAIL: {failure}")
    if done.failures:
        raise typer.Exit(FAIL)


def _several(given: Sequence[T] | None, usual: tuple[T, ...]) -> tuple[T, ...]:
    """Return what was given, each value once, or else what is usual."""
    return tuple(dict.fromkeys(given or usual))
