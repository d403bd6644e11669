"""Commands on a terminal of their own, so that Ctrl-C reaches them as it reaches a user's."""

from __future__ import annotations

import os
import pty
import select
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import psutil

ROOT = Path(__file__).resolve().parents[2]
CTRL_C = b"\x03"


@dataclass
class Terminal:
    """A command in the foreground of a pseudo-terminal.

    Args:
        pid: of the command.
        descriptor: the terminal's other side.
        shown: what the command has printed so far.
    """

    pid: int
    descriptor: int
    shown: bytes = b""
    family: list[psutil.Process] = field(default_factory=list)

    def read(self, seconds: float) -> None:
        """Read for so long; an ended command has closed its side."""
        end = time.monotonic() + seconds
        while (rest := end - time.monotonic()) > 0 and select.select([self.descriptor], [], [], rest)[0]:
            try:
                self.shown += os.read(self.descriptor, 1 << 16)
            except OSError:
                return

    def wait_for(self, happened: Callable[[], bool], seconds: float = 300.0) -> None:
        """Read until something happened."""
        end = time.monotonic() + seconds
        while not happened():
            assert time.monotonic() < end, f"it never happened; shown: {self.shown.decode(errors='replace')}"
            self.read(0.05)

    def press(self, key: bytes) -> None:
        """Press a key; the kernel turns Ctrl-C into SIGINT for the whole foreground group."""
        self.family = psutil.Process(self.pid).children(recursive=True)
        self.shown = b""
        os.write(self.descriptor, key)

    def ended(self) -> int | None:
        """Return the exit code of a command that has ended, else None."""
        pid, status = os.waitpid(self.pid, os.WNOHANG)
        return os.waitstatus_to_exitcode(status) if pid else None


def open_terminal(arguments: list[str], more: Mapping[str, str] | None = None) -> Terminal:
    """Run `roboscribe` with arguments on a new terminal."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "TERM": "xterm", **(more or {})}
    command = [sys.executable, "-m", "roboscribe.pipelines.cli", *arguments]
    pid, descriptor = pty.fork()
    if pid == 0:
        os.execve(sys.executable, command, environment)
    return Terminal(pid, descriptor)
