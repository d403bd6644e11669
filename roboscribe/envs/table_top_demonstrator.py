"""What to do next on the table-top: push the mug back, open the drawer, turn the faucet left.

The command is a function of the observed state alone, so that a learner without memory can imitate it. The hand rises
straight from what it has done, crosses above everything, and comes down a funnel on what it does next.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roboscribe.world.layout import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class Work:
    """How one thing is done.

    Args:
        enough: how far what the hand is at is done, at least: m or rad. The task asks for less.
        left: the same for what the hand has left; still less, or noise would call the hand back.
        speed: action with which the hand pushes or pulls.
        height: of the end effector at work, m.
        back: how far behind the object, in the direction of work, the hand comes down, m.
        tip: the hand comes down within this distance of there, in that direction, m.
        broad: weight of distances across it: fingers meet what is wide wherever they come down.
        closest: how far behind where it came down the hand may be when it rises, m.
    """

    enough: float
    left: float
    speed: float
    height: float
    back: float
    tip: float
    broad: float
    closest: float


WORK = {
    "mug": Work(0.055, 0.045, 0.3, height=0.022, back=0.0, tip=0.008, broad=0.6, closest=-np.inf),
    "drawer": Work(0.09, 0.06, 0.5, height=0.085, back=-0.015, tip=0.010, broad=0.3, closest=-np.inf),
    "faucet": Work(0.5, 0.36, 0.5, height=0.105, back=0.05, tip=0.015, broad=0.4, closest=0.0),
}
"""Fingers surround the mug, which tips at a speed of 0.5, and the bar, with one finger behind it; the hand pushes the
knob from beside."""
JOBS = tuple(WORK)
SLACK = (-0.02, 0.045)
"""How far the hand at work may be behind and ahead of where it came down, m: objects give way, and there is play."""
GAIN = 16.0
"""Commanded displacement per metre of error, in actions."""
CROSSING = 0.21
"""Height at which the hand crosses the table, m: 4 cm above the drawer."""
STEEP = 3.0
"""Height of a funnel per horizontal distance."""
FREE = (0.01, 0.03)
"""The hand goes sideways freely where it is at most this far below the funnel, m, and not at all from the second on."""
OPENS = -1.0
"""Finger command; they stay open."""
DOWN, LOW = 0.015, 0.03
"""The hand works, and is at what it works on, when it is at most this far above the height for it, m."""
AT = 0.07
"""The hand is at an object within this horizontal distance of where it came down on it, m."""
TALL = 0.055
"""Objects reach this far above the height at which the hand works on them, m."""
LOOSEN = 10.0
"""Gain with which the hand lets go: with more it overshoots, and strikes back what it has moved."""
LOOSE = (0.008, 0.014)
"""Distances from where the hand came down up to which it rises freely, or at all, m."""
CALM = 0.5
"""Share of the noise with which objects are handled."""


@dataclass(frozen=True)
class Seen:
    """What a command looks at, over R states.

    Args:
        hand: (R, 3) position of the end effector, m.
        places: (R, 3) position of the mug, of the drawer's bar and of the knob's grip point, m, by job.
        progress: (R,) how far the mug is behind its start, m; the drawer's extension, m; the knob's angle, rad.
    """

    hand: FloatArray
    places: dict[str, FloatArray]
    progress: dict[str, FloatArray]

    def along(self, job: str) -> FloatArray:
        """Direction (R, 2) in which the hand works: away from the robot, towards it, along the knob's tangent."""
        if job == "faucet":
            angle = self.progress[job]
            return np.stack([np.cos(angle), np.sin(angle)], axis=1)
        return np.tile([0.0, 1.0 if job == "mug" else -1.0], (len(self.hand), 1))

    def target(self, job: str) -> FloatArray:
        """Where the hand comes down (R, 3), m."""
        target = self.places[job] - WORK[job].back * np.pad(self.along(job), ((0, 0), (0, 1)))
        target[:, 2] = WORK[job].height
        return target

    def left_to_do(self, job: str) -> BoolArray:
        """Tell where a job is not done yet (R,), with a margin where the hand is at it."""
        gap = self.hand - self.target(job)
        near = (np.linalg.norm(gap[:, :2], axis=1) < AT) & (gap[:, 2] < LOW)
        left: BoolArray = self.progress[job] < np.where(near, WORK[job].enough, WORK[job].left)
        return left


