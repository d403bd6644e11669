"""Scripted, noisy demonstrators in several styles; some are told to fail."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from roboscribe.world.layout import FloatArray
from roboscribe.world.trajectory import Trajectory
from tests.quality.bench.data import STYLES, Aim, Phase, Style
from tests.quality.bench.kinematics import RADIUS, STEP, TRAVEL, TURN
from tests.quality.bench.task import wrapped

if TYPE_CHECKING:
    from tests.quality.bench.task import KinematicTask

NOISE = 0.08
"""Standard deviation of the noise on each axis of an action, in shares of the style's speed."""
TOUCH = 0.011
"""Distance at which an object counts as held, metres."""
CLOSE = 0.025
"""Distance at which the fingers close, metres."""
THERE = 0.03
"""Distance at which a way-point counts as reached, metres."""
PRECISE = 0.5
"""Share of what an aim allows within which a demonstrator goes on to the next."""
BEYOND = 0.15
"""Share of a threshold by which a demonstrator exceeds it."""
SPREAD = 0.35
"""Greatest distance from a container's middle at which things are put into it, in what is allowed."""
WANDER = 15
"""Steps that a failing demonstrator goes on after it has given up."""
RISE = 0.12
"""Height of the way-points of a demonstrator that comes from above, metres."""
ROUND_AT, NEAR, ROUND, ASIDE, PRESS = 0.06, 0.075, 0.6, 0.01, 0.02
"""Pushing: distance at which the hand goes round an object, and at which it begins to; radians per step; how far
beside the line through object and goal it may push; how far behind the object's middle it aims."""


