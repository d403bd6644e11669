"""Running programs in a kinematic world, and cutting demonstrations."""

from __future__ import annotations

import numpy as np
import pytest

from roboscribe.dsl.interpreter import Rollouts, execute
from roboscribe.dsl.parser import parse_program
from roboscribe.dsl.syntax import Get, Program, Seq, Truth
from roboscribe.errors import ProgramError
from roboscribe.world.layout import BoolArray, FloatArray, IntArray
from tests.dsl.kinematic import CONTROLLERS, PICK, PLACE, TOWER, B, Stacking

PICK_AND_PLACE = Program("PickAndPlace", Seq((Get(B, "block", Truth()), PICK, PLACE)))
SEEDS = np.arange(7)


def same(left: Rollouts, right: Rollouts) -> bool:
    """Tell whether two results are equal, bit for bit."""
    equal = [np.array_equal(a.states, b.states) for a, b in zip(left.trajectories, right.trajectories, strict=True)]
    lines = [np.array_equal(a, b) for a, b in zip(left.lines, right.lines, strict=True)]
    outcome = np.array_equal(left.success, right.success) and left.bound == right.bound
    return all(equal) and all(lines) and outcome and left.control_steps == right.control_steps


def test_pick_and_place_solves_every_start_and_stops_there() -> None:
    task = Stacking(1)
    runs = execute(PICK_AND_PLACE, CONTROLLERS, task, SEEDS, limits={}, batch=3)
    assert runs.success.all()
    for trajectory, lines in zip(runs.trajectories, runs.lines, strict=True):
        assert task.solved(trajectory.states).tolist() == [False] * len(lines) + [True]
        assert trajectory.actions is None
        switch = int(np.flatnonzero(lines == 1)[0])
        assert lines.tolist() == [0] * switch + [1] * (len(lines) - switch)
    assert runs.control_steps == sum(map(len, runs.lines))
    assert len({len(lines) for lines in runs.lines}) > 1, "rows stop on their own"


def test_the_tower_is_built_from_below_in_any_order_of_goals() -> None:
    runs = execute(TOWER, CONTROLLERS, Stacking(3), SEEDS, limits={}, horizon=150)
    assert runs.success.all()
    for trajectory, bound in zip(runs.trajectories, runs.bound, strict=True):
        heights = trajectory.states[0, [9, 15, 21]]
        assert bound == tuple(np.argsort(heights))


@pytest.mark.parametrize("batch", [1, 2, 64])
def test_results_do_not_depend_on_the_batch(batch: int) -> None:
    reference = execute(TOWER, CONTROLLERS, Stacking(2), SEEDS, limits={"hold": 4}, batch=5)
    assert same(reference, execute(TOWER, CONTROLLERS, Stacking(2), SEEDS, limits={"hold": 4}, batch=batch))
    backwards = execute(TOWER, CONTROLLERS, Stacking(2), SEEDS[::-1].copy(), limits={"hold": 4}, batch=batch)
    assert np.array_equal(reference.trajectories[0].states, backwards.trajectories[-1].states)


def test_drawing_is_reproducible_by_generator() -> None:
    order_free = parse_program(
        f"def P(μ : EE): while ((b := get(λb:block. ¬(‖b↓xyz − g(b)↓xyz‖ < 0.05))) ≠ null) {{ {PICK}; {PLACE} }}"
    )
    runs = [
        execute(order_free, CONTROLLERS, Stacking(3), SEEDS, limits={}, rng=np.random.default_rng(seed), horizon=150)
        for seed in (1, 1, 2)
    ]
    assert same(runs[0], runs[1])
    assert runs[0].bound != runs[2].bound


