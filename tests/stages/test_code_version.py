"""The version of a stage's code changes with what it imports, and with nothing else."""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

from roboscribe.envs.point_world import POINT_TASKS, PointTask
from roboscribe.stages.runtime import code_version, task_config
from roboscribe.stages.runtime.task_config import TaskConfig
from roboscribe.world.task import Task


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("roboscribe", "roboscribe/stages", "roboscribe/dsl"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("")
    (tmp_path / "roboscribe" / "stages" / "one.py").write_text("import json\nfrom roboscribe.dsl import syntax\n")
    (tmp_path / "roboscribe" / "dsl" / "syntax.py").write_text("def f():\n    from roboscribe import late\n")
    (tmp_path / "roboscribe" / "late.py").write_text("x = 1\n")
    (tmp_path / "roboscribe" / "other.py").write_text("y = 1\n")
    monkeypatch.setattr(code_version, "ROOT", tmp_path)
    return tmp_path


def version() -> str:
    code_version.code_version.cache_clear()
    code_version._imports.cache_clear()
    return code_version.code_version("roboscribe.stages.one")


@pytest.mark.parametrize(
    "changed",
    ["roboscribe/stages/one.py", "roboscribe/dsl/syntax.py", "roboscribe/late.py", "roboscribe/dsl/__init__.py"],
)
def test_imports_count_however_deep(project: Path, changed: str) -> None:
    before = version()
    path = project / changed
    path.write_text(path.read_text() + "# changed\n")
    assert version() != before


def test_other_modules_do_not_count(project: Path) -> None:
    before = version()
    (project / "roboscribe" / "other.py").write_text("y = 2\n")
    assert version() == before


TASK = """
from dataclasses import dataclass, replace
from roboscribe.envs.point_world import PointTask
from helpers import order

@dataclass(frozen=True)
class Push(PointTask):
    def demonstrate(self, episodes, seed):
        return order(super().demonstrate(episodes, seed), "scene.xml")
"""


def loaded(path: Path) -> Task:
    """Import a file as a module of its own and make the task in it."""
    spec = spec_from_file_location("some_task", path)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    task: Task = module.Push("push", ("block",))
    return task


def changed(path: Path) -> None:
    path.write_text(path.read_text() + "\n# changed\n")


@pytest.mark.parametrize("package", [False, True])
def test_a_task_from_elsewhere_counts_with_its_sources(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, package: bool
) -> None:
    """Formerly a changed demonstrator in a file of a user's own gave stale results."""
    for name, text in (
        ("task.py", TASK),
        ("helpers.py", "order = lambda shown, scene: shown\n"),
        ("scene.xml", "<a/>"),
        ("apart.py", "x = 1\n"),
    ):
        (tmp_path / name).write_text(text)
    if package:
        (tmp_path / "__init__.py").write_text("")
    monkeypatch.syspath_prepend(str(tmp_path))
    before = code_version.task_version(loaded(tmp_path / "task.py"))
    assert code_version.task_version(loaded(tmp_path / "task.py")) == before
    for name in ("task.py", "helpers.py", "scene.xml"):
        code_version._imports.cache_clear()
        changed(tmp_path / name)
        after = code_version.task_version(loaded(tmp_path / "task.py"))
        assert after != before
        before = after
    changed(tmp_path / "apart.py")
    assert (code_version.task_version(loaded(tmp_path / "task.py")) == before) is not package


def test_what_a_task_holds_counts(tmp_path: Path) -> None:
    """A wrapper around a task is as stale as the task; so is one that was given a function."""

    @dataclass
    class Wrapper:
        inner: object

    (tmp_path / "task.py").write_text(TASK.replace("from helpers import order", "order = lambda shown, scene: shown"))
    task = loaded(tmp_path / "task.py")
    versions = [code_version.task_version(part) for part in (Wrapper(task), Wrapper(type(task).demonstrate))]
    changed(tmp_path / "task.py")
    code_version._imports.cache_clear()
    task = loaded(tmp_path / "task.py")
    again = [code_version.task_version(part) for part in (Wrapper(task), Wrapper(type(task).demonstrate))]
    assert all(old != new for old, new in zip(versions, again, strict=True))


def test_tasks_of_the_catalogue_have_versions_of_their_own() -> None:
    point, fetch = (TaskConfig(name).code() for name in ("point-push-1", "pick-place-1"))
    assert point != fetch
    task = TaskConfig("point-push-1").make()
    assert isinstance(task, PointTask)
    assert code_version.task_version(task) == code_version.task_version(task)
    before = code_version.task_version(replace(task))
    assert task.layout
    assert code_version.task_version(task) == before, "what a task has computed for itself does not count"
    assert code_version.task_version(replace(task, horizon=7)) != before, "what it was made with does"


def test_a_task_in_a_file_counts_with_the_file(tmp_path: Path) -> None:
    """Also where the file only gives a class of ours other numbers."""
    path = tmp_path / "task.py"
    versions = []
    for kinds in ("1", "2"):
        path.write_text(
            "from roboscribe.envs.point_world import PointTask\n"
            f'PUSH = PointTask("push", ("block",) * {kinds}, plane="xy", fingers=False)\n'
        )
        task_config._code.cache_clear()
        code_version._imports.cache_clear()
        versions.append(TaskConfig(f"{path}:PUSH").code())
    assert versions[0] != versions[1]


def test_what_was_asked_of_a_task_before_changes_no_key() -> None:
    """Tasks of the plane are kept for the whole process, with what their cached properties have stored."""
    task = replace(POINT_TASKS["point-tower-3"])
    before = code_version.task_version(task)
    assert task.layout.names == ("b1", "b2", "b3")
    assert code_version.task_version(task) == before
