"""`roboscribe synthesize`: options, settings and files become one plan, and a plan one run or one per seed."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from roboscribe.defaults import EVALUATION_EPISODES
from roboscribe.pipelines.commands.options import HomeDir, JsonFile, Quiet
from roboscribe.pipelines.commands.output import FAIL, announce, console, make_room, say, write_result
from roboscribe.rl.config import Profile

if TYPE_CHECKING:
    from collections.abc import Mapping

    from roboscribe.io.atomic import Json
    from roboscribe.pipelines.synthesis_run import Engine as EngineName
    from roboscribe.stages.runtime.synthesis_plan import SynthesisPlan

app = typer.Typer()
EXAMPLES = """Examples:
\b
roboscribe synthesize pick-place-1 --out DIR
roboscribe synthesize pick-place-1 --demos FILE.parquet --profile states
roboscribe synthesize pick-place-1 --seeds 0-4 --jobs 2
roboscribe synthesize tower-5 --set training.learner.worlds=32
roboscribe synthesize --config data/runs/RUN/config.toml --seed 1
"""
SEEDS_HELP = "several seeds, one run for each: 0-4, or 0,2,5; ends in one table and one run of MLflow above them"
SET_HELP = "any other setting, by its name in the config.toml beside each run; repeatable"


class Engine(StrEnum):
    """What runs the stages."""

    prefect = "prefect"
    local = "local"


@app.command(epilog=EXAMPLES)
def synthesize(
    task: Annotated[
        str | None, typer.Argument(help="a name that `roboscribe tasks` lists, or FILE.py:CLASS", metavar="TASK")
    ] = None,
    demos: Annotated[Path | None, typer.Option(help="demonstrations in Parquet; left out: collect 50")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="decides everything random; default 0")] = None,
    seeds: Annotated[str | None, typer.Option(help=SEEDS_HELP)] = None,
    jobs: Annotated[int, typer.Option(min=1, help="with --seeds: runs at a time")] = 1,
    profile: Annotated[Profile | None, typer.Option(help="what may be learned from; left out: all there is")] = None,
    engine: Annotated[Engine, typer.Option(help="what runs the stages")] = Engine.prefect,
    out: Annotated[Path | None, typer.Option("--out", help="directory for the program")] = None,
    json: JsonFile = None,
    episodes: Annotated[
        int | None, typer.Option(min=1, help=f"episodes of the final evaluation; default {EVALUATION_EPISODES}")
    ] = None,
    budget: Annotated[int | None, typer.Option(min=1, help="control steps per training of a skill")] = None,
    success: Annotated[
        float | None, typer.Option(min=0.0, max=1.0, help="success rate that is good enough; default 0.97")
    ] = None,
    contact: Annotated[str | None, typer.Option(help="contact model: stable or paper; default stable")] = None,
    timing: Annotated[
        str | None, typer.Option(help="simulator: fast (10 x 4 ms) or faithful (20 x 2 ms); default fast")
    ] = None,
    horizon: Annotated[
        int | None, typer.Option(min=1, help="control steps of an episode; left out: as many as demonstrations need")
    ] = None,
    config: Annotated[Path | None, typer.Option("--config", help="settings in TOML; options go before them")] = None,
    settings: Annotated[list[str] | None, typer.Option("--set", help=SET_HELP, metavar="NAME=VALUE")] = None,
    register: Annotated[
        bool, typer.Option("--register", help="make the program a version of a model in MLflow, named after the task")
    ] = False,
    quiet: Quiet = False,
    home: HomeDir = Path(),
) -> None:
    """Find a program that solves a task, from demonstrations; the same command goes on where it was interrupted."""
    given = {
        "task": {"name": task, "contact": contact, "timing": timing, "horizon": horizon},
        "seed": seed,
        "profile": profile,
        "demonstrations": demos,
        "evaluation_episodes": episodes,
        "limits": {"success": success},
        "training": {"budget": budget},
    }
    plan = _plan(given, config, settings or [])
    make_room(out, json)
    if seeds is not None:
        _sweep(plan, seeds, jobs, engine.value, out, json, register, home)
        return
    say(f"{plan.task.name}, seed {plan.seed}")
    write_result(json, _single(plan, engine.value, out, register, home))


def _plan(given: Mapping[str, Any], config: Path | None, settings: list[str]) -> SynthesisPlan:
    """Lay options over a file's settings, and single settings over both; the task must be there.

    Raises:
        ArtifactError, TaskError: a setting that is none, no task, or an unknown one.
    """
    from roboscribe.errors import TaskError
    from roboscribe.stages.runtime.plan_file import merged, read_settings, to_plan, with_setting

    nested = merged({} if config is None else read_settings(config), _without_none(given))
    for assignment in settings:
        nested = with_setting(nested, assignment)
    if "name" not in nested.get("task", {}):
        msg = "no task is named: expected TASK, a name that `roboscribe tasks` lists, or a --config that has one"
        raise TaskError(msg)
    plan = to_plan(nested, "settings" if config is None else str(config))
    plan.task.make()
    return plan


def _without_none(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Leave out what was not asked for."""
    nested = {name: _without_none(value) if isinstance(value, dict) else value for name, value in settings.items()}
    return {name: value for name, value in nested.items() if value is not None and value != {}}


