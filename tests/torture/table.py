"""The reliability table: its rows, and what tests told about each."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field
from typing import cast

import pytest

ROWS = {
    1: ("kill -9 at any moment, then the same command again", "the same program, weights and figures as uninterrupted"),
    2: ("kill -9 between writing, fsync and rename", "the old or the new file, never half of one"),
    3: ("a learner stopped at step k and resumed", "bitwise-equal weights"),
    4: ("the same seed twice, another seed", "equal results; different results"),
    5: ("`--engine local` and `--engine prefect`", "identical outputs"),
    6: ("a file truncated anywhere, any bit flipped", "a typed error or no effect; never another result in silence"),
    7: ("NaN or inf in a state, action or goal", "rejected with episode, frame and column"),
    8: ("missing column, wrong type, width, version or task", "refused with expected and found"),
    9: ("units that cannot be right, non-unit quaternions", "a range error that names the column"),
    10: ("failed, empty, one-frame or duplicate demonstrations", "reported and left out; too few left is an error"),
    11: ("object counts or goals that disagree", "FAIL with the reason"),
    12: ("demonstrations that never reach the goal", "exit code 3 and the reason"),
    13: ("disk full", "a clean error; earlier artifacts intact; resumable"),
    14: ("the same run twice at once; four on a fresh store", "one result; none lost"),
    15: ("tracking store locked, unreachable, deleted; clock put back", "training goes on; no point twice or lost"),
    16: ("SIGINT, SIGTERM", "prompt end, checkpoint, run marked as killed, no orphans"),
    17: ("no network", "everything passes, no outbound connection"),
    18: ("hostile program text", "parsed by the grammar or refused with line and column; limits"),
    19: ("pickles, YAML tags, `../`, links, archives", "refused"),
    20: ("crafted names in reports; other locales and paths", "escaped; same results"),
    21: ("physics that diverges", "the episode fails and is counted; the run goes on"),
    22: ("interface", "loopback only; foreign Host or Origin gets 403"),
}
HEAD = """Tried for {minutes:.0f} minutes of wall time.

| # | fault or input | what must happen | tests that passed | cases |
|---|---|---|---|---|
"""


@dataclass
class _Found:
    """What the tests of one row showed."""

    passed: int = 0
    run: int = 0
    figures: dict[str, list[int]] = field(default_factory=lambda: defaultdict(lambda: [0, 0]))


class Table:
    """Listens to pytest and counts."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self._rows: dict[int, _Found] = defaultdict(_Found)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Count a test that ended."""
        told = list(report.user_properties)
        rows = {int(str(value)) for name, value in told if name == "row"}
        for row in rows if report.when == "call" or report.outcome == "failed" else ():
            found = self._rows[row]
            found.run += 1
            found.passed += report.outcome == "passed"
            for name, value in told:
                if name == "figure":
                    what, held, tried = cast("tuple[str, int, int]", value)
                    found.figures[what][0] += held
                    found.figures[what][1] += tried

    def missing(self) -> list[int]:
        """List rows without a test that passed."""
        return [row for row in ROWS if not self._rows[row].run or self._rows[row].passed < self._rows[row].run]

    def markdown(self, seconds: float) -> str:
        """Spell the table."""
        lines = [self._line(row, *ROWS[row]) for row in ROWS]
        return HEAD.format(minutes=seconds / 60) + "\n".join(lines) + "\n"

    def _line(self, row: int, fault: str, expected: str) -> str:
        found = self._rows[row]
        figures = "; ".join(f"{what}: {held} of {tried}" for what, (held, tried) in sorted(found.figures.items()))
        return f"| {row} | {fault} | {expected} | {found.passed} of {found.run} | {figures or 'as many'} |"
