"""TRAINPROGRAM on the kinematic toy: what is learned, from what, at what cost, and how it resumes."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from roboscribe.dsl.interpreter import execute
from roboscribe.dsl.syntax import Get, Goal, Not, Program, Run, Seq, Solved, Truth, While
from roboscribe.envs.point_world import PointTask
from roboscribe.rl import warm_start
from roboscribe.rl.config import CloneConfig, InverseConfig, PoolConfig, PpoConfig, SacConfig, TrainConfig
from roboscribe.rl.pool import StartPool
from roboscribe.rl.program_training import ProgramTraining, step_limits
from roboscribe.rl.screening import least_worth_improving, mostly_fails, never_together
from roboscribe.rl.skill import Skill
from roboscribe.rl.skill_job import SkillReport
from roboscribe.rl.train_program import TrainingResult, train_program
from roboscribe.world.layout import BoolArray, FloatArray
from tests.rl.carry_world import AT, HOLD, PROGRAM, Carry, b, mu

TASK = Carry()
SHOWN = TASK.demonstrate(15, 0)
QUICK = TrainConfig(
    target=0.9,
    budget=40_000,
    learning=0.04,
    opaque_budget=800,
    screening=8,
    pool=PoolConfig(starts=24, evaluation=16, opaque=8, batch=16, screening=4),
    clone=CloneConfig(steps=250, hidden=(32, 32), checkpoints=2),
    inverse=InverseConfig(steps=400, hidden=(32, 32)),
    learner=PpoConfig(worlds=16, steps=10, epochs=2, minibatches=2, critic_iterations=1, evaluate_every=2),
    blind=PpoConfig(worlds=16, steps=10, epochs=2, minibatches=2, critic_iterations=0, evaluate_every=2, noise=0.5),
)
SAC = SacConfig(worlds=8, updates=1, batch=16, learning_starts=80, buffer=2000, hidden=(16, 16), evaluate_every=50)
FIRST = Program("Reach", Seq((Get(b, "block", Truth()), Run("hold", (mu, b), HOLD))))
LOOP = Program(
    "Loop",
    Seq((While(Get(b, "block", Not(AT)), Seq((Run("hold", (mu, b), HOLD), Run("at", (mu, b, Goal(b)), AT)))),)),
)
BLIND = Program("Blind", Seq((Get(b, "block", Truth()), Run("solve", (mu, b, Goal(b)), Solved()))))


def weights(skill: Skill) -> NDArray[np.floating[Any]]:
    return np.concatenate([array.ravel() for layer in skill.layers for array in layer])


@pytest.fixture(scope="module")
def trained() -> TrainingResult:
    return train_program(TASK, PROGRAM, SHOWN, {}, QUICK, 0)


def test_clones_solve_the_task(trained: TrainingResult) -> None:
    rollouts = execute(PROGRAM, trained.library, TASK, np.arange(100) + 1000, limits={}, batch=25)
    assert rollouts.success.mean() >= 0.9
    assert [report.controller for report in trained.reports] == ["hold", "at"]
    assert {report.learner for report in trained.reports} <= {"clone", "ppo"}


def test_every_control_step_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    worlds = []
    world = Carry.world

    def counted(self: Carry, batch: int) -> object:
        worlds.append(world(self, batch))
        return worlds[-1]

    monkeypatch.setattr(Carry, "world", counted)
    states, paper = (
        replace(QUICK, profile="states", target=2.0),
        replace(QUICK, profile="paper", learner=SAC, target=2.0),
    )
    for config, program in ((replace(QUICK, target=2.0), PROGRAM), (states, FIRST), (paper, FIRST)):
        worlds.clear()
        result = train_program(TASK, program, SHOWN, {}, config, 0, solve=program is PROGRAM)
        assert result.control_steps == sum(each.control_steps for each in worlds)
    known = train_program(TASK, PROGRAM, SHOWN, {}, QUICK, 0).library
    worlds.clear()
    monkeypatch.setattr("roboscribe.rl.train_program.IMPROVED", ("kept", "clone", "ppo"))  # each is compared
    again = train_program(TASK, PROGRAM, SHOWN, known, replace(QUICK, target=2.0, assurance=20), 0)
    assert again.control_steps == sum(each.control_steps for each in worlds)
    assert all(report.control_steps <= QUICK.budget for report in again.reports)


def test_what_a_clone_reaches_needs_no_starts_to_train_from(monkeypatch: pytest.MonkeyPatch) -> None:
    """Most of what a training used to simulate were starts that nothing was trained from."""
    looked_for: list[str] = []
    find = ProgramTraining.starts

    def starts(
        self: ProgramTraining, run: Run, skills: Mapping[str, Skill], most: float, left: float, *, again: int = 0
    ) -> tuple[StartPool, int]:
        looked_for.append(run.controller)
        return find(self, run, skills, most, left, again=again)

    monkeypatch.setattr(ProgramTraining, "starts", starts)
    train_program(TASK, PROGRAM, SHOWN, {}, replace(QUICK, target=0.0), 0)
    assert looked_for == []
    train_program(TASK, PROGRAM, SHOWN, {}, replace(QUICK, target=2.0), 0)
    assert looked_for == ["hold", "at"]


def test_known_skills_are_left_alone(trained: TrainingResult) -> None:
    held = {"hold": trained.library["hold"]}
    result = train_program(TASK, PROGRAM, SHOWN, held, QUICK, 0, solve=False)
    assert result.library["hold"] is held["hold"]
    assert [report.controller for report in result.reports] == ["at"]


def test_a_program_that_solves_the_task_may_improve_what_is_known(trained: TrainingResult) -> None:
    demanding = replace(QUICK, target=2.0, learning=0.0, rounds=1)
    result = train_program(TASK, PROGRAM, SHOWN, trained.library, demanding, 0)
    assert [report.controller for report in result.reports] == ["hold", "at"]
    assert all(report.success >= report.warm_success for report in result.reports)


def test_skills_that_do_all_that_is_wanted_are_left_as_they_are(trained: TrainingResult) -> None:
    content = replace(QUICK, target=0.5, assurance=20)
    result = train_program(TASK, PROGRAM, SHOWN, trained.library, content, 0)
    (report,) = result.reports
    assert report.learner == "kept"
    assert report.starts == 0, "no start states were collected for it"
    assert report.success >= content.target
    assert result.library == trained.library


def test_what_was_trained_in_vain_is_improved_however_well_it_does_at_a_first_look(trained: TrainingResult) -> None:
    """Else the same few episodes would say for ever that nothing is to be done."""
    content = replace(QUICK, target=0.5, assurance=20, learning=0.0)
    result = train_program(TASK, PROGRAM, SHOWN, trained.library, content, 0, trained_before=1)
    assert [report.controller for report in result.reports] == ["hold", "at"]
    assert all(report.starts for report in result.reports)


@pytest.mark.parametrize(
    ("failures", "starts", "enough"), [(3, 384, True), (6, 384, False), (2, 200, True), (4, 200, False)]
)
def test_whether_a_skill_is_good_enough_is_told_by_an_interval(failures: int, starts: int, enough: bool) -> None:
    training = ProgramTraining(TASK, PROGRAM, SHOWN, replace(QUICK, target=0.995), 0, True)
    assert training.may_be_enough(training.runs[0], 1 - failures / starts, starts) == enough
    again = replace(training, trained_before=1)
    assert not again.may_be_enough(training.runs[0], 1 - failures / starts, starts)


def test_what_may_be_good_enough_is_improved_only_where_the_program_was_trained_in_vain(
    trained: TrainingResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    demanding, learned = replace(QUICK, target=2.0), list[str]()
    monkeypatch.setattr(ProgramTraining, "may_be_enough", lambda self, *_: not self.trained_before)

    def improve(_training: object, _context: object, job: Any, warm: Skill, report: object, *_: object) -> object:  # noqa: ANN401
        learned.append(job.title)
        return warm, report

    monkeypatch.setattr("roboscribe.rl.train_program._improve", improve)
    for times, titles in ((0, []), (1, ["hold.improved", "at.improved"])):
        train_program(TASK, PROGRAM, SHOWN, trained.library, demanding, 0, trained_before=times)
        assert learned == titles


def test_a_loop_that_does_all_that_is_wanted_takes_one_turn() -> None:
    content = replace(QUICK, target=0.0, subgoal_target=0.0, worth_improving=0.0, assurance=20)
    for solve in (False, True):
        result = train_program(TASK, LOOP, SHOWN, {}, content, 0, solve=solve)
        assert [report.learner for report in result.reports] == ["clone", "clone", "kept"]


def test_what_a_clone_mostly_reaches_is_reinforced_for_the_goal_alone() -> None:
    """A subgoal's clone is left as it is where it is passable; the same clone is reinforced where nothing passes."""
    wanted = replace(QUICK, subgoal_target=2.0, learning=0.2)
    learning = [
        train_program(TASK, FIRST, SHOWN, {}, replace(wanted, passable=passable), 0, solve=False).control_steps
        for passable in (0.0, 2.0)
    ]
    assert learning[0] < learning[1]


