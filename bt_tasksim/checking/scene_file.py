"""``bt-tasksim check`` of a scene: can its worlds be drawn, reached, held and stood still?"""

from __future__ import annotations

import math
from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from bt_tasksim.checking.part_goals import check_part_goals
from bt_tasksim.checking.report import ERROR, WARNING, Report
from bt_tasksim.checking.scene_goals import check_together
from bt_tasksim.checking.scene_reach import check_goals, check_objects
from bt_tasksim.checking.scene_room import check_room
from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError, NoDrawError
from bt_tasksim.core.world import Command
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.overlap import check_configuration
from bt_tasksim.scene.success import at_rest

if TYPE_CHECKING:
    from bt_tasksim.scene.scene import Scene

DRAWS = 50
"""Worlds that are drawn."""
COMPARED = 20
"""Worlds of which it is seen whether things overlap."""
REACHED = 6
"""Worlds of which it is seen what the arm reaches."""
SETTLED = 3
"""Worlds that are simulated for a moment."""
MOMENT = 1.0
"""Seconds for which nothing should move."""
MOVED, TILTED = 0.01, math.radians(5.0)
"""Metres and radians by which an object may move in that moment."""


def check_scene(scene: Scene, report: Report | None = None) -> Report:
    """Check a scene: its draws, what overlaps, what the hand reaches and holds, its goals, what falls over.

    Args:
        scene: The scene.
        report: Where findings go; by default a new one.

    Raises:
        InputError: The robot's file is no good.
        MachineError: The physics engine is not installed.
    """
    report = Report() if report is None else report
    worlds = _draw(scene, report)
    if worlds:
        _check_overlaps(scene, worlds[:COMPARED], report)
        _check_places(scene, worlds, report)
        check_room(scene, worlds[:REACHED], report)
        check_objects(scene, worlds[:REACHED], report)
        check_goals(scene, worlds[:REACHED], report)
        check_part_goals(scene, worlds[:REACHED], report)
        check_together(scene, worlds[:REACHED], report)
        _check_still(scene, worlds[:SETTLED], report)
    things = f"{len(scene.objects)} object{'' if len(scene.objects) == 1 else 's'}"
    report.done(
        f"scene {scene.name}, {things} for {load_robot(scene.robot).name}: "
        f"{len(worlds)} of {DRAWS} draws, overlaps, reach, goals, rest"
    )
    return report


def _draw(scene: Scene, report: Report) -> list[ActorConfiguration]:
    """The worlds that can be drawn."""
    worlds: list[ActorConfiguration] = []
    failed: dict[str, list[int]] = {}
    for seed in range(DRAWS):
        try:
            worlds.append(scene.sample(seed))
        except InputError as error:
            why = error.__cause__ if isinstance(error, NoDrawError) else error
            failed.setdefault(str(why or error), []).append(seed)
    for sentence, seeds in failed.items():
        level = WARNING if worlds else ERROR
        what = f"fails in {len(seeds)} of {DRAWS} draws, such as with seed {seeds[0]}"
        report.add(level, scene.name, "draws", what, sentence)
    return worlds


def _check_overlaps(scene: Scene, worlds: list[ActorConfiguration], report: Report) -> None:
    said = Counter[str]()
    for world in worlds:
        try:
            check_configuration(world)
        except InputError as error:
            said[str(error)] += 1
    if said:
        sentence, remedy = next(iter(said)).split(": ", 1)
        what = f"has things in each other in {said.total()} of {len(worlds)} draws, such as {sentence}"
        report.add(ERROR, scene.name, "objects", what, remedy)


def _check_places(scene: Scene, worlds: list[ActorConfiguration], report: Report) -> None:
    """Every object stands on its place, and not beyond its edge or under the next board."""
    for name in scene.object_names:
        off, high = 0, 0
        for world in worlds:
            actor = next(o for o in world.objects if o.name == name)
            place = next(p for p in world.places if p.name == actor.on)
            local = poses.localise(place.pose, np.array(actor.pose[:3]))
            beyond = np.abs(local[:2] - place.centre) - np.array(place.extent) / 2
            off += bool((beyond > 0.0).any())
            high += actor.model().extent[2] > place.height > 0.0 and not place.container
        on = worlds[0].objects[list(scene.object_names).index(name)].on
        if off:
            what = f"stands beyond the edge of '{on}' in {off} of {len(worlds)} draws"
            report.add(ERROR, scene.name, name, what, "change its 'at' or 'area'")
        if high:
            what = f"is higher than the free space above '{on}' in {high} of {len(worlds)} draws"
            report.add(ERROR, scene.name, name, what, "take a lower object, or another place")


def _check_still(scene: Scene, worlds: list[ActorConfiguration], report: Report) -> None:
    """Nothing moves by itself in the first moment."""
    from bt_tasksim.execution.pipelines import EngineOptions, build_pipeline

    robot = load_robot(scene.robot)
    moved: dict[str, tuple[float, float]] = {}
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
            for k, actor in enumerate(world.objects):
                shift = float(poses.norm(hidden.objects[k, :3] - np.array(actor.pose[:3])))
                up = poses.z_axis(hidden.objects[k, 3:]) @ poses.z_axis(np.array(actor.pose[3:]))
                tilt = math.acos(min(1.0, max(-1.0, float(up))))
                before = moved.get(actor.name, (0.0, 0.0))
                moved[actor.name] = max(before[0], shift), max(before[1], tilt)
    finally:
        pipeline.close()
    for name, (shift, tilt) in moved.items():
        if shift > MOVED or tilt > TILTED:
            what = (
                f"does not stand where it is put: in {MOMENT:g} s it moves by {1000 * shift:.0f} mm and "
                f"tilts by {math.degrees(tilt):.0f} degrees"
            )
            report.add(ERROR, scene.name, name, what, "give it a foot to stand on, or another place")
    if restless and not any(shift > MOVED or tilt > TILTED for shift, tilt in moved.values()):
        what = f"is still in motion {MOMENT:g} s after the start in {restless} of {len(worlds)} draws"
        report.add(WARNING, scene.name, "objects", what, "see that nothing rolls or rocks")
