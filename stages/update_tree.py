"""UPDATETREE: refine a subtask tree with a learned subgoal."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from roboscribe.stages.runtime import cli
from roboscribe.stages.runtime.files import TREE, write_json
from roboscribe.stages.runtime.progress import ProgressCallback, ignore_progress
from roboscribe.stages.runtime.serialization import read_refinement, read_tree
from roboscribe.stages.runtime.store import Inputs, Stage
from roboscribe.subtask_tree import update_tree
from roboscribe.tree_json import tree_to_json


@dataclass(frozen=True)
class Config:
    """Nothing to set."""


def run(config: Config, inputs: Inputs, out: Path, report: ProgressCallback = ignore_progress) -> None:
    """Write `tree.json`.

    Inputs:
        tree: the subtask tree.
        refinement: the subgoal and what it is a subgoal of.
    """
    refinement = read_refinement(inputs["refinement"])
    tree = update_tree(read_tree(inputs["tree"]), refinement.node, refinement.psi, refinement.place)
    write_json(out / TREE, tree_to_json(tree))


STAGE = Stage("update_tree", Config, run)

if __name__ == "__main__":
    sys.exit(cli.main(STAGE))
