"""The batched engine, against plain MuJoCo and against states that leave physics."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

from roboscribe.envs.engine import CONTROL, INTEGRATION, Engine, columns, integration_state, thread_count
from roboscribe.world.layout import FloatArray

PENDULUM = """
<mujoco>
  <option timestep="0.002"/>
  <worldbody>
    <body name="guide" mocap="true" pos="0 0 1"/>
    <body name="bob" pos="0 0 1">
      <joint name="hinge" axis="0 1 0"/>
      <geom size="0.05" pos="0.3 0 0"/>
      <site name="tip" pos="0.3 0 0"/>
    </body>
    <body pos="0.1 0 0.4"><freejoint/><geom type="box" size="0.05 0.05 0.05"/></body>
    <geom type="plane" size="2 2 1"/>
  </worldbody>
  <actuator><motor joint="hinge"/></actuator>
  <sensor><framepos objtype="site" objname="tip"/></sensor>
</mujoco>
"""
ALL = np.arange(4)


@pytest.fixture
def model() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(PENDULUM)


def start(model: mujoco.MjModel, batch: int = 4) -> Engine:
    engine = Engine(model, batch, substeps=20)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    data.qacc_warmstart[:] = 0
    rows = np.arange(batch)
    states = np.repeat(integration_state(model, data)[None], batch, axis=0)
    engine.put(rows, states, np.repeat(data.sensordata[None], batch, axis=0))
    return engine


def torque(*values: float) -> FloatArray:
    return np.array([[value, 0, 0, 1, 1, 0, 0, 0] for value in values])


def test_columns_name_the_parts_of_a_state(model: mujoco.MjModel) -> None:
    assert columns(model, int(mujoco.mjtState.mjSTATE_TIME)).tolist() == [0]
    assert columns(model, int(mujoco.mjtState.mjSTATE_QPOS)).tolist() == list(range(1, 9))
    assert columns(model, CONTROL).size == 1 + 3 + 4


def test_a_control_step_is_plain_mujoco(model: mujoco.MjModel) -> None:
    engine, data = start(model), mujoco.MjData(model)
    for _ in range(25):
        mujoco.mj_setState(model, data, engine.states[2], INTEGRATION)
        data.ctrl[:] = 0.7
        mujoco.mj_step(model, data, nstep=20)
        engine.step(ALL, torque(0, 0.1, 0.7, 1))
    assert data.qpos.tolist() == engine.states[2, 1:9].tolist()
    assert data.sensordata.tolist() == engine.sensors[2].tolist()
    assert data.time == pytest.approx(25 * 0.04)


def test_what_was_saved_comes_back(model: mujoco.MjModel) -> None:
    engine = start(model)
    engine.step(ALL, torque(0, 0.1, 0.7, 1))
    kept = engine.save(ALL)
    engine.step(ALL, torque(1, 1, 1, 1))
    after = engine.save(ALL)
    engine.load(ALL[::-1], kept[::-1])
    assert (engine.save(ALL) == kept).all()
    engine.step(ALL, torque(1, 1, 1, 1))
    assert (engine.save(ALL) == after).all()


@pytest.mark.parametrize("broken", [np.nan, np.inf, 1e12])
def test_a_row_that_leaves_physics_fails_alone(
    model: mujoco.MjModel, broken: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    engine, sane = start(model), start(model)
    speed = columns(model, int(mujoco.mjtState.mjSTATE_QVEL))[0]
    engine.states[1, speed] = broken
    before = engine.states[1].copy()
    for world in (engine, sane):
        world.step(ALL, torque(0, 0.1, 0.7, 1))
        world.step(ALL, torque(0, 0.1, 0.7, 1))
    assert engine.failed.tolist() == [False, True, False, False]
    assert np.array_equal(engine.states[1], before, equal_nan=True), "it stays where it was"
    others = [0, 2, 3]
    assert (engine.states[others] == sane.states[others]).all()
    engine.load(ALL[1:2], sane.save(ALL[1:2]))
    assert not engine.failed.any()
    assert not list(tmp_path.iterdir()), "no log file in the working directory"


def test_failing_in_the_last_substep_counts(model: mujoco.MjModel) -> None:
    engine = start(model)
    engine.substeps, engine.interval = 1, 0.002
    engine._after, engine._sensed = engine._after[:, :1].copy(), engine._sensed[:, :1].copy()
    engine.states[0, columns(model, int(mujoco.mjtState.mjSTATE_TIME))] = 3.0
    engine.states[0, columns(model, int(mujoco.mjtState.mjSTATE_QVEL))[0]] = 1e12
    engine.step(ALL, torque(0, 0, 0, 0))
    assert engine.failed.tolist() == [True, False, False, False]


def test_rows_without_a_state_are_refused(model: mujoco.MjModel) -> None:
    with pytest.raises(ValueError, match=r"rows \[1\] were never"):
        Engine(model, 2, 20).step(np.array([1]), torque(0))


def test_threads_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.cpu_count", lambda: 3)
    assert [thread_count(n) for n in (0, 2, 8)] == [1, 2, 3]
