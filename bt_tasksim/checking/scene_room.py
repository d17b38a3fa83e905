"""Whether something of a scene stands in its robot before anything has moved."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from bt_tasksim.checking.report import ERROR, WARNING, Report
from bt_tasksim.core.errors import InputError
from bt_tasksim.execution.clear_start import (
    TOUCHING,
    fixture_in_robot,
    links_at_rest,
    object_in_robot,
)
from bt_tasksim.robot.description import load_robot
from bt_tasksim.robot.link_parts import DEEP, link_parts
from bt_tasksim.scene.configuration import ActorConfiguration

if TYPE_CHECKING:
    from bt_tasksim.scene.scene import Scene


def check_room(scene: Scene, worlds: Sequence[ActorConfiguration], report: Report) -> None:
    """No furniture and no object stands in the robot, which is at rest with an open hand.

    Args:
        scene: The scene.
        worlds: Draws of it.
        report: Where findings go.
    """
    robot = load_robot(scene.robot)
    try:
        links = links_at_rest(robot)
    except InputError as error:
        what = f"was not compared with what stands there: {error}"
        report.add(WARNING, scene.name, "robot", what, "put the files of its URDF there")
        return
    for said in link_parts(robot).left_out:
        report.add(WARNING, robot.name, "urdf", said, "give the shape a thickness, or leave it out")
    for fixture in worlds[0].fixtures:
        link, depth = fixture_in_robot(links, fixture)
        if depth > DEEP:
            what = f"stands {1000 * depth:.0f} mm in '{link}' of {robot.name}"
            report.add(ERROR, scene.name, f"fixture '{fixture.name}'", what, "put it elsewhere, by its 'at'")
    for name in scene.object_names:
        every = [object_in_robot(links, world, name) for world in worlds]
        deep = [found for found in every if found.depth > TOUCHING]
        if deep:
            link, depth = max(deep, key=lambda found: found.depth)
            often = f"in {len(deep)} of {len(worlds)} draws"
            what = f"is in '{link}' of {robot.name} {often}, by {1000 * depth:.0f} mm"
            level = ERROR if len(deep) == len(worlds) else WARNING
            report.add(level, scene.name, name, what, "draw it from an area beside the robot")