def test_the_last_skill_is_kept_when_the_program_does_not_solve_the_task(trained: TrainingResult) -> None:
    held = {"hold": trained.library["hold"]}
    result = train_program(TASK, FIRST, SHOWN, held, QUICK, 0)
    assert result.library["hold"] is held["hold"]
    (report,) = result.reports
    assert report.learner == "kept"
    assert report.success < QUICK.worth_improving
    assert result.control_steps > 0, "finding that out took rollouts"


def test_a_subgoals_program_is_not_asked_to_solve_the_task() -> None:
    (report,) = train_program(TASK, FIRST, SHOWN, {}, QUICK, 0, solve=False).reports
    assert report.success >= 0.5


def test_a_subgoals_program_that_is_trained_again_improves_what_it_knows(trained: TrainingResult) -> None:
    held = {"hold": trained.library["hold"]}
    (report,) = train_program(TASK, FIRST, SHOWN, held, QUICK, 0, solve=False).reports
    assert report.controller == "hold"
    assert report.success >= report.warm_success >= 0.5


@pytest.mark.parametrize(("solve", "turns"), [(False, 1), (True, 2)])
def test_a_loop_whose_clones_mostly_fail_is_not_trained_together_for_a_subgoal(solve: bool, turns: int) -> None:
    """What is good enough is set so high that every clone mostly fails: a subgoal is missing, more steps are wasted."""
    demanding = replace(QUICK, worth_improving=1.1, learning=0.0, budget=4000)
    result = train_program(TASK, LOOP, SHOWN, {}, demanding, 0, solve=solve)
    assert [report.controller for report in result.reports] == ["hold", "at"] * turns


