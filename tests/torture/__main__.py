"""Run every test of the reliability table with many cases, print the table, and write it to docs/reliability.md."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from time import perf_counter

import pytest

from tests.conftest import TORTURE
from tests.torture.table import Table

ROOT = Path(__file__).resolve().parents[2]


def main(arguments: list[str]) -> int:
    """Run the tests; returns 0 when every row held."""
    os.environ[TORTURE] = "1"
    start, table = perf_counter(), Table()
    options = ["-q", "-m", "row", "-p", "no:cacheprovider", *(arguments or ["-n", "2", "--dist", "worksteal"])]
    code = pytest.main([*options, str(ROOT / "tests")], plugins=[table])
    text = table.markdown(perf_counter() - start)
    sys.stdout.write(f"\n{text}")
    if not arguments:
        (ROOT / "docs" / "reliability.md").write_text(text, encoding="utf-8")
    return int(code) or int(bool(table.missing()))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
