"""Rows 18 and 19 by fuzzing: whatever text or JSON comes, it is read or refused with a typed error."""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import hypothesis.strategies as st
import pytest
from hypothesis import HealthCheck, given, settings

from roboscribe.dsl.parser import parse_predicate, parse_program
from roboscribe.errors import ArtifactError, DemonstrationError, ProgramError
from roboscribe.io.schema import check_metadata, describe, lengths_of
from roboscribe.stages.runtime.configuration import decode, encode
from roboscribe.stages.runtime.synthesis_plan import SynthesisPlan
from roboscribe.stages.runtime.task_config import TaskConfig
from roboscribe.tree_json import tree_from_json
from tests.conftest import Figure, effort
from tests.io.examples import LAYOUT, TASK

EXAMPLES = effort(100, 5_000)
SPELLED = (
    "def while if else get until where true skip null μ b g(b) hold at π_hold λ b:block . ∃ ¬ ∧ ∨ ≡ := = ≠ < > "
    "‖ − ↓xyz ↓z ( ) { } : , ; 0.05 1e999 EE P \n \x00 \u202e arctan2("
)
WORDS = tuple(SPELLED.split(" "))
VALID = """def P(μ : EE):
  while (b := get(λb:block. ¬at(b) ∧ ¬∃b':block. g(b')↓z < g(b)↓z ∧ ¬at(b'))) ≠ null:
    π_hold(μ, b) until hold(μ, b)
    π_at(μ, b, g(b)) until at(b)
where
  hold(μ, b) ≡ ‖μ↓xyz − b↓xyz‖ < 0.0248
  at(b) ≡ ‖b↓xyz − g(b)↓xyz‖ < 0.0141
"""
JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-3, 10**20) | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=8,
)
fuzzed = settings(max_examples=EXAMPLES, deadline=None, database=None, suppress_health_check=list(HealthCheck))


@dataclass
class Count:
    """How many texts were read or refused."""

    good: int = 0
    tried: int = 0


def mutated(draw: st.DrawFn) -> str:
    """Change a valid program in a few places."""
    text = VALID
    for _ in range(draw(st.integers(1, 4))):
        place, gap = draw(st.integers(0, len(text))), draw(st.integers(0, 6))
        text = text[:place] + draw(st.sampled_from(WORDS) | st.text(max_size=3)) + text[place + gap :]
    return text


SOURCES = st.text() | st.lists(st.sampled_from(WORDS)).map(" ".join) | st.composite(mutated)()


@pytest.mark.parametrize("parse", [parse_program, parse_predicate])
def test_row_18_any_text_is_a_program_or_refused(parse: Any, figure: Figure) -> None:  # noqa: ANN401 - two parsers
    """What is read prints and reads again as itself."""
    count = Count()

    @fuzzed
    @given(SOURCES)
    def check(text: str) -> None:
        count.tried += 1
        with suppress(ProgramError):
            found = parse(text)
            assert parse(str(found)) == found
        count.good += 1

    check()
    figure(f"texts, {parse.__name__}", count.good, count.tried)


def test_row_19_any_json_is_a_setting_a_tree_or_refused(figure: Figure) -> None:
    count = Count()
    plan = json.loads(json.dumps(encode(SynthesisPlan(TaskConfig("tower-5")))))
    tree = {"nodes": [{"name": "at", "predicate": "true", "circular": False, "scales": {}}], "edges": [["at", "ψ_R"]]}

    @fuzzed
    @given(st.data())
    def check(data: st.DataObject) -> None:
        whole = data.draw(st.sampled_from([plan, tree]))
        spoilt = {**whole, data.draw(st.sampled_from(sorted(whole)) | st.text(max_size=5)): data.draw(JSON)}
        count.tried += 1
        for read in (lambda: decode(TaskConfig, spoilt), lambda: tree_from_json(spoilt), lambda: tree_from_json(whole)):
            with suppress(ArtifactError):
                read()
        count.good += 1

    check()
    figure("JSON values", count.good, count.tried)


def test_row_8_any_metadata_is_right_or_refused(figure: Figure) -> None:
    """What a Parquet file says about itself is not believed."""
    count, right = Count(), describe("carry-2", LAYOUT, 25.0, generator="", seed=None, lengths=[], snapshots=False)
    values = st.text(max_size=8) | JSON.map(lambda value: json.dumps(value, default=str))

    @fuzzed
    @given(st.dictionaries(st.sampled_from(sorted(right)) | st.text(max_size=5), values, max_size=3))
    def check(spoilt: dict[str, str]) -> None:
        count.tried += 1
        with suppress(DemonstrationError):
            check_metadata({**right, **spoilt}, TASK, "demos.parquet")
            lengths_of({**right, **spoilt})
        count.good += 1

    check()
    figure("metadata", count.good, count.tried)
