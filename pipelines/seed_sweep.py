"""The same synthesis for several seeds: a process for each, a few at a time; one table and one run of MLflow above."""

from __future__ import annotations

import hashlib
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from roboscribe.errors import TaskError
from roboscribe.evaluation import format_success
from roboscribe.io.atomic import Json, canonical_json, parse_json, write_file
from roboscribe.pipelines.runs.table import columns
from roboscribe.pipelines.source_commit import checkout_commit
from roboscribe.pipelines.synthesis_run import Engine
from roboscribe.pipelines.workspace import Workspace
from roboscribe.stages.runtime.configuration import encode
from roboscribe.stages.runtime.plan_file import CONFIG, to_toml
from roboscribe.stages.runtime.synthesis_plan import SynthesisPlan
from roboscribe.stages.tracking.experiment import track_experiment
from roboscribe.stages.tracking.mlflow_store import NOTE_TAG, adopt
from roboscribe.stages.tracking.source import source_tags

SEEDS = re.compile(r"\d+(-\d+)?(,\d+(-\d+)?)*")
KILLED = 128
"""Exit code that a signal's number is added to."""
MOST = 1000
"""Seeds of one sweep: a slip of the finger is not asked for a million runs."""


@dataclass(frozen=True)
class Outcome:
    """What came out for one seed.

    Args:
        seed: which.
        code: exit code of its process.
        result: what `roboscribe synthesize --json` writes; seed and reason where there is no program.
    """

    seed: int
    code: int
    result: Mapping[str, Json]


@dataclass(frozen=True)
class SeedSweep:
    """A synthesis and its seeds.

    Args:
        plan: what is asked for; its seed does not matter.
        seeds: one run for each.
        jobs: runs at a time.
        engine: what runs the stages of each.
        workspace: where all is kept.
        out: the programs go in directories in it, `seed-0` and so on; None is `data/programs` as for single runs.
        register: whether each becomes a version of a model in MLflow.
    """

    plan: SynthesisPlan
    seeds: tuple[int, ...]
    jobs: int
    engine: Engine
    workspace: Workspace
    out: Path | None = None
    register: bool = False
    _running: list[subprocess.Popen[bytes]] = field(default_factory=list)

    @property
    def directory(self) -> Path:
        """Where the sweep keeps its logs and its journal; the same sweep keeps them in the same place."""
        plan = encode(replace(self.plan, seed=0, demonstrations=None))
        given = None if self.plan.demonstrations is None else str(self.plan.demonstrations)
        identity: Json = {"sweep": list(self.seeds), "plan": plan, "demonstrations": given}
        return self.workspace.data / "runs" / hashlib.sha256(canonical_json(identity).encode()).hexdigest()[:32]

    def run(self, tell: Callable[[str], None]) -> tuple[Outcome, ...]:
        """Run all; told again, finished ones are found and interrupted ones go on.

        Args:
            tell: hears one line when a seed is done.
        """
        self.directory.mkdir(parents=True, exist_ok=True)
        write_file(self.directory / CONFIG, to_toml(self.plan).encode())
        tell(f"{self.plan.task.name}, seeds {_spelled(self.seeds)}, {self.jobs} at a time; logs in {self.directory}")

        def one(seed: int) -> Outcome:
            outcome = self._one(seed)
            tell(_line(outcome))
            return outcome

        with ThreadPoolExecutor(self.jobs) as pool:
            waiting = [pool.submit(one, seed) for seed in self.seeds]
            try:
                return tuple(each.result() for each in waiting)
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                for process in self._running:
                    process.send_signal(signal.SIGINT)
                raise

    def track(self, outcomes: Sequence[Outcome]) -> str | None:
        """Put one run above those of the seeds; returns MLflow's id, None where the store cannot be reached."""
        lines, rates = summary(outcomes), _rates(outcomes)
        note = "\n".join(["```", *lines, "```"])
        run_id = track_experiment(
            self.directory,
            self.workspace.mlruns,
            f"{self.plan.task.name} seeds {_spelled(self.seeds)}",
            self.plan.task.name,
            {"task": self.plan.task.name, "kind": "seeds", "seeds": _spelled(self.seeds)},
            {"success": sum(rates) / len(rates), "least_success": min(rates)} if rates else {},
            {"table.txt": "\n".join(lines).encode(), CONFIG: to_toml(self.plan).encode()},
            {**source_tags(f"roboscribe synthesize --seeds {_spelled(self.seeds)}", checkout_commit()), NOTE_TAG: note},
        )
        below = [str(each.result["mlflow_run_id"]) for each in outcomes if each.result.get("mlflow_run_id")]
        if run_id is not None:
            adopt(self.workspace.mlruns, run_id, below)
        return run_id

    def _one(self, seed: int) -> Outcome:
        """Run one seed in a process of its own."""
        told = self.directory / f"seed-{seed}.json"
        told.unlink(missing_ok=True)
        log = told.with_suffix(".log")
        with log.open("wb") as output:
            process = subprocess.Popen(self._words(seed, told), stdout=output, stderr=output, stdin=subprocess.DEVNULL)
            self._running.append(process)
            ended = process.wait()
            code = ended if ended >= 0 else KILLED - ended  # as a shell has it for what a signal ended
        self._running.remove(process)
        if code == 0:
            result = parse_json(told.read_text(encoding="utf-8"))
            assert isinstance(result, Mapping)
            return Outcome(seed, code, result)
        said = [line for line in log.read_text(encoding="utf-8", errors="replace").splitlines() if line.strip()]
        return Outcome(seed, code, {"seed": seed, "reason": said[-1].strip() if said else f"exit code {code}"})

    def _words(self, seed: int, told: Path) -> list[str]:
        """Spell the command line of one seed."""
        words = [sys.executable, "-m", "roboscribe.pipelines.cli", "synthesize"]
        words += ["--config", str(self.directory / CONFIG), "--seed", str(seed), "--engine", self.engine]
        words += ["--json", str(told), "--home", str(self.workspace.path)]
        words += ["--out", str(self.out / f"seed-{seed}")] if self.out is not None else []
        return words + ["--register"] * self.register


