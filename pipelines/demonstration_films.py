"""Films of demonstrations, as they were recorded: nothing is simulated, no program is needed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from roboscribe.dsl.replay import Moment
from roboscribe.envs.panel import RecordedEpisode
from roboscribe.envs.render import SIZE, SLOW, film_grid, steps_per_picture, write_video
from roboscribe.errors import DemonstrationError
from roboscribe.io.demonstrations import Demonstrations
from roboscribe.world.task import Task
from roboscribe.world.trajectory import Trajectory

NO_PROGRAM = Moment(-1, {}, ended=False)


def film_demonstrations(
    shown: Demonstrations, task: Task, numbers: Sequence[int], columns: int, out: Path, slow: bool = False
) -> Path:
    """Write a film of demonstrations, beside each other.

    The task's own picture is drawn where simulator states were stored, positions alone where they were not.

    Args:
        shown: what was demonstrated.
        task: whose picture is drawn.
        numbers: which of them; those that are not there are left out.
        columns: how many stand beside each other.
        out: file to write.
        slow: whether it runs at a quarter of the speed.

    Returns:
        The file written, a GIF where no encoder is found.

    Raises:
        DemonstrationError: there is none of these.
    """
    there = [number for number in numbers if number < len(shown.trajectories)]
    if not there:
        msg = f"demonstration {numbers[0]}: there are {len(shown.trajectories)}, numbered from 0"
        raise DemonstrationError(msg)
    every = steps_per_picture(task.frequency) if out.suffix.lower() == ".gif" else 1
    takes = [_take(shown.trajectories[number], task, number).thinned(every) for number in there]
    columns = min(columns, len(takes))
    frames = film_grid(task, takes, columns, SIZE)
    return write_video(frames, out, task.frequency / every * (SLOW if slow else 1.0))


def _take(trajectory: Trajectory, task: Task, number: int) -> RecordedEpisode:
    """Return a demonstration as an episode that no program ran."""
    states, stored = trajectory.states, trajectory.snapshots
    snapshots = states[:, :0] if stored is None else stored
    solved = bool(task.solved(states[-1]))
    return RecordedEpisode(states, snapshots, (NO_PROGRAM,) * len(states), solved, f"demonstration {number}")
