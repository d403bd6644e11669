"""What type-checks and what does not."""

from __future__ import annotations

import pytest

from roboscribe.dsl.parser import parse_predicate, parse_program
from roboscribe.dsl.syntax import Const, Less, Program, Proj, Seq
from roboscribe.dsl.types import check_predicate, check_program
from roboscribe.errors import ProgramError
from roboscribe.world import Layout
from tests.dsl.kinematic import BLOCK, FAUCET, GRIPPER, PICK, TOWER, B

LAYOUT = Layout(GRIPPER, (BLOCK, BLOCK, FAUCET))
TYPES = {"b": "block", "f": "faucet"}


@pytest.mark.parametrize(
    "text",
    [
        "true ∧ ψ_R ∨ ¬(b ≠ null)",
        "∃c:block. g(c)↓z < b↓z",
        "arctan2(b↓xy − μ↓xy) − f↓angle > -0.5",
        "‖f↓angle − g(f)↓angle‖ < 0.1",
        "μ↓opening < 0.05",
    ],
)
def test_well_typed_predicates_pass(text: str) -> None:
    check_predicate(parse_predicate(text), LAYOUT, TYPES)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("v↓z < 1.0", "variable v is used before it is bound"),
        ("∃c:mug. true", "unknown type 'mug'"),
        ("b↓angle < 1.0", "type block has no field 'angle'; it has: position, x, y, z"),
        ("g(f)↓z < 1.0", "goals of type faucet has no field 'z'; it has: angle"),
        ("b↓xyz < 1.0", "compares 3 with 1 numbers"),
        ("‖b↓xyz − μ↓xy‖ < 1.0", "subtracts 2 from 3 numbers"),
        ("b↓z < f↓angle", "mixes the units m and rad"),
        ("f↓angle − b↓z < 1.0", "mixes the units rad and m"),
        ("arctan2(b↓z) < 1.0", "takes a planar vector of 2 numbers, got 1"),
    ],
)
def test_ill_typed_predicates_are_refused(text: str, message: str) -> None:
    with pytest.raises(ProgramError, match=message):
        check_predicate(parse_predicate(text), LAYOUT, TYPES)


def test_constants_must_be_finite() -> None:
    with pytest.raises(ProgramError, match="inf is not finite"):
        check_predicate(Less(Proj(B, "z"), Const(float("inf"))), LAYOUT, TYPES)


def test_the_tower_program_passes_and_entities_may_be_named() -> None:
    check_program(TOWER, LAYOUT)
    check_program(parse_program("def P(μ : EE): π_hold(μ, b2) until b2↓z < f1↓x"), LAYOUT)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("π_hold(μ, b) until true", "variable b is used before"),
        ("b := get(λb:block. true); π_a(b) until true; π_a(μ) until true", "arguments of types .block. and .gripper."),
        ("f := get(λf:gripper. true)", "unknown type 'gripper'"),
        ("if (true) { b := get(λb:block. true) }; π_a(b) until true", "variable b is used before"),
        ("while (b ≠ null) { b := get(λb:block. true) }", "variable b is used before"),
    ],
)
def test_ill_formed_programs_are_refused(body: str, message: str) -> None:
    with pytest.raises(ProgramError, match=message):
        check_program(parse_program(f"def P(μ : EE): {body}"), LAYOUT)


def test_a_goal_argument_needs_a_goal_and_sequences_are_flat() -> None:
    plain = Layout(GRIPPER, (type(BLOCK)("block", BLOCK.attributes),))
    with pytest.raises(ProgramError, match="entities of type block have no goal"):
        check_program(parse_program("def P(μ : EE): π_at(g(b1)) until true"), plain)
    with pytest.raises(ProgramError, match="directly inside a sequence"):
        check_program(Program("P", Seq((Seq((PICK,)),))), LAYOUT)
