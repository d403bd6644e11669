"""`import roboscribe` costs nothing, and every name it promises is there."""

from __future__ import annotations

import subprocess
import sys
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import pytest

import roboscribe
from roboscribe import notebook
from roboscribe.subtask_tree import Tree

ROOT = Path(__file__).resolve().parent.parent.parent


def python(code: str) -> str:
    """Run code in a fresh process."""
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    return done.stdout


def test_importing_it_imports_no_other_package() -> None:
    new = "{name.partition('.')[0] for name in set(sys.modules) - before}"
    code = f"import sys; before = set(sys.modules); import roboscribe; print(*{new})"
    assert set(python(code).split()) - set(sys.stdlib_module_names) == {"roboscribe"}


def test_loading_and_running_a_program_needs_no_learner() -> None:
    code = (
        "import sys, roboscribe; policy = roboscribe.load('pick-place-1'); "
        "policy.act([0.0] * policy.task.layout.size); "
        "print({'torch', 'mlflow', 'prefect', 'pyarrow', 'scipy', 'matplotlib'} & set(sys.modules))"
    )
    assert python(code).strip() == "set()"


@pytest.mark.parametrize("name", roboscribe.__all__)
def test_every_name_is_there_and_documented(name: str) -> None:
    assert getattr(roboscribe, name).__doc__


def test_names_stay_what_they_are_when_modules_are_imported() -> None:
    for module in ("abstraction_refinement", "learning", "policy", "evaluation"):
        import_module(f"roboscribe.{module}")
    assert all(not isinstance(getattr(roboscribe, name), type(roboscribe)) for name in roboscribe.__all__)
    assert set(dir(roboscribe)) == set(roboscribe.__all__)


def test_an_unknown_name_is_told_what_there_is() -> None:
    with pytest.raises(AttributeError, match=r"no attribute 'learn'; expected one of .*synthesize"):
        _ = roboscribe.learn


def test_notebooks_learn_to_show_programs_and_trees(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = {}
    formatter = SimpleNamespace(for_type_by_name=lambda module, kind, show: shown.update({(module, kind): show}))
    shell = SimpleNamespace(display_formatter=SimpleNamespace(formatters={"text/html": formatter}))
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: shell))
    notebook.show_in_notebooks()
    assert all(hasattr(import_module(module), kind) for module, kind in shown)
    assert "<svg" in shown["roboscribe.subtask_tree", "Tree"](Tree())
    program = roboscribe.load("pick-place-1").program
    assert "<style>" in shown["roboscribe.dsl.syntax", "Program"](program)


def test_outside_of_notebooks_nothing_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: None))
    notebook.show_in_notebooks()


def test_a_policy_shows_its_program_as_html() -> None:
    assert "π_hold" in roboscribe.load("tower-4")._repr_html_()
