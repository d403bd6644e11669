"""How many episodes it takes to tell whether a program is good enough."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pytest

from roboscribe import evaluation
from roboscribe.dsl.rollouts import Rollouts
from roboscribe.dsl.syntax import Program, Seq
from roboscribe.envs.point_world import POINT_TASKS
from roboscribe.evaluation import episode_seeds, try_program
from roboscribe.runnable import Runnable
from roboscribe.steps import Limits
from roboscribe.world.layout import IntArray


@pytest.mark.parametrize(
    ("failing", "wanted", "episodes"),
    [
        ((), 0.97, 100),  # nothing fails
        (range(20), 0.97, 100),  # 80 % are not 97
        ((5,), 0.97, 200),  # 99 of 100 may be 95 %, 199 of 200 are more than 97
        ((5, 50, 150, 160, 170, 180, 190), 0.97, 400),
        ((5,), None, 100),  # nobody asks
    ],
)
def test_more_episodes_are_run_while_they_cannot_tell(
    failing: Sequence[int], wanted: float | None, episodes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    task = POINT_TASKS["point-pick-place-1"]
    seeds = episode_seeds(3, "roll out ψ_R", 400)
    bad = set(seeds[list(failing)].tolist())
    ran: list[int] = []

    def waves(program: Runnable, where: object, some: IntArray, *_: object) -> Iterator[Rollouts]:
        ran.extend(some.tolist())
        success = np.array([seed not in bad for seed in some.tolist()])
        yield Rollouts(task.layout, (), success, np.zeros_like(success), (), 0, ())

    monkeypatch.setattr(evaluation, "waves", waves)
    runnable = Runnable(Program("P", Seq()), {}, {})
    limits = None if wanted is None else Limits(success=wanted)
    list(try_program(runnable, task, 3, "ψ_R", 100, limits))
    assert ran == seeds[:episodes].tolist()
