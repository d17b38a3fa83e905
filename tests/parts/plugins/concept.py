"""A concept from outside: tilt what the hand holds, and set it upright again."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bt_tasksim.concept.contact import ContactChange, ContactState
from bt_tasksim.concept.demonstrated import Shown
from bt_tasksim.concept.parameters import Direction, MetresPerSecond, Newtons, ObjectName, Radians
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept.task import Task
from bt_tasksim.core import poses
from bt_tasksim.core.registry import register
from bt_tasksim.planning.reference_motion import plan
from concept_nodes.carry import Carry, MoveMemory


@register("concept")
class Decant(Carry):
    """Tilt a held object about a horizontal axis through the tool, and set it upright again (keeps NC).

    Args:
        target: The held object.
        axis: Axis of the turn, robot base frame.
        angle: How far it is tilted.
        speed: Peak speed of the tool.
        force_limit: Force at the wrist at which the task is broken off.
    """

    target: ObjectName
    axis: Direction = (1.0, 0.0, 0.0)
    angle: Radians = 0.8
    speed: MetresPerSecond = 0.3
    force_limit: Newtons = 60.0

    presentation = Presentation(
        colour="#2a7f9e", symbol="◒", spoken=r"\bdecant", sayings=("I decant the {}",)
    )
    contact = ContactChange(ContactState.NC, ContactState.NC, motion="rotation")

    def begin(self, seen: Seen) -> MoveMemory:
        """There and back, on the spot."""
        xp = poses.array_namespace(seen.tool)
        turn = [np.cos(self.angle / 2), *(np.sin(self.angle / 2) * np.asarray(self.axis))]
        tilted = poses.quat_multiply(poses.constant(turn, seen.tool), seen.tool[:, 3:])
        tilted = xp.concat([seen.tool[:, :3], tilted], axis=-1)
        return MoveMemory(plan([seen.tool, tilted, seen.tool], self.speed))

    @classmethod
    def recognise(cls, shown: Shown, tasks: Sequence[Task]) -> Sequence[Task]:
        """A carried object that is tilted by more than 30 degrees and comes upright again."""
        found = []
        for task in tasks:
            if task.concept != "bring":
                continue
            span = (shown.time >= task.start) & (shown.time <= task.end)
            pose = shown.objects[task.parameters["target"]].pose[span]
            up = poses.rotate(pose[:, 3:], np.broadcast_to([0.0, 0.0, 1.0], (len(pose), 3)))
            tilt = np.arccos(np.clip(up[:, 2], -1.0, 1.0))
            if not tilt.max() > np.radians(30.0) > max(tilt[0], tilt[-1]):
                continue
            top = int(tilt.argmax())
            axis = np.cross([0.0, 0.0, 1.0], up[top])
            over = shown.time[span][tilt > 0.1]
            values = {"axis": axis / np.linalg.norm(axis), "angle": float(tilt[top])}
            parameters = {"target": task.parameters["target"], **values}
            found.append(Task("decant", float(over[0]), float(over[-1]), task.confidence, parameters))
        return sorted([*tasks, *found], key=lambda task: task.start)

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """How far."""
        return f"by {np.degrees(parameters['angle']):.0f} degrees"
