"""``bt-tasksim check`` of a scene: can its worlds be drawn, reached, held and stood still?"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from bt_tasksim.checking.part_goals import check_part_goals
from bt_tasksim.checking.report import ERROR, WARNING, Report
from bt_tasksim.checking.scene_goals import check_together
from bt_tasksim.checking.scene_reach import check_goals, check_objects
from bt_tasksim.checking.scene_room import check_room
from bt_tasksim.checking.scene_still import check_still
from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError, NoDrawError
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.overlap import check_configuration

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
        check_part_goals(scene, worlds, report)
        check_together(scene, worlds[:REACHED], report)
        check_still(scene, worlds[:SETTLED], report)
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
