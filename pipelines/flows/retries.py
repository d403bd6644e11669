"""Which failures of a stage are worth another try: those of the machine that may pass by themselves."""

from __future__ import annotations

import errno
from collections.abc import Iterator
from typing import Any

PASSING = frozenset(
    {
        errno.EAGAIN,
        errno.EBUSY,
        errno.EINTR,
        errno.EIO,
        errno.ESTALE,
        errno.ETIMEDOUT,
        errno.ECONNRESET,
        errno.EREMOTEIO,
    }
)
"""Errors of the system that may be over in a moment: network file systems and busy devices. A full disk is not."""
DELAYS = [1.0, 10.0]
"""Seconds before each further try; a stage goes on from its checkpoint."""


def may_pass(error: BaseException | None) -> bool:
    """Tell whether an error, or one that it came from, may pass by itself; what is wrong with the input does not."""
    return any(isinstance(each, OSError) and each.errno in PASSING for each in _causes(error))


def worth_another_try(task: object, run: object, state: Any) -> bool:  # noqa: ANN401 - Prefect's state of any result
    """Answer Prefect, which asks after a task run has failed."""
    del task, run
    found = state.result(raise_on_failure=False)
    return isinstance(found, BaseException) and may_pass(found)


def _causes(error: BaseException | None) -> Iterator[BaseException]:
    """Go from an error to what it came from."""
    while error is not None:
        yield error
        error = error.__cause__
