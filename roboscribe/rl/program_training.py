"""What every skill of one TRAINPROGRAM call shares, and what follows from it for one skill."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf
from zlib import crc32

import numpy as np

from roboscribe.defaults import CONFIRM
from roboscribe.dsl.rewrite import controllers, free_vars, run_variables, walk
from roboscribe.dsl.segmentation import Segment, segment
from roboscribe.dsl.semantics import evaluate, holds
from roboscribe.dsl.syntax import Exists, Get, Predicate, Program, Run, Solved, Truth, While
from roboscribe.reward import atom_term, atoms
from roboscribe.rl.clone import initial_skill
from roboscribe.rl.config import SacConfig, TrainConfig
from roboscribe.rl.last_statement import continues_if
from roboscribe.rl.observation import ObservationSpec, observation_spec
from roboscribe.rl.pool import StartPool
from roboscribe.rl.skill import Skill
from roboscribe.rl.starts import Prefix, collect_starts
from roboscribe.rl.subtask import Invariant, Subtask
from roboscribe.rl.warm_start import Frames, busy, frames_of, joined
from roboscribe.success_rate import wilson
from roboscribe.world.layout import BoolArray
from roboscribe.world.naming import Movements
from roboscribe.world.task import Task
from roboscribe.world.trajectory import Trajectory

USUALLY = 0.95
"""Share of a controller's segments that set its step limit: a demonstrator's rare mishap does not."""
SLACK = 2
"""Times what its segments usually take that a controller may take in training: it may be slower than it was shown."""
SETTLING = 2
"""Times the steps of confirmation that a controller has in a loop beyond what its segments usually take."""
HELD_OUT, TO_TRAIN_FROM = 1 / 6, 1 / 3
"""Shares of the control steps of a controller that it may take to find what it is measured on, and trained from."""
SEEDS = 2**31
"""Seeds are drawn below this, so that they fit into 32 bits, with a sign or without."""


@dataclass(frozen=True)
class Group:
    """Controllers that are learned together: those of one outermost `loop`, or a single one."""

    runs: tuple[Run, ...]
    loop: bool


@dataclass(frozen=True)
class ProgramTraining:
    """A program to be grounded.

    Args:
        task: the robot's world.
        program: P.
        demonstrations: canonically named.
        config: settings.
        seed: decides everything.
        solve: whether the program is to bring ψ_R about, or only to reach its end.
        trained_before: how often it was trained before, and was not good enough.
    """

    task: Task
    program: Program
    demonstrations: Sequence[Trajectory]
    config: TrainConfig
    seed: int
    solve: bool
    trained_before: int = 0

    @cached_property
    def runs(self) -> tuple[Run, ...]:
        """The program's controller statements in textual order."""
        return controllers(self.program)

    def target(self, run: Run) -> float:
        """Return the success at which a skill is good enough; one only met on the way may be improved later.

        What a loop repeats for every entity has to succeed as often as all repetitions together.
        """
        return float(self.wanted ** (1 / max(1, self.repetitions(run))))

    def enough(self, run: Run) -> float:
        """Return the success from which on a skill is not reinforced.

        Of a subgoal's skill, unless the program was trained before and nothing explained why it fails, it is what
        passes: ψ_R decides what is worth more. SAC would begin anew then.
        """
        most = self.target(run)
        entirely = bool(self.trained_before) or isinstance(self.config.learner, SacConfig)
        return most if self.solve or entirely else min(most, self.config.passable)

    def may_be_enough(self, run: Run, rate: float, starts: int) -> bool:
        """Tell whether a known skill is as good as is asked, for all that its success from some starts tells.

        Others are more likely to blame then; where the program was improved in vain, it is improved as well.
        """
        return not self.trained_before and wilson(rate * starts, starts)[1] >= self.target(run)

    @property
    def wanted(self) -> float:
        """Share of episodes that is to reach the program's goal."""
        return self.config.target if self.solve else self.config.subgoal_target

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """The controllers of each outermost loop together, every other one alone, in textual order."""
        found: list[Group] = []
        for part in walk(self.program):
            if isinstance(part, While | Run):
                seen = {run.controller for group in found for run in group.runs}
                runs = tuple(run for run in controllers(part) if run.controller not in seen)
                found.append(Group(runs, isinstance(part, While)))
        return tuple(found)

    def in_loop(self, run: Run) -> bool:
        """Tell whether a loop repeats a controller."""
        return any(group.loop and run in group.runs for group in self.groups)

    def repetitions(self, run: Run) -> int:
        """Return for how many entities a loop repeats a controller; 0 outside loops."""
        loops = [part for part in walk(self.program) if isinstance(part, While) and run in controllers(part.body)]
        kinds = [part.guard.type for part in loops if isinstance(part.guard, Get)]
        return sum(len(self.task.layout.of_type(kind)) for kind in kinds)

    def invariant(self, run: Run) -> Invariant | None:
        """Return what the loop around a controller, or the last one before it, brings about for each entity."""
        found: Invariant | None = None
        for part in walk(self.program):
            if part is run:
                return found
            if isinstance(part, While) and isinstance(part.guard, Get):
                get, reached = part.guard, controllers(part.body)[-1].until
                if free_vars(reached) == (get.var.name,):
                    found = Invariant(reached, get.var.name, get.type)
        return found

    @cached_property
    def segments(self) -> tuple[tuple[Segment, ...], ...]:
        """Each demonstration cut by the program; what comes after its end counts where it is to bring ψ_R about.

        What a demonstration does in a segment first for entities that the program does not deal with is left out.
        """
        cut = segment(self.program, self.demonstrations, solved=self.task.solved, after_end=self.solve)
        return tuple(_attended(parts, shown) for parts, shown in zip(cut, self.demonstrations, strict=True))

    @cached_property
    def usual_steps(self) -> dict[str, int]:
        """What 95 % of each controller's segments take; those that no demonstration runs are left out."""
        steps: dict[str, list[int]] = {}
        for part in (part for parts in self.segments for part in parts):
            steps.setdefault(self.runs[part.run_index].controller, []).append(part.stop - part.start)
        usual = {name: int(np.ceil(np.quantile(counts, USUALLY))) for name, counts in steps.items()}
        return {name: count for name, count in usual.items() if count > 0}

    @cached_property
    def limits(self) -> dict[str, int]:
        """Step limit by controller, after which its loop turns to something else; it may come back."""
        return {name: count + SETTLING * self.config.confirm for name, count in self.usual_steps.items()}

    def draw(self, name: str) -> np.random.Generator:
        """Return a generator of its own for one purpose, so that a resumed run draws the same numbers."""
        return np.random.default_rng([self.seed, crc32(name.encode())])

    def this_time(self, name: str) -> str:
        """Name what is drawn anew each time: what was chosen on some starts shows its true success on others."""
        return f"{name} {self.trained_before}" if self.trained_before else name

    def seed_of(self, name: str) -> int:
        """Return a seed of its own for one purpose."""
        return int(self.draw(name).integers(SEEDS))

    def continues_if(self, run: Run) -> Predicate:
        """Return where the program goes on after `run`; where it is over, `run` is to bring ψ_R about, too."""
        if not self.solve or isinstance(run.until, Solved):
            return Truth()
        return continues_if(self.program, run.controller, self._settled)

    def _settled(self, condition: Predicate) -> bool:
        """Tell whether a condition never changes in a demonstration."""
        found = (holds(condition, shown.states, {}, self.task.layout) for shown in self.demonstrations)
        return all(truth.all() or not truth.any() for truth in found)

    def title(self, run: Run) -> str:
        """Return the name under which a skill's progress is kept."""
        return run.controller if self.continues_if(run) == Truth() else f"{run.controller}.last"

    def subtask(self, run: Run) -> Subtask:
        """Say what is asked of a skill: its step limit and the units of its reward come from the demonstrations."""
        return Subtask(
            task=self.task,
            until=run.until,
            variables=run_variables(run),
            limit=self.training_limit(run),
            confirm=self.config.confirm,
            continues_if=self.continues_if(run),
            scales=self.scales(run),
            invariant=self.invariant(run),
        )

    def training_limit(self, run: Run) -> int:
        """Return the control steps that a controller may take in training."""
        usual = self.usual_steps.get(run.controller)
        return SLACK * usual if usual else self.task.horizon

    def scales(self, run: Run) -> dict[str, float]:
        """Return the spread of each atom's term over the demonstrated segments of a skill, by the term's text.

        The variable of a quantifier ranges over all its entities.
        """
        values: dict[str, list[float]] = {}
        layout = self.task.layout
        quantifiers = [part for part in walk(run.until) if isinstance(part, Exists)]
        every = {part.var.name: np.array(layout.of_type(part.type))[:, None] for part in quantifiers}
        for rank, part in self._parts(run):
            shown = self.demonstrations[rank]
            binding = every | dict(zip(run_variables(run), part.entities, strict=True))
            states = shown.states[part.start : part.stop + 1]
            for term in map(atom_term, atoms(run.until)):
                found = evaluate(term, states, binding, layout)
                values.setdefault(str(term), []).extend(found[..., 0].ravel().tolist())
        spreads = {text: float(np.nanstd(found)) for text, found in values.items()}
        return {text: spread for text, spread in spreads.items() if spread > 0}

    def _parts(self, run: Run) -> list[tuple[int, Segment]]:
        """List the segments of a controller, each with the rank of its demonstration."""
        ranks = self.ranks(run)
        return [(rank, part) for rank, parts in enumerate(self.segments) for part in parts if part.run_index in ranks]

    def ranks(self, run: Run) -> tuple[int, ...]:
        """Return where a controller stands among the statements: more than once where branches share it."""
        return tuple(rank for rank, each in enumerate(self.runs) if each.controller == run.controller)

    def frames(self, run: Run) -> Frames | None:
        """Cut a controller's frames out of the demonstrations, and a few beyond φ; None where there are none."""
        beyond, actions = self.config.clone.extra_frames, self.config.profile == "actions"
        size = self.task.action_size
        found = []
        for rank, part in self._parts(run):
            frames = frames_of(part, self.demonstrations[rank], beyond, actions, size)
            found.append(frames.take(self.busy[rank][part.start : part.start + len(frames.states)]))
        return joined(found) if found else None

    @cached_property
    def busy(self) -> list[BoolArray]:
        """In which steps of each demonstration anything changes."""
        return busy(self.demonstrations)

    def specs(self, run: Run, *, speeds: bool = False) -> tuple[ObservationSpec, ...]:
        """Return what may be seen of a controller's arguments, not yet normalised, the most first.

        In a loop goals are seen, too: a controller takes over where the last entity was served, and has to leave it.
        Few demonstrations do not show what hardly matters: how differences lie to each other, or goals far off.
        With `speeds` all of these are seen: together they tell which action was taken.
        """
        types = {part.var.name: part.type for part in walk(self.program) if isinstance(part, Get)}
        most, near = (
            observation_spec(run, types, self.task.layout, goals=self.in_loop(run), near=near, speeds=speeds)
            for near in (False, True)
        )
        return tuple(dict.fromkeys((most, replace(most, turned=()), replace(near, turned=()))))

    def fresh_skills(self, run: Run, pool: StartPool) -> tuple[Skill, ...]:
        """Return untrained skills that see less and less, normalised on demonstrated, else on start states."""
        layout, frames = self.task.layout, self.frames(run)
        shown = frames if frames is not None and len(frames.states) else None
        states, entities = (pool.states, pool.entities) if shown is None else (shown.states, shown.entities)
        seed, found = self.seed_of(f"{run.controller} weights"), []
        for spec in self.specs(run):
            seen = spec if shown is None else spec.without_still(layout, states, entities)
            blank = Skill(run.controller, seen.fitted(layout, states, entities), (), layout)
            found.append(initial_skill(blank, self.task.action_size, self.config.clone.hidden, seed))
        return tuple(found)

    def held_out(self, run: Run, skills: Mapping[str, Skill], most: float, *, again: int = 0) -> tuple[StartPool, int]:
        """Return starts on which a controller is measured, and the control steps that it took to find them.

        They are few enough that an evaluation takes a quarter of the steps at most.

        Args:
            run: the controller's statement.
            skills: controllers so far.
            most: control steps that may be spent on the controller.
            again: turns at improving it, this one included: one that was chosen for its success on some starts shows
                its true success on others.
        """
        wanted = min(
            self._starts_wanted(run, self.config.pool.evaluation), max(1, int(most / 4 / self.training_limit(run)))
        )
        return self._starts(run, skills, wanted, HELD_OUT * most, "held out" + again * " again")

    def starts(
        self, run: Run, skills: Mapping[str, Skill], most: float, left: float = inf, *, again: int = 0
    ) -> tuple[StartPool, int]:
        """Return starts from which a controller is trained, and the control steps that it took to find them.

        Args:
            run: the controller's statement.
            skills: controllers so far.
            most: control steps that may be spent on the controller.
            left: of them.
            again: as in `held_out`.
        """
        wanted = self._starts_wanted(run, self.config.pool.starts)
        most = min(TO_TRAIN_FROM * most, left)
        return self._starts(run, skills, wanted, most, "starts" + again * " again")

    def _starts_wanted(self, run: Run, usual: int) -> int:
        if isinstance(run.until, Solved):
            return self.config.pool.opaque
        return usual * (self.config.pool.in_loops if self.in_loop(run) else 1)

    def _starts(
        self, run: Run, skills: Mapping[str, Skill], wanted: int, most: float, purpose: str
    ) -> tuple[StartPool, int]:
        """Run the program up to `run`; starts of other purposes are others."""
        config, rng = self.config.pool, self.draw(self.this_time(f"{run.controller} {purpose}"))
        prefix = Prefix(self.program, self.ranks(run), skills, self.limits, self.config.confirm)
        seeds = rng.integers(SEEDS, size=config.attempts * wanted)
        found, steps = collect_starts(prefix, self.task, wanted, seeds, rng, config.batch, most)
        return found.capped(config.tries), steps


def _attended(parts: Sequence[Segment], shown: Trajectory) -> tuple[Segment, ...]:
    """Leave out of each segment what a demonstration does in it first for entities that were not dealt with yet."""
    found: list[Segment] = []
    known: set[int] = set()
    moves = Movements(shown)
    for part in parts:
        known |= set(part.entities)
        begin = moves.attended_from(part.start, part.stop, part.entities, known) if part.entities else part.start
        found.append(replace(part, start=begin))
    return tuple(found)


def step_limits(
    program: Program, demonstrations: Sequence[Trajectory], task: Task, confirm: int = CONFIRM
) -> dict[str, int]:
    """Return each controller's step limit in loops: what 95 % of its segments take, and some steps to be confirmed.

    Args:
        program: P.
        demonstrations: canonically named.
        task: answers ψ_R.
        confirm: consecutive steps for which φ must hold.

    Returns:
        Steps by controller name; controllers that no demonstration runs are left out.

    Departs: the paper's π[φ] runs until φ, however long. A learned controller that takes longer than demonstrators do
        has mostly lost what it was to serve; its loop may come back to it.
    """
    return ProgramTraining(task, program, demonstrations, TrainConfig(confirm=confirm), 0, True).limits
