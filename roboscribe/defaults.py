"""Numbers that several parts take unless they are told otherwise; each stands here once."""

from __future__ import annotations

CONFIRM = 3
"""Consecutive observed states in which a subgoal must hold to count as reached."""
N_DEMONSTRATIONS = 50
"""Demonstrations that are collected where none are given."""
ROLLOUT_EPISODES = 100
"""Episodes in which each program of Algorithm 2 is tried."""
EVALUATION_EPISODES = 500
"""Episodes of a final evaluation."""
CONTACT = "stable"
"""Contact model."""
TIMING = "fast"
"""Simulator timing."""
