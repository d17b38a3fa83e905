"""Whether the goals of a scene can be reached together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bt_tasksim.checking.report import ERROR, WARNING, Report
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import PlaceModel
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.outlines import distance, rectangle
from bt_tasksim.scene.relations import relation_named
from bt_tasksim.scene.relations.base import Presence
from bt_tasksim.scene.relations.joint_goals import JointGoal
from bt_tasksim.scene.spatial_laws import SUNK
from bt_tasksim.scene.specs import Goal

if TYPE_CHECKING:
    from bt_tasksim.scene.scene import Scene

SLENDER = 0.7
"""Share of half a bounding box's shorter side that is surely solid about its middle, of what stands there."""

VALUES = 1001
"""Values of a joint, from its lower limit to its upper one, at which two goals of a part are asked about."""


def check_together(scene: Scene, worlds: Sequence[ActorConfiguration], report: Report) -> None:
    """No two goals for the end of a run exclude each other.

    Goals that have to be true once may follow one another, and functions say nothing of what they ask: these
    are left out.

    Args:
        scene: The scene.
        worlds: Draws of it.
        report: Where findings go.
    """
    found: dict[str, int] = {}
    for world in worlds:
        for sentence in dict.fromkeys(contradictions(world)):
            found[sentence] = found.get(sentence, 0) + 1
    for sentence, count in found.items():
        level = ERROR if count == len(worlds) else WARNING
        what = f"cannot be reached together in {count} of {len(worlds)} draws: {sentence}"
        report.add(level, scene.name, "goals", what, "leave one away, or say when='once' of what comes first")


def contradictions(world: ActorConfiguration) -> Iterator[str]:
    """What is wrong with pairs of goals that have to be true at the end, and with circles of them."""
    goals = [goal for goal in world.goals if goal.when == "end"]
    for one, two in combinations(goals, 2):
        if why := _excluded(one, two, world):
            yield f"'{one}' and '{two}' ({why})"
    if circle := _circle(goals):
        yield f"{' carries '.join(repr(name) for name in circle)} (that goes round in a circle)"


def _excluded(one: Goal, two: Goal, world: ActorConfiguration) -> str:
    """Why two goals cannot both be reached; empty where nothing says so."""
    relations = [relation_named(goal.relation) for goal in (one, two)]
    held = [relation.in_hand for relation in relations]
    of_parts = [relation for relation in relations if isinstance(relation, JointGoal)]
    if one.object == two.object and len(of_parts) == 2:
        return _both_ways(of_parts, (one, two), world)
    if one.object != two.object:
        if all(held):
            return "one hand holds one object"
        return "" if any(held) else _at_one_place(one, two, world)
    if held[0] != held[1]:
        return f"'{one.object}' is in the hand in one, and let go in the other"
    if all(held):
        apart = abs(one.height - two.height) > one.position_tolerance + two.position_tolerance
        return "they ask for different heights" if apart else ""
    places = {place.name: place for place in world.places}
    if one.place not in places or two.place not in places:
        return ""
    first, second = (_region(goal, places[goal.place], world) for goal in (one, two))
    if first is None or second is None:
        return ""
    gap = distance(first.outline, second.outline) - first.slack - second.slack
    if gap > 0.0:
        return f"'{one.place}' and '{two.place}' are {1000 * gap:.0f} mm too far apart"
    if first.low > second.high or second.low > first.high:
        return f"'{one.place}' and '{two.place}' are at different heights"
    return ""


def _both_ways(relations: Sequence[JointGoal], goals: Sequence[Goal], world: ActorConfiguration) -> str:
    """One part that is to stand in two ways, of which no value of its joint is both."""
    part = next(actor for actor in world.objects if actor.name == goals[0].object)
    joint = part.model().joint
    if joint is None:
        return ""
    values = np.linspace(*joint.limits, VALUES)
    so = [relation.asked(goal, joint, values).so for relation, goal in zip(relations, goals, strict=True)]
    return "" if (so[0] & so[1]).any() else f"'{part.name}' cannot stand both ways"


class _Region(NamedTuple):
    """Where a goal lets the middle of its object be.

    Attributes:
        outline: From above ``(n, 2)``, robot base frame, metres.
        slack: Metres beyond it.
        low: Least height of its lowest point, metres.
        high: Largest.
    """

    outline: Array
    slack: float
    low: float
    high: float


def _region(goal: Goal, place: PlaceModel, world: ActorConfiguration) -> _Region | None:
    """None for relations of which that is not known."""
    z, tolerance = float(place.pose[2]), goal.position_tolerance
    whole = rectangle(place.pose, place.centre, place.extent)
    match goal.relation:
        case "on":
            return _Region(_point(place), tolerance, z - tolerance, z + tolerance)
        case "anywhere":
            return _Region(whole, 0.0, z - tolerance, z + tolerance)
        case "inside":
            tall = max(_extent(goal.object, world))
            return _Region(whole, 0.0, z - SUNK - tall, z + max(place.height, SUNK))
    return None


def _point(place: PlaceModel) -> Array:
    return rectangle(place.pose, (0.0, 0.0), (1e-6, 1e-6))


def _at_one_place(one: Goal, two: Goal, world: ActorConfiguration) -> str:
    """Two objects that are both to stand on the very middle of one thing."""
    if not (one.relation == two.relation == "on" and one.place == two.place):
        return ""
    room = one.position_tolerance + two.position_tolerance
    needed = sum(SLENDER * min(_extent(goal.object, world)[:2]) / 2 for goal in (one, two))
    return "" if needed <= room else f"two objects cannot both stand on the middle of '{one.place}'"


def _extent(name: str, world: ActorConfiguration) -> tuple[float, float, float]:
    x, y, z = next(actor for actor in world.objects if actor.name == name).model().extent
    return float(x), float(y), float(z)


def _circle(goals: Sequence[Goal]) -> list[str]:
    """Objects each of which is to bear the one before it, the first one again at the end; or none."""
    below: dict[str, list[str]] = {}
    for goal in goals:
        if relation_named(goal.relation).presence == Presence.BORNE:
            below.setdefault(goal.object, []).append(goal.place)
    for start in below:
        path, waiting = {start: [start]}, [start]
        while waiting:
            name = waiting.pop()
            for place in below.get(name, ()):
                if place == start:
                    return [*path[name], start][::-1]
                if place not in path:
                    path[place] = [*path[name], place]
                    waiting.append(place)
    return []
