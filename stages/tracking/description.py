"""What MLflow's pages say about an experiment and a run, in Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from roboscribe.evaluation import format_success

FIGURES = {
    "success": "share of episodes that solved the task; its curve has one point per program tried, then the final one",
    "subgoal_success": "the same for programs that are to reach a subgoal only",
    "ci_low, ci_high": "95 % Wilson interval of each of these",
    "episodes": "episodes in which each was measured",
    "env_steps": "control steps of the synthesis: attempts, rollouts and evaluations of skills included",
    "evaluation_steps": "control steps of the final evaluation",
    "refinements": "subgoals found so far",
    "wall_seconds": "seconds, all attempts of an interrupted run together",
    "curve/…": "of one controller's training, by its own control steps",
}
"""Figures of runs; steps are control steps everywhere."""


def experiment_description(task: str) -> str:
    """Say what the runs of an experiment show."""
    rows = [f"| `{name}` | {about} |" for name, about in FIGURES.items()]
    return "\n".join([f"Programs learned for `{task}`.", "", "| metric | what it is |", "|---|---|", *rows])


def begun(command: str) -> str:
    """Say what a run that is at work was asked for."""
    return f"    {command}\n"


def solved(command: str, result: Mapping[str, Any], subgoals: Sequence[tuple[str, str, str]], run: str) -> str:
    """Describe a run that found a program.

    Args:
        command: what was asked for.
        result: what `roboscribe synthesize --json` writes.
        subgoals: goal, subgoal and predicate of every refinement.
        run: by which the run is found on this machine.
    """
    shown = f"**success {format_success(result)}** of {result['episodes']} episodes, 95 % interval"
    spent = f"{result['refinements']} refinements, {result['env_steps']} control steps"
    program = ["```", str(result["program"]).rstrip(), "```"]
    use = ["```python", "import roboscribe", f'policy = roboscribe.load("{result["program_dir"]}")', "```"]
    told = f"`roboscribe show {run}` tells how it went, `roboscribe report {run} --out report.html` draws it."
    return "\n".join([shown, f"({spent})", "", *program, "", *_table(subgoals), "", begun(command), *use, "", told])


def failed(command: str, reason: str) -> str:
    """Describe a run that found none."""
    return f"**no program**: {reason}\n\n{begun(command)}"


def _table(subgoals: Sequence[tuple[str, str, str]]) -> list[str]:
    """List the refinements."""
    rows = [f"| {number} | {goal} | {name} | `{_cell(phi)}` |" for number, (goal, name, phi) in enumerate(subgoals, 1)]
    return ["| refinement | goal | subgoal | predicate |", "|---|---|---|---|", *rows] if rows else []


def _cell(text: str) -> str:
    """Keep a bar from ending a table's cell."""
    return text.replace("|", "\\|")
