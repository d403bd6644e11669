"""Running one stage from the command line: `python -m roboscribe.stages.NAME --config FILE --out DIR`."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from roboscribe.errors import RoboScribeError
from roboscribe.io.atomic import parse_json
from roboscribe.stages.runtime.configuration import decode
from roboscribe.stages.runtime.progress import Progress
from roboscribe.stages.runtime.stage_help import input_names, stage_help
from roboscribe.stages.runtime.store import AnyStage


def main(stage: AnyStage, arguments: Sequence[str] | None = None) -> int:
    """Run a stage outside the store.

    Returns:
        Exit code: 0, or 2 with one line on standard error where the input is bad.
    """
    given = _parser(stage).parse_args(arguments)
    try:
        config = decode(stage.config, parse_json(_config_text(given.config)), "config")
        given.out.mkdir(parents=True, exist_ok=True)
        stage.run(config, dict(map(_named_path, given.input)), given.out, _print_progress)
    except (RoboScribeError, ValueError, OSError) as error:
        sys.stderr.write(f"error: {error}\n")
        return 2
    except KeyError as error:
        missing = error.args[0]
        lacks_input = missing in input_names(stage) and not any(text.startswith(f"{missing}=") for text in given.input)
        needed = f"needs --input {missing}=PATH" if lacks_input else f"found no {missing!r} in what it was given"
        sys.stderr.write(f"error: stage {stage.name} {needed}\n")
        return 2
    return 0


def _parser(stage: AnyStage) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=f"python -m roboscribe.stages.{stage.name}",
        description=(sys.modules[stage.run.__module__].__doc__ or "").strip(),
        epilog=stage_help(stage),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--config", default="{}", help="settings: a JSON file, or JSON itself")
    parser.add_argument("--input", action="append", default=[], metavar="NAME=PATH", help="an input file; repeatable")
    parser.add_argument("--out", type=Path, required=True, help="directory for the outputs")
    return parser


def _config_text(given: str) -> str:
    return given if given.lstrip().startswith("{") else Path(given).read_text(encoding="utf-8")


def _named_path(given: str) -> tuple[str, Path]:
    name, equals, path = given.partition("=")
    if not equals:
        msg = f"--input {given}: expected NAME=PATH"
        raise ValueError(msg)
    return name, Path(path)


def _print_progress(progress: Progress) -> None:
    figures = " ".join(f"{name}={value:.4g}" for name, value in progress.metrics.items())
    sys.stderr.write(f"{progress.what}: {progress.done}/{progress.total} {progress.unit} {figures}".rstrip() + "\n")
