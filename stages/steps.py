"""The pieces of Algorithm 2, each backed by a stage; the algorithm itself stands in `abstraction_refinement` alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol, TypeAlias, assert_never

from roboscribe import steps as core
from roboscribe.classifier import Refinement, alternative
from roboscribe.dsl.syntax import Program
from roboscribe.errors import Fail
from roboscribe.evidence import Evidence
from roboscribe.grounding import CHECKED, LastTraining, grounds, stale
from roboscribe.io.atomic import Json, indented_json
from roboscribe.loosening import looser
from roboscribe.stages import classify, generate, roll_out, train, update_tree, validate
from roboscribe.stages.runtime import controller_files
from roboscribe.stages.runtime.events import (
    Abandoned,
    EventCallback,
    Loosened,
    Programmed,
    Refined,
    Removed,
    Retrained,
    RolledOut,
    Trained,
)
from roboscribe.stages.runtime.files import (
    EPISODES,
    FAILURES,
    OUTCOME,
    PROGRAM,
    REFINEMENT,
    TREE,
    program_bytes,
    read_fail,
    read_json,
    read_program,
)
from roboscribe.stages.runtime.serialization import (
    failures_bytes,
    read_outcome,
    read_refinement,
    read_tree,
    refinement_to_json,
)
from roboscribe.stages.runtime.store import METRICS, AnyStage, Inputs
from roboscribe.stages.runtime.synthesis_plan import SynthesisPlan
from roboscribe.stages.runtime.task_config import load_evidence
from roboscribe.steps import Decision, Outcome, Steps, explained
from roboscribe.strips import Strips, strips
from roboscribe.subtask_tree import ROOT, Tree
from roboscribe.tree_json import tree_to_json
from roboscribe.world.layout import FloatArray


class RunStage(Protocol):
    """Runs a stage under a readable name; returns the directory of its outputs."""

    def __call__(self, label: str, stage: AnyStage, config: object, inputs: Inputs) -> Path:
        """Run or find the outputs."""


StoreValue: TypeAlias = Callable[[str, bytes], Path]
"""Stores a small value as a file, see `Store.put`."""


@dataclass(frozen=True)
class ControllerFiles:
    """Controllers as they pass through Algorithm 2: the training stage's outputs, and their names.

    Args:
        out: the stage's directory; None before anything is trained.
        grounds: by controller, what its node followed on when it was trained.
        last: for what they were trained last.
    """

    out: Path | None = None
    grounds: Mapping[str, Json] = field(default_factory=dict)
    last: LastTraining = field(default_factory=LastTraining)

    def inputs(self) -> dict[str, Path]:
        """Return its files as inputs of a stage."""
        if self.out is None:
            return {}
        return {"controllers": self.out / controller_files.DESCRIPTIONS, "weights": self.out / controller_files.WEIGHTS}

    def runnable(self) -> dict[str, Path]:
        """Return its files with the step limits of the program it was last trained for."""
        return {**self.inputs(), **({} if self.out is None else {"limits": self.out / train.LIMITS})}


@dataclass(frozen=True)
class StagedSteps:
    """Turns values into files, calls stages, and turns files back into values."""

    plan: SynthesisPlan
    demonstrations: Path
    call: RunStage
    put: StoreValue
    tell: EventCallback

    def steps(self) -> Steps[ControllerFiles]:
        """Return the pieces of Algorithm 2."""
        return Steps(
            generate=self.generate,
            train=self.train,
            roll_out=self.roll_out,
            classify=self.classify,
            alternative=lambda refinement, rank, tree: alternative(refinement, rank, self.evidence, tree),
            update_tree=self.update_tree,
            validate=self.validate,
            explained=lambda program: explained(program, self.evidence),
            turns=lambda node: self.evidence.turns(node),
            check=self.check,
            looser=lambda outcome, tree: looser(outcome, tree, self.evidence.layout),
            unfinished=lambda library: library.last.unfinished,
            tell=self.decided,
        )

    @property
    def evidence(self) -> Evidence:
        """Demonstrations as the algorithms use them."""
        return load_evidence(self.demonstrations, self.plan.task)

    def generate(self, goal: str, tree: Tree) -> Program | Fail:
        """GENPROGRAM."""
        config = generate.Config(self.plan.task, goal, self.plan.program_name)
        out = self.call(f"generate program for {goal}", generate.STAGE, config, self.shown(tree))
        return read_fail(out) or read_program(out / PROGRAM)

    def train(self, program: Program, goal: str, tree: Tree, library: ControllerFiles) -> ControllerFiles:
        """TRAINPROGRAM.

        Departs: a controller whose node got another predecessor since it was trained is trained afresh, for it now
            takes over in other states.
        """
        self.tell(Programmed(goal, program))
        now = grounds(tree, program)
        afresh, plan = stale(now, library.grounds), self.plan
        new = [name for name in now if name not in library.grounds or name in afresh]
        asked = library.last.next(goal, program)
        config = train.Config(plan.practice, goal, plan.seed, plan.training, afresh, goal == ROOT, asked.trained_before)
        inputs = {**self.shown(tree), "program": self.program(program), **library.inputs()}
        label = f"train {', '.join(new)}" if new else f"improve {', '.join(now)} for {goal}"
        out = self.call(label, train.STAGE, config, inputs)
        reports = tuple(read_json(out / train.REPORTS))
        self.tell(Trained(goal, reports, out / METRICS))
        last = replace(asked, unfinished=any(report["unfinished"] for report in reports))
        return ControllerFiles(out, {**library.grounds, **now}, last)

    def roll_out(self, program: Program, goal: str, library: ControllerFiles) -> Outcome:
        """Exec(M, P)."""
        wanted = self.plan.limits.success if goal == ROOT else None
        out = self._roll_out(f"roll out {goal}", program, goal, library, self.plan.rollout_episodes, wanted)
        self.tell(RolledOut(goal, read_json(out / OUTCOME), out / EPISODES))
        return read_outcome(out)

    def check(self, program: Program, goal: str, library: ControllerFiles) -> Outcome:
        """Exec(M, P) for a few episodes."""
        episodes = min(CHECKED, self.plan.rollout_episodes)
        return read_outcome(self._roll_out("check a shorter program", program, goal, library, episodes))

    def _roll_out(
        self,
        label: str,
        program: Program,
        goal: str,
        library: ControllerFiles,
        episodes: int,
        wanted: float | None = None,
    ) -> Path:
        plan = self.plan
        config = roll_out.Config(plan.practice, goal, plan.seed, episodes, wanted, plan.training.confirm)
        return self.call(label, roll_out.STAGE, config, {"program": self.program(program), **library.runnable()})

    def classify(self, failures: FloatArray, tree: Tree, goal: str) -> Refinement | Fail:
        """LEARNCLASSIFIER."""
        inputs = {**self.shown(tree), "failures": self.put(FAILURES, failures_bytes(failures))}
        out = self.call(f"classify {goal}", classify.STAGE, classify.Config(self.plan.task, goal), inputs)
        return read_fail(out) or read_refinement(out / REFINEMENT)

    def decided(self, decision: Decision) -> None:
        """Pass on what Algorithm 1 decides, as events."""
        match decision:
            case core.Refined(refinement, tree, count, shown):
                path = self.json(REFINEMENT, refinement_to_json(refinement))
                self.tell(Refined(refinement, path, tree, count, shown, self.strips(refinement, tree)))
            case core.Abandoned(reason):
                self.tell(Abandoned(reason))
            case core.Retrained(success):
                self.tell(Retrained(success))
            case core.Loosened(node, predicate, success, helps):
                self.tell(Loosened(node, predicate, success, helps))
            case core.Removed(node, success):
                self.tell(Removed(node, success))
            case _:
                assert_never(decision)

    def strips(self, refinement: Refinement, tree: Tree) -> Strips:
        """Compute where a subgoal holds along the demonstrations."""
        frequency = self.plan.task.make().frequency
        return strips(refinement.node.name, refinement.psi, tree, self.evidence, frequency)

    def update_tree(self, tree: Tree, refinement: Refinement) -> Tree:
        """UPDATETREE."""
        inputs = {"tree": self.tree(tree), "refinement": self.json(REFINEMENT, refinement_to_json(refinement))}
        label = f"update tree with {refinement.node.name}"
        return read_tree(self.call(label, update_tree.STAGE, update_tree.Config(), inputs) / TREE)

    def validate(self, tree: Tree) -> Fail | None:
        """VALIDATE."""
        label = f"validate tree of {len(tree.edges)} edges"
        return read_fail(self.call(label, validate.STAGE, validate.Config(self.plan.task), self.shown(tree)))

    def shown(self, tree: Tree) -> dict[str, Path]:
        """Return demonstrations and tree as inputs."""
        return {"demonstrations": self.demonstrations, "tree": self.tree(tree)}

    def tree(self, tree: Tree) -> Path:
        """Return a tree as a file."""
        return self.json(TREE, tree_to_json(tree))

    def program(self, program: Program) -> Path:
        """Return a program as a file."""
        return self.put(PROGRAM, program_bytes(program))

    def json(self, name: str, value: Json) -> Path:
        """Return a JSON value as a file."""
        return self.put(name, indented_json(value).encode())