def parse_seeds(text: str) -> tuple[int, ...]:
    """Read "0-4" or "0,2,5".

    Raises:
        TaskError: it says something else, or nothing.
    """
    parts = [part.partition("-") for part in text.split(",")] if SEEDS.fullmatch(text) else []
    seeds = [seed for low, _, high in parts for seed in range(int(low), int(high or low) + 1)[: MOST + 1]]
    if not seeds or len(seeds) > MOST:
        msg = f"--seeds {text}: expected 0-4, or 0,2,5, at most {MOST} of them"
        raise TaskError(msg)
    return tuple(dict.fromkeys(seeds))


def summary(outcomes: Sequence[Outcome]) -> list[str]:
    """Line up what came out for every seed, and the mean."""
    rates = _rates(outcomes)
    mean = f"mean success {100 * sum(rates) / len(rates):.1f} % over {len(rates)} programs" if rates else "no program"
    missing = len(outcomes) - len(rates)
    return [*columns([_row(each.result) for each in outcomes]), mean + f", {missing} seeds without" * (missing > 0)]


def _row(result: Mapping[str, Any]) -> dict[str, str]:
    """Sum up one seed."""
    if "reason" in result:
        return {**dict.fromkeys(_TITLES, ""), "seed": str(result["seed"]), "success": str(result["reason"])}
    cells = (result["seed"], format_success(result), result["refinements"], result["env_steps"])
    return dict(zip(_TITLES, map(str, (*cells, f"{result['wall_seconds']:.0f}", result["program_dir"])), strict=True))


_TITLES = ("seed", "success", "refinements", "steps", "seconds", "program")


def _line(outcome: Outcome) -> str:
    """Say in one line how a seed ended."""
    if "reason" in outcome.result:
        return f"seed {outcome.seed}: {outcome.result['reason']}"
    return f"seed {outcome.seed}: success {format_success(outcome.result)}"


def _rates(outcomes: Sequence[Outcome]) -> list[float]:
    """Return the success of every program that was found."""
    return [float(str(each.result["success"])) for each in outcomes if "success" in each.result]


def _spelled(seeds: Sequence[int]) -> str:
    """Spell seeds: "0-4", or "0,2,5"."""
    together = list(seeds) == list(range(seeds[0], seeds[0] + len(seeds))) and len(seeds) > 1
    return f"{seeds[0]}-{seeds[-1]}" if together else ",".join(map(str, seeds))
