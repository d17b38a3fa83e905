"""Facts of worlds as arrays, from what is known of each world by names."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.fact_arrays import FILLING, ObjectFacts, ObstacleFacts, PlaceFacts
from bt_tasksim.core.joints import JointModel, Joints
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import ObjectModel, PlaceModel, WorldModel


def object_facts(worlds: Sequence[WorldModel], names: Sequence[str]) -> ObjectFacts:
    """Facts of the objects with these names, in columns ``(N, names)``."""
    rows = [[w.objects[w.index[n]] if n in w.index else None for n in names] for w in worlds]
    models = [model for row in rows for model in row]
    turns = [_IDENTITY if model is None else rotations(model) for model in models]
    axes = [((0.0, 1.0, 0.0),) if model is None else model.grasp_axes for model in models]
    widths = [(np.inf,) if model is None else model.grasp_widths for model in models]
    shape = (len(rows), len(rows[0]))
    turned, counts = _padded(turns, shape, "rotations")
    handles, handle_counts = _padded([_handles(model) for model in models], shape, "handles")
    return ObjectFacts(
        present=np.array([model is not None for model in models], bool).reshape(shape),
        extent=np.array([(1.0,) * 3 if m is None else m.extent for m in models], float).reshape(*shape, 3),
        revolved=np.array([m is not None and m.symmetry == 0 and not m.cubic for m in models], bool).reshape(
            shape
        ),
        cubic=np.array([m is not None and m.cubic for m in models], bool).reshape(shape),
        ball=np.array([m is not None and m.symmetry == 0 and m.cubic for m in models], bool).reshape(shape),
        rotations=turned,
        rotation_counts=counts,
        grasp_axes=_padded(axes, shape, "grasp_axes")[0],
        grasp_widths=_padded(widths, shape, "grasp_widths")[0],
        handles=handles,
        handle_counts=handle_counts,
        **_joint_facts([None if model is None else model.joint for model in models], shape),
    )


def _handles(model: ObjectModel | None) -> Array:
    """Where two fingers may hold a part of a fixture ``(k, 3)``, in its own frame."""
    if model is None or model.joint is None or model.solid is None:
        return np.zeros((0, 3))
    found: Array = np.asarray(model.solid.grips.points, float).reshape(-1, 3)
    return found


def _joint_facts(joints: Sequence[JointModel | None], shape: tuple[int, int]) -> dict[str, Array]:
    """The fields of `ObjectFacts` that speak of joints."""
    some = [_NO_JOINT if joint is None else joint for joint in joints]
    made = Joints.of(some)
    return {
        "jointed": np.array([joint is not None for joint in joints], bool).reshape(shape),
        "joint_turns": made.turns.reshape(shape),
        "joint_origin": made.origin.reshape(*shape, 3),
        "joint_axis": made.axis.reshape(*shape, 3),
        "joint_zero": made.zero.reshape(*shape, 7),
        "joint_limits": made.limits.reshape(*shape, 2),
        "joint_sensed": np.array([joint.sensed for joint in some], bool).reshape(shape),
    }


def place_facts(worlds: Sequence[WorldModel], names: Sequence[str]) -> PlaceFacts:
    """Facts of the places with these names, in columns ``(N, names)``."""
    shape = (len(worlds), len(names))
    places = [world.places.get(name) for world in worlds for name in names]
    ranked = [{name: k for k, name in enumerate(world.places)} for world in worlds]
    ranks = [own.get(name, 0) for own in ranked for name in names]

    def each(value: Callable[[PlaceModel], Any], nothing: Any) -> Array:
        found = [nothing if place is None else value(place) for place in places]
        return np.array(found, bool if isinstance(nothing, bool) else float).reshape(
            *shape, *np.shape(nothing)
        )

    up = (0.0, 0.0, 1.0)
    return PlaceFacts(
        present=each(lambda place: True, False),
        pose=each(lambda place: place.pose, (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)),
        extent=each(lambda place: place.extent, (0.0, 0.0)),
        centre=each(lambda place: place.centre, (0.0, 0.0)),
        height=each(lambda place: place.height, 0.0),
        access=each(lambda place: place.access, up),
        exit=each(lambda place: place.exit, up),
        clearance=each(lambda place: place.clearance, 0.0),
        container=each(lambda place: place.container, False),
        rank=np.array(ranks, float).reshape(shape),
        carries=each(lambda place: place.carries, False),
    )


def obstacle_facts(worlds: Sequence[WorldModel]) -> ObstacleFacts:
    """Facts of the worlds' obstacles ``(N, most)``."""
    most = max(len(world.obstacles) for world in worlds)
    shape = (len(worlds), most)
    present, size = np.zeros(shape, bool), np.zeros((*shape, 3))
    pose = np.broadcast_to(FILLING["pose"], (*shape, 7)).copy()
    for i, world in enumerate(worlds):
        for k, box in enumerate(world.obstacles):
            present[i, k], pose[i, k], size[i, k] = True, box.pose, box.size
    return ObstacleFacts(present, pose, size)


def _padded(rows: Sequence[Any], shape: tuple[int, int], name: str) -> tuple[Array, Array]:
    """Lists of unlike lengths as one array ``(*shape, most, ...)``, and which entries are there."""
    most, filling = max((len(row) for row in rows), default=1) or 1, FILLING[name]
    inner = np.shape(filling)
    out = np.broadcast_to(filling, (len(rows), most, *inner)).copy()
    there = np.zeros((len(rows), most), bool)
    for i, row in enumerate(rows):
        out[i, : len(row)] = np.reshape(row, (len(row), *inner))
        there[i, : len(row)] = True
    return out.reshape(*shape, most, *inner), there.reshape(*shape, most)


def rotations(model: ObjectModel) -> Array:
    """Rotations ``(k, 4)`` that bring an object onto itself, in its own frame."""
    if model.cubic:
        return _CUBE
    if model.symmetry == 0:
        return _IDENTITY
    return np.array([poses.yaw(2 * np.pi * k / model.symmetry) for k in range(model.symmetry)])


def _cube_rotations() -> Array:
    quarter = np.array([poses.yaw(k * np.pi / 2) for k in range(4)])
    turns = [(0.0, 0, 0), (1.0, 0, 0), (2.0, 0, 0), (-1.0, 0, 0), (0.0, 1, 0), (0.0, -1, 0)]
    tips = poses.from_rotation_vector(np.array(turns) * np.pi / 2)
    return poses.quat_multiply(quarter[None], tips[:, None]).reshape(-1, 4)


_NO_JOINT = JointModel("slide", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), FILLING["pose"], (0.0, 1.0))
_IDENTITY = np.array([[1.0, 0.0, 0.0, 0.0]])
_CUBE = _cube_rotations()