def test_the_horizon_and_divergence_are_failures_and_the_others_go_on() -> None:
    runs = execute(PICK_AND_PLACE, CONTROLLERS, Stacking(1, broken=3), SEEDS, limits={}, batch=2)
    assert runs.diverged.tolist() == [seed == 3 for seed in SEEDS]
    assert runs.success.tolist() == [seed != 3 for seed in SEEDS]
    assert len(runs.lines[3]) == 1
    short = execute(PICK_AND_PLACE, CONTROLLERS, Stacking(1), SEEDS, limits={}, horizon=5)
    assert not short.success.any()
    assert [len(lines) for lines in short.lines] == [5] * len(SEEDS)


def test_episodes_end_at_what_they_never_reached() -> None:
    """Whoever cannot place holds the block in the end; whoever cannot grasp does not get that far."""
    for broken, unreached in (("", ""), (PLACE.controller, PLACE.controller), (PICK.controller, PICK.controller)):
        crew = {name: Standing() if name == broken else each for name, each in CONTROLLERS.items()}
        runs = execute(PICK_AND_PLACE, crew, Stacking(1), SEEDS, limits={}, horizon=60)
        assert runs.success.all() == (not broken)
        if broken:
            assert set(runs.unreached) == {unreached}


class Standing:
    """Never moves."""

    def act(self, states: FloatArray, entities: IntArray) -> FloatArray:
        """Command nothing."""
        return np.zeros((len(states), Stacking(1).action_size))


def test_a_subgoal_succeeds_at_the_program_s_end() -> None:
    grasp = Program("Grasp", Seq((Get(B, "block", Truth()), PICK)))
    runs = execute(grasp, CONTROLLERS, Stacking(1), SEEDS, limits={}, until_end=True, confirm=2)
    assert runs.success.all()
    for trajectory in runs.trajectories:
        reached = np.linalg.norm(trajectory.states[:, :3] - trajectory.states[:, 4:7], axis=1) < 0.021
        assert reached[-2:].all()
        assert not (reached[1:-1] & reached[:-2]).any(), "the end is the second of the first two in a row"


def test_after_the_end_the_last_controller_keeps_acting() -> None:
    grasp = Program("Grasp", Seq((Get(B, "block", Truth()), PICK)))
    runs = execute(grasp, CONTROLLERS, Stacking(1), SEEDS[:1], limits={}, keep_actions=True, horizon=30)
    assert not runs.success[0]
    assert runs.lines[0].tolist() == [0] * 30
    actions = runs.trajectories[0].actions
    assert actions is not None
    assert actions.shape == (30, 4)
    assert actions[-1].tolist() == pytest.approx([0, 0, 0, 1]), "it holds on"


def test_a_solved_start_needs_no_step_and_no_seeds_no_world() -> None:
    class Easy(Stacking):
        def solved(self, states: FloatArray) -> BoolArray:
            return np.ones(states.shape[:-1], dtype=np.bool_)

    runs = execute(TOWER, CONTROLLERS, Easy(2), SEEDS, limits={}, batch=2)
    assert runs.success.all()
    assert runs.control_steps == 0
    assert [len(t) for t in runs.trajectories] == [1] * len(SEEDS)
    assert execute(TOWER, CONTROLLERS, Stacking(2), SEEDS[:0], limits={}).trajectories == ()


def test_controllers_see_their_rows_and_entities_only() -> None:
    seen: list[tuple[int, int]] = []

    class Watch:
        def act(self, states: FloatArray, entities: IntArray) -> FloatArray:
            seen.append((len(states), entities.shape[1]))
            return np.zeros((len(states), 4))

    two = parse_program(
        "def P(μ : EE): a := get(λa:block. true); b := get(λb:block. true); π_x(μ, b, a, g(b)) until ¬true"
    )
    execute(two, {"x": Watch()}, Stacking(2), SEEDS, limits={}, batch=4, horizon=1)
    assert seen == [(4, 2), (3, 2)]


def test_a_missing_controller_is_named() -> None:
    with pytest.raises(ProgramError, match="Tower runs π_at; controllers given: hold"):
        execute(TOWER, {"hold": CONTROLLERS["hold"]}, Stacking(1), SEEDS, limits={})
