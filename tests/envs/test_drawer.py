"""PlaceCubesDrawer: scene, control, success, demonstrator and pictures."""

from __future__ import annotations

import numpy as np
import pytest

from roboscribe.envs import demonstrator, graphics
from roboscribe.envs.catalogue import make_task
from roboscribe.envs.drawer import geometry, moves
from roboscribe.envs.drawer.model import drawer_model
from roboscribe.envs.drawer.world import DrawerWorld
from roboscribe.envs.styles import choices
from roboscribe.envs.tasks.drawer import PlaceCubes
from roboscribe.errors import TaskError
from roboscribe.world.layout import FloatArray

ROWS = np.arange(4)


def put(extension: float, *cubes: tuple[float, float, float]) -> FloatArray:
    """Build a state with the drawer and the cubes somewhere."""
    places = np.concatenate([np.array([*cube, 0.0, 0.0, 0.0]) for cube in cubes])
    drawer = geometry.drawer_columns(np.array([geometry.CABINET]), np.array([extension]), geometry.TRAVEL)[0]
    return np.concatenate([np.zeros(7), drawer, places])


@pytest.mark.parametrize(
    ("extension", "cube", "solved"),
    [
        (0.18, (0.0, 0.0, 0.836), True),
        (0.18, (0.0, 0.0, 0.87), False),
        (0.18, (0.0, 0.16, 0.836), False),
        (0.18, (-0.1, 0.0, 0.836), False),
        (0.0, (0.0, 0.0, 0.836), False),
        (0.0, (0.18, 0.0, 0.836), True),
        (0.18, (0.2, 0.0, 0.97), False),
    ],
)
def test_a_cube_is_in_the_drawer_or_not(extension: float, cube: tuple[float, float, float], solved: bool) -> None:
    assert bool(geometry.solved(put(extension, cube), 1, closed=False)) is solved


def test_every_cube_counts_and_shut_is_shut() -> None:
    inside, outside = (0.18, 0.0, 0.836), (0.2, 0.1, 0.97)
    assert not geometry.solved(put(0.0, inside, outside), 2, closed=False)
    assert geometry.solved(put(0.0, inside), 1, closed=True)
    assert not geometry.solved(put(0.03, inside), 1, closed=True)


@pytest.mark.parametrize("cubes", range(1, geometry.MOST_CUBES + 1))
def test_cubes_and_goals_are_apart(cubes: int) -> None:
    for seed in range(20):
        episode = geometry.draw(np.random.default_rng(seed), cubes)
        for places, room in ((episode.places, 0.045), (episode.goals[:, :2], 0.05)):
            gaps = np.linalg.norm(places[:, None] - places[None], axis=2) + np.eye(cubes)
            assert gaps.min() > room
        bar = geometry.drawer_columns(episode.cabinet[None], np.array([geometry.TRAVEL]), 0.0)[0, :3]
        assert geometry.inside(episode.goals, bar).all()


@pytest.mark.parametrize("extension", [0.0, 0.1, geometry.TRAVEL])
def test_goals_go_with_a_drawer_that_has_to_be_shut_again(extension: float) -> None:
    episode, out = geometry.draw(np.random.default_rng(0), 3), np.array(extension)
    bar = geometry.drawer_columns(episode.cabinet[None], out[None], 0.0)[0, :3]
    assert geometry.inside(geometry.cube_goals(episode.goals, out, closed=True), bar).all()
    np.testing.assert_array_equal(geometry.cube_goals(episode.goals, out, closed=False), episode.goals)


def test_goals_do_not_tell_where_the_handle_is() -> None:
    """A controller that sees a cube and its goal alone must not open the drawer by knowing where it always is."""
    world = DrawerWorld(1, False, "fast", 200)
    states = world.reset(np.arange(200), np.arange(200))
    seen = np.concatenate([states[:, 12:18], np.ones((200, 1))], axis=1)
    missed = states[:, 7] - seen @ np.linalg.lstsq(seen, states[:, 7], rcond=None)[0]
    assert np.std(missed) > 0.015
    assert np.ptp(states[:, 10]) > 0.9 * geometry.AJAR
    assert np.ptp(states[:, 8]) > 0.9 * 2 * geometry.CABINET_JITTER[1]


def test_the_cabinet_stands_where_the_state_says() -> None:
    world = DrawerWorld(1, False, "fast", 2)
    states = world.reset(ROWS[:2], ROWS[:2])
    for _ in range(5):
        after = world.step(ROWS[:2], np.zeros((2, 4)))
    assert np.abs(after[:, 7:11] - states[:, 7:11]).max() < 1e-4
    assert np.allclose(after[:, 14], geometry.CABINET_TOP + geometry.HALF_CUBE, atol=1e-3)
    assert np.abs(after[:, 12:14] - states[:, 12:14]).max() < 1e-3


