"""Small films within a page."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from markupsafe import Markup

KINDS = {".mp4": "video/mp4", ".gif": "image/gif"}
FINAL = -1
"""Place of the final evaluation among the chapters."""


@dataclass(frozen=True)
class Film:
    """A film and what it shows."""

    path: Path
    caption: str


def films_html(films: Sequence[Film]) -> Markup:
    """Show films beside each other, each within the page itself."""
    return Markup(f'<div class="films">{"".join(map(_film, films))}</div>') if films else Markup()


def _film(film: Film) -> str:
    """Show one film; it starts when it is asked to."""
    kind = KINDS[film.path.suffix]
    data = f"data:{kind};base64,{base64.b64encode(film.path.read_bytes()).decode()}"
    caption = escape(film.caption)
    shown = (
        f'<img src="{data}" alt="{caption}">'
        if kind == "image/gif"
        else f'<video src="{data}" controls loop muted playsinline preload="metadata" aria-label="{caption}"></video>'
    )
    return f"<figure>{shown}<figcaption>{caption}</figcaption></figure>"
