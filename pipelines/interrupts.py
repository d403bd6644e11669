"""Ctrl-C and SIGTERM: a command ends at once, whatever it is doing, and says so in one line.

The first signal asks for the orderly end, which checkpoints and journals; where that takes too long, or some library
swallows it, the process simply ends: everything that matters is on the disk already, as after kill -9.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from types import FrameType
from typing import NoReturn

INTERRUPTED = 130
"""Exit code."""
PATIENCE = 1.5
"""Seconds that the orderly end may take."""
SHOW_CURSOR = "\x1b[?25h"


class Interrupts:
    """Handles SIGINT and SIGTERM while a command runs.

    Args:
        message: the one line.
    """

    def __init__(self, message: str) -> None:
        """Install the handlers."""
        self._message = message
        self._asked = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._ask)

    def _ask(self, number: int, frame: FrameType | None) -> None:
        """End in order; at the second signal, at once."""
        if self._asked:
            self.end()
        self._asked = True
        sys.unraisablehook = threading.excepthook = _ignore  # who is interrupted while tidying up need not say so
        watchdog = threading.Timer(PATIENCE, self.end)
        watchdog.daemon = True
        watchdog.start()
        raise KeyboardInterrupt

    def end(self) -> NoReturn:
        """Say that the command was interrupted, and end without what libraries do at the end of a process."""
        cursor = SHOW_CURSOR if sys.stdout.isatty() else ""
        os.write(2, f"{cursor}{self._message}\n".encode())
        os._exit(INTERRUPTED)


def _ignore(_: object) -> None:
    """Ignore a signal."""
