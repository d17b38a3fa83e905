"""Push: push an object along what it stands on, until it lies where it should.

A complete concept to change into one of your own. See it with ``bt-tasksim check push.py``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from bt_tasksim import ConceptModel, poses
from bt_tasksim.context import Known, Seen
from bt_tasksim.motion import Path, minimum_jerk, plan, sample
from bt_tasksim.parameters import Direction, Metres, MetresPerSecond, ObjectName, Ratio
from bt_tasksim.poses import Array, array_namespace
from bt_tasksim.robot import RobotDescription
from bt_tasksim.world import Command

GAP = 0.02
"""Metres between the hand and the object when the push begins, as far as it is known."""
SHORT = 0.012
"""Metres by which the reference motion stops short: what was pushed too far cannot be pulled back."""
FASTER = 0.06
"""Speed in m/s with which an action of 1 pushes on, and one of -1 draws back."""
MOST = 0.04
"""Metres that it can do so in all."""
MISS = 0.005
"""Metres by which the object may lie beside its goal."""
STILL = 0.05
"""Speed in m/s below which the object counts as at rest."""


class PushMemory(NamedTuple):
    """What is remembered from tick to tick; batch dimensions ``(...)``.

    Attributes:
        path: Way of the tool to a place behind the object.
        first: Estimated position ``(..., 3)`` of the object at the start, metres.
        moved: How far the object had moved at the previous tick, metres.
        more: How much farther than the reference motion the tool is pushed, metres.
    """

    path: Path
    first: Array
    moved: Array
    more: Array


class Push(ConceptModel):
    """Push an object along what it stands on, which keeps its contact (PC).

    It does not know exactly where the object is, nor how large, heavy and slippery it is. So a
    planned motion pushes it too far or not far enough. A learned policy sees how far it has moved, pushes on,
    and says when it is done.

    Args:
        target: The object.
        direction: Direction in which it is pushed, robot base frame.
        distance: How far.
        speed: Speed of the reference motion.
        closure: How far the hand is closed: two fingertips side by side push straighter than one.
    """

    target: ObjectName
    direction: Direction = (1.0, 0.0, 0.0)
    distance: Metres = 0.06
    speed: MetresPerSecond = 0.3
    closure: Ratio = 0.6

    actions = 1  # how fast the tool pushes on where the reference motion has ended: 1 is FASTER, -1 back
    observables = ("objects", "contacts", "time")  # what features looks at: no forces, no hidden state
    is_task_model = False  # something is unknown, so there is something to learn
    default_timeout = 3.0

    def initial_state(self, seen: Seen) -> str:
        """The object must be seen."""
        return "" if np.isfinite(seen.object(self.target)[0]) else f"{self.target} is not seen"

    def begin(self, seen: Seen) -> PushMemory:
        """Plan the way to a place behind the object. This runs once, for one robot: no batches here."""
        d, now = np.asarray(self.direction), seen.object(self.target)
        across = poses.rotate(now[3:] * np.array([1.0, -1.0, -1.0, -1.0]), d)  # seen from the object
        half = float(np.abs(across) @ np.asarray(seen.model(self.target).extent)) / 2
        down = poses.frame_from_axes(np.array([0.0, 0.0, -1.0]), poses.cross(d, np.array([0.0, 0.0, 1.0])))
        behind = poses.pose(now[:3] - (half + GAP) * d, down)
        above = behind.copy()
        above[2] = max(float(seen.tool[2]), float(behind[2]) + 0.08)
        path = plan([seen.tool, above, behind], speed=0.6)
        return PushMemory(path, now[:3], np.float64(0.0), np.float64(0.0))

    # From here on everything is pure and batched: [..., :3] for [:3], xp.where for if.

    def advance(self, action: Array, seen: Seen, memory: PushMemory) -> PushMemory:
        """The memory of the next tick."""
        return memory._replace(moved=self.moved(seen, memory), more=self.more(action, seen, memory))

    def decides(self, seen: Seen, memory: PushMemory) -> Array:
        """A learned policy is asked once the reference motion has ended."""
        return seen.elapsed >= memory.path.duration + self.duration

    @classmethod
    def layout(cls, robot: RobotDescription) -> Mapping[str, int]:
        """What `features` holds, in its order."""
        return {"missing": 2, "moving": 1, "more": 1, "time": 1, "contacts": len(robot.tips)}

    def features(self, seen: Seen, memory: PushMemory) -> Array:
        """What a learned policy sees ``(..., n)``: numbers of the order of one, from `observables` alone."""
        moved = self.moved(seen, memory)
        missing = self.distance - moved
        columns = (
            missing / 0.02,
            poses.clip(missing / (2.0 * MISS), -1.0, 1.0),  # finer where it matters
            (moved - memory.moved) / 0.01,
            memory.more / 0.02,
            seen.elapsed - memory.path.duration - self.duration,
        )
        xp = array_namespace(seen.object(self.target))
        contacts = xp.astype(xp.asarray(seen.contacts), moved.dtype)
        return xp.concat([xp.stack(columns, axis=-1), contacts], axis=-1)

    def command(self, action: Array, seen: Seen, memory: PushMemory) -> Command:
        """The tool's pose and the hand's closure that are asked for."""
        behind = sample(memory.path, seen.elapsed)
        xp = array_namespace(behind)
        ahead = self.way(seen, memory) + self.more(action, seen, memory)
        position = behind[..., :3] + ahead[..., None] * poses.constant(self.direction, behind)
        hand = xp.full_like(behind[..., :1], self.closure)
        return Command(tool=xp.concat([position, behind[..., 3:]], axis=-1), hand=hand)

    def done(self, seen: Seen, memory: PushMemory) -> Array:
        """The programmed policy's completion signal: the reference motion has ended."""
        return seen.elapsed >= memory.path.duration + self.duration + 0.2

    def necessary_cost(self, seen: Seen, memory: PushMemory) -> Array:
        """How far the object seems to be from its goal, over 0.1 m."""
        return abs(self.distance - self.moved(seen, memory)) / 0.1

    def violated(self, seen: Seen, memory: PushMemory) -> Array:
        """The object was pushed much too far."""
        return self.moved(seen, memory) > self.distance + 0.05

    def sufficient_cost(self, known: Known, memory: PushMemory) -> Array:
        """What only a simulator knows, in units of what is tolerable: below 1 the goal is reached.

        The larger of the object's distance from its goal over `MISS`, and of its speed over `STILL`.
        """
        now, xp = known.object(self.target), array_namespace(known.hidden.objects)
        speed = poses.norm(known.velocity(self.target)[..., :3]) / STILL
        if known.began is None:
            return speed
        before = Known(known.began, known.world).object(self.target)
        moved = poses.dot(now[..., :3] - before[..., :3], poses.constant(self.direction, now))
        return xp.maximum(speed, abs(moved - self.distance) / MISS)

    def explain(self, seen: Seen, memory: PushMemory) -> str:
        """Where things stand, for people."""
        moved = 1000 * float(self.moved(seen, memory))
        return f"{self.target} was pushed by {moved:.0f} of {1000 * self.distance:.0f} mm"

    def moved(self, seen: Seen, memory: PushMemory) -> Array:
        """How far ``(...)`` the object has moved along the direction, as it is seen, metres."""
        gone = seen.object(self.target)[..., :3] - memory.first
        return poses.dot(gone, poses.constant(self.direction, gone))

    @property
    def duration(self) -> float:
        """Seconds that the reference motion pushes; 1.875 is a minimum-jerk motion's peak over its mean."""
        return 1.875 * (self.distance + GAP - SHORT) / self.speed

    def way(self, seen: Seen, memory: PushMemory) -> Array:
        """How far ``(...)`` the reference motion has pushed, metres."""
        share = poses.clip((seen.elapsed - memory.path.duration) / self.duration, 0.0, 1.0)
        return minimum_jerk(share) * (self.distance + GAP - SHORT)

    def more(self, action: Array, seen: Seen, memory: PushMemory) -> Array:
        """How much farther ``(...)`` the tool is pushed at the end of this tick, metres."""
        xp = array_namespace(seen.tool)
        step = poses.clip(action[..., 0], -1.0, 1.0) * FASTER * seen.world.control_period
        more = xp.where(self.decides(seen, memory), step, xp.zeros_like(step))
        return poses.clip(memory.more + more, -MOST, MOST)
