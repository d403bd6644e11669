"""Small films within a page."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from markupsafe import Markup

from roboscribe.envs.render import poster

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
    data, caption = _data(kind, film.path.read_bytes()), escape(film.caption)
    if kind == "image/gif":
        shown = f'<img src="{data}" alt="{caption}">'
    else:
        first = f'poster="{_data("image/jpeg", poster(film.path))}"'
        shown = f'<video src="{data}" {first} controls loop muted playsinline aria-label="{caption}"></video>'
    return f"<figure>{shown}<figcaption>{caption}</figcaption></figure>"


def _data(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"
