"""Whether anything of a scene moves by itself in the first moment of a run."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from bt_tasksim.checking.report import ERROR, WARNING, Report
from bt_tasksim.core import poses
from bt_tasksim.core.joints import Joints
from bt_tasksim.core.poses import Array
from bt_tasksim.core.units import METRES, RADIANS
from bt_tasksim.core.world import Command
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.joints import Joint
from bt_tasksim.scene.success import at_rest

if TYPE_CHECKING:
    from bt_tasksim.scene.scene import Scene

MOMENT = 1.0
"""Seconds for which nothing should move."""
MOVED, TILTED = 0.01, math.radians(5.0)
"""Metres and radians by which an object, or a part of furniture along its joint, may move in that moment."""


def check_still(scene: Scene, worlds: Sequence[ActorConfiguration], report: Report) -> None:
    """Objects stand where they are put, and parts of furniture stay as far open as they are.

    Args:
        scene: The scene.
        worlds: Draws of it, which are simulated for a moment.
        report: Where findings go.
    """
    ends, restless = _simulated(scene, worlds)
    moved: dict[str, tuple[float, float]] = {}
    left: dict[str, tuple[Joint, float, float]] = {}
    for world, after in zip(worlds, ends, strict=True):
        for actor in world.objects:
            begun, ended = np.array(actor.pose), after[actor.name]
            if actor.joint is not None:
                way = _went(actor.joint, begun, ended)
                if actor.name not in left or _far(way) > _far(left[actor.name]):
                    left[actor.name] = way
                continue
            shift = float(poses.norm(ended[:3] - begun[:3]))
            up = poses.z_axis(ended[3:]) @ poses.z_axis(begun[3:])
            tilt = math.acos(min(1.0, max(-1.0, float(up))))
            before = moved.get(actor.name, (0.0, 0.0))
            moved[actor.name] = max(before[0], shift), max(before[1], tilt)
    fallen = {name: found for name, found in moved.items() if found[0] > MOVED or found[1] > TILTED}
    gone = {name: way for name, way in left.items() if _far(way) > 1.0}
    for name, (shift, tilt) in fallen.items():
        what = (
            f"does not stand where it is put: in {MOMENT:g} s it moves by {1000 * shift:.0f} mm and "
            f"tilts by {math.degrees(tilt):.0f} degrees"
        )
        report.add(ERROR, scene.name, name, what, "give it a foot to stand on, or another place")
    for name, way in gone.items():
        report.add(WARNING, scene.name, name, _said(way), "let it start where it stays, or give it friction")
    if restless and not fallen and not gone:
        what = f"is still in motion {MOMENT:g} s after the start in {restless} of {len(worlds)} draws"
        report.add(WARNING, scene.name, "objects", what, "see that nothing rolls or rocks")


def _simulated(scene: Scene, worlds: Sequence[ActorConfiguration]) -> tuple[list[Mapping[str, Array]], int]:
    """Poses ``(7,)`` by name after that moment in each world, and in how many worlds there is motion then."""
    from bt_tasksim.execution.pipelines import EngineOptions, build_pipeline

    robot = load_robot(scene.robot)
    ends: list[Mapping[str, Array]] = []
    restless = 0
    pipeline = build_pipeline(robot, EngineOptions(noise="none"))
    try:
        for world in worlds:
            pipeline.reset(world, world.world_model([tip.name for tip in robot.tips], robot.opening))
            for _ in range(round(MOMENT * world.control_frequency)):
                pipeline.step(Command())
            hidden = pipeline.hidden()
            assert hidden is not None
            restless += not at_rest(hidden.velocities[: len(world.objects)])
            ends.append({actor.name: hidden.objects[k].copy() for k, actor in enumerate(world.objects)})
    finally:
        pipeline.close()
    return ends, restless


def _went(joint: Joint, begun: Array, ended: Array) -> tuple[Joint, float, float]:
    """A part's joint and its values at two poses ``(7,)``, metres or radians."""
    before, after = Joints.of([joint, joint]).value(np.stack([begun, ended]))
    return joint, float(before), float(after)


def _far(way: tuple[Joint, float, float]) -> float:
    """How far a part has gone, in shares of how far it may."""
    joint, before, after = way
    return abs(after - before) / (TILTED if joint.turns else MOVED)


def _said(way: tuple[Joint, float, float]) -> str:
    """In words, with what may have moved it."""
    joint, before, after = way
    unit = RADIANS if joint.turns else METRES
    causes = {"spring": joint.stiffness > 0.0, "latch": joint.latch > 0.0, "weight": True}
    by = " or ".join(f"its {cause}" for cause, has in causes.items() if has)
    return f"does not stay at {unit.text(before)}: in {MOMENT:g} s {by} takes it to {unit.text(after)}"