@pytest.mark.parametrize(("rate", "starts", "fails"), [(0.48, 200, False), (0.4, 200, True), (0.0, 0, True)])
def test_whether_a_clone_mostly_fails_is_told_by_an_interval(rate: float, starts: int, fails: bool) -> None:
    """48 % of 200 starts may be half of all; where there were no starts nothing was reached."""
    assert mostly_fails(QUICK, rate, starts) == fails


@pytest.mark.parametrize(
    ("hold", "at", "successes", "solve", "together"),
    [
        (1.0, 0.5, 0, False, True),  # half of 32 are expected
        (1.0, 0.5, 1, False, False),
        (0.2, 0.4, 0, False, False),  # 2 or 3 of 32 are expected: none may be chance
        (1.0, 0.5, 0, True, False),
        (1.0, None, 0, False, False),
    ],
)
def test_what_fails_together_and_not_one_by_one_lacks_a_subgoal(
    hold: float, at: float | None, successes: int, solve: bool, together: bool
) -> None:
    training = ProgramTraining(TASK, LOOP, SHOWN, QUICK, 0, solve)
    rates = {"hold": hold, "at": at}
    reports = [SkillReport(name, "clone", 50, rate, rate, 1) for name, rate in rates.items() if rate is not None]
    assert never_together(training, reports, np.arange(32) < successes) == together


