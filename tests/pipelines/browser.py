"""Pages looked at in a real browser, served by a command of their own."""

from __future__ import annotations

import os
import re
import shutil
import socket
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from http.client import HTTPConnection, HTTPException
from pathlib import Path

import pytest

BROWSER = next((path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), "")
SECONDS = 90.0
needs_browser = pytest.mark.skipif(not BROWSER, reason="no Chromium on this machine (Debian package: chromium)")


@contextmanager
def serving(
    command: Callable[[int], Sequence[str]],
    health: str,
    log: Path,
    variables: Callable[[int], Mapping[str, str]] = lambda port: {},
) -> Iterator[str]:
    """Run a server on a free port until the end of the block; yields its address once it says that it is well."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        port = listening.getsockname()[1]
    environment = {**os.environ, **variables(port)}
    with log.open("wb") as written:
        server = subprocess.Popen(
            command(port), stdout=written, stderr=written, start_new_session=True, env=environment
        )
    try:
        deadline = time.monotonic() + SECONDS
        while not _answers(port, health):
            assert server.poll() is None, log.read_text()
            assert time.monotonic() < deadline, log.read_text()
            time.sleep(0.2)
        yield f"http://127.0.0.1:{port}"
    finally:
        os.killpg(server.pid, 15)
        server.wait(20)


def _answers(port: int, health: str) -> bool:
    """Whether a server is there."""
    connection = HTTPConnection("127.0.0.1", port, timeout=1.0)
    try:
        connection.request("GET", health)
        return connection.getresponse().status == 200
    except (HTTPException, OSError):
        return False
    finally:
        connection.close()


def seen(page: str, profile: Path) -> str:
    """Return the text of a page in a browser that was never here before."""
    words = [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={profile}"]
    words += ["--window-size=1500,1000", "--virtual-time-budget=30000", "--dump-dom", page]
    ended = subprocess.run(words, capture_output=True, text=True, timeout=SECONDS)
    return re.sub(r"<(script|style).*?</\1>|<[^>]+>", " ", ended.stdout, flags=re.DOTALL)
