"""The paper's transfer experiment (Sec. 5.2): programs for one single tower build other towers, without training."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from rich.console import Console

from pipelines.bar import Bar
from pipelines.chain import Plan
from pipelines.home import Home
from pipelines.prefect_server import prefect_server
from pipelines.programs import program_directory, spell_success
from pipelines.session import Engine, Session
from pipelines.story import Story
from roboscribe.envs.catalogue import CONTACTS
from roboscribe.errors import ArtifactError, Fail
from roboscribe.io.atomic import canonical_json, sha256_of, write_files
from roboscribe.io.saved_program import load_program
from stages import transfer
from stages.code_version import code_version
from stages.experiment import track_experiment
from stages.files import OUTCOME, read_json
from stages.paper_values import SUCCESS, TASKS
from stages.settings import encode
from stages.store import Store, locked
from stages.transfer_report import MARKDOWN, Measurement, cell_means, report_files, tabulate
from stages.world import TaskConfig

TITLE = "paper towers"
SINGLE_TOWER = re.compile(r"tower-([0-9]+)(-crowded)?")
"""Names of the tasks for which programs are transferred."""


@dataclass(frozen=True)
class Experiment:
    """What is compared.

    Args:
        trained: blocks of the single towers for which programs are synthesized.
        seeds: programs per tower; their seeds count from 0.
        episodes: of each measurement.
        contacts: contact models under which programs are measured.
        programs: programs that are measured instead of synthesizing any: directories, MLflow run ids, shipped names.
        tasks: where programs are measured.
    """

    trained: tuple[int, ...] = tuple(SUCCESS)
    seeds: int = 3
    episodes: int = 500
    contacts: tuple[str, ...] = CONTACTS
    programs: tuple[str, ...] = ()
    tasks: tuple[str, ...] = TASKS


@dataclass(frozen=True)
class Subject:
    """A program that is measured.

    Args:
        trained: blocks of the single tower for which it was made.
        seed: that decided it.
        directory: where it lies.
    """

    trained: int
    seed: int
    directory: Path

    def __str__(self) -> str:
        return f"tower-{self.trained} seed {self.seed}"


@dataclass(frozen=True)
class Cell:
    """One measurement.

    Args:
        subject: what is measured.
        config: where, on which episodes.
    """

    subject: Subject
    config: transfer.Config

    def __str__(self) -> str:
        return f"{self.subject} on {self.config.task.name}, {self.config.task.contact} contact"


@dataclass(frozen=True)
class Report:
    """What an experiment leaves.

    Args:
        summary: the Markdown table; "" where there was no program to measure.
        failures: which syntheses gave no program, and why.
        run_id: MLflow's; None where nothing was tracked.
    """

    summary: str
    failures: tuple[str, ...]
    run_id: str | None = None


@dataclass(frozen=True)
class TowersSession:
    """Everything one run of the experiment needs.

    Args:
        experiment: what is compared.
        home: where it is kept.
        engine: what runs syntheses and measurements.
        out: where the report goes; None is `data/paper/towers`.
        track: whether MLflow is told.
    """

    experiment: Experiment
    home: Home
    engine: Engine = "prefect"
    out: Path | None = None
    track: bool = True

    def run(self, console: Console) -> Report:
        """Synthesize the programs or take the given ones, measure each, and write the report.

        The same experiment goes on where it was interrupted: finished stages and measurements are in the store.

        Raises:
            ArtifactError: a given program cannot be used.
            TaskError: an unknown contact model, or a tower that cannot be built.
        """
        self._check()
        failures: list[str] = []
        with ExitStack() as stack:
            if self.experiment.programs:
                given = (stack.enter_context(self._given(name)) for name in self.experiment.programs)
                subjects = _distinct(list(given))
            else:
                subjects = self._synthesized(console, failures)
            measured = self._measured(subjects, console)
            return self._report(subjects, measured, tuple(failures))

    def _check(self) -> None:
        """Make every task once, so that hours of training do not end in a typing error."""
        own = [] if self.experiment.programs else [planned(blocks, 0).task for blocks in self.experiment.trained]
        for task in (*own, *self._tasks()):
            task.make()

    def _tasks(self) -> list[TaskConfig]:
        return [TaskConfig(task, contact) for contact, task in product(self.experiment.contacts, self.experiment.tasks)]

    @contextmanager
    def _given(self, name: str) -> Iterator[Subject]:
        """Find a given program.

        Raises:
            ArtifactError: there is none, or it was made for something else than a single tower.
        """
        with program_directory(name, self.home.mlruns) as directory:
            manifest: Mapping[str, Any] = load_program(directory).manifest
            family = SINGLE_TOWER.fullmatch(manifest["task"])
            if family is None:
                msg = f"program {name}: was made for task {manifest['task']}, expected a single tower such as tower-5"
                raise ArtifactError(msg)
            yield Subject(int(family[1]), manifest["seed"], directory)

    def _synthesized(self, console: Console, failures: list[str]) -> list[Subject]:
        """Synthesize all programs; those that cannot be found are added to `failures`."""
        subjects = []
        for blocks, seed in product(self.experiment.trained, range(self.experiment.seeds)):
            plan = planned(blocks, seed)
            with Story(console) as story:
                story.say(f"{plan.task.name} seed {seed}", "bold")
                result = Session(plan, self.home, self.engine, track=self.track).run(story.audience())
            if isinstance(result, Fail):
                failures.append(f"{plan.task.name} seed {seed}: {result.reason}")
            else:
                subjects.append(Subject(blocks, seed, Path(str(result["program_dir"]))))
        return subjects

    def _measured(self, subjects: Sequence[Subject], console: Console) -> list[Measurement]:
        """Measure every program in every task."""
        store, measured = Store(self.home.data / "stages"), list[Measurement]()
        episodes = self.experiment.episodes
        cells = [Cell(s, transfer.Config(t, s.seed, episodes)) for s, t in product(subjects, self._tasks())]
        with Bar(console) as bar:

            def measure(number: int) -> None:
                cell = cells[number]
                bar.begin(str(cell))
                subject, where = cell.subject, cell.config.task
                out = store.run(transfer.STAGE, cell.config, transfer.inputs_of(subject.directory), bar.watch)
                figures = read_json(out / OUTCOME)
                measured.append(Measurement(subject.trained, subject.seed, where.contact, where.name, figures))
                bar.say(f"{cell}: {spell_success(figures)}")

            if self.engine == "local":
                for number in range(len(cells)):
                    measure(number)
            elif cells:
                with prefect_server(self.home.data / "prefect") as server:
                    from pipelines.measuring import measure_with_prefect

                    measure_with_prefect(TITLE, [str(cell) for cell in cells], measure, server)
        return measured

    def _report(
        self, subjects: Sequence[Subject], measured: Sequence[Measurement], failures: tuple[str, ...]
    ) -> Report:
        """Write the report's files and track them."""
        if not measured:
            return Report("", failures)
        table = tabulate(measured)
        files = report_files(table)
        out = self.out or self.home.data / "paper" / "towers"
        out.mkdir(parents=True, exist_ok=True)
        write_files({out / name: data for name, data in files.items()})
        run_id = None
        if self.track:
            directory = self.home.data / "runs" / self._key(subjects)
            directory.mkdir(parents=True, exist_ok=True)
            with locked(directory):
                params = self._params(subjects)
                run_id = track_experiment(directory, self.home.mlruns, TITLE, TITLE, params, cell_means(table), files)
        return Report(files[MARKDOWN].decode(), failures, run_id)

    def _key(self, subjects: Sequence[Subject]) -> str:
        """Identify the run: the same experiment on the same programs with the same code gives the same key."""
        inputs = [
            {name: sha256_of(path) for name, path in transfer.inputs_of(subject.directory).items()}
            for subject in subjects
        ]
        code = [code_version(name) for name in ("stages.transfer", "stages.transfer_report")]
        text = canonical_json({"experiment": encode(self.experiment), "programs": inputs, "code": code})
        return hashlib.sha256(text.encode()).hexdigest()[:32]

    def _params(self, subjects: Sequence[Subject]) -> dict[str, str]:
        """Say what was compared."""
        values: dict[str, Sequence[object]] = {
            "episodes": [self.experiment.episodes],
            "contacts": self.experiment.contacts,
            "trained": sorted({subject.trained for subject in subjects}),
            "seeds": sorted({subject.seed for subject in subjects}),
        }
        return {name: ", ".join(map(str, shown)) for name, shown in values.items()}


def planned(blocks: int, seed: int) -> Plan:
    """Plan the synthesis of a program for a single tower: what `roboscribe synthesize tower-N --seed S` does."""
    return Plan(TaskConfig(f"tower-{blocks}"), seed)


def _distinct(subjects: list[Subject]) -> list[Subject]:
    """Refuse programs that the report could not tell apart.

    Raises:
        ArtifactError: two programs are for the same tower and of the same seed.
    """
    names = [str(subject) for subject in subjects]
    twice = next((name for i, name in enumerate(names) if name in names[:i]), None)
    if twice is not None:
        msg = f"two of the programs are {twice}; expected another tower or seed for each"
        raise ArtifactError(msg)
    return subjects
