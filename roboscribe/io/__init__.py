"""Files: demonstrations in Parquet, saved programs, and how every file is written whole or not at all."""

from importlib import import_module
from typing import TYPE_CHECKING

from roboscribe.io.atomic import (
    Json,
    canonical_json,
    package_versions,
    parse_json,
    remove_unfinished,
    sha256_of,
    write_file,
    write_files,
)
from roboscribe.io.saved_program import SavedProgram, load_program, save_program
from roboscribe.io.validation import Screened, check_trajectory, consistent, screen

if TYPE_CHECKING:
    from roboscribe.io.demonstrations import Demonstrations, read_demonstrations, write_demonstrations
    from roboscribe.io.schema import metadata_for

__all__ = [
    "Demonstrations",
    "Json",
    "SavedProgram",
    "Screened",
    "canonical_json",
    "check_trajectory",
    "consistent",
    "load_program",
    "metadata_for",
    "package_versions",
    "parse_json",
    "read_demonstrations",
    "remove_unfinished",
    "save_program",
    "screen",
    "sha256_of",
    "write_demonstrations",
    "write_file",
    "write_files",
]

LATE = {
    "Demonstrations": "demonstrations",
    "metadata_for": "schema",
    "read_demonstrations": "demonstrations",
    "write_demonstrations": "demonstrations",
}
"""What needs pyarrow, which takes long to import: who only loads a program does without."""


def __getattr__(name: str) -> object:
    """Import what is used for the first time."""
    if name in LATE:
        return getattr(import_module(f"roboscribe.io.{LATE[name]}"), name)
    msg = f"module {__name__} has no attribute {name!r}"
    raise AttributeError(msg)
