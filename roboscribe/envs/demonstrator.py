"""Demonstrations by a script: a script without memory, noise that lasts, and a style in which it is all done."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.random import Generator

from roboscribe.envs.performer import Performer, Scene
from roboscribe.envs.styles import DEFAULT, STYLES, Style, choices, style_names
from roboscribe.errors import TaskError
from roboscribe.world.layout import BoolArray, FloatArray, IntArray
from roboscribe.world.task import Task, World
from roboscribe.world.trajectory import Trajectory

MEMORY = 0.7
"""Correlation of the noise from one step to the next."""
BATCH = 64
"""Episodes run at once."""
LEAST = 0.5
"""Share of episodes that must succeed for a demonstrator to be one."""
MOST_FAILING = 0.5
"""Greatest share of the demonstrations that may be asked to fail."""
BROKEN_OFF = (0.25, 0.85)
"""A demonstration is broken off after this share of the steps to its goal."""
SHORTEST = 5
"""Steps that a broken-off demonstration has, at least."""
HABITS, FAILURES, FAILING_HABITS = 1, 2, 3
"""Random numbers of their own: what performers do, episodes that fail, and what performers do in those."""


@dataclass(frozen=True)
class Script:
    """What is done, apart from how.

    Args:
        command: the noiseless action (R, 4) in states (R, F), given the plan where there is one.
        above: the same, crossing well above everything and coming down vertically.
        spread: (4,) standard deviation of the noise.
        share: the share (R,) of the noise that is applied in states (R, F).
        look: how performers read a state (F,).
        styles: in which it can be given.
        plan: what the first states (R, F) of episodes decide for the whole of each.
    """

    command: Callable[..., FloatArray]
    above: Callable[..., FloatArray]
    spread: FloatArray
    share: Callable[[FloatArray], FloatArray]
    look: Callable[[FloatArray], Scene] = Scene.of
    styles: tuple[str, ...] = tuple(STYLES)
    plan: Callable[[FloatArray], FloatArray] | None = None

    def commands(self, states: FloatArray, plans: tuple[FloatArray, ...], above: BoolArray) -> FloatArray:
        """Decide the noiseless action (R, 4) in states (R, F), given the `plans` of their episodes, see `planned`.

        It comes from well above in those rows (R,) where asked to.
        """
        actions = self.command(states, *plans)
        if above.any():
            actions[above] = self.above(states[above], *(plan[above] for plan in plans))
        return actions

    def planned(self, starts: FloatArray) -> tuple[FloatArray, ...]:
        """Return the plan of episodes that begin in `starts` (R, F); nothing where the script makes none."""
        return () if self.plan is None else (self.plan(starts),)


class ScriptedTask(Task):
    """A task that a script solves."""

    @property
    @abstractmethod
    def script(self) -> Script:
        """What solves it."""

    def demonstrate(self, episodes: int, seed: int) -> list[Trajectory]:
        """Collect `episodes` successful noisy demonstrations; episode i of a seed does not depend on `episodes`."""
        return collect(self, episodes, seed)


@dataclass
class DemonstrationAttempt:
    """One running episode: its own random numbers, its noise, who performs it, and what was recorded."""

    seed: int
    rng: Generator
    performer: Performer
    states: list[FloatArray] = field(default_factory=list)
    actions: list[FloatArray] = field(default_factory=list)
    snapshots: list[FloatArray] = field(default_factory=list)
    noise: FloatArray = field(default_factory=lambda: np.zeros(4))
    solved: int = 0

    @property
    def succeeded(self) -> bool:
        """Whether the task has been solved for as long as the style wants."""
        return self.solved == self.performer.style.after

    def over(self, horizon: int) -> bool:
        """Tell whether nothing more is to be done in a task of this horizon."""
        late = len(self.actions) >= round(horizon * self.performer.style.patience)
        return late or self.succeeded or self.performer.left

    def act(self, scripted: FloatArray, spread: FloatArray, share: float) -> FloatArray:
        """Turn the script's action (4,) into the performer's, with noise."""
        action, disturbed = self.performer.act(self.states[-1], scripted, self.solved > 0)
        return self.disturb(action, spread, share * disturbed)

    def disturb(self, action: FloatArray, spread: FloatArray, share: float) -> FloatArray:
        """Add a share of the next correlated noise (Ornstein-Uhlenbeck) to an action (4,), within its bounds."""
        fresh = self.rng.normal(size=4) * spread
        self.noise = MEMORY * self.noise + np.sqrt(1 - MEMORY**2) * fresh
        return np.clip(action + share * self.noise, -1.0, 1.0)

    def record(self, state: FloatArray, snapshot: FloatArray, solved: bool) -> None:
        """Append what was observed."""
        self.states.append(state)
        self.snapshots.append(snapshot)
        self.solved = self.solved + 1 if solved else 0


def start(
    seed: int,
    index: int,
    styles: Sequence[Style] = (STYLES[DEFAULT],),
    *,
    failing: bool = False,
    look: Callable[[FloatArray], Scene] = Scene.of,
) -> DemonstrationAttempt:
    """Prepare episode `index` of a seed; it depends on nothing else.

    Args:
        seed: decides everything.
        index: which episode.
        styles: it draws one of them.
        failing: an episode of a failing demonstration; in half of them the block is dropped and left.
        look: how its performer reads a state (F,).
    """
    rng = np.random.default_rng(np.random.SeedSequence((seed, index, FAILURES) if failing else (seed, index)))
    habits = np.random.default_rng(np.random.SeedSequence((seed, index, FAILING_HABITS if failing else HABITS)))
    style = styles[int(habits.integers(len(styles)))]
    gives_up = failing and bool(habits.random() < 0.5)
    return DemonstrationAttempt(int(rng.integers(2**62)), rng, Performer(style, habits, gives_up, look))


def demonstrate(task: Task, episodes: int, seed: int, style: str = DEFAULT, failing: float = 0.0) -> list[Trajectory]:
    """Collect demonstrations of any task in a named style.

    Args:
        task: tasks without a script know the default style only, and no failures.
        episodes: how many.
        seed: decides everything.
        style: one of `style_names()`.
        failing: share of the demonstrations that end without success.

    Raises:
        TaskError: an unknown style, one that the task does not know, or a share outside 0 to `MOST_FAILING`.
    """
    known = task.script.styles if isinstance(task, ScriptedTask) else style_names()
    styles = choices(style, known)
    if not 0.0 <= failing <= MOST_FAILING:
        msg = f"a share of {failing:g} failing demonstrations: expected 0 to {MOST_FAILING:g}"
        raise TaskError(msg)
    if style == DEFAULT and failing == 0:
        return task.demonstrate(episodes, seed)
    if not isinstance(task, ScriptedTask):
        msg = f"{task.name} has its own demonstrator: expected style {DEFAULT} and no failing demonstrations"
        raise TaskError(msg)
    return collect(task, episodes, seed, styles, failing)


def collect(
    task: ScriptedTask, episodes: int, seed: int, styles: Sequence[Style] = (STYLES[DEFAULT],), failing: float = 0.0
) -> list[Trajectory]:
    """Collect noisy demonstrations of a scripted task.

    Args:
        task: what is shown.
        episodes: how many to return.
        seed: decides everything; as long as none fails, a longer collection starts with the shorter one.
        styles: each episode draws one.
        failing: share of the demonstrations, rounded to whole ones, in which the task is never solved; which they are
            is drawn. They are broken off on the way, or the block is dropped and left.

    Raises:
        TaskError: fewer than half of the attempts give a demonstration.
    """
    fail = round(failing * episodes)
    succeeding, failed = gather(task, episodes - fail, seed, styles), gather(task, fail, seed, styles, failing=True)
    order = np.random.default_rng(np.random.SeedSequence((seed, FAILURES))).permutation(episodes)
    given = iter(succeeding), iter(failed)
    return [next(given[int(place < fail)]) for place in order]


def gather(
    task: ScriptedTask, count: int, seed: int, styles: Sequence[Style], *, failing: bool = False
) -> list[Trajectory]:
    """Try until there are `count` demonstrations that succeed, or that fail.

    Raises:
        TaskError: fewer than half of the attempts give one.
    """
    if count == 0:
        return []
    world = task.world(min(BATCH, count))
    found: list[Trajectory] = []
    tried = 0
    while len(found) < count:
        if tried > 2 * BATCH and len(found) < LEAST * tried:
            did = "failed in" if failing else "solved"
            msg = f"the demonstrator of {task.name} {did} {len(found)} of {tried} episodes, expected at least half"
            raise TaskError(msg)
        wave = [start(seed, tried + i, styles, failing=failing, look=task.script.look) for i in range(world.batch)]
        run(task, world, wave)
        given = [failure(task, episode) if failing else success(task, episode) for episode in wave]
        found += [trajectory for trajectory in given if trajectory is not None]
        tried += len(wave)
    return found[:count]


def run(task: ScriptedTask, world: World, wave: Sequence[DemonstrationAttempt]) -> None:
    """Run a wave of episodes, one per row, until each is over or has left physics."""
    script, rows = task.script, np.arange(len(wave))
    states = world.reset(rows, np.array([episode.seed for episode in wave], dtype=np.int64))
    _record(task, world, rows, states, wave)
    plans = script.planned(states)
    while True:
        running = ~world.diverged(rows) & np.array([not wave[row].over(task.horizon) for row in rows])
        rows, states = rows[running], states[running]
        if len(rows) == 0:
            return
        above = np.array([wave[row].performer.style.above for row in rows])
        commands = script.commands(states, tuple(plan[rows] for plan in plans), above)
        scripted = zip(rows, commands, script.share(states), strict=True)
        actions = np.array([wave[row].act(action, script.spread, share) for row, action, share in scripted])
        states = world.step(rows, actions)
        for row, action in zip(rows, actions, strict=True):
            wave[row].actions.append(action)
        _record(task, world, rows, states, wave)


def _record(task: Task, world: World, rows: IntArray, states: FloatArray, wave: Sequence[DemonstrationAttempt]) -> None:
    """Append the present states and snapshots of `rows` to their episodes."""
    observed = zip(rows, states, world.save(rows), task.solved(states), strict=True)
    for row, state, snapshot, solved in observed:
        wave[row].record(state, snapshot, bool(solved))


def success(task: Task, episode: DemonstrationAttempt) -> Trajectory | None:
    """Return what a successful episode recorded; None if it failed, or was over before anything was done."""
    return trajectory(task, episode, len(episode.actions)) if episode.succeeded and episode.actions else None


def failure(task: Task, episode: DemonstrationAttempt) -> Trajectory | None:
    """Return an episode in which the task is never solved: as it was, or broken off on the way to success.

    None if it left physics, or if nothing is left of it.
    """
    if not episode.over(task.horizon):
        return None
    solved, steps = task.solved(np.array(episode.states)), len(episode.actions)
    if solved.any():
        steps = int(episode.rng.uniform(*BROKEN_OFF) * solved.argmax())
    return trajectory(task, episode, steps) if steps >= SHORTEST else None


def trajectory(task: Task, episode: DemonstrationAttempt, steps: int) -> Trajectory:
    """Freeze the first `steps` of what an episode recorded."""
    states, snapshots = np.array(episode.states[: steps + 1]), np.array(episode.snapshots[: steps + 1])
    return Trajectory(task.layout, states, np.array(episode.actions[:steps]), snapshots)
