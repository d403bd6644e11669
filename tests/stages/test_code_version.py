"""The version of a stage's code changes with what it imports, and with nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

from stages import code_version


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("stages", "roboscribe", "roboscribe/dsl"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text("")
    (tmp_path / "stages" / "one.py").write_text("import json\nfrom roboscribe.dsl import syntax\n")
    (tmp_path / "roboscribe" / "dsl" / "syntax.py").write_text("def f():\n    from roboscribe import late\n")
    (tmp_path / "roboscribe" / "late.py").write_text("x = 1\n")
    (tmp_path / "roboscribe" / "other.py").write_text("y = 1\n")
    monkeypatch.setattr(code_version, "ROOT", tmp_path)
    return tmp_path


def version() -> str:
    code_version.code_version.cache_clear()
    code_version._imports.cache_clear()
    return code_version.code_version("stages.one")


@pytest.mark.parametrize(
    "changed", ["stages/one.py", "roboscribe/dsl/syntax.py", "roboscribe/late.py", "roboscribe/dsl/__init__.py"]
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
