"""What the console says of what happens."""

from __future__ import annotations

from roboscribe.pipelines.console import training_line, tried_line


def test_where_most_were_stuck_is_told() -> None:
    counts = {"successes": 17, "episodes": 20, "unreached": ["hold", "hold", ""]}
    assert tried_line("at", counts) == "at in 17 of 20 episodes; 2 of the others did not get beyond π_hold"
    for unreached, goal in ((["hold", "at", ""], "at"), (["hold", "hold"], "hold"), (["R", "R"], "ψ_R"), ([], "at")):
        assert ";" not in tried_line(goal, {**counts, "unreached": unreached})


def test_what_was_undone_is_told() -> None:
    report = {
        "controller": "hold",
        "learner": "ppo",
        "starts": 9,
        "warm_success": 0.9,
        "success": 1.0,
        "control_steps": 7,
    }
    assert training_line(report) == "π_hold: ppo, 90% → 100% of held-out starts, 7 control steps"
    undone = training_line({**report, "learner": "undone"})
    assert undone == "π_hold: as it was, for the program is worse with what was learned (7 control steps)"
