"""Who may import whom: the layers of the library, the stages above it, the pipelines above them."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
WORLD = {"defaults", "errors", "success_rate", "world"}
LANGUAGE = WORLD | {"dsl"}
TREE = LANGUAGE | {"search", "subtask_tree", "evidence"}
LAYERS = {
    "defaults": set(),
    "errors": set(),
    "success_rate": set(),
    "world": {"errors"},
    "dsl": WORLD,
    "reward": LANGUAGE,
    "search": LANGUAGE,
    "subtask_tree": LANGUAGE,
    "evidence": LANGUAGE | {"subtask_tree"},
    "classifier": TREE,
    "strips": TREE,
    "html": TREE | {"classifier", "strips"},
    "loop_guard": TREE,
    "branch_condition": TREE,
    "branch_threshold": TREE,
    "program_gen": TREE | {"loop_guard", "branch_condition", "branch_threshold"},
    "steps": TREE | {"program_gen", "classifier"},
    "loosening": TREE | {"steps"},
    "best_first": TREE | {"classifier", "steps"},
    "abstraction_refinement": TREE | {"classifier", "steps", "best_first"},
    "adapt": TREE | {"loop_guard"},
    "envs": LANGUAGE | {"reward"},
    "rl": LANGUAGE | {"reward"},
    "baselines": LANGUAGE | {"reward", "rl"},
    "io": LANGUAGE,
    "controllers": LANGUAGE | {"reward", "subtask_tree", "rl", "io"},
    "tree_json": LANGUAGE | {"subtask_tree", "io"},
    "runnable": LANGUAGE | {"controllers", "io"},
    "onnx_controllers": LANGUAGE | {"rl", "io"},
    "saved": LANGUAGE | {"runnable", "baselines", "io"},
    "programs": LANGUAGE | {"subtask_tree", "controllers", "tree_json", "io"},
    "evaluation": LANGUAGE | {"subtask_tree", "steps", "runnable", "io"},
    "policy": LANGUAGE | {"evaluation", "programs", "runnable", "saved", "onnx_controllers", "envs", "html", "io"},
    "synthesis": TREE | {"classifier", "evaluation", "policy", "html", "io"},
    "grounding": TREE | {"program_gen", "controllers", "rl", "io"},
    "learning": TREE
    | {"abstraction_refinement", "steps", "controllers", "grounding", "runnable", "evaluation", "programs", "policy"}
    | {"synthesis", "loosening", "rl", "io"},
    "notebook": set(),
}
"""What each part of `roboscribe` may import of the others."""
SURFACE = {
    *("controllers", "onnx_controllers", "tree_json", "runnable", "saved", "programs", "evaluation", "policy"),
    *("synthesis", "grounding", "learning", "notebook"),
}
"""What a user of the library calls, and what it needs of everything below."""
CORE = set(LAYERS) - SURFACE - {"envs", "rl", "baselines", "io"}
"""The algorithms: values in, values out."""
EFFECTS = {"torch", "mujoco", "pyarrow", "mlflow", "prefect"}
HEAVY = EFFECTS | {"sklearn", "scipy", "pandas", "matplotlib"}
"""Packages that take from tenths of a second to seconds to import, and that importing the algorithms must not cost."""


def imports(path: Path) -> Iterator[str]:
    """List the modules that a file imports, within functions too."""
    for node in ast.walk(ast.parse(path.read_bytes())):
        match node:
            case ast.Import(names=names):
                yield from (alias.name for alias in names)
            case ast.ImportFrom(module=str(module), names=names):
                yield from (f"{module}.{alias.name}" for alias in names)
            case _:
                pass


def part(path: Path) -> str:
    """Name the part of the library to which a file belongs."""
    return path.relative_to(ROOT / "roboscribe").parts[0].removesuffix(".py")


def files(package: str) -> list[Path]:
    """List the files of a package."""
    return sorted((ROOT / package).rglob("*.py"))


def named(path: Path) -> str:
    return str(path.relative_to(ROOT))


def dotted(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


@pytest.mark.parametrize("path", files("roboscribe"), ids=named)
def test_the_library_imports_downwards_only(path: Path) -> None:
    own = part(path)
    for module in imports(path):
        top, _, rest = module.partition(".")
        assert top != "tests"
        if top == "roboscribe" and own != "__init__":
            assert rest.partition(".")[0] in LAYERS[own] | {own}, f"roboscribe/{own} imports {module}"


@pytest.mark.parametrize("path", [path for path in files("roboscribe") if part(path) in CORE], ids=named)
def test_the_algorithms_have_no_effects(path: Path) -> None:
    assert not {module.partition(".")[0] for module in imports(path)} & EFFECTS


def test_importing_the_algorithms_loads_numpy_alone() -> None:
    core = [dotted(path) for path in files("roboscribe") if part(path) in CORE]
    assert "roboscribe.abstraction_refinement" in core
    script = f"import sys, {', '.join(core)}; print(*{{name.partition('.')[0] for name in sys.modules}})"
    loaded = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    heavy = set(loaded.stdout.split()) & HEAVY
    assert not heavy, f"importing the algorithms imports {', '.join(sorted(heavy))}; import them where they are used"


@pytest.mark.parametrize("path", files("stages"), ids=named)
def test_stages_know_no_pipeline(path: Path) -> None:
    found = set(imports(path))
    assert not {module.partition(".")[0] for module in found} & {"prefect", "tests", "typer"}
    assert not any(module.startswith("roboscribe.pipelines") for module in found)


@pytest.mark.parametrize("path", files("pipelines"), ids=named)
def test_pipelines_do_no_numbers(path: Path) -> None:
    assert not {module.partition(".")[0] for module in imports(path)} & {"numpy", "scipy", "torch", "mujoco", "tests"}


@pytest.mark.parametrize(
    "path", [path for top in ("roboscribe", "stages", "pipelines", "tests") for path in files(top)], ids=named
)
def test_stages_and_pipelines_are_named_as_they_are_installed(path: Path) -> None:
    """The folders at the top are importable from a checkout, too, but their modules would then exist twice."""
    assert not {module.partition(".")[0] for module in imports(path)} & {"stages", "pipelines"}


def test_stages_has_one_file_per_stage() -> None:
    for path in set((ROOT / "stages").glob("*.py")) - {ROOT / "stages" / "__init__.py", ROOT / "stages" / "steps.py"}:
        assert "STAGE = Stage(" in path.read_text(), f"{named(path)} is no stage"


def test_the_flow_is_short() -> None:
    assert len((ROOT / "pipelines" / "flows" / "synthesis.py").read_text().splitlines()) <= 60


@pytest.mark.parametrize(
    "path", [path for top in ("roboscribe", "stages", "pipelines") for path in files(top)], ids=named
)
def test_modules_have_at_most_400_lines(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= 400


def test_every_module_has_a_place() -> None:
    assert {part(path) for path in files("roboscribe")} - {"__init__"} <= set(LAYERS)