def command(seen: Seen, order: IntArray, crossing: float = 0.0) -> FloatArray:
    """Decide the noiseless action: do the first job that is left, or rise.

    Args:
        seen: R states.
        order: (R, n) ranks in `JOBS`, in the order in which they are done.
        crossing: least height above a job that the hand keeps until it is right above it, m; 0 for the funnel alone.

    Returns:
        (R, 4) actions in [-1, 1].
    """
    actions = np.stack([_rise(seen), *(_do(seen, job, crossing) for job in JOBS)])
    decided: FloatArray = actions[1 + next_job(seen, order), np.arange(len(order))]
    return decided


def next_job(seen: Seen, order: IntArray) -> IntArray:
    """Rank in `JOBS` of the first job of an order (R, n) that is left to do, (R,); -1 where none is."""
    left = np.take_along_axis(np.stack([seen.left_to_do(job) for job in JOBS], axis=1), order, axis=1)
    first = np.take_along_axis(order, left.argmax(axis=1)[:, None], axis=1)[:, 0]
    return np.where(left.any(axis=1), first, -1)


def _rise(seen: Seen) -> FloatArray:
    """Go straight up to where the hand crosses."""
    up = CROSSING - seen.hand[:, 2]
    return _finished(_clear(seen, np.column_stack([0.0 * up, 0.0 * up, GAIN * up]), JOBS))


def _do(seen: Seen, job: str, crossing: float) -> FloatArray:
    """Come down where the job begins, then work along its direction."""
    along, gap = seen.along(job), seen.target(job) - seen.hand
    ahead = np.clip(-(gap[:, :2] * along).sum(axis=1), *SLACK)
    aside = gap[:, :2] + ahead[:, None] * along
    works = (gap[:, 2] > -DOWN) & (_radius(aside, along, job) < 2 * WORK[job].tip)
    push = np.column_stack([GAIN * aside + WORK[job].speed * along, GAIN * gap[:, 2]])
    come = _clear(seen, _approach(gap, along, job, crossing), tuple(other for other in JOBS if other != job))
    return _finished(np.where(works[:, None], push, come))


def _finished(move: FloatArray) -> FloatArray:
    """Bound a displacement (R, 3) and add the fingers' command."""
    return np.column_stack([np.clip(move, -1.0, 1.0), np.full(len(move), OPENS)])


def _approach(gap: FloatArray, along: FloatArray, job: str, crossing: float) -> FloatArray:
    """Close a gap (R, 3), going up to the funnel first, then sideways and down it: action (R, 3), not bounded."""
    radius, top = _radius(gap[:, :2], along, job), CROSSING - WORK[job].height
    funnel = np.clip(STEEP * (radius - WORK[job].tip), crossing * (radius > 2 * WORK[job].tip), top)
    below = gap[:, 2] + funnel
    free = 1.0 - _ramp(below, *FREE)
    return np.column_stack([free[:, None] * np.clip(GAIN * gap[:, :2], -1.0, 1.0), GAIN * below])


def _radius(gap: FloatArray, along: FloatArray, job: str) -> FloatArray:
    """Length (R,) of horizontal gaps (R, 2), of which what is across the direction of work counts less."""
    ahead, length = (gap * along).sum(axis=1), np.linalg.norm(gap, axis=1)
    across = np.sqrt(np.maximum(length**2 - ahead**2, 0.0))
    radius: FloatArray = np.hypot(ahead, WORK[job].broad * across)
    return radius


def _clear(seen: Seen, move: FloatArray, left: tuple[str, ...]) -> FloatArray:
    """Let go of what the hand leaves before it rises: back to where it came down, or it would drag it along."""
    for job in left:
        along, gap = seen.along(job), seen.target(job) - seen.hand
        ahead = np.maximum(-(gap[:, :2] * along).sum(axis=1), WORK[job].closest)
        beside = (np.linalg.norm(gap[:, :2], axis=1) < AT) & (gap[:, 2] > -TALL)
        back = np.column_stack([-LOOSEN * ahead[:, None] * along, move[:, 2] * (1.0 - _ramp(abs(ahead), *LOOSE))])
        move = np.where(beside[:, None], back, move)
    return move


def _ramp(values: FloatArray, low: float, high: float) -> FloatArray:
    """Rise linearly from 0 at `low` to 1 at `high`."""
    return np.clip((values - low) / (high - low), 0.0, 1.0)


def calm(seen: Seen) -> FloatArray:
    """Share (R,) of the noise: half of it where the hand is down at something."""
    down = np.zeros(len(seen.hand), dtype=np.bool_)
    for job in JOBS:
        gap = seen.target(job) - seen.hand
        down |= (np.linalg.norm(gap[:, :2], axis=1) < AT) & (gap[:, 2] > -TALL)
    return np.where(down, CALM, 1.0)
