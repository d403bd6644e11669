"""MLflow's server as it is, but that its pages open in the view for training, not in that for language models.

MLflow keeps the view in the browser's storage, where only a click on its switch changes it; the kind of an experiment
does not. A line in the page does what the click does, once: whoever chose a view keeps it.

`pyproject.toml` makes it known to `mlflow ui --app-name roboscribe`.
"""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any, TypeAlias

Message: TypeAlias = MutableMapping[str, Any]
Receive: TypeAlias = Callable[[], Awaitable[Message]]
Send: TypeAlias = Callable[[Message], Awaitable[None]]
Server: TypeAlias = Callable[[Message, Receive, Send], Awaitable[None]]
CHOICES = {"mlflow.workflowType_v1": '"machine_learning"'}
"""What the browser's storage holds after a click on MLflow's switch."""
SCRIPT = (
    f"<script>for (const [key, value] of Object.entries({json.dumps(CHOICES)}))"
    " localStorage.getItem(key) ?? localStorage.setItem(key, value)</script>"
).encode()
HEAD = b"<head>"
PAGE = "/"


class TrainingView:
    """Puts the line into the one page that there is.

    Args:
        server: MLflow's.
    """

    def __init__(self, server: Server) -> None:
        """Wrap a server."""
        self.server = server

    async def __call__(self, scope: Message, receive: Receive, send: Send) -> None:
        """Answer a request."""
        if scope["type"] != "http" or scope["path"] != PAGE:
            await self.server(scope, receive, send)
            return
        told: list[Message] = []

        async def keep(message: Message) -> None:
            told.append(message)

        await self.server(scope, receive, keep)
        for message in edited(told):
            await send(message)


def edited(told: list[Message]) -> list[Message]:
    """Put the line into an answer, whose parts become one."""
    start, body = told[0], b"".join(part.get("body", b"") for part in told[1:])
    body = body.replace(HEAD, HEAD + SCRIPT, 1)
    headers = [(name, value) for name, value in start.get("headers", ()) if name.lower() != b"content-length"]
    headers.append((b"content-length", str(len(body)).encode()))
    return [{**start, "headers": headers}, {"type": "http.response.body", "body": body}]


def app() -> TrainingView:
    """Return the server; MLflow is imported here, where its settings are made."""
    from mlflow.server.fastapi_app import app as mlflow_app

    return TrainingView(mlflow_app)