def test_a_loop_is_worth_improving_where_half_of_its_turns_succeed() -> None:
    for program, blocks, turns in ((PROGRAM, 3, 1), (LOOP, 1, 1), (LOOP, 3, 3)):
        task = PointTask("toy", ("block",) * blocks)
        assert least_worth_improving(ProgramTraining(task, program, (), QUICK, 0, True)) == 0.5**turns


def test_a_subgoals_skill_is_reinforced_until_it_passes() -> None:
    at = Run("at", (mu, b, Goal(b)), AT)
    cases = ((False, 0, 0.8), (False, 1, 0.97), (True, 0, 0.9))
    for solve, trained_before, enough in cases:
        training = ProgramTraining(TASK, LOOP, SHOWN, replace(QUICK, subgoal_target=0.97), 0, solve, trained_before)
        assert training.enough(at) == pytest.approx(enough)
    anew = ProgramTraining(TASK, LOOP, SHOWN, replace(QUICK, subgoal_target=0.97, learner=SAC), 0, solve=False)
    assert anew.enough(at) == pytest.approx(0.97), "SAC would begin anew for the task"


def test_in_every_turn_a_program_is_trained_from_other_starts(trained: TrainingResult) -> None:
    run = Run("hold", (mu, b), HOLD)
    first, second = (
        ProgramTraining(TASK, PROGRAM, SHOWN, QUICK, 0, True, turn).held_out(run, trained.library, 1e5, again=1)[0]
        for turn in (1, 2)
    )
    assert not np.array_equal(first.states, second.states)