def _single(plan: SynthesisPlan, engine: EngineName, out: Path | None, register: bool, home: Path) -> dict[str, Json]:
    """Run one synthesis and say what came out.

    Raises:
        Exit: there is no program.
    """
    from roboscribe.errors import Fail
    from roboscribe.evaluation import format_success
    from roboscribe.pipelines.console import SynthesisConsole
    from roboscribe.pipelines.synthesis_run import SynthesisRun
    from roboscribe.pipelines.workspace import Workspace

    with SynthesisConsole(console) as told:
        result = SynthesisRun(plan, Workspace(home), engine, out).run(told.callbacks())
    if isinstance(result, Fail):
        raise typer.Exit(FAIL)
    say(f"success {format_success(result)} of {result['episodes']} episodes, 95 % interval")
    if float(str(result["ci_high"])) < plan.limits.success:
        say(f"this is the best program found, below the {plan.limits.success:.0%} asked for")
    say(f"{result['refinements']} refinements, {result['env_steps']} control steps, {result['wall_seconds']} s")
    say(f"program {result['program_dir']}")
    say(f"MLflow run {result['mlflow_run_id'] or 'not there yet; `roboscribe ui` brings it up to date'}")
    if register:
        _register(result, plan, home)
    return result


def _register(result: Mapping[str, Json], plan: SynthesisPlan, home: Path) -> None:
    """Make a program a version of a model of its task's name.

    Raises:
        ArtifactError: MLflow has no model of this run.
    """
    from roboscribe.errors import ArtifactError
    from roboscribe.pipelines.workspace import Workspace
    from roboscribe.stages.tracking.mlflow_model import register_run

    name, run_id = plan.program_name, result["mlflow_run_id"]
    version = None if run_id is None else register_run(Workspace(home).mlruns, str(run_id), name)
    if version is None:
        msg = f"--register: MLflow has no model of run {run_id}; `roboscribe ui` and the same command bring it there"
        raise ArtifactError(msg)
    say(f"MLflow model {name}, version {version}")


def _sweep(
    plan: SynthesisPlan,
    seeds: str,
    jobs: int,
    engine: EngineName,
    out: Path | None,
    json: Path | None,
    register: bool,
    home: Path,
) -> None:
    """Run one synthesis per seed, and say what came out of all.

    Raises:
        Exit: one of them found no program, or ended otherwise.
    """
    announce(f"{plan.task.name}, seeds {seeds}")
    from roboscribe.pipelines.seed_sweep import SeedSweep, parse_seeds, summary
    from roboscribe.pipelines.workspace import Workspace

    sweep = SeedSweep(plan, parse_seeds(seeds), jobs, engine, Workspace(home), out, register)
    outcomes = sweep.run(say)
    for line in summary(outcomes):
        say(line)
    run_id = sweep.track(outcomes)
    say(f"MLflow run {run_id or 'not there yet'}")
    write_result(json, {"runs": [dict(outcome.result) for outcome in outcomes], "mlflow_run_id": run_id})
    if any(outcome.code for outcome in outcomes):
        raise typer.Exit(max(outcome.code for outcome in outcomes))
