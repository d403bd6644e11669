"""What tests of the command line share."""

from __future__ import annotations

from tests.pipelines.conftest import command

__all__ = ["command"]
