"""What all tests share: how much they try, and how they tell what they found out."""

from __future__ import annotations

import os
import re
from collections.abc import Callable

import pytest
from hypothesis import settings

settings.register_profile("any machine", deadline=None)  # a deadline would measure how busy this one is
settings.load_profile("any machine")
TORTURE = "ROBOSCRIBE_TORTURE"
"""Environment variable under which tests of reliability try many cases instead of a few."""
ROW = re.compile(r"row_(\d+)_")
Figure = Callable[[str, int, int], None]
"""Told what was tried, how often it went well, and how often it was tried."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests of the reliability table, which have the row in their name or as a mark, and tell its number.

    Leave out what takes minutes, unless it is asked for. This is done here and not by whoever counts, because with
    several processes tests are collected in others.
    """
    for item in items:
        named = ROW.search(item.name)
        if named is not None:
            item.add_marker(pytest.mark.row(int(named[1])))
        item.user_properties += [("row", marker.args[0]) for marker in item.iter_markers("row")]
        if item.get_closest_marker("torture") and TORTURE not in os.environ:
            item.add_marker(pytest.mark.skip(reason="run by `make torture`"))


def effort(few: int, many: int) -> int:
    """Say how many cases to try: few by default, many in `make torture`."""
    return many if TORTURE in os.environ else few


@pytest.fixture
def figure(record_property: Callable[[str, object], None]) -> Figure:
    """Tell a figure for the table, and insist that nothing went wrong."""

    def tell(what: str, held: int, tried: int) -> None:
        record_property("figure", [what, held, tried])
        assert held == tried, f"{what}: {held} of {tried}"

    return tell
