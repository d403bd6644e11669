"""Run every test of the reliability table with many cases, print the table, and put it into docs/reliability.md."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from time import perf_counter

import pytest

from tests.conftest import TORTURE
from tests.torture.table import Table

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "reliability.md"
BEGIN, END = "<!-- printed by make torture -->\n", "<!-- end -->\n"
"""What the table stands between on the page."""


def main(arguments: list[str]) -> int:
    """Run the tests; returns 0 when every row held."""
    os.environ[TORTURE] = "1"
    start, table = perf_counter(), Table()
    options = ["-q", "-m", "row", "-p", "no:cacheprovider", *(arguments or ["-n", "2", "--dist", "worksteal"])]
    code = pytest.main([*options, str(ROOT / "tests")], plugins=[table])
    text = table.markdown(perf_counter() - start)
    sys.stdout.write(f"\n{text}")
    if not arguments:
        PAGE.write_text(with_table(PAGE.read_text(encoding="utf-8"), text), encoding="utf-8")
    return int(code) or int(bool(table.missing()))


def with_table(page: str, table: str) -> str:
    """Return the page with another table."""
    before, rest = page.split(BEGIN)
    return f"{before}{BEGIN}\n{table}\n{END}{rest.split(END)[1]}"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
