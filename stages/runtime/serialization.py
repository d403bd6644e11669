"""Trees, refinements and outcomes on disk: JSON and safetensors, nothing else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors import numpy as safetensors

from roboscribe.classifier import Refinement
from roboscribe.dsl.parser import parse_predicate
from roboscribe.dsl.printer import text
from roboscribe.errors import ArtifactError, RoboScribeError
from roboscribe.io.atomic import Json
from roboscribe.search.candidates import Candidate
from roboscribe.stages.runtime.files import FAILURES, OUTCOME, read_json
from roboscribe.steps import Failure, Outcome
from roboscribe.subtask_tree import Place, Tree
from roboscribe.tree_json import node_from_json, node_to_json, tree_from_json
from roboscribe.world.layout import FloatArray


def read_tree(path: Path) -> Tree:
    """Read a tree's file."""
    return tree_from_json(read_json(path), str(path))


def refinement_to_json(refinement: Refinement) -> dict[str, Json]:
    """Describe a refinement with its whole ranked table."""
    return {
        "psi": refinement.psi,
        "node": node_to_json(refinement.node),
        "positives": refinement.positives,
        "negatives": refinement.negatives,
        "place": asdict(refinement.place),
        "passed_over": [list(pair) for pair in refinement.passed_over],
        "table": [_candidate_to_json(candidate) for candidate in refinement.table],
    }


def read_refinement(path: Path) -> Refinement:
    """Read a refinement's file.

    Raises:
        ArtifactError: it holds something else.
    """
    return refinement_from_json(read_json(path), str(path))


def refinement_from_json(value: Any, where: str = "refinement") -> Refinement:  # noqa: ANN401 - whatever JSON is found
    """Read what `refinement_to_json` wrote.

    Raises:
        ArtifactError: it is something else.
    """
    try:
        return Refinement(
            psi=str(value["psi"]),
            node=node_from_json(value["node"]),
            table=tuple(_candidate_from_json(row) for row in value["table"]),
            positives=int(value["positives"]),
            negatives=int(value["negatives"]),
            place=Place(str(value["place"]["before"]), bool(value["place"]["apart"])),
            passed_over=tuple((str(phi), str(why)) for phi, why in value["passed_over"]),
        )
    except (KeyError, TypeError, ValueError, RoboScribeError) as error:
        msg = f"{where}: found no refinement ({error})"
        raise ArtifactError(msg) from error


def failures_bytes(failures: FloatArray) -> bytes:
    """Encode N_s, the states of failures, as safetensors."""
    return safetensors.save({"failures": np.ascontiguousarray(failures)})


def read_failures(path: Path) -> FloatArray:
    """Read N_s, the states of failures.

    Raises:
        ArtifactError: the file is damaged.
    """
    try:
        failures: FloatArray = safetensors.load_file(path)["failures"]
    except (OSError, SafetensorError, KeyError) as error:
        msg = f"{path}: cannot be read as failing states ({error})"
        raise ArtifactError(msg) from error
    return failures


def lost_to_json(lost: Sequence[Failure]) -> dict[str, Json]:
    """Describe failing episodes, whose states lie one after the other in a file of their own."""
    return {"lengths": [len(each.states) for each in lost], "unreached": [each.unreached for each in lost]}


def read_outcome(out: Path) -> Outcome:
    """Read what a rollout stage wrote.

    Raises:
        ArtifactError: a file is damaged, or they do not belong together.
    """
    value, failures = read_json(out / OUTCOME), read_failures(out / FAILURES)
    try:
        lengths = np.array(value["lengths"], dtype=np.int64)
        if lengths.sum() != len(failures):
            msg = f"{len(failures)} states where {lengths.sum()} are expected"
            raise ValueError(msg)
        states = np.split(failures, np.cumsum(lengths))[:-1]
        lost = tuple(Failure(part, str(name)) for part, name in zip(states, value["unreached"], strict=True))
        return Outcome(int(value["successes"]), int(value["episodes"]), lost)
    except (KeyError, TypeError, ValueError) as error:
        msg = f"{out}: found no outcome of rollouts ({error})"
        raise ArtifactError(msg) from error


def _candidate_to_json(candidate: Candidate) -> dict[str, Json]:
    """Describe a candidate: all its figures, its predicate as text."""
    row = {field.name: getattr(candidate, field.name) for field in fields(candidate)}
    predicates = {name: text(row[name]) for name in ("predicate", "only")}
    return {**row, **predicates, "scales": [list(pair) for pair in candidate.scales]}


def _candidate_from_json(row: Mapping[str, Any]) -> Candidate:
    scales = tuple((str(term), float(scale)) for term, scale in row["scales"])
    read = {"predicate": parse_predicate(row["predicate"]), "only": parse_predicate(row.get("only", "true"))}
    return Candidate(**{**row, **read, "scales": scales})
