"""Running the code of a page of the documentation."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parent.parent.parent / "docs"
BLOCK = re.compile(r"^```(python|console)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks(page: str, kind: str) -> list[str]:
    """List the blocks of one kind in a page."""
    return [code for found, code in BLOCK.findall((DOCS / page).read_text(encoding="utf-8")) if found == kind]


def run_python(page: str) -> dict[str, Any]:
    """Run a page in the present directory: blocks that begin with the name of a file are written, others executed."""
    names: dict[str, Any] = {}
    for code in blocks(page, "python"):
        named = re.match(r"# (\w+\.py)\n", code)
        if named:
            Path(named[1]).write_text(code, encoding="utf-8")
        else:
            exec(compile(code, page, "exec"), names)
    return names
