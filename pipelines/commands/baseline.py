"""The command that trains what programs are compared with."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from roboscribe.defaults import EVALUATION_EPISODES
from roboscribe.pipelines.commands.options import HomeDir, JsonFile, Quiet
from roboscribe.pipelines.commands.output import FAIL, announce, console, make_room, say, write_result

if TYPE_CHECKING:
    from roboscribe.io.atomic import Json
    from roboscribe.pipelines.progress_bar import ProgressBar
    from roboscribe.stages.runtime.progress import Progress, ProgressCallback

METHOD_HELP = "bc, chunked-bc, deepset, gail, goalgail or rlpd"
STEPS_HELP = "gradient steps of bc and chunked-bc, control steps of the others; left out: what is usual"
app = typer.Typer()


@app.command()
def baseline(
    method: Annotated[str, typer.Argument(help=METHOD_HELP, metavar="METHOD")],
    task: Annotated[str, typer.Argument(help="a name that `roboscribe tasks` lists", metavar="TASK")],
    demos: Annotated[Path | None, typer.Option(help="demonstrations in Parquet; left out: collect 50")] = None,
    seed: Annotated[int, typer.Option(min=0, help="decides everything random")] = 0,
    steps: Annotated[int | None, typer.Option(min=1, help=STEPS_HELP)] = None,
    engine: Annotated[str, typer.Option(help="what runs the stages: prefect or local")] = "prefect",
    out: Annotated[Path | None, typer.Option("--out", help="directory for the policy")] = None,
    json: JsonFile = None,
    episodes: Annotated[int, typer.Option(min=1, help="episodes of the final evaluation")] = EVALUATION_EPISODES,
    contact: Annotated[str, typer.Option(help="contact model: stable or paper")] = "stable",
    timing: Annotated[str, typer.Option(help="simulator timing: fast (10 x 4 ms) or faithful (20 x 2 ms)")] = "fast",
    quiet: Quiet = False,
    home: HomeDir = Path(),
) -> None:
    """Train and measure what programs are compared with; the same command goes on where it was interrupted."""
    announce(f"{method}, {task}, seed {seed}")
    from roboscribe.baselines.config import method_named
    from roboscribe.errors import Fail
    from roboscribe.pipelines.baseline_run import BaselinePlan, BaselineRun, engine_named
    from roboscribe.pipelines.callbacks import Callbacks
    from roboscribe.pipelines.progress_bar import ProgressBar
    from roboscribe.pipelines.workspace import Workspace
    from roboscribe.stages.runtime.task_config import TaskConfig

    where = TaskConfig(task, contact, timing)
    where.make()
    plan = BaselinePlan(method_named(method), where, seed, steps, demos, evaluation_episodes=episodes)
    make_room(out, json)
    with ProgressBar(console) as bar:
        run = BaselineRun(plan, Workspace(home), engine_named(engine), out)
        result = run.run(Callbacks(bar.on_stage, lambda event: None, _follow(bar)))
    if isinstance(result, Fail):
        say(f"FAIL: {result.reason}")
        raise typer.Exit(FAIL)
    _tell(result)
    write_result(json, result)


def _follow(bar: ProgressBar) -> ProgressCallback:
    """Move the bar, and say how each evaluation on the way went: learners with rollouts take hours."""

    def on_progress(progress: Progress) -> None:
        bar.on_progress(progress)
        if progress.unit == "steps" and "success" in progress.metrics:
            bar.say(f"{progress.done} of {progress.total} control steps: success {progress.metrics['success']:.0%}")

    return on_progress


def _tell(result: dict[str, Json]) -> None:
    """Say what was found."""
    from roboscribe.evaluation import format_success

    lines = [f"success {format_success(result)} of {result['episodes']} episodes, 95 % interval"]
    if result["hopeless"]:
        lines.append(f"given up: no success in any evaluation of {result['env_steps']} control steps")
    spent = f"{result['env_steps']} control steps, {result['gradient_steps']} gradient steps"
    lines += [f"{spent}, {result['wall_seconds']} s", f"policy {result['program_dir']}"]
    say("\n".join([*lines, f"MLflow run {result['mlflow_run_id']}"]))