def test_constants_are_those_of_the_cabinet() -> None:
    model = drawer_model(1, "fast")
    assert model.joint("cabinet_slide").range.tolist() == [0.0, geometry.TRAVEL]
    handle = model.site("cabinet_handle")
    assert np.allclose(handle.pos, geometry.HANDLE)
    top, floor = model.geom("cabinet_top"), model.geom("cabinet_floor")
    assert geometry.CABINET[2] + top.pos[2] + top.size[2] == pytest.approx(geometry.CABINET_TOP)
    assert floor.pos[2] + floor.size[2] == pytest.approx(geometry.TRAY_Z[0])


def test_the_hand_starts_where_the_geometry_says_and_stays() -> None:
    world = DrawerWorld(1, False, "fast", 1)
    start = world.reset(ROWS[:1], ROWS[:1])[0]
    assert np.allclose(start[:3], (0, 0, 1.05), atol=1e-3)
    for _ in range(10):
        state = world.step(ROWS[:1], np.zeros((1, 4)))[0]
    assert np.abs(state[:3] - start[:3]).max() < 1e-3


@pytest.mark.parametrize("axis", range(3))
def test_actions_displace_the_hand(axis: int) -> None:
    world = DrawerWorld(1, False, "fast", 1)
    start = world.reset(ROWS[:1], ROWS[:1])[0]
    action = np.zeros((1, 4))
    action[0, axis] = 0.5
    for _ in range(6):
        state = world.step(ROWS[:1], action)[0]
    moved = state[:3] - start[:3]
    assert moved[axis] > 0.02
    assert np.abs(np.delete(moved, axis)).max() < 0.4 * moved[axis]


def test_fingers_open_and_close() -> None:
    world = DrawerWorld(1, False, "fast", 2)
    world.reset(ROWS[:2], ROWS[:2])
    for _ in range(15):
        states = world.step(ROWS[:2], np.array([[0, 0, 0, 1.0], [0, 0, 0, -1.0]]))
    assert states[0, 3] == pytest.approx(0.060, abs=0.003)
    assert states[1, 3] < 0.02


def test_timings_agree_in_free_space() -> None:
    worlds = [DrawerWorld(1, False, timing, 1) for timing in ("fast", "faithful")]
    for world in worlds:
        world.reset(ROWS[:1], ROWS[:1])
    for step in range(20):
        action = np.array([[np.sin(step / 5), np.cos(step / 4), 0.2, 1.0]])
        hands = [world.step(ROWS[:1], action)[0, :3] for world in worlds]
    assert np.linalg.norm(hands[0] - hands[1]) < 0.006


def test_the_demonstrator_succeeds() -> None:
    task = make_task("place-cubes-drawer-2")
    assert isinstance(task, PlaceCubes)
    wave = [demonstrator.start(3, i, choices("default"), look=task.script.look) for i in range(8)]
    demonstrator.run(task, task.world(8), wave)
    assert sum(episode.succeeded for episode in wave) >= 7


def test_the_demonstrator_has_no_memory() -> None:
    states = make_task("place-cubes-drawer-1").demonstrate(1, seed=0)[0].states
    order = np.random.default_rng(0).permutation(len(states))
    assert np.allclose(moves.command(states)[order], moves.command(states[order]), atol=1e-12)


def test_what_is_put_down_stays() -> None:
    """What a cube is brought to holds from the first time on: a loop needs that."""
    for shown in make_task("place-cubes-drawer-1").demonstrate(4, seed=1):
        gap = np.linalg.norm(shown.states[:, 12:15] - shown.states[:, 15:18], axis=1)
        assert gap[-1] < 0.02
        assert gap[(gap < 0.02).argmax() :].max() < 0.03


@pytest.mark.parametrize("name", ["place-cubes-drawer-6", "place-cubes-drawer-99-closed"])
def test_more_cubes_than_fit_are_refused(name: str) -> None:
    with pytest.raises(TaskError, match="cubes, expected 1 to 5"):
        make_task(name)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["place-cubes-drawer-3", "place-cubes-drawer-5", "place-cubes-drawer-3-closed"])
def test_the_demonstrator_succeeds_nearly_always(name: str) -> None:
    task = make_task(name)
    assert isinstance(task, PlaceCubes)
    wave = [demonstrator.start(3, i, choices("default"), look=task.script.look) for i in range(64)]
    demonstrator.run(task, task.world(64), wave)
    assert np.mean([episode.succeeded for episode in wave]) >= 0.95


@pytest.mark.skipif(not graphics.backends(), reason="no OpenGL library on this machine")
def test_pictures_show_the_cubes() -> None:
    task = make_task("place-cubes-drawer-1")
    world = task.world(1)
    state = world.reset(ROWS[:1], ROWS[:1])[0]
    painter = task.painter(320, 240)
    assert painter is not None
    picture = painter(state, world.save(ROWS[:1])[0]).astype(int)
    painter.close()
    red = (picture[..., 0] > 2 * picture[..., 1]) & (picture[..., 0] > 60)
    assert picture.shape == (240, 320, 3)
    assert red.sum() > 20
