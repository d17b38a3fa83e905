from typing import NamedTuple

import numpy as np

from bt_tasksim import ConceptModel, Goal, ObjectSpec, Scene, SpotSpec, poses
from bt_tasksim.motion import minimum_jerk
from bt_tasksim.parameters import Direction, Metres, MetresPerSecond, Newtons, ObjectName
from bt_tasksim.world import Command
from concept_nodes import Grasp, Release
from concept_nodes.holding import HOLDING, holding, not_held
from trees import sequence


class Progress(NamedTuple):
    start: np.ndarray  # (..., 7) tool pose at the begin
    pressed: np.ndarray  # (...) how far the target is pushed below it, m
    covered: np.ndarray  # (...) share of the way, 0 to 1


class Wipe(ConceptModel):
    """Slide the held target along what it stands on, and keep pressing."""

    target: ObjectName
    direction: Direction  # unit vector, robot base frame
    distance: Metres
    press: Newtons = 4.0
    speed: MetresPerSecond = 0.08

    maintains = (HOLDING,)  # reached by Grasp, ended by Release: losing it is FAILURE
    default_timeout = 12.0

    def initial_state(self, seen):
        return "" if bool(holding(seen, self.target)) else not_held(seen, self.target)

    def begin(self, seen):
        return Progress(seen.tool, np.float64(0.0), np.float64(0.0))

    def advance(self, action, seen, memory):
        xp, period = poses.array_namespace(seen.tool), seen.world.control_period
        missing = self.press - self.felt(seen)
        pressed = xp.clip(memory.pressed + 0.001 * period * missing, -0.005, 0.015)
        moving = xp.where(seen.elapsed > 0.5, self.speed * period / self.distance, 0.0)
        return memory._replace(pressed=pressed, covered=xp.clip(memory.covered + moving, 0.0, 1.0))

    def command(self, action, seen, memory):
        xp = poses.array_namespace(seen.tool)
        along = poses.constant(np.asarray(self.direction) * self.distance, seen.tool)
        down = poses.constant([0.0, 0.0, -1.0], seen.tool)
        position = memory.start[..., :3] + minimum_jerk(memory.covered)[..., None] * along
        position = position + memory.pressed[..., None] * down
        return Command(tool=xp.concat([position, memory.start[..., 3:]], axis=-1))

    def done(self, seen, memory):
        return (memory.covered >= 1.0) & (self.necessary_cost(seen, memory) < self.tolerance)

    def maintained(self, goal, seen, memory):
        return holding(seen, self.target)

    def violated(self, seen, memory):
        return self.felt(seen) > 10.0 * self.press

    def necessary_cost(self, seen, memory):
        return abs(self.distance - self.way(seen.tool, memory))

    def sufficient_cost(self, known, memory):
        xp = poses.array_namespace(known.hidden.objects)
        return xp.where(xp.asarray(known.supported(self.target)), 0.0, 1.0)

    def explain(self, seen, memory):
        return f"{1000 * float(self.way(seen.tool, memory)):.0f} mm wiped, {float(self.felt(seen)):.1f} N pressed"

    def felt(self, seen):  # external force along +z of the robot base frame, N
        return poses.rotate(seen.tool[..., 3:], seen.wrench[..., :3])[..., 2]

    def way(self, tool, memory):  # how far the tool has come along the direction, m
        xp = poses.array_namespace(tool)
        d = poses.constant(self.direction, tool)
        return xp.sum((tool[..., :3] - memory.start[..., :3]) * d, axis=-1)


def scene(robot="panda"):
    return Scene(
        robot,
        objects={
            "sponge": ObjectSpec(kinds=("box",), on="table", centre=(0.0, -0.10), area=(0.0, 0.0), yaw=0.2)
        },
        spots=[SpotSpec("end", on="table", centre=(0.0, 0.05), area=(0.0, 0.0))],
        goal=Goal("sponge", "end", angle_tolerance=0.3),
        name="wipe",
    )


def build():
    return sequence(
        "wipe the table", Grasp("sponge"), Wipe("sponge", (0.0, 1.0, 0.0), 0.15), Release("sponge")
    )
