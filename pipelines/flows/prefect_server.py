"""Prefect's server for one run: it starts in the background, ignores Ctrl-C, and ends with its owner.

Prefect's own temporary server belongs to the terminal's process group, so that Ctrl-C ends it before the run that
still talks to it, and outlives a run that is killed. This one is a session of its own and reads a pipe that only its
owner holds: when the owner ends, however it ends, the pipe does, and the server with it. It is given a socket that
listens already, so that no two servers ever want one port.

`python -m roboscribe.pipelines.flows.prefect_server DESCRIPTOR` is the server itself.
"""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from http.client import HTTPConnection, HTTPException
from pathlib import Path
from urllib.parse import urlsplit

from roboscribe.errors import RoboScribeError
from roboscribe.pipelines.flows.prefect_settings import configure_prefect
from roboscribe.stages.runtime.code_version import ROOT

PATIENCE = 180.0
"""Seconds that a server may take to answer: four that start at once on a fresh database wait for each other."""
GLANCE = 0.01
"""Seconds that it may take where there is something else to do: it is asked before every stage."""
SECONDS_TO_END = 5.0
LOG = "server.log"
TEMPORARY = {"PREFECT_UI_ENABLED": "0", "PREFECT__SERVER_EPHEMERAL": "1", "PREFECT__SERVER_FINAL": "1"}
"""What Prefect tells a server that is to serve one process: no pages, no settings changed on the way."""
CHOSEN = ("PREFECT_API_URL", "PREFECT_HOME", "PREFECT_PROFILE", "PREFECT_PROFILES_PATH")
"""Where a user may name a server of their own."""


@dataclass(frozen=True)
class PrefectServer:
    """A server, ours or the user's.

    Args:
        url: of its API.
        process: the server, where it is ours.
        log: what it writes, where it is ours.
    """

    url: str
    process: subprocess.Popen[bytes] | None = None
    log: Path = Path()

    def is_starting(self) -> bool:
        """Tell whether our server is on its way; one that has ended is not."""
        ours = self.process is not None and self.process.poll() is None
        return ours and not _answers(self.url, GLANCE)

    def wait(self, seconds: float = PATIENCE) -> None:
        """Wait until our server answers; a server of the user's own is not checked.

        Raises:
            RoboScribeError: it ended, or does not answer in time.
        """
        end = time.monotonic() + seconds
        while self.process is not None and not _answers(self.url):
            if self.process.poll() is not None or time.monotonic() > end:
                msg = f"Prefect's server did not start ({self.log} says why); --engine local runs without it"
                raise RoboScribeError(msg)
            time.sleep(0.05)

    def stop(self) -> None:
        """End the server where it is ours."""
        if self.process is not None and self.process.stdin is not None:
            self.process.stdin.close()
            try:
                self.process.wait(SECONDS_TO_END)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()


@contextmanager
def prefect_server(home: Path) -> Iterator[PrefectServer]:
    """Start a server unless the user has one; it need not answer yet, see `PrefectServer.wait`.

    Args:
        home: where Prefect keeps its database.
    """
    named = any(name in os.environ for name in CHOSEN)  # before our own settings name a home
    configure_prefect(home)
    theirs = _chosen() if named else None
    server = _start(home) if theirs is None else PrefectServer(theirs)
    try:
        yield server
    finally:
        server.stop()


def _chosen() -> str | None:
    """Return the address of the server that the user's settings name, None where there is none."""
    from prefect.settings import PREFECT_API_URL

    url: str | None = PREFECT_API_URL.value()
    return url


def _start(home: Path) -> PrefectServer:
    """Start a server on a free port of the loopback address."""
    home.mkdir(parents=True, exist_ok=True)
    with socket.create_server(("127.0.0.1", 0)) as listening, (home / LOG).open("ab") as log:
        process = subprocess.Popen(
            [sys.executable, "-m", "roboscribe.pipelines.flows.prefect_server", str(listening.fileno())],
            env=_environment(os.environ),
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=log,
            stderr=log,
            pass_fds=[listening.fileno()],
            start_new_session=True,
        )
        return PrefectServer(f"http://127.0.0.1:{listening.getsockname()[1]}/api", process, home / LOG)


def _environment(own: Mapping[str, str]) -> dict[str, str]:
    """Return the server's environment: ours, and nothing that names another server."""
    return {name: value for name, value in own.items() if name != "PREFECT_API_URL"} | TEMPORARY


def _answers(url: str, seconds: float = 1.0) -> bool:
    """Whether a server answers in time; one that listens but is not ready yet delays the answer."""
    connection = HTTPConnection(urlsplit(url).netloc, timeout=seconds)
    try:
        connection.request("GET", f"{urlsplit(url).path}/health")
        return connection.getresponse().status == 200
    except (HTTPException, OSError):
        return False
    finally:
        connection.close()


def _end_with_owner() -> None:
    """End this process when the pipe does; Prefect's database bears that at any moment."""
    while os.read(sys.stdin.fileno(), 1):
        pass
    os._exit(0)


def main(descriptor: int) -> None:
    """Serve on a socket that listens already, until the owner ends."""
    threading.Thread(target=_end_with_owner, daemon=True).start()
    import uvicorn
    from prefect.server.api.server import create_app

    settings = uvicorn.Config(create_app, factory=True, log_level="error", lifespan="on")
    uvicorn.Server(settings).run(sockets=[socket.socket(fileno=descriptor)])


if __name__ == "__main__":
    main(int(sys.argv[1]))