@dataclass
class Script:
    """One demonstrator in one episode.

    Args:
        task: what is to be done.
        style: how.
        rng: its randomness.
        phases: in which order.
        gives_up: after how many steps it stops working; -1 for never.
    """

    task: KinematicTask
    style: Style
    rng: np.random.Generator
    phases: list[Phase]
    gives_up: int = -1
    job: tuple[Phase, int] | None = None
    offset: FloatArray = field(default_factory=lambda: np.zeros(0))
    through: list[FloatArray] = field(default_factory=list)
    carried: bool = False
    idle: int = 0
    lost: int = 0
    steps: int = 0
    last: FloatArray = field(default_factory=lambda: np.zeros(0))

    def act(self, state: FloatArray) -> FloatArray:
        """Choose an action (A,)."""
        self.steps += 1
        if self.gives_up >= 0 and self.steps > self.gives_up:
            return self._noisy(self._action(self._away(state), -1.0))
        if self.idle or self.rng.random() < self.style.pause:
            self.idle = self.idle - 1 if self.idle else int(self.rng.integers(4, 13))
            return self._still()
        action = self._noisy(self._work(state))
        self.last = action
        return action

    def _still(self) -> FloatArray:
        """Stand still, with the fingers as they were."""
        action = self._action(np.zeros(self.task.width), -1.0)
        if len(self.last):
            action[self.task.width :][: self.task.fingers] = self.last[self.task.width :][: self.task.fingers]
        return action

    def _work(self, state: FloatArray) -> FloatArray:
        self._choose(state)
        if self.job is None:
            away = self._away(state) if self.task.away else np.zeros(self.task.width)
            return self._action(away, -1.0)
        phase, entity = self.job
        if not self.task.fingers:
            return self._action(self._push(state, entity), -1.0)
        return self._serve(state, phase, entity)

    def _choose(self, state: FloatArray) -> None:
        """Go on to the next object where the present one is served."""
        if self.job and not self.task.served(state, self.job[0], self.job[1], PRECISE):
            return
        was, self.job = self.job, None
        if not self.phases:
            self.phases = [phase for phase in self.task.phases if not phase.passing]  # something may be disturbed
        while self.phases and self.job is None:
            waiting = self._waiting(state, self.phases[0])
            if waiting:
                self._begin(state, self.phases[0], waiting)
            else:
                self.phases.pop(0)
        if self.style.above and was and self.task.entities[was[1]].loose:
            self.through.insert(0, state[self.task.hand] + RISE * np.eye(self.task.width)[-1])

    def _waiting(self, state: FloatArray, phase: Phase) -> list[int]:
        members = [e for e in self.task.of_kind(phase.kind) if not self.task.served(state, phase, e, 0.99)]
        ranks = [float(self.task.rank(state, phase.order, e)) for e in members]
        return [e for e, rank in zip(members, ranks, strict=True) if rank <= min(ranks) + 1e-9]

    def _begin(self, state: FloatArray, phase: Phase, waiting: list[int]) -> None:
        entity = waiting[int(self.rng.integers(len(waiting)))]
        self.job, self.carried = (phase, entity), False
        direction = self.rng.standard_normal(self.task.width)
        self.offset = SPREAD * self.rng.random() * direction / np.linalg.norm(direction)
        self.through = self._way(state[self.task.place(entity)])

    def _way(self, goal: FloatArray) -> list[FloatArray]:
        """Way-points before a goal."""
        way = [self.rng.uniform(0.0, 1.0, self.task.width)] if self.rng.random() < self.style.detour else []
        return [*way, goal + RISE * np.eye(self.task.width)[-1]] if self.style.above else way

    def _serve(self, state: FloatArray, phase: Phase, entity: int) -> FloatArray:
        """Take hold of the object, then do what the first aim that is not met asks for."""
        hand, thing = state[self.task.hand], state[self.task.place(entity)]
        gap = float(np.linalg.norm(hand - thing))
        if gap > TOUCH:
            if gap < CLOSE:
                return self._action(thing - hand, 1.0)
            return self._action(self._via(state, thing, float(gap > THERE)) - hand, -1.0)
        aim = next((a for a in phase.aims if not self.task.meets(state, a, entity, PRECISE)), phase.aims[-1])
        if self._drops():
            self.lost -= 1
            return self._action(self.rng.uniform(-STEP, STEP, self.task.width), -1.0)
        return self._pursue(state, aim, entity)

    def _drops(self) -> bool:
        if not self.lost and self.rng.random() < self.style.drop:
            self.lost = 2
        return bool(self.lost)

    def _via(self, state: FloatArray, goal: FloatArray, going: float) -> FloatArray:
        """Return the next way-point, or the goal."""
        while self.through and (not going or np.linalg.norm(self.through[0] - state[self.task.hand]) < THERE):
            self.through.pop(0)
        return self.through[0] if self.through else goal

    def _pursue(self, state: FloatArray, aim: Aim, entity: int) -> FloatArray:
        """Move or turn the held object towards an aim."""
        task, kind = self.task, self.task.entities[entity]
        thing = state[task.place(entity)]
        if aim.attribute == "position":
            goal = self.wanted(state, aim, entity)
            if not self.carried:
                self.carried, self.through = True, self._way(goal)
            return self._action(self._via(state, goal, 1.0) - thing, 1.0)
        missing = float(self.wanted(state, aim, entity)[0] - state[task.place(entity, aim.attribute)][0])
        if aim.attribute in kind.turned:
            action = self._action(np.zeros(task.width), 1.0)
            turn = np.clip(wrapped(np.array(missing)) / TURN, -self.style.speed, self.style.speed)
            action[task.width + 1 + task.rotations.index(aim.attribute)] = turn
            return action
        along = np.zeros(task.width)
        if kind.moves == "slides":
            along[kind.axis] = missing
        elif kind.moves == "turns":
            angle = state[task.place(entity, aim.attribute)][0]
            along[0], along[-1] = RADIUS * missing * -np.sin(angle), RADIUS * missing * np.cos(angle)
        return self._action(along, 1.0)

    def wanted(self, state: FloatArray, aim: Aim, entity: int) -> FloatArray:
        """Value (w,) that an attribute shall get."""
        return target(self.task, state, aim, entity, self.offset)

    def _push(self, state: FloatArray, entity: int) -> FloatArray:
        """Come near the object, go round it to the side away from its goal, then push."""
        hand, thing = state[self.task.hand], state[self.task.place(entity)]
        missing = self.task.goal(state, entity) - thing
        along = missing / max(1e-9, float(np.linalg.norm(missing)))
        offset = hand - thing
        behind = float(-offset @ along)
        if behind > 0.0 and float(np.linalg.norm(offset + behind * along)) < ASIDE:
            return np.asarray(thing - PRESS * along - hand)
        here, turn = np.arctan2(offset[1], offset[0]), 0.0
        if np.linalg.norm(offset) < NEAR:
            there = np.arctan2(-along[1], -along[0])
            turn = float(np.clip((there - here + np.pi) % (2 * np.pi) - np.pi, -ROUND, ROUND))
        around = ROUND_AT * np.array([np.cos(here + turn), np.sin(here + turn)])
        return np.asarray(self._aside(state, entity, thing + around - hand))

    def _aside(self, state: FloatArray, entity: int, towards: FloatArray) -> FloatArray:
        """Bend a way round the other objects."""
        hand = state[self.task.hand]
        for other in range(len(self.task.entities)):
            gap = state[self.task.place(other)] - hand
            near = float(np.linalg.norm(gap))
            if other != entity and near < NEAR and float(gap @ towards) > 0.0:
                side = np.array([-gap[1], gap[0]]) / near
                return np.asarray(STEP * (side * (1.0 if side @ towards >= 0 else -1.0) - 0.3 * gap / near))
        return towards

    def _away(self, state: FloatArray) -> FloatArray:
        """Go up and to the left, where no object lies."""
        goal = np.full(self.task.width, 1.3)
        goal[0] = 0.6
        return np.asarray(goal - state[self.task.hand])

    def _action(self, displacement: FloatArray, fingers: float) -> FloatArray:
        """Build the action that moves by a displacement, at most at the style's speed."""
        action = np.zeros(self.task.action_size)
        largest = float(np.abs(displacement).max())
        action[: self.task.width] = displacement / max(STEP, largest / self.style.speed)
        if self.task.fingers:
            action[self.task.width] = fingers
        return action

    def _noisy(self, action: FloatArray) -> FloatArray:
        """Disturb the displacement, and turning where there is any, not the fingers."""
        noise = self.rng.standard_normal(len(action))
        noise[self.task.width :] *= action[self.task.width :] != 0.0
        if self.task.fingers:
            noise[self.task.width] = 0.0
        return np.asarray(np.clip(action + NOISE * self.style.speed * noise, -1.0, 1.0))


