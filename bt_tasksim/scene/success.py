"""Success as the physics state tells it: where the object is, whether all is at rest and unharmed.

Nothing here looks at the tree, its statuses or its estimates.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bt_tasksim import poses
from bt_tasksim.poses import Array
from bt_tasksim.scene import ActorConfiguration, Goal
from bt_tasksim.world import Hidden, ObjectModel, PlaceModel, WorldModel

AT_REST = (0.01, 0.1)
"""Speeds in m/s and rad/s below which an object is at rest."""
DEEPEST = 0.002
"""Metres of overlap of two bodies that may not be exceeded at any time of a run."""
TOUCHING = 1e-4
"""Metres between hand and object within which the hand touches it."""
KNOCKED = (0.05, math.radians(15.0))
"""Metres and radians by which another object may be shifted or tilted."""


@dataclass(frozen=True)
class Verdict:
    """What became of a run.

    Attributes:
        success: Everything asked for is true.
        reason: A short, countable reason for failure, such as ``not in place``; empty on success.
        why: One sentence with numbers.
        position_error: Metres from where the object should stand; NaN where no goal says so.
        angle_error: Radians from how it should stand, up to its symmetry; NaN likewise.
        penetration: Deepest overlap of two bodies during the run, metres.
    """

    success: bool
    reason: str
    why: str
    position_error: float
    angle_error: float
    penetration: float


def judge(configuration: ActorConfiguration, model: WorldModel, hidden: Hidden) -> Verdict:
    """Judge the state at the end of a run.

    Args:
        configuration: The world as it was drawn, with its goal.
        model: Names and facts.
        hidden: The physics state at the end.
    """
    goal = configuration.goal
    depth = float(hidden.penetration)
    if goal is None:
        return Verdict(True, "", "no goal is set for this scene", math.nan, math.nan, depth)
    k = model.object_index(goal.object)
    place, thing = model.place(goal.place), model.object(goal.object)
    if goal.relation == "lifted":
        return _judge_lifted(configuration, goal, hidden, k)
    distance, angle, placed = _placement(goal, place, thing, hidden.objects[k])
    off = f"{1000 * distance:.0f} mm and {math.degrees(angle):.1f} degrees off"

    def end(reason: str, why: str) -> Verdict:
        return Verdict(not reason, reason, why, distance, angle, depth)

    if not placed:
        inside = goal.relation == "inside"
        reason = "not in the bin" if inside else _misplaced(goal, distance)
        return end(
            reason, f"{goal.object} {'is not in' if inside else 'does not stand on'} {goal.place}: {off}"
        )
    speed, turning = (float(np.linalg.norm(v)) for v in np.split(hidden.velocities[k], 2))
    if speed > AT_REST[0] or turning > AT_REST[1]:
        return end("not at rest", f"{goal.object} still moves at {1000 * speed:.0f} mm/s")
    if float(hidden.hand_distance[k]) <= TOUCHING:
        return end("hand not clear", f"the hand still touches {goal.object}")
    for i, actor in enumerate(configuration.objects):
        if i == k:
            continue
        shift = float(np.linalg.norm(hidden.objects[i][:3] - np.array(actor.pose[:3])))
        tilt = _tilt(hidden.objects[i]) - _tilt(np.array(actor.pose))
        if shift > KNOCKED[0] or tilt > KNOCKED[1]:
            moved = f"was shifted by {1000 * shift:.0f} mm and tilted by {math.degrees(tilt):.0f} degrees"
            return end("knocked something over", f"{actor.name} {moved}")
    if depth > DEEPEST:
        return end("penetration", f"two bodies overlapped by {1000 * depth:.1f} mm")
    return end(
        "", f"{goal.object} {'is in' if goal.relation == 'inside' else 'stands on'} {goal.place}, {off}"
    )


def _judge_lifted(configuration: ActorConfiguration, goal: Goal, hidden: Hidden, k: int) -> Verdict:
    """The object hangs in the hand alone, as high as it should, and as upright as it stood."""
    start, now = np.array(configuration.objects[k].pose), hidden.objects[k]
    missing = goal.height - float(now[2] - start[2])
    up = np.array([0.0, 0.0, 1.0])
    cosine = float(poses.rotate(start[3:], up) @ poses.rotate(now[3:], up))
    tilt, depth = math.acos(min(max(cosine, -1.0), 1.0)), float(hidden.penetration)
    off = f"{1000 * missing:.0f} mm below and {math.degrees(tilt):.1f} degrees off"
    reason, why = "", f"{goal.object} is held {1000 * goal.height:.0f} mm up, {off}"
    if bool(np.any(hidden.support[k])) or float(hidden.hand_distance[k]) > TOUCHING:
        reason, why = "not lifted", f"{goal.object} is not in the hand: {off}"
    elif abs(missing) > goal.position_tolerance:
        reason, why = "slipped", f"{goal.object} did not follow the hand: {off}"
    elif tilt > goal.angle_tolerance:
        reason, why = "tilted or turned", f"{goal.object} did not keep upright: {off}"
    elif depth > DEEPEST:
        reason, why = "penetration", f"two bodies overlapped by {1000 * depth:.1f} mm"
    return Verdict(not reason, reason, why, abs(missing), tilt, depth)


def at_rest(hidden: Hidden) -> bool:
    """Every object is at rest."""
    v = hidden.velocities
    return bool(
        np.all(np.linalg.norm(v[:, :3], axis=-1) < AT_REST[0] / 2)
        and np.all(np.linalg.norm(v[:, 3:], axis=-1) < AT_REST[1] / 2)
    )


def _misplaced(goal: Goal, distance: float) -> str:
    return "not in place" if distance > goal.position_tolerance else "tilted or turned"


def _placement(goal: Goal, place: PlaceModel, model: ObjectModel, pose: Array) -> tuple[float, float, bool]:
    """Distance (m) and angle (rad) to where the object should be, and whether that is good enough."""
    local = poses.multiply(poses.inverse(place.pose), pose)
    if goal.relation == "inside":
        low = all(abs(float(local[i]) - place.centre[i]) <= place.extent[i] / 2 for i in range(2))
        inside = low and -0.01 < float(local[2]) < place.height
        return float(np.linalg.norm(local[:2])), _tilt(pose), inside
    should = np.array([0.0, 0.0, model.extent[2] / 2])
    distance = float(np.linalg.norm(local[:3] - should))
    angle = _angle(local[3:], model)
    return distance, angle, distance <= goal.position_tolerance and angle <= goal.angle_tolerance


def _angle(rotation: Array, model: ObjectModel) -> float:
    """Smallest angle (rad) from upright with the place's heading, over the object's symmetries."""
    if model.symmetry == 0:
        return _tilt(np.concatenate([np.zeros(3), rotation]))
    if model.cubic:
        m = np.abs(poses.to_matrix(rotation))
        rows = np.argmax(m, axis=1)
        snapped = np.zeros((3, 3))
        snapped[np.arange(3), rows] = np.sign(poses.to_matrix(rotation)[np.arange(3), rows])
        if len(set(rows.tolist())) == 3:
            cosine = (np.trace(snapped.T @ poses.to_matrix(rotation)) - 1) / 2
            return float(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return min(
        float(poses.angle_between(rotation, poses.yaw(2 * np.pi * k / model.symmetry)))
        for k in range(max(model.symmetry, 1))
    )


def _tilt(pose: Array) -> float:
    up = poses.rotate(pose[3:], np.array([0.0, 0.0, 1.0]))
    return float(np.arccos(np.clip(up[2], -1.0, 1.0)))
