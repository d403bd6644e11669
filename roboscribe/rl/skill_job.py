"""What is to be learned about one controller, and how it was learned."""

from __future__ import annotations

from dataclasses import dataclass

from roboscribe.dsl.syntax import Run


@dataclass(frozen=True)
class SkillJob:
    """One controller that is to be learned.

    Args:
        run: its statement.
        title: under which its progress is kept.
        reinforce: whether reinforcement learning may follow the warm start.
        again: turns at improving it, this one included; 0 where it was not learned before. Where it was, no subgoal is
            expected before it.
        together: whether its loop's controllers have all had a first turn.
    """

    run: Run
    title: str
    reinforce: bool = True
    again: int = 0
    together: bool = False


@dataclass(frozen=True)
class SkillReport:
    """How one skill was learned.

    Args:
        controller: its name.
        learner: what gave the weights that were kept: "kept" from before, "clone", "ppo", "sac" or "initial"; "undone"
            are those from before, where the program had been worse with what was learned.
        starts: held-out start states that it was measured on; 0 where the program never got there.
        warm_success: success on held-out starts before reinforcement learning.
        success: success of what was kept.
        control_steps: all control steps spent on it: starts, evaluations and learning.
        unfinished: whether they ran out while it was still getting better.
        known_success: success of what was known before; 0 where nothing was.
    """

    controller: str
    learner: str
    starts: int
    warm_success: float
    success: float
    control_steps: int
    unfinished: bool = False
    known_success: float = 0.0
