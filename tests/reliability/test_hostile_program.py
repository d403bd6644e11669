"""Hostile program text is refused with its place, or runs within limits (what must not break, row 18)."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from roboscribe.dsl.interpreter import Machine, execute
from roboscribe.dsl.parser import parse_predicate, parse_program, parse_statement
from roboscribe.dsl.printer import pretty, text
from roboscribe.errors import ProgramError
from tests.dsl.kinematic import CONTROLLERS, Stacking, blocks

HEAD = "def P(μ : EE): "
DEEP = 10_000


@pytest.mark.parametrize(
    "body",
    [
        "import os",
        "__import__('os').system('touch owned')",
        "π_hold(μ, open('owned', 'w')) until true",
        "π_hold(μ) until (lambda: 1)() < 2",
        "b := get(λb:block. [x for x in ()])",
        "exec(\"open('owned','w')\")",
        "π_hold(μ) until μ↓__class__ ≠ null",
        "while (True) { print(1) }",
        "f'{b}' until true",
    ],
)
def test_python_is_not_the_language(body: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ProgramError, match=r"line 1, column [0-9]+"):
        parse_program(HEAD + body)
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize(
    "source",
    [
        f"{HEAD}π_a() until {'(' * DEEP}true{')' * DEEP}",
        f"{HEAD}π_a() until {'¬' * DEEP}true",
        f"{HEAD}π_a() until {'‖' * DEEP}μ↓xyz{'‖' * DEEP} < 1.0",
        f"{HEAD}π_a() until {'arctan2(' * DEEP}μ↓xy",
        f"{HEAD}π_a() until {'∃b:block. ' * (DEEP // 2)}true",
        f"{HEAD}π_a() until {'true ∧ ' * DEEP}true",
        f"{HEAD}π_a() until {'true ∨ (' * DEEP}true",
        f"{HEAD}π_a() until μ↓x{' − 1.0' * DEEP} < 0.0",
        f"{HEAD}while {'(' * DEEP}b := get(λb:block. true)",
        f"{HEAD}{'while(true){' * (DEEP // 2)}",
        f"{HEAD}{'if(true){}else{' * (DEEP // 2)}",
        HEAD + "".join("\n" + " " * depth + "while true:" for depth in range(1, 400)),
    ],
)
def test_deep_nesting_is_refused_with_its_place(source: str) -> None:
    with pytest.raises(ProgramError, match=r"line [0-9]+, column [0-9]+: .*(limit|expected)"):
        parse_program(source)


def test_the_limit_leaves_room_for_real_programs() -> None:
    loops = 40
    nested = HEAD + "while (true) { " * loops + "π_a(μ) until true" + " }" * loops
    assert parse_program(text(parse_program(nested))) == parse_program(nested)
    assert parse_program(pretty(parse_program(nested))) == parse_program(nested)
    wide = " ∧ ".join(f"b↓z > {number}.0" for number in range(150))
    assert text(parse_predicate(wide)) == wide
    long = "; ".join(["π_a(μ) until true"] * 2_000)
    assert len(text(parse_statement(long))) == len(long)


@pytest.mark.parametrize("order", [1, -1])
def test_definitions_that_explode_are_refused(order: int) -> None:
    doubling = [f"p{k}(b) ≡ p{k + 1}(b) ∧ p{k + 1}(b)" for k in range(40)] + ["p40(b) ≡ b ≠ null"]
    source = "\n".join([f"{HEAD}π_a(b) until p0(b)", "where", *doubling[::order]])
    with pytest.raises(ProgramError, match="expands to more than 20000 nodes"):
        parse_program(source)


@pytest.mark.parametrize("order", [1, -1])
def test_long_chains_of_definitions_are_refused(order: int) -> None:
    run_pipeline = [f"p{k}(b) ≡ ¬p{k + 1}(b)" for k in range(3_000)] + ["p3000(b) ≡ b ≠ null"]
    source = f"{HEAD}skip\nwhere\n" + "\n".join(run_pipeline[::order])
    with pytest.raises(ProgramError, match="limit"):
        parse_program(source)


def test_definitions_in_a_circle_are_refused() -> None:
    with pytest.raises(ProgramError, match="'p' is defined by itself: p → q → p"):
        parse_program(f"{HEAD}π_a() until p() where p() ≡ q() q() ≡ ¬p()")


def test_too_many_quantifiers_inside_each_other_are_refused() -> None:
    quantified = "∃b:block. " * 7 + "b ≠ null"
    with pytest.raises(ProgramError, match="more than 6 quantifiers"):
        parse_predicate(quantified)
    with pytest.raises(ProgramError, match="more than 6 quantifiers"):
        parse_statement(f"c := get(λc:block. {'∃b:block. ' * 6}b ≠ null)")


def test_too_long_a_text_is_refused() -> None:
    with pytest.raises(ProgramError, match="program text has 100019 characters; at most 100000 are read"):
        parse_program(HEAD + " " * 100_000 + "skip")


@pytest.mark.parametrize(
    "source", ["", "\x00", "def", "\ud800", "def P(μ : EE): \x1b[31m", "где", "def P(μ : EE): x\u202e", "²"]
)
def test_rubbish_is_refused_and_error_messages_hold_no_control_characters(source: str) -> None:
    with pytest.raises(ProgramError, match=r"line 1, column [0-9]+") as caught:
        parse_program(source)
    assert all(line.isprintable() for line in str(caught.value).splitlines())


@pytest.mark.parametrize(
    "body",
    [
        "while (true) {}",
        "while (true) { while (true) { } }",
        "while (true) { π_hold(b1) until true }",
        "while (true) { if (true) { skip } else { π_hold(b1) until true } }",
        "while ((b := get(λb:block. true)) ≠ null) { c := get(λc:block. true) }",
    ],
)
def test_an_endless_loop_ends_by_limits(body: str) -> None:
    program = parse_program(HEAD + body)
    machine = Machine(program, blocks(2), 3, limits={}, confirm=1)
    machine.advance(np.arange(3), np.zeros((3, blocks(2).size)))
    assert machine.stuck.all()
    runs = execute(program, CONTROLLERS, Stacking(2), np.arange(3), limits={}, confirm=1, horizon=10)
    assert not runs.success.any()
    assert [len(lines) for lines in runs.lines] == [10, 10, 10]
    ended = execute(program, CONTROLLERS, Stacking(2), np.arange(3), limits={}, confirm=1, until_end=True)
    assert not ended.success.any()
    assert ended.control_steps == 0


def test_a_loop_that_never_finishes_ends_at_the_horizon() -> None:
    program = parse_program(HEAD + "while (true) { π_hold(b1) until ¬true; π_at(b1) until ¬true }")
    runs = execute(program, CONTROLLERS, Stacking(2), np.arange(3), limits={"hold": 1}, horizon=12, until_end=True)
    assert not runs.success.any()
    assert [len(lines) for lines in runs.lines] == [12, 12, 12]
