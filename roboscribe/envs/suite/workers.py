"""Processes with one environment each, among which the rows of a world are shared out."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import lru_cache
from multiprocessing import get_context, resource_tracker
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from roboscribe.envs.suite.bench import bench
from roboscribe.envs.suite.request import SuiteRequest
from roboscribe.world.layout import BoolArray, FloatArray, IntArray

Moved = tuple[FloatArray, FloatArray, BoolArray]
"""Snapshots (R, S), states (R, F), and which rows stayed within physics (R,)."""


def reset(request: SuiteRequest, seeds: IntArray) -> Moved:
    """Start episodes in this process's environment."""
    found = [bench(request).reset(int(seed)) for seed in seeds]
    return np.array([one for one, _ in found]), np.array([state for _, state in found]), np.ones(len(found), bool)


def step(request: SuiteRequest, snapshots: FloatArray, actions: FloatArray) -> Moved:
    """Go one control step on from every snapshot."""
    found = [bench(request).step(one, action) for one, action in zip(snapshots, actions, strict=True)]
    after, states, good = zip(*found, strict=True)
    return np.array(after), np.array(states), np.array(good)


def load(request: SuiteRequest, snapshots: FloatArray) -> Moved:
    """Look at snapshots."""
    states = np.array([bench(request).load(one) for one in snapshots])
    return snapshots, states, np.ones(len(snapshots), bool)


Job = Callable[..., Moved]


def serve(pipe: Connection, request: SuiteRequest) -> None:
    """Do jobs until whoever asks for them is gone; what goes wrong is told to them."""
    with suppress(EOFError, ConnectionError):
        while True:
            job, parts = pipe.recv()
            pipe.send(_done(job, request, parts))


def _done(job: Job, request: SuiteRequest, parts: Sequence[Any]) -> Moved | Exception:
    try:
        return job(request, *parts)
    except Exception as error:  # handed to the process that asked, which raises it
        return error


class Workers:
    """A pool for one environment, or this process alone.

    Args:
        request: which environment.
        count: processes; with 1 there is no other than this.
    """

    def __init__(self, request: SuiteRequest, count: int) -> None:
        """Start the processes; they build their environments at their first job."""
        self._request = request
        context = get_context("spawn")
        pairs = [context.Pipe() for _ in range(count if count > 1 else 0)]
        self._pipes = [ours for ours, _ in pairs]
        with _deaf_to_interrupts():
            for _, theirs in pairs:
                context.Process(target=serve, args=(theirs, request), daemon=True).start()
                theirs.close()

    def do(self, job: Job, *parts: Any) -> Moved:  # noqa: ANN401 - arrays over rows
        """Do a job on all rows, shared out in order.

        Raises:
            Exception: what a process raised.
        """
        if not self._pipes:
            return job(self._request, *parts)
        shares = [np.array_split(part, len(self._pipes)) for part in parts]
        busy = [(pipe, share) for pipe, *share in zip(self._pipes, *shares, strict=True) if len(share[0])]
        for pipe, share in busy:
            pipe.send((job, share))
        answers = [pipe.recv() for pipe, _ in busy]
        for answer in answers:
            if isinstance(answer, Exception):
                raise answer
        snapshots, states, good = zip(*answers, strict=True)
        return np.concatenate(snapshots), np.concatenate(states), np.concatenate(good)


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Start processes that Ctrl-C, which every process of a terminal hears, does not end: their owner ends them."""
    resource_tracker.ensure_running()  # which would let Ctrl-C through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@lru_cache(maxsize=4)
def workers(request: SuiteRequest, count: int) -> Workers:
    """Return the pool for an environment, which all its worlds share."""
    return Workers(request, count)


def process_count(rows: int) -> int:
    """Choose how many processes serve so many rows: as many as there are processors, and at least two rows for each."""
    return max(1, min(os.cpu_count() or 1, rows // 2))
