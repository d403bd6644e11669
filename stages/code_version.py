"""Which code a stage depends on: what it imports of this project, and the versions of the packages that compute."""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from roboscribe.io.atomic import canonical_json, package_versions, sha256_of

ROOT = Path(__file__).resolve().parent.parent
"""Where `roboscribe` and `stages` lie."""
PACKAGES = ("roboscribe", "stages")
NUMERIC = (
    "numpy",
    "torch",
    "mujoco",
    "rsl-rl-lib",
    "stable-baselines3",
    "scikit-learn",
    "pyarrow",
    "gymnasium-robotics",
)
"""Packages whose version may change a result."""


@cache
def code_version(module: str) -> str:
    """Hash the sources of a module and of every module of this project that it imports, however deep.

    Imports within functions count too. The versions of the packages that compute are part of the hash.

    Args:
        module: dotted name, for instance "stages.train".

    Returns:
        SHA-256, hexadecimal.
    """
    digests: dict[str, str] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        path = _source(name)
        if path is not None and name not in digests:
            digests[name] = sha256_of(path)
            waiting += _imports(path)
    text = canonical_json({"sources": digests, "packages": package_versions(NUMERIC)})
    return hashlib.sha256(text.encode()).hexdigest()


def _source(name: str) -> Path | None:
    """Find the file of a module of this project; None for what is not one."""
    if name.partition(".")[0] not in PACKAGES:
        return None
    base = ROOT.joinpath(*name.split("."))
    return next((path for path in (base.with_suffix(".py"), base / "__init__.py") if path.is_file()), None)


@cache
def _imports(path: Path) -> tuple[str, ...]:
    """List what a file imports: modules, and names that may be modules, with the packages that contain them."""
    found: set[str] = set()
    for node in _executed(ast.parse(path.read_bytes())):
        match node:
            case ast.Import(names=names):
                found.update(alias.name for alias in names)
            case ast.ImportFrom(module=str(module), names=names):
                found.add(module)
                found.update(f"{module}.{alias.name}" for alias in names)
    parents = {name.rpartition(".")[0] for name in found} | {name.partition(".")[0] for name in found}
    return tuple(sorted(found | parents - {""}))


def _executed(node: ast.AST) -> Iterator[ast.AST]:
    """List the nodes of a source but for what only type checkers see."""
    for child in ast.iter_child_nodes(node):
        match child:
            case ast.If(test=ast.Name(id="TYPE_CHECKING")):
                continue
        yield child
        yield from _executed(child)
