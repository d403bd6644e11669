"""Every task by name. A family of tasks registers itself: ours are the files of `roboscribe.envs.tasks`.

Tasks of other packages are found through their entry points in the group `roboscribe.tasks`, each of which names a
module that registers tasks, or a task. One in a file of its own needs no package: `path/to/task.py:NAME`.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from hashlib import sha256
from importlib import import_module, util
from importlib.metadata import entry_points
from pathlib import Path
from pkgutil import iter_modules
from typing import TypeAlias

from roboscribe.defaults import CONTACT, TIMING
from roboscribe.dsl.fields import check_layout
from roboscribe.envs import tasks as own
from roboscribe.errors import TaskError
from roboscribe.world.task import Task

CONTACTS = ("stable", "paper")
TIMINGS = ("faithful", "fast")
GROUP = "roboscribe.tasks"
"""Group of the entry points by which other packages bring tasks."""
BLANKS = {"N": "([1-9][0-9]?)", "NAME": "(.+)"}
"""What stands in a pattern for a number and for any text."""
EXTRAS = {"mujoco": "fetch", "gymnasium_robotics": "fetch", "robosuite": "robosuite", "metaworld": "metaworld"}
"""Which extra of this package brings a simulator."""
IN_FILE = re.compile(r"(.+\.py):([A-Za-z_][A-Za-z0-9_]*)")
"""A task in a file: path and name."""


@dataclass(frozen=True)
class Request:
    """A task that is asked for.

    Args:
        name: in full.
        blanks: what its name has where the pattern has `N` or `NAME`, in order.
        contact: contact model, one of `CONTACTS`; tasks without a choice ignore it.
        timing: simulator steps per control step, one of `TIMINGS`; the same.
    """

    name: str
    blanks: tuple[str, ...] = ()
    contact: str = "stable"
    timing: str = "fast"

    @property
    def number(self) -> int:
        """The first blank, a number."""
        return int(self.blanks[0])


Maker: TypeAlias = Callable[[Request], Task]


@dataclass(frozen=True)
class Family:
    """Tasks that one function makes.

    Args:
        patterns: their names, with `N` for a number and `NAME` for any text.
        examples: names that are listed.
        make: makes one.
    """

    patterns: tuple[str, ...]
    examples: tuple[str, ...]
    make: Maker

    def request(self, name: str, contact: str, timing: str) -> Request | None:
        """Return the request for a name; None where no pattern fits it."""
        fits = (_compiled(pattern).fullmatch(name) for pattern in self.patterns)
        return next((Request(name, fit.groups(), contact, timing) for fit in fits if fit is not None), None)


_FAMILIES: dict[tuple[str, ...], Family] = {}


def register(*patterns: str, examples: tuple[str, ...] | None = None) -> Callable[[Maker], Maker]:
    """Register the decorated function as the maker of tasks.

    Args:
        patterns: names it makes tasks for, with `N` for a number and `NAME` for any text.
        examples: names to list; left out: the patterns without a blank.
    """

    def add(make: Maker) -> Maker:
        plain = tuple(pattern for pattern in patterns if _compiled(pattern).groups == 0)
        _FAMILIES[patterns] = Family(patterns, plain if examples is None else examples, make)
        return make

    return add


@cache
def _compiled(pattern: str) -> re.Pattern[str]:
    """Compile a pattern of names."""
    words = re.split(r"(?<![A-Za-z])(N|NAME)(?![A-Za-z])", pattern)
    return re.compile("".join(BLANKS.get(word, re.escape(word)) for word in words))


@cache
def _import_own() -> tuple[str, ...]:
    """Let our families register themselves; returns what says which simulators are missing for others."""
    missing: dict[str, None] = {}
    for module in sorted(found.name for found in iter_modules(own.__path__)):
        try:
            import_module(f"{own.__name__}.{module}")
        except ModuleNotFoundError as error:
            if error.name not in EXTRAS:
                raise
            missing[f"{error.name} is not installed: pip install 'roboscribe[{EXTRAS[error.name]}]' brings more"] = None
    return tuple(missing)


@cache
def _import_others() -> None:
    """Let families of other packages register themselves; a name of ours cannot be taken.

    Raises:
        TaskError: one cannot be imported.
    """
    for point in entry_points(group=GROUP):
        try:
            found = point.load()
        except Exception as error:  # whatever another package does wrong, the user is told which
            msg = f"tasks of entry point {point.name} = {point.value}: cannot be imported ({error!r})"
            raise TaskError(msg) from error
        if isinstance(found, Task) or (isinstance(found, type) and issubclass(found, Task)):
            _FAMILIES.setdefault((point.name,), Family((point.name,), (point.name,), _maker(found)))


def _maker(found: Task | type[Task]) -> Maker:
    return lambda _request: found if isinstance(found, Task) else found()


def _families() -> Iterator[Family]:
    """List ours, then those of other packages, which are only imported where ours do not suffice."""
    _import_own()
    yield from list(_FAMILIES.values())
    _import_others()
    yield from list(_FAMILIES.values())


def task_names() -> tuple[str, ...]:
    """List tasks that `make_task` knows; families take other numbers, too, and some `-crowded` behind their names.

    In a crowded task blocks start as near to each other and to goals as in the paper, and some cannot be picked there.
    """
    return tuple(dict.fromkeys(name for family in _families() for name in family.examples))


def make_task(name: str, *, contact: str = CONTACT, timing: str = TIMING) -> Task:
    """Build a task.

    Args:
        name: one of `task_names()`, such a name with another number, or `path/to/task.py:NAME`.
        contact: "stable" (elliptic cones, impratio 10) or "paper" (the scene file's defaults).
        timing: "faithful" (20 x 2 ms) or "fast" (10 x 4 ms); a control step is 40 ms under both.

    Raises:
        TaskError: an unknown name, contact model or timing, or declared names that programs cannot speak of.
    """
    if contact not in CONTACTS:
        msg = f"unknown contact model {contact!r}: expected one of {', '.join(CONTACTS)}"
        raise TaskError(msg)
    if timing not in TIMINGS:
        msg = f"unknown timing {timing!r}: expected one of {', '.join(TIMINGS)}"
        raise TaskError(msg)
    if (place := IN_FILE.fullmatch(name)) is not None:
        return _checked(_task_in_file(name, Path(place[1]), place[2]))
    for family in _families():
        if (request := family.request(name, contact, timing)) is not None:
            return _checked(family.make(request))
    near = get_close_matches(name, task_names(), n=1)
    hint = f"did you mean {near[0]}? " if near else ""
    known = f"expected one of {', '.join(task_names())}, or another number of objects"
    msg = "; ".join((f"unknown task {name!r}: {hint}{known}", *_import_own()))
    raise TaskError(msg)


def _checked(task: Task) -> Task:
    """Check that programs can speak of what a task declares."""
    check_layout(task.layout)
    return task


def origin_of(name: str) -> Path | Maker | None:
    """Return what makes a task: the file that its name names, or the function of its family; None for neither."""
    if (place := IN_FILE.fullmatch(name)) is not None:
        return Path(place[1])
    requests = ((family, family.request(name, CONTACTS[0], TIMINGS[0])) for family in _families())
    return next((family.make for family, request in requests if request is not None), None)


def _task_in_file(name: str, path: Path, attribute: str) -> Task:
    """Take a task, or a class of one without arguments, out of a file.

    Raises:
        TaskError: there is no such file, it cannot be run, or has no such task.
    """
    if not path.is_file():
        msg = f"task {name}: file {path} does not exist"
        raise TaskError(msg)
    try:
        found = getattr(_run_file(path, sha256(path.read_bytes()).hexdigest()), attribute, None)
        task = found() if isinstance(found, type) and issubclass(found, Task) else found
    except Exception as error:  # whatever a user's file does wrong, the user is told which file
        msg = f"task {name}: {path} cannot be run ({type(error).__name__}: {error})"
        raise TaskError(msg) from error
    if not isinstance(task, Task):
        msg = f"task {name}: found {found!r} in {path}, expected a roboscribe Task or a class of one"
        raise TaskError(msg)
    return task


@cache
def _run_file(path: Path, digest: str) -> object:
    """Run a file as a module, once for every content."""
    spec = util.spec_from_file_location(f"roboscribe_task_{digest[:16]}", path)
    assert spec is not None
    assert spec.loader is not None, "a file that ends in .py has a loader"
    module = sys.modules[spec.name] = util.module_from_spec(spec)  # dataclasses look their module up by name
    spec.loader.exec_module(module)
    return module