def target(task: KinematicTask, state: FloatArray, aim: Aim, entity: int, offset: FloatArray) -> FloatArray:
    """Value (w,) of an attribute that meets an aim; `offset` says where in a container, in what it allows."""
    match aim.to:
        case "goal":
            return task.goal(state, entity, aim.attribute)
        case "inside":
            here, places = state[task.place(entity)], [state[task.place(each)] for each in task.of_kind(aim.of)]
            return np.asarray(min(places, key=lambda place: np.linalg.norm(here - place)) + offset * aim.value)
        case "below":
            return np.array([0.3 * aim.value])
        case "right of":
            here = state[task.place(entity)]
            return np.array([aim.value + 0.12, *here[1:]])
        case _:
            if aim.attribute not in TRAVEL:
                return np.ones(1)
            start = state[task.place(entity, f"initial_{aim.attribute}")][0] if aim.to == "risen" else 0.0
            return np.array([min(start + (1.0 + BEYOND) * aim.value, TRAVEL[aim.attribute])])


def demonstrate(task: KinematicTask, episodes: int, seed: int) -> list[Trajectory]:
    """Collect demonstrations, reproducible by `seed`; those that are to fail fail, the others succeed.

    Raises:
        RuntimeError: the demonstrator fails too often.
    """
    share = round(task.failing * episodes)
    failing = set(np.random.default_rng([seed, 7]).permutation(episodes)[:share].tolist())
    kept: list[Trajectory] = []
    attempt = 0
    while len(kept) < episodes:
        if attempt > 2 * episodes + 20:
            msg = f"the demonstrator of {task.name} succeeded in only {len(kept)} of {attempt} episodes"
            raise RuntimeError(msg)
        found = attempts(task, seed, range(attempt, attempt + episodes - len(kept)))
        kept += [t for t in found if task.solved(t.states[-1])]
        attempt += episodes
    return [_spoilt(task, t, seed, i) if i in failing else t for i, t in enumerate(kept)]


