"""Small files of stages: JSON, program text, and failures with their reasons."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from roboscribe.dsl.parser import parse_program
from roboscribe.dsl.printer import program_text
from roboscribe.dsl.syntax import Program
from roboscribe.errors import ArtifactError, Fail
from roboscribe.io.atomic import Json, indented_json, parse_json, write_file

FAIL, PROGRAM, TREE, REFINEMENT = "fail.json", "program.txt", "tree.json", "refinement.json"
OUTCOME, FAILURES, EPISODES = "outcome.json", "failures.safetensors", "episodes.json"


def write_json(path: Path, value: Json) -> None:
    """Write a JSON file whole or not at all."""
    write_file(path, indented_json(value).encode())


def read_json(path: Path) -> Any:  # noqa: ANN401 - callers know what they wrote
    """Read a JSON file.

    Raises:
        ArtifactError: it cannot be read or is no JSON.
    """
    try:
        return parse_json(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        msg = f"{path}: cannot be read as JSON ({error})"
        raise ArtifactError(msg) from error


def write_fail(out: Path, fail: Fail) -> None:
    """Write a failure with its reason."""
    write_json(out / FAIL, {"reason": fail.reason})


def read_fail(out: Path) -> Fail | None:
    """Read a failure; None where the stage succeeded."""
    return Fail(str(read_json(out / FAIL)["reason"])) if (out / FAIL).exists() else None


def program_bytes(program: Program) -> bytes:
    """Encode a program's text, which parses back to the same program."""
    return program_text(program).encode()


def read_program(path: Path) -> Program:
    """Parse a program's file.

    Raises:
        ArtifactError: the file cannot be read.
        ProgramError: its text is no program.
    """
    try:
        return parse_program(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        msg = f"{path}: cannot be read as text ({error})"
        raise ArtifactError(msg) from error
