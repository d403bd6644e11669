"""What the off-policy learner draws from: its own transitions, in hindsight or not, and demonstrated ones."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.type_aliases import ReplayBufferSamples
from stable_baselines3.common.vec_env import VecNormalize

from roboscribe.baselines.set_network import Tokenizer
from roboscribe.baselines.transitions import Batch, Relabeller, Shown, judged, later
from roboscribe.rl.checkpoint import Arrays
from roboscribe.world import Task
from roboscribe.world.layout import BoolArray, FloatArray, IntArray

RUNNING = -1
"""Last round of an episode that is not over."""
CANDIDATES = 8
"""Transitions looked at for each whose goals are replaced."""
STORED = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts", "last")
"""Arrays of which the filled part is kept by a checkpoint."""
Reward: TypeAlias = Callable[[Batch], FloatArray]


def task_reward(batch: Batch) -> FloatArray:
    """Return 1 where the task is solved (R,)."""
    return batch.solved.astype(np.float64)


@dataclass(frozen=True)
class Sampling:
    """How batches are put together.

    Args:
        task: judges transitions with replaced goals.
        tokenizer: is shown every state that is stored.
        rng: draws.
        relabelled: share of the transitions whose goals are replaced in hindsight.
        shown: demonstrated transitions, half of every batch; None where all are the learner's own.
        reward: of a batch.
    """

    task: Task
    tokenizer: Tokenizer
    rng: np.random.Generator
    relabelled: float = 0.0
    shown: Shown | None = None
    reward: Reward = task_reward


class HindsightBuffer(ReplayBuffer):
    """A replay buffer that replaces goals by what was reached later in the same episode.

    Departs: the library's own hindsight buffer computes rewards from achieved and desired goal alone; whether a task is
        solved may depend on the whole state.
    """

    def __init__(
        self,
        buffer_size: int,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        device: torch.device | str = "auto",
        n_envs: int = 1,
        optimize_memory_usage: bool = False,
        *,
        sampling: Sampling,
    ) -> None:
        """Make room; the arguments are the library's, and how batches are put together."""
        super().__init__(buffer_size, observation_space, action_space, device, n_envs, optimize_memory_usage)
        self.sampling = sampling
        self.rounds = 0
        """Rounds of one transition per row ever stored."""
        self.last = np.full((self.buffer_size, n_envs), RUNNING, np.int64)
        """Round in which the episode of each transition ended."""
        self.first = np.zeros(n_envs, np.int64)
        """Round in which the present episode of each row began."""
        self._relabel = Relabeller(sampling.task.layout)

    def add(
        self,
        obs: NDArray[np.float32],
        next_obs: NDArray[np.float32],
        action: NDArray[np.float32],
        reward: NDArray[np.float32],
        done: NDArray[np.bool_],
        infos: list[dict[str, Any]],
    ) -> None:
        """Store one transition of every row."""
        super().add(obs, next_obs, action, reward, done, infos)
        self.last[self.rounds % self.buffer_size] = RUNNING
        for row in np.flatnonzero(done):
            first = max(int(self.first[row]), self.rounds - self.buffer_size + 1)
            self.last[np.arange(first, self.rounds + 1) % self.buffer_size, row] = self.rounds
            self.first[row] = self.rounds + 1
        self.rounds += 1
        self.sampling.tokenizer.observe(next_obs.astype(np.float64))

    def draw(self, count: int, relabelled: float) -> Batch:
        """Draw own transitions, the goals of a share of them replaced in hindsight.

        That share is drawn where something that has a goal is moved later: elsewhere the new goals would be attained
        already, and there is nothing to learn from that. Where so much is not found, the goals stay.

        Departs: the originals draw evenly, and most of what they draw shows objects that nobody touches. On one block
            success is several times as high after as many control steps.
        """
        wanted = round(relabelled * count)
        rounds, rows = self._anywhere(CANDIDATES * wanted)
        last = self.last[self._slot(rounds), rows]
        last = np.where(last == RUNNING, self.rounds - 1, last)
        future = later(self.sampling.rng, rounds, last)
        moving = np.flatnonzero(self._is_going(rounds, future, rows))[:wanted]
        others, their_rows = self._anywhere(count - len(moving))
        at = self._slot(np.concatenate([rounds[moving], others])), np.concatenate([rows[moving], their_rows])
        solved = self.rewards[at] > 0
        lost = (self.dones[at] > 0) & (self.timeouts[at] == 0) & ~solved
        states, actions, following = (each[at].astype(np.float64) for each in self._kept())
        reached = self.next_observations[self._slot(future[moving]), rows[moving]].astype(np.float64)
        drawn = Batch(states, actions, following, solved, lost)
        return drawn.relabelled(np.arange(count) < len(moving), reached, self.sampling.task)

    def _anywhere(self, count: int) -> tuple[IntArray, IntArray]:
        """Draw rounds and rows, evenly."""
        rng = self.sampling.rng
        return rng.integers(self.rounds - self.size(), self.rounds, size=count), rng.integers(self.n_envs, size=count)

    def _slot(self, rounds: IntArray) -> IntArray:
        """Return where the transitions of rounds are stored."""
        return rounds % self.buffer_size

    def _is_going(self, rounds: IntArray, future: IntArray, rows: IntArray) -> BoolArray:
        """Tell in which transitions (M,) the goals that a later one shows are not attained yet."""
        states, reached = self.observations[self._slot(rounds), rows], self.next_observations[self._slot(future), rows]
        own = self._relabel.columns[1]
        going: BoolArray = (states[:, own] != reached[:, own]).any(axis=1)
        relabelled = self._relabel(states[going].astype(np.float64), reached[going].astype(np.float64))
        going[going] = ~judged(self.sampling.task, relabelled)
        return going

    def _kept(self) -> tuple[NDArray[np.float32], ...]:
        return self.observations, self.actions, self.next_observations

    def sample(self, batch_size: int, env: VecNormalize | None = None) -> ReplayBufferSamples:
        """Draw what SAC learns from."""
        how = self.sampling
        demonstrated = 0 if how.shown is None else batch_size // 2
        batch = self.draw(batch_size - demonstrated, how.relabelled)
        if how.shown is not None:
            shown = how.shown.draw(how.rng, demonstrated, how.relabelled, how.task)
            batch = Batch.concatenated([batch, shown])
        columns = (batch.ended[:, None], how.reward(batch)[:, None])
        parts = (batch.states, batch.actions, batch.following, *columns)
        return ReplayBufferSamples(*(torch.from_numpy(part.astype(np.float32)) for part in parts))

    def save(self) -> tuple[Arrays, Mapping[str, object]]:
        """Return all that decides the future: arrays, and JSON values."""
        arrays: Arrays = {name: getattr(self, name)[: self.size()] for name in STORED}
        return {**arrays, "first": self.first}, {"rounds": self.rounds, "rng": self.sampling.rng.bit_generator.state}

    def restore(self, arrays: Arrays, notes: Mapping[str, Any]) -> None:
        """Return to what `save` gave."""
        for name in STORED:
            getattr(self, name)[: len(arrays[name])] = arrays[name]
        self.first[:] = arrays["first"]
        self.rounds = int(notes["rounds"])
        self.pos, self.full = self.rounds % self.buffer_size, self.rounds >= self.buffer_size
        self.sampling.rng.bit_generator.state = dict(notes["rng"])
