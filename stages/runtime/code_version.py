"""Which code a stage depends on: what it imports of this project, the task's own, and the packages' versions."""

from __future__ import annotations

import ast
import hashlib
import sysconfig
from collections.abc import Iterator
from functools import cache, cached_property
from importlib.metadata import packages_distributions
from pathlib import Path
from types import CodeType, FunctionType

import roboscribe
from roboscribe.io.atomic import Json, canonical_json, package_versions, sha256_of

ROOT = Path(roboscribe.__file__).resolve().parent.parent
"""Where the package lies."""
PACKAGES = ("roboscribe",)
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
LONGEST_NAME = 200
"""Characters; a longer text names no file."""


@cache
def code_version(module: str) -> str:
    """Hash the sources of a module and of every module of this project that it imports, however deep.

    Imports within functions count too. The versions of the packages that compute are part of the hash.

    Args:
        module: dotted name, for instance "roboscribe.stages.train".

    Returns:
        SHA-256, hexadecimal.
    """
    digests: dict[str, str] = {}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        path = _module_file(name)
        if path is not None and name not in digests:
            digests[name] = sha256_of(path)
            waiting += _imports(path)
    text = canonical_json({"sources": digests, "packages": package_versions(NUMERIC)})
    return hashlib.sha256(text.encode()).hexdigest()


def task_version(task: object, *origin: object) -> str:
    """Hash the sources that make a task what it is, wherever they lie.

    A task of this project counts with all that its module imports; one of another package with every file of that
    package; one in a file of its own with the file, what it imports of its own directory, and the files that it names
    there. So do the classes that it extends, and the tasks, functions and plain values that it holds. Of other packages
    that are imported the version counts.

    Args:
        task: the task.
        origin: what made it: a function, or the path of a file.

    Returns:
        SHA-256, hexadecimal.
    """
    own: set[str] = set()
    held: list[str] = []
    files = {part for part in origin if isinstance(part, Path)}
    for kind in _parts([task, *origin]):
        if isinstance(kind, str):
            held.append(kind)
        elif kind.__module__.partition(".")[0] in PACKAGES:
            own.add(kind.__module__)
        else:
            files.update(_defining_files(kind))
    outside = {source for file in files for source in _external_sources(file)}
    digests = sorted(sha256_of(path) for path in outside)
    versions: list[Json] = [code_version(name) for name in sorted(own)]
    text = canonical_json({"own": versions, "outside": digests, "held": sorted(held), **_used_packages(outside)})
    return hashlib.sha256(text.encode()).hexdigest()


def _parts(waiting: list[object]) -> Iterator[type | FunctionType | str]:
    """List the classes of things and of what they hold, the functions among that, and numbers and texts as text."""
    seen = set[int]()
    while waiting:
        part = waiting.pop()
        if isinstance(part, int | float | str):
            yield str(part)
        elif isinstance(part, tuple | list):
            waiting += part
        elif isinstance(part, dict):
            waiting += [*part.keys(), *part.values()]
        elif id(part) not in seen and not isinstance(part, Path):
            seen.add(id(part))
            if isinstance(part, FunctionType):
                yield part
                waiting += [cell.cell_contents for cell in part.__closure__ or ()]
            else:
                kind = part if isinstance(part, type) else type(part)
                yield from (each for each in kind.__mro__ if each.__module__ != "builtins")
                waiting += [] if part is kind else _held(part)


def _held(part: object) -> list[object]:
    """List what a thing holds, but for what it computed from that and keeps."""
    values = getattr(part, "__dict__", {})
    return [held for name, held in values.items() if not isinstance(getattr(type(part), name, None), cached_property)]


def _defining_files(kind: type | FunctionType) -> set[Path]:
    """Find the files in which a class or a function is written; none for what comes with Python."""
    members = [kind] if isinstance(kind, FunctionType) else [_function(part) for part in vars(kind).values()]
    codes = [code for part in members if isinstance(code := getattr(part, "__code__", None), CodeType)]
    paths = {Path(code.co_filename) for code in codes if Path(code.co_filename).is_file()}
    standard, installed = (Path(sysconfig.get_path(name)) for name in ("stdlib", "purelib"))
    return {path for path in paths if installed in path.parents or standard not in path.parents}


def _function(member: object) -> object:
    """Return the function behind a property, a cached property, a class method or a static one."""
    for name in ("fget", "func", "__func__"):
        member = getattr(member, name, member)
    return member


def _external_sources(file: Path) -> set[Path]:
    """List the sources of a task of another project, and the files that they name."""
    if (file.parent / "__init__.py").exists():
        top = file.parent
        while (top.parent / "__init__.py").exists():
            top = top.parent
        return {path for path in top.rglob("*") if path.is_file() and path.suffix != ".pyc"}
    found, waiting = set[Path](), [file]
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            waiting += [near for name in _imports(path) if (near := _sibling_module(path, name)) is not None]
    return found | {named for path in found for named in _mentioned_files(path)}


def _sibling_module(path: Path, name: str) -> Path | None:
    """Find a module in the directory of the file that imports it."""
    base = path.parent.joinpath(*name.split("."))
    return next((near for near in (base.with_suffix(".py"), base / "__init__.py") if near.is_file()), None)


def _mentioned_files(path: Path) -> set[Path]:
    """List the files beside a source that it names in a text, a scene for instance."""
    texts = {n.value for n in ast.walk(ast.parse(path.read_bytes())) if isinstance(n, ast.Constant)}
    names = {text for text in texts if isinstance(text, str) and 0 < len(text) < LONGEST_NAME and text.isprintable()}
    return {path.parent / name for name in names if (path.parent / name).is_file()}


def _used_packages(sources: set[Path]) -> dict[str, Json]:
    """Return the versions of installed packages that sources outside of this project import."""
    if not sources:
        return {}
    tops = {name.partition(".")[0] for path in sources if path.suffix == ".py" for name in _imports(path)}
    known = packages_distributions()
    return {"packages": package_versions(sorted({each for top in tops for each in known.get(top, ())}))}


def _module_file(name: str) -> Path | None:
    """Find the file of a module of this project; None for what is not one."""
    if name.partition(".")[0] not in PACKAGES:
        return None
    base = ROOT.joinpath(*name.split("."))
    return next((path for path in (base.with_suffix(".py"), base / "__init__.py") if path.is_file()), None)


@cache
def _imports(path: Path) -> tuple[str, ...]:
    """List what a file imports: modules, and names that may be modules, with the packages that contain them."""
    found: set[str] = set()
    for node in _runtime_nodes(ast.parse(path.read_bytes())):
        match node:
            case ast.Import(names=names):
                found.update(alias.name for alias in names)
            case ast.ImportFrom(module=str(module), names=names):
                found.add(module)
                found.update(f"{module}.{alias.name}" for alias in names)
            case _:
                pass
    parents = {name.rpartition(".")[0] for name in found} | {name.partition(".")[0] for name in found}
    return tuple(sorted(found | parents - {""}))


def _runtime_nodes(node: ast.AST) -> Iterator[ast.AST]:
    """List the nodes of a source but for what only type checkers see."""
    for child in ast.iter_child_nodes(node):
        match child:
            case ast.If(test=ast.Name(id="TYPE_CHECKING")):
                continue
            case _:
                yield child
                yield from _runtime_nodes(child)
