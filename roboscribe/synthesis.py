"""What a synthesis found."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from roboscribe.classifier import Refinement
from roboscribe.dsl.syntax import Program
from roboscribe.evaluation import Evaluation
from roboscribe.html.style import standalone
from roboscribe.html.tables import pairs_html, refinement_html
from roboscribe.io.saved_program import SavedProgram, save_program
from roboscribe.policy import Policy
from roboscribe.subtask_tree import Tree


@dataclass(frozen=True)
class Synthesis:
    """A program and how it was found.

    Args:
        policy: the program with its controllers, ready to drive a robot.
        tree: the abstraction it was generated from.
        refinements: every refinement in order, each with its ranked table.
        evaluation: how well it does.
        saved: what is saved of it.
    """

    policy: Policy
    tree: Tree
    refinements: tuple[Refinement, ...]
    evaluation: Evaluation
    saved: SavedProgram

    @property
    def program(self) -> Program:
        """The program."""
        return self.policy.program

    def save(self, directory: str | Path) -> Path:
        """Write a directory that `roboscribe.load` and every command take; returns it.

        Raises:
            ArtifactError: the system refused.
        """
        save_program(Path(directory), self.saved)
        self.policy.save_onnx(directory)
        return Path(directory)

    def __str__(self) -> str:
        """Spell the program and its success."""
        return f"{self.policy}\n{self.evaluation}"

    def _repr_html_(self) -> str:
        """Show program, success and refinements in a notebook."""
        tables = "".join(
            f"<h4>{rank}. {each.node.name}, before {each.psi}</h4>{refinement_html(each)}"
            for rank, each in enumerate(self.refinements, start=1)
        )
        success = pairs_html({"success": str(self.evaluation), "refinements": str(len(self.refinements))})
        return standalone(self.policy.html() + success + tables)
