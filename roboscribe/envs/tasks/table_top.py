"""Table-top: push the mug back, open the drawer, turn the faucet left; the paper's Meta-World task.

The paper's environment, a modified LOReL, is not public. Success is tested as LOReL does.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial
from itertools import permutations

import mujoco
import numpy as np

from roboscribe.envs import table_top_demonstrator as moves
from roboscribe.envs import table_top_scene as scene
from roboscribe.envs.catalogue import Request, register
from roboscribe.envs.demonstrator import Script, ScriptedTask
from roboscribe.envs.performer import Scene
from roboscribe.envs.scene_painter import Marker, ScenePainter, Viewpoint
from roboscribe.envs.styles import STYLES
from roboscribe.envs.table_top_demonstrator import JOBS, Seen
from roboscribe.envs.table_top_world import EXTENDED, PUSHED, TURNED, TableTopWorld, layout
from roboscribe.world.layout import BoolArray, FloatArray, IntArray, Layout

SOLVED = {"mug": 0.02, "drawer": 0.02, "faucet": np.pi / 10}
"""What must be exceeded: how far the mug has been pushed back, m; the drawer's extension, m; the knob's angle, rad."""
HORIZON, HORIZON_OF_ONE = 150, 75
"""Control steps of an episode in which everything is asked, and in which one thing is."""
SPREAD = np.array([0.15, 0.15, 0.15, 0.05])
"""Standard deviation of the demonstrator's noise."""
ABOVE = 0.12
"""Height above its work from which the hand comes down vertically, where that is asked for, m."""
DIGIT = 1e-4
"""Of where the mug begins, m: nothing depends on it, so that it is as good as a lot."""
GRASPING = ("clumsy",)
"""Styles that need something to be grasped: nothing is missed or dropped here."""
VIEWPOINT = Viewpoint((0.0, 0.66, 0.08), 1.3, 140.0, -33.0)
"""From where pictures show the whole table: behind the robot's right shoulder."""
COLORS = {"mug": (0.2, 0.45, 0.85), "drawer": (0.25, 0.65, 0.3), "faucet": (0.85, 0.25, 0.2)}
GOAL_RADIUS, GOAL_OPACITY = 0.02, 0.6


@dataclass(frozen=True)
class TableTop(ScriptedTask):
    """The task of doing some of the three things.

    Args:
        name: name in the catalogue.
        jobs: what is asked, some of `JOBS`.
        goals: whether goals are in the state; else the mug's initial position is, and joints are read.
        ordered: whether demonstrations do everything in the order of `jobs`; else each in an order drawn by lot.
        timing: "faithful" (16 x 2.5 ms) or "fast" (6 x 6.7 ms).
        horizon: control steps of an episode.
    """

    name: str
    jobs: tuple[str, ...] = JOBS
    goals: bool = True
    ordered: bool = True
    timing: str = "fast"
    horizon: int = HORIZON
    action_size: int = 4
    frequency: float = scene.FREQUENCY

    @cached_property
    def layout(self) -> Layout:
        """Meaning of a state's columns."""
        return layout(self.goals)

    def world(self, batch: int) -> TableTopWorld:
        """Build a world of `batch` rows."""
        return TableTopWorld(self.goals, self.timing, batch)

    def began(self, states: FloatArray) -> FloatArray:
        """Where the mug was at the start in states (..., F): (..., 3), m."""
        goal, initial = (0, "position", True), (0, "initial_position", False)
        began: FloatArray = states[..., self.layout.columns[goal if self.goals else initial]]
        return began - PUSHED if self.goals else began

    def seen(self, states: FloatArray) -> Seen:
        """Read what the demonstrator looks at from states (..., F)."""
        columns = self.layout.columns
        places = {job: states[..., columns[i, "position", False]] for i, job in enumerate(JOBS)}
        extension, angle = states[..., columns[1, "extension", False]], states[..., columns[2, "angle", False]]
        pushed = (places["mug"] - self.began(states))[..., 1]
        return Seen(states[..., :3], places, {"mug": pushed, "drawer": extension[..., 0], "faucet": angle[..., 0]})

    def solved(self, states: FloatArray) -> BoolArray:
        """ψ_R: everything that is asked is done; states (..., F), returns (...)."""
        progress = self.seen(states).progress
        done: BoolArray = np.stack([progress[job] > SOLVED[job] for job in self.jobs]).all(axis=0)
        return done

    def order(self, states: FloatArray) -> IntArray:
        """Ranks in `JOBS` of what is asked, in the order in which it is shown in states (R, F): (R, n).

        By lot it is decided by digits of where the mug began: a script without memory keeps to it.
        """
        ranks = np.array(list(permutations(JOBS.index(job) for job in self.jobs)))
        lot = np.floor(self.began(states)[:, :2].sum(axis=1) / DIGIT).astype(np.int64)
        order: IntArray = ranks[np.zeros_like(lot) if self.ordered else lot % len(ranks)]
        return order

    def command(self, states: FloatArray, crossing: float = 0.0) -> FloatArray:
        """Decide the noiseless action (R, 4) in states (R, F)."""
        return moves.command(self.seen(states), self.order(states), crossing)

    def share(self, states: FloatArray) -> FloatArray:
        """Share (R,) of the noise in states (R, F)."""
        return moves.calm(self.seen(states))

    def look(self, state: FloatArray) -> Scene:
        """Show a performer what stands around in a state (F,); nothing is ever held."""
        places = np.stack(list(self.seen(state).places.values()))
        return Scene(state[:3], bool(state[6] < 0), float(state[3]), places, places, -1)

    @property
    def script(self) -> Script:
        """What the demonstrator does."""
        styles = tuple(style for style in STYLES if style not in GRASPING)
        return Script(self.command, partial(self.command, crossing=ABOVE), SPREAD, self.share, self.look, styles)

    def markers(self, state: FloatArray) -> list[Marker]:
        """Mark where mug, bar and knob of a state (F,) shall be; success needs less."""
        seen = self.seen(state[None])
        bar, angle = seen.places["drawer"][0].copy(), seen.progress["faucet"][0]
        bar[1] -= EXTENDED - seen.progress["drawer"][0]
        turn = scene.knob_arm(TURNED) - scene.knob_arm(angle)
        goals = {"mug": self.began(state) + PUSHED, "drawer": bar, "faucet": seen.places["faucet"][0] + turn}
        return [Marker(goals[job], GOAL_RADIUS, (*COLORS[job], GOAL_OPACITY)) for job in self.jobs]

    def painter(self, width: int, height: int) -> ScenePainter | None:
        """Draw the scene by MuJoCo, with the goals as translucent spheres; None without OpenGL."""
        model = mujoco.MjModel.__copy__(scene.base_model())
        model.site_rgba[:, 3] = 0
        model.light_active[1:] = 0
        return ScenePainter.opened(model, VIEWPOINT, self.markers, (width, height))


@register("table-top", "table-top-open", "table-top-any-order")
def table_top(request: Request) -> TableTop:
    """Make the task of all three things; `-open` without goals in the state, `-any-order` shown in any."""
    goals, ordered = not request.name.endswith("-open"), not request.name.endswith("-any-order")
    return TableTop(request.name, goals=goals, ordered=ordered, timing=request.timing)


@register(*(f"table-top-{job}" for job in JOBS))
def one_of_the_three(request: Request) -> TableTop:
    """Make the task of one thing, with the others standing around."""
    job = request.name.removeprefix("table-top-")
    return TableTop(request.name, (job,), timing=request.timing, horizon=HORIZON_OF_ONE)
