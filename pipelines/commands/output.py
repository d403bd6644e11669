"""What commands print and write: lines, errors, results, and the exit codes that go with them."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.text import Text

if TYPE_CHECKING:
    from roboscribe.io.atomic import Json

SOLVED, BAD_INPUT, FAIL = 0, 2, 3
"""Exit codes: done; the input is bad; no program, or nothing can be learned."""
STANDARD_OUTPUT = Path("-")
"""Stands for standard output where a file for a result is asked for."""
console = Console(highlight=False)


def say(line: str) -> None:
    """Print text as it is."""
    console.print(Text(line), soft_wrap=True)


def announce(line: str) -> None:
    """Say at once what begins, to whoever looks on: what does the work may take seconds to import."""
    if console.is_terminal:
        say(line)


def refuse(message: str) -> int:
    """Print one line on standard error; returns the exit code of bad input."""
    if message:
        sys.stderr.write(f"error: {message}\n")
    return BAD_INPUT


def make_directory(path: Path, asked: Path | None = None) -> None:
    """Make a directory in which results go, with those above it.

    Args:
        path: the directory.
        asked: what the user asked for; None is the directory itself.

    Raises:
        ArtifactError: it cannot be made.
    """
    from roboscribe.errors import ArtifactError

    try:
        path.resolve().mkdir(parents=True, exist_ok=True)
    except OSError as error:
        msg = f"{asked or path}: its directory cannot be made ({error.strerror})"
        raise ArtifactError(msg) from error


def make_room(*files: Path | None) -> None:
    """Make the directories in which files go; None stands for a file that was not asked for.

    Raises:
        ArtifactError: one cannot be made.
    """
    for file in files:
        if file not in (None, STANDARD_OUTPUT):
            assert file is not None
            make_directory(file.resolve().parent, file)


def write_result(path: Path | None, result: Json) -> None:
    """Write a result as JSON where that is asked for."""
    from roboscribe.io.atomic import indented_json, write_file

    if path == STANDARD_OUTPUT:
        sys.stdout.write(indented_json(result))
    elif path is not None:
        write_file(path, indented_json(result).encode())
