"""Which commit of the sources is at work."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

from roboscribe.stages.runtime.code_version import ROOT

SECONDS = 10.0
"""How long git may take."""


def checkout_commit(root: Path = ROOT) -> str:
    """Return the git commit that is checked out, "-dirty" behind it where tracked files differ from it.

    Args:
        root: top of a checkout.

    Returns:
        The commit; "" where there is no checkout, no commit or no git.
    """
    if not (root / ".git").exists():  # git would look for a repository further up, which is another project's
        return ""
    own = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}
    words = ["git", "-C", str(root), "describe", "--always", "--exclude=*", "--abbrev=40", "--dirty"]
    try:
        ended = subprocess.run(
            words, env={**own, "GIT_OPTIONAL_LOCKS": "0"}, capture_output=True, text=True, check=True, timeout=SECONDS
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return ended.stdout.strip()
