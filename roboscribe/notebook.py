"""Values that have no page of their own, shown in notebooks: programs, trees, refinements, evaluations."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module

SHOWN = {
    ("roboscribe.dsl.syntax", "Program"): ("roboscribe.html.code", "program_html"),
    ("roboscribe.subtask_tree", "Tree"): ("roboscribe.html.tree", "tree_html"),
    ("roboscribe.classifier", "Refinement"): ("roboscribe.html.tables", "refinement_html"),
}
"""What shows the values of a class: module and function by module and class."""


def show_in_notebooks() -> None:
    """Tell the notebook that runs, if one does, how to show our values; none of their modules is imported for it."""
    shell = sys.modules["IPython"].get_ipython()
    if shell is not None:
        formatter = shell.display_formatter.formatters["text/html"]
        for (module, kind), (home, function) in SHOWN.items():
            formatter.for_type_by_name(module, kind, _shown_by(home, function))


def _shown_by(home: str, function: str) -> Callable[[object], str]:
    def show(value: object) -> str:
        style = import_module("roboscribe.html.style")
        fragment: str = style.standalone(getattr(import_module(home), function)(value))
        return fragment

    return show
