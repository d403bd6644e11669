"""What the console says of what happens."""

from __future__ import annotations

from roboscribe.pipelines.console import tried_line


def test_where_most_were_stuck_is_told() -> None:
    counts = {"successes": 17, "episodes": 20, "unreached": ["hold", "hold", ""]}
    assert tried_line("at", counts) == "at in 17 of 20 episodes; 2 of the others did not get beyond π_hold"
    for unreached, goal in ((["hold", "at", ""], "at"), (["hold", "hold"], "hold"), (["R", "R"], "ψ_R"), ([], "at")):
        assert ";" not in tried_line(goal, {**counts, "unreached": unreached})
