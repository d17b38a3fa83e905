"""Scripts of the synthetic demonstrations: where things stand and what the person's hand does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.demos_decomp.log import Floats, Surface, surface_of
from bt_tasksim.demos_decomp.synthetic_motion import Hand
from bt_tasksim.scene.fixtures import load_fixture

DOWN = np.array([0.0, 0, -1])
CUP = np.array([0.07, 0.07, 0.10])
KINDS = ("box", "cylinder", "oval", "diamond")


def places_of(*fixtures: str) -> dict[str, Surface]:
    """The places of bundled fixtures, by name."""
    return {
        place.name: surface_of(place)
        for fixture in fixtures
        for place in load_fixture(fixture).place_models()
    }


@dataclass(frozen=True)
class DrawnThing:
    """An object as it stands at the beginning: ``(7,)`` pose, kind, ``(3,)`` full size in metres."""

    pose: Floats
    kind: str
    size: Floats


@dataclass(frozen=True)
class Performance:
    """A script as acted by the hand.

    Attributes:
        hand: The hand with all its strokes.
        objects: Objects by name.
        places: Places by name.
        target: The object that is handled.
        destination: The place it goes to.
        closed: Second from which the target moves with the hand.
        opened: Second from which it no longer does.
        rest: ``(7,)`` pose in which the target comes to rest.
        lowest: Height in metres below which the target's centre cannot go while it is held.
        labels: Concept, first and last second of each task.
    """

    hand: Hand
    objects: dict[str, DrawnThing]
    places: dict[str, Surface]
    target: str
    destination: str
    closed: float
    opened: float
    rest: Floats
    lowest: float
    labels: list[tuple[str, float, float]]


def pick_and_place(rng: np.random.Generator) -> Performance:
    """A box, cylinder, oval pack or diamond-shaped box goes from the table to a marked spot."""
    kind = str(rng.choice(KINDS))
    width = rng.uniform(0.04, 0.06)
    depth = width if kind == "cylinder" else rng.uniform(0.04, 0.06)
    size = np.array([depth, width, rng.uniform(0.08, 0.12)])
    heading = poses.yaw(rng.uniform(-0.5, 0.5))
    goal = np.array([rng.uniform(0.42, 0.58), rng.uniform(0.08, 0.25), 0.0, *heading])
    places = {**places_of("table"), "goal": Surface(goal, np.array([0.12, 0.12]), "spot")}
    start = np.array([rng.uniform(0.42, 0.58), rng.uniform(-0.24, -0.05), 0.0])
    begin = _standing(start, size, poses.yaw(rng.uniform(-1.2, 1.2)))
    end = _standing([*(goal[:2] + rng.normal(0, 0.006, 2)), 0.0], size, _turned(heading, rng.normal(0, 0.03)))
    things = {"target": DrawnThing(begin, kind, size)}
    lift, above = rng.uniform(0.08, 0.15), rng.uniform(0.06, 0.12)
    raised = _shifted(begin, [*rng.normal(0, 0.004, 2), lift])
    ready = _shifted(end, [*rng.normal(0, 0.004, 2), above])
    middle = poses.interpolate(raised, ready, rng.uniform(0.4, 0.6))
    middle[2] = max(lift, above) + rng.uniform(0.0, 0.04) + size[2] / 2
    way = [middle] if rng.random() < 0.6 else []
    return _perform(rng, things, places, ("target", "goal"), DOWN, [raised, *way, ready], end)


def shelf_to_shelf(rng: np.random.Generator) -> Performance:
    """A cup goes from the upper board of a shelf to the lower one, out and in at the front."""
    places = places_of("table", "shelf")
    upper, lower = places["upper_board"].pose, places["lower_board"].pose
    heading = poses.yaw(rng.uniform(-3, 3))
    begin = _standing(_shifted(upper, [rng.normal(0, 0.004), rng.uniform(-0.12, 0.12), 0]), CUP, heading)
    end = _standing(_shifted(lower, [*rng.normal(0, 0.006, 2), 0]), CUP, heading)
    lift, above = rng.uniform(0.07, 0.09), rng.uniform(0.04, 0.06)
    out = rng.uniform(0.20, 0.24)
    raised = _shifted(begin, [*rng.normal(0, 0.003, 2), lift])
    ready = _shifted(end, [*rng.normal(0, 0.003, 2), above])
    before = _shifted(raised, [-out, rng.normal(0, 0.01), rng.normal(0, 0.006)])
    below = _shifted(ready, [-out + rng.normal(0, 0.01), rng.normal(0, 0.01), rng.normal(0.01, 0.006)])
    things = {"cup": DrawnThing(begin, "cup", CUP)}
    way = [raised, before, below, ready]
    approach = next(p.access for p in load_fixture("shelf").place_models() if p.name == "upper_board")
    return _perform(rng, things, places, ("cup", "lower_board"), approach, way, end, overlap=0.12)


def pick_and_throw(rng: np.random.Generator) -> Performance:
    """A cup on the table is lifted high, brought over the trash bin and let go."""
    places = places_of("table", "trash_bin")
    floor = places["trash_bin"].pose[:3]
    start = np.array([rng.uniform(0.42, 0.58), rng.uniform(-0.18, 0.15), 0.0])
    begin = _standing(start, CUP, poses.yaw(rng.uniform(-1.2, 1.2)))
    raised = _shifted(begin, [*rng.normal(0, 0.005, 2), rng.uniform(0.28, 0.34)])
    over = raised.copy()
    over[:2] = floor[:2] + rng.normal(0, 0.012, 2)
    over[2] += rng.normal(0.0, 0.012)
    heading = poses.yaw(rng.uniform(-3, 3))
    rest = _standing(_shifted(floor, [*rng.normal(0, 0.008, 2), 0]), CUP, heading)
    if rng.random() < 0.6:  # tips over
        rest[2] = floor[2] + CUP[0] / 2
        rest[3:] = poses.quat_multiply(heading, poses.from_rotation_vector(np.array([np.pi / 2, 0.0, 0.0])))
    things = {"cup": DrawnThing(begin, "cup", CUP)}
    return _perform(rng, things, places, ("cup", "trash_bin"), DOWN, [raised, over], rest, throws=True)


SCRIPTS: dict[str, Callable[[np.random.Generator], Performance]] = {
    "pick_and_place": pick_and_place,
    "shelf_to_shelf": shelf_to_shelf,
    "pick_and_throw": pick_and_throw,
}


def _perform(
    rng: np.random.Generator,
    things: dict[str, DrawnThing],
    places: dict[str, Surface],
    target_and_destination: tuple[str, str],
    approach: Floats,
    way: list[Floats],
    end: Floats,
    overlap: float = 0.25,
    throws: bool = False,
) -> Performance:
    """Acts a script: ``way`` are poses ``(7,)`` of the target, the first of them after the pick."""
    target, destination = target_and_destination
    thing = things[target]
    grip = _grip(rng, thing, approach)
    width = float(thing.size[1])
    wide = width + rng.uniform(0.025, 0.05)
    relaxed = rng.uniform(0.02, 0.06)
    home = np.array([rng.uniform(0.25, 0.35), rng.uniform(-0.1, 0.2), rng.uniform(0.25, 0.4), 0, 0, 0, 0])
    at_target = poses.multiply(thing.pose, grip)
    home[3:] = poses.quat_multiply(at_target[3:], poses.from_rotation_vector(rng.normal(0, 0.25, 3)))
    hand = Hand(home, relaxed, time_scaling=float(rng.uniform(0.75, 1.4)))

    back = poses.rotate(at_target[3:], np.array([0.0, 0, -rng.uniform(0.07, 0.12)]))
    reach = hand.clock
    hand.move(_shifted(at_target, back))
    hand.set_opening(wide, float(rng.uniform(0.4, 0.7)), start=reach + 0.1)
    hand.move(at_target, overlap=float(rng.uniform(0, 0.3)))
    hand.wait(float(rng.uniform(0, 0.15)))
    hand.set_opening(width, float(rng.uniform(0.2, 0.45)))
    closed = hand.clock
    labels = [("grasp", 0.0, closed)]
    hand.wait(float(rng.exponential(0.1)))
    for step, pose in enumerate(way):
        early = overlap * rng.random() if step else 0.0
        hand.move(poses.multiply(pose, grip), overlap=float(early))
        if step == 0:
            labels.append(("pick", closed, hand.clock))
        if rng.random() < 0.3:
            hand.wait(float(rng.exponential(0.15)))
    labels.append(("bring", labels[-1][2], hand.clock))
    lowest = min(float(thing.pose[2]), float(end[2]))
    if not throws:
        hand.move(
            poses.multiply(_shifted(end, [0, 0, rng.uniform(0, 0.002)]), grip), float(0.2 * rng.random())
        )
        labels.append(("place", labels[-1][2], hand.clock))
    hand.wait(float(0.05 + rng.exponential(0.12)))
    opened = hand.clock + 0.03
    hand.set_opening(wide, float(rng.uniform(0.2, 0.4)))
    labels.append(("release", labels[-1][2], hand.clock))
    away = poses.rotate(hand.pose[3:], np.array([0.0, 0, -rng.uniform(0.1, 0.2)]))
    leave = hand.clock
    hand.move(_shifted(hand.pose, away))
    hand.set_opening(relaxed, 0.6, start=leave + float(rng.uniform(0.3, 0.6)))
    hand.wait(0.2)
    return Performance(hand, things, places, target, destination, closed, opened, end, lowest, labels)


def _grip(rng: np.random.Generator, thing: DrawnThing, approach: Floats) -> Floats:
    """Pose ``(7,)`` of the hand in the target's frame."""
    side = poses.rotate(thing.pose[3:], np.array([0.0, 1, 0]))
    if approach[0] > 0.5:  # a cup from the front: the fingers close sideways
        side = np.array([0.0, 1, 0])
    side = side if side[1] >= 0 else -side
    hand = np.concatenate([thing.pose[:3], poses.frame_from_axes(approach, side)])
    tilt = poses.from_rotation_vector(rng.normal(0, 0.07, 3) * [1.0, 0.6, 0.6])
    hand[3:] = poses.quat_multiply(hand[3:], tilt)
    hand[:3] += rng.normal(0, 0.003, 3) + np.array([0, 0, rng.uniform(0.0, 0.02)])
    return np.asarray(poses.multiply(poses.inverse(thing.pose), hand))


def _standing(at: Floats | list[float], size: Floats, heading: Floats) -> Floats:
    """Pose ``(7,)`` of a thing that stands on a point ``(3,)`` with a heading (quaternion)."""
    return np.array([at[0], at[1], at[2] + size[2] / 2, *heading])


def _turned(heading: Floats, by: float) -> Floats:
    return np.asarray(poses.quat_multiply(heading, poses.yaw(by)))


def _shifted(pose: Floats, by: Floats | list[float]) -> Floats:
    shifted = np.array(pose, dtype=float)
    shifted[:3] += by
    return shifted