def _spoilt(task: KinematicTask, trajectory: Trajectory, seed: int, rank: int) -> Trajectory:
    """Run an episode again with a demonstrator that gives up on the way."""
    rng = np.random.default_rng([seed, rank, 11])
    while True:
        steps = int(rng.uniform(0.1, 0.8) * len(trajectory))
        (found,) = _episodes(task, [_start(trajectory)], [rng], [steps])
        if not task.solved(found.states).any():
            return found


def _start(trajectory: Trajectory) -> FloatArray:
    return np.asarray(trajectory.states[0])


def attempts(task: KinematicTask, seed: int, which: range) -> list[Trajectory]:
    """Run episodes, successful or not, side by side."""
    rngs = [np.random.default_rng([seed, i]) for i in which]
    seeds = np.array([rng.integers(2**31) for rng in rngs])
    starts = task.world(len(rngs)).reset(np.arange(len(rngs)), seeds)
    return _episodes(task, list(starts), rngs, [-1] * len(rngs))


def _episodes(
    task: KinematicTask, starts: list[FloatArray], rngs: list[np.random.Generator], gives_up: list[int]
) -> list[Trajectory]:
    """Run one episode per generator; each ends `stay` steps after success, or at a horizon."""
    world = task.world(len(rngs))
    states = [world.load(np.arange(len(rngs)), np.stack(starts))]
    scripts = [_script(task, *each) for each in zip(starts, rngs, gives_up, strict=True)]
    left = np.array([WANDER + quits if quits >= 0 else task.stay for quits in gives_up])
    lengths = np.zeros(len(rngs), dtype=np.int64)
    live = np.ones(len(rngs), dtype=np.bool_)
    actions: list[FloatArray] = []
    while live.any() and len(actions) < _longest(task):
        rows = np.flatnonzero(live)
        command = np.zeros((len(rngs), task.action_size))
        command[rows] = [scripts[row].act(states[-1][row]) for row in rows]
        actions.append(command)
        states.append(states[-1].copy())
        states[-1][rows] = world.step(rows, command[rows])
        lengths[rows] += 1
        counting = task.solved(states[-1]) | (np.array(gives_up) >= 0)
        over = live & counting & (left <= 0)
        left -= live & counting
        live &= ~over
    return [_cut(task, states, actions, row, int(length)) for row, length in enumerate(lengths)]


def _longest(task: KinematicTask) -> int:
    """Return after how many steps a demonstrator is hopelessly lost."""
    style = STYLES.get(task.style, STYLES["slow"])
    jobs = sum(task.kind(phase.kind).count for phase in task.phases)
    return int(150 * (jobs + 1) / style.speed)


def _script(task: KinematicTask, state: FloatArray, rng: np.random.Generator, gives_up: int) -> Script:
    name = task.style if task.style != "mixed" else str(rng.choice(list(STYLES)))
    return Script(task, replace(STYLES[name]), rng, list(task.sequence(state, rng)), gives_up)


def _cut(task: KinematicTask, states: list[FloatArray], actions: list[FloatArray], row: int, length: int) -> Trajectory:
    history = np.stack([state[row] for state in states[: length + 1]])
    return Trajectory(task.layout, history, np.stack([action[row] for action in actions[:length]]), history)
