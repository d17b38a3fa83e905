"""By how much two shapes in SAPIEN overlap, where PhysX says that they do so deeply.

PhysX gives each contact a normal and says how deep the shapes are along that. Where the thin end of one of a
mesh's convex pieces is met aside, that may be a direction in which they are centimetres deep, while half a
millimetre in another one would part them. What counts is the least way that parts them (S. Cameron and
R. Culley, "Determining the minimum translational distance between two convex polyhedra", ICRA 1986).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.convex_hulls import convex
from bt_tasksim.core.narrow_phase import coal
from bt_tasksim.core.poses import Array
from bt_tasksim.engines.physics.sapien_world import array, floats

if TYPE_CHECKING:
    import sapien
    from sapien import physx


TOO_DEEP = 0.0015
"""Metres deeper than shapes are that PhysX takes them to be, at least, in a contact that it makes up."""


def least_overlap(
    contact: physx.PhysxContact, said: float, step: float, before: Mapping[Any, sapien.Pose]
) -> float:
    """Metres by which the two shapes of a contact overlap; never more than what PhysX said.

    Args:
        contact: The contact.
        said: Metres along the contact's own normal, as the bodies were before the last step.
        step: Seconds of that step: it is looked where the bodies are, and where they were.
        before: Where bodies were before it. Others are taken to have moved as they move now, which is wrong
            of what was thrown in it.
    """
    solids = [_solid(shape) for shape in contact.shapes]
    if any(solid is None for solid in solids):
        return said
    pairs = list(zip(contact.bodies, contact.shapes, strict=True))
    apart = [_compared(solids, [_placement(*pair, 0.0) for pair in pairs])]
    apart.append(_compared(solids, [_placement(*pair, step, before.get(pair[0])) for pair in pairs]))
    return min(said, max(-float(each.min_distance) for each in apart))


@dataclass(frozen=True)
class DeepestPlace:
    """Where two shapes overlap most.

    Attributes:
        depth: Metres along the least way that parts them; negative where they are apart.
        place: Middle of the overlap ``(3,)``, metres.
        normal: That way ``(3,)``, of length one: from the first to the second.
    """

    depth: float
    place: Array
    normal: Array


Solids = dict[Any, tuple[Any, Any] | None]
"""By shape: coal's, and its place in its body; None for those that are neither boxes nor convex meshes."""


def deepest_place(
    contact: physx.PhysxContact, known: Solids, elsewhere: tuple[Any, sapien.Pose] | None = None
) -> DeepestPlace | None:
    """Where the two shapes of a contact overlap most, as they are now.

    Args:
        contact: The contact.
        known: What is known already of some shapes; more is added.
        elsewhere: A body, and the pose in which it is to be thought.

    Returns:
        None for shapes that are neither boxes nor convex meshes.
    """
    solids, placed = [], []
    for body, shape in zip(contact.bodies, contact.shapes, strict=True):
        if shape not in known:
            solid = _solid(shape)
            known[shape] = None if solid is None else (solid, _transform(array(shape.local_pose)))
        found = known[shape]
        if found is None:
            return None
        solids.append(found[0])
        pose = body.entity_pose if elsewhere is None or body != elsewhere[0] else elsewhere[1]
        placed.append(_transform(floats(pose)) * found[1])
    result = _compared(solids, placed)
    place = 0.5 * (np.asarray(result.getNearestPoint1()) + np.asarray(result.getNearestPoint2()))
    return DeepestPlace(-float(result.min_distance), place, np.asarray(result.normal, float))


def _compared(solids: Sequence[Any], placed: Sequence[Any]) -> Any:
    """How far two solids are apart, coal's answer: negative where they overlap."""
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    request.enable_signed_distance = True
    coal.distance(solids[0], placed[0], solids[1], placed[1], request, result)
    return result


def _solid(shape: physx.PhysxCollisionShape) -> Any:
    """A shape as coal's; None for those that are no boxes, balls or convex meshes."""
    from sapien import physx

    if isinstance(shape, physx.PhysxCollisionShapeBox):
        return coal.Box(*(2.0 * np.asarray(shape.half_size, float)))
    if isinstance(shape, physx.PhysxCollisionShapeSphere):
        return coal.Sphere(float(shape.radius))
    if isinstance(shape, physx.PhysxCollisionShapeConvexMesh):
        return convex(np.asarray(shape.vertices, float) * np.asarray(shape.scale, float))
    return None


def _placement(
    body: physx.PhysxRigidBaseComponent,
    shape: physx.PhysxCollisionShape,
    back: float,
    before: sapien.Pose | None = None,
) -> Any:
    """Where a shape is, or was so many seconds back, if need be as its body moves now."""
    pose = array(body.entity.pose if before is None else before)
    if back and before is None and hasattr(body, "linear_velocity"):
        turn = poses.from_rotation_vector(-back * np.asarray(body.angular_velocity, float))
        pose = np.concatenate(
            [pose[:3] - back * np.asarray(body.linear_velocity, float), poses.quat_multiply(turn, pose[3:])]
        )
    placed = poses.multiply(pose, array(shape.local_pose))
    return _transform(placed)


def _transform(pose: Sequence[float] | Array) -> Any:
    x, y, z, *turn = (float(v) for v in pose)
    w, i, j, k = turn
    return coal.Transform3s(coal.Quaternion(w, i, j, k), np.array([x, y, z]))
