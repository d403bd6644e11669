"""Reading HTML in tests: every element closed, every text as a reader sees it."""

from __future__ import annotations

from dataclasses import dataclass, field
from html.parser import HTMLParser

VOID = {"br", "img", "meta", "link", "input", "hr"}


@dataclass
class Element:
    """An element that was opened, with its attributes and the text within."""

    tag: str
    attributes: dict[str, str]
    text: str = ""

    def has(self, kind: str) -> bool:
        return kind in self.attributes.get("class", "").split()


@dataclass
class Page(HTMLParser):
    """All elements of a page, in order."""

    elements: list[Element] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__()
        self._open: list[Element] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        element = Element(tag, {name: value or "" for name, value in attrs})
        self.elements.append(element)
        if tag not in VOID:
            self._open.append(element)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append(Element(tag, {name: value or "" for name, value in attrs}))

    def handle_endtag(self, tag: str) -> None:
        assert self._open, f"</{tag}> closes nothing"
        assert self._open[-1].tag == tag, f"</{tag}> where <{self._open[-1].tag}> is open"
        self._open.pop()

    def handle_data(self, data: str) -> None:
        for element in self._open:
            element.text += data

    def of(self, kind: str) -> list[Element]:
        """Return elements of a class or tag."""
        return [element for element in self.elements if element.has(kind) or element.tag == kind]


def read(html: str) -> Page:
    """Parse HTML; fails where elements are not closed in order."""
    page = Page()
    page.feed(html)
    page.close()
    assert not page._open, f"<{page._open[-1].tag}> is never closed"
    return page
