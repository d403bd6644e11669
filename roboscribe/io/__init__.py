"""Files: demonstrations in Parquet, saved programs, and how every file is written whole or not at all."""

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
from roboscribe.io.demonstrations import Demonstrations, read_demonstrations, write_demonstrations
from roboscribe.io.saved_program import SavedProgram, load_program, save_program
from roboscribe.io.schema import metadata_for
from roboscribe.io.validation import Screened, check_trajectory, consistent, screen

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