def test_a_second_round_starts_elsewhere_and_clones_nothing(
    trained: TrainingResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    find, clone = ProgramTraining.held_out, warm_start.clone_frames
    starts: list[StartPool] = []
    cloned: list[str] = []

    def held_out(
        self: ProgramTraining, run: Run, skills: Mapping[str, Skill], most: float, *, again: int = 0
    ) -> tuple[StartPool, int]:
        found = find(self, run, skills, most, again=again)
        starts.append(found[0])
        return found

    def clone_frames(blanks: Sequence[Skill], *args: object) -> object:
        cloned.append(blanks[0].name)
        return clone(blanks, *args)  # type: ignore[arg-type]

    monkeypatch.setattr(ProgramTraining, "held_out", held_out)
    monkeypatch.setattr("roboscribe.rl.best_warm_start.clone_frames", clone_frames)
    useless = trained.library["hold"].with_layers(tuple((0 * w, 0 * c) for w, c in trained.library["hold"].layers))
    known = {**trained.library, "hold": useless}  # it is better after the first round, so that there is a second one
    result = train_program(TASK, PROGRAM, SHOWN, known, replace(QUICK, target=2.0, worth_improving=0.0), 0)
    assert [report.controller for report in result.reports] == ["hold", "at"] * 2
    assert cloned == ["hold", "at"]
    assert not np.array_equal(starts[0].states, starts[2].states)


def test_an_attempt_on_the_task_itself_is_cheap_and_not_cloned() -> None:
    (report,) = train_program(TASK, BLIND, SHOWN, {}, QUICK, 0).reports
    assert report.learner in {"initial", "ppo"}
    assert report.starts <= QUICK.pool.opaque
    evaluations = 1 + QUICK.opaque_budget // (160 * QUICK.blind.evaluate_every)
    assert report.control_steps <= QUICK.opaque_budget + evaluations * QUICK.pool.opaque * TASK.horizon


def test_what_never_succeeds_is_not_reinforced() -> None:
    """Nothing is ever rewarded then: what is left to pay for is the look at it."""

    class Never(Carry):
        def solved(self, states: FloatArray) -> BoolArray:
            return np.zeros(states.shape[:-1], dtype=np.bool_)

    (report,) = train_program(Never(), BLIND, SHOWN, {}, QUICK, 0).reports
    assert (report.learner, report.success) == ("initial", 0.0)
    assert report.control_steps <= 2 * QUICK.pool.opaque * Never().horizon


@pytest.mark.parametrize(
    ("profile", "program", "budget"),
    [
        ("actions", PROGRAM, 300),
        ("actions", PROGRAM, 6000),
        ("actions", LOOP, 2000),
        ("states", FIRST, 2000),
        ("paper", FIRST, 2000),
    ],
)
def test_a_budget_is_a_budget(profile: str, program: Program, budget: int) -> None:
    """Start states, clones, evaluations and learning together; formerly `--budget 60000` reported 135,315 steps."""
    config = replace(QUICK, budget=budget, learning=1.0, target=2.0, profile=profile)  # type: ignore[arg-type]
    config = replace(config, learner=SAC) if profile == "paper" else config
    result = train_program(TASK, program, SHOWN, {}, config, 0, solve=program is not FIRST)
    for name in result.library:
        assert sum(each.control_steps for each in result.reports if each.controller == name) <= budget


def test_profile_states_reads_no_actions(trained: TrainingResult) -> None:
    config = replace(QUICK, profile="states")
    spoilt = [replace(each, actions=np.full_like(each.actions, np.nan)) for each in SHOWN]
    without = [replace(each, actions=None) for each in SHOWN]
    one, other = (train_program(TASK, PROGRAM, shown, {}, config, 0).library for shown in (spoilt, without))
    np.testing.assert_array_equal(weights(one["at"]), weights(other["at"]))
    rollouts = execute(PROGRAM, one, TASK, np.arange(60) + 1000, limits={}, batch=20)
    assert rollouts.success.mean() >= 0.8


def test_profile_paper_learns_by_sac_alone() -> None:
    config = replace(QUICK, profile="paper", learner=SAC, target=2.0)
    reports = train_program(TASK, FIRST, SHOWN, {}, config, 0, solve=False).reports
    assert [report.learner for report in reports] in (["sac"], ["initial"])


def test_a_program_that_never_gets_there_reports_no_starts() -> None:
    config = replace(QUICK, learning=0.0, pool=replace(QUICK.pool, starts=4, evaluation=2, attempts=1))
    reports = train_program(Carry(horizon=1), PROGRAM, SHOWN, {}, config, 0).reports
    assert reports[1].starts == 0
    assert reports[1].success == 0.0


def test_same_seed_same_skills_another_seed_others() -> None:
    one, same, other = (train_program(TASK, FIRST, SHOWN, {}, QUICK, seed, solve=False).library for seed in (1, 1, 2))
    np.testing.assert_array_equal(weights(one["hold"]), weights(same["hold"]))
    assert not (weights(one["hold"]) == weights(other["hold"])).all()


class KilledError(Exception):
    """Stands for kill -9."""


def test_killed_and_started_again_it_ends_alike(tmp_path: Path) -> None:
    config = replace(QUICK, target=2.0)
    straight = train_program(TASK, PROGRAM, SHOWN, {}, config, 3)

    def kill(controller: str, metrics: Mapping[str, float], step: int) -> None:
        seen.append(controller)
        if seen.count("at") == 6:
            raise KilledError

    seen: list[str] = []
    with pytest.raises(KilledError):
        train_program(TASK, PROGRAM, SHOWN, {}, config, 3, kill, tmp_path)
    assert (tmp_path / "hold.safetensors").exists()
    assert not (tmp_path / "at.last.safetensors").exists()
    again: list[str] = []
    resumed = train_program(
        TASK, PROGRAM, SHOWN, {}, config, 3, lambda controller, metrics, step: again.append(controller), tmp_path
    )
    assert "hold" not in again, "finished skills are read, not learned"
    for name in ("hold", "at"):
        np.testing.assert_array_equal(weights(resumed.library[name]), weights(straight.library[name]))
    assert resumed.reports == straight.reports


def test_step_limits_are_the_longest_segment_and_some_steps_of_confirmation() -> None:
    limits = step_limits(PROGRAM, SHOWN, TASK)
    gaps = [np.linalg.norm(each.states[:, :2] - each.states[:, 2:4], axis=1) < 0.04 for each in SHOWN]
    assert limits["hold"] == max(int(np.argmax(gap)) for gap in gaps) + 6
    assert limits["at"] == max(len(each) - 1 - int(np.argmax(gap)) for each, gap in zip(SHOWN, gaps, strict=True)) + 6
    assert AT != HOLD
