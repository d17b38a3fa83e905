"""What sinks into something in SAPIEN is stopped, where PhysX pushes it only in another direction.

Where the tilted edge of a box comes down on the rim of a container, or one cup on another, PhysX may take the
wall's side for what it meets: along that normal the two part, so it does nothing, and the thing falls into
the wall by several millimetres. The least way that parts them (`bt_tasksim.engines.physics.sapien_overlap`)
tells where they truly meet. Along that, the nearing at the place where they are deepest is taken from them by
an impulse, as by a contact without bouncing or friction (D. Baraff, "Analytical methods for dynamic
simulation of non-penetrating rigid bodies", SIGGRAPH 1989, with several contacts one after the other).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.engines.physics.sapien_overlap import DeepestPlace, Solids, deepest_place
from bt_tasksim.engines.physics.sapien_world import World, array

if TYPE_CHECKING:
    from sapien import physx

SUNK = 0.0008
"""Metres of overlap from which on things are stopped: PhysX itself keeps what it stops well below that."""
FAR = 1.0
"""Metres that stand for shapes of which nobody knows how deep they are in each other."""


class Sinking:
    """Watches things that move, for some steps.

    PhysX's own word is no help: of a box that is in a wall it may say that they are centimetres apart. So all
    within its reach are looked at, each again once they can have gone the way that was between them.

    Args:
        world: The world.
        moving: Indices of the objects that are watched.
        known: What is known already of their shapes.
    """

    def __init__(self, world: World, moving: Collection[int], known: Solids) -> None:
        self._world, self._moving, self._known = world, moving, known
        self._apart: dict[tuple[object, object], float] = {}  # metres, by pair of shapes

    def stop(self, way: float) -> None:
        """Stop what overlaps something and still sinks into it, in its velocity for the steps to come.

        Args:
            way: Metres that surfaces have neared each other at most since this was called last.
        """
        world, sunk = self._world, []
        for contact in world.system.get_contacts():
            kinds = [world.bodies.get(body, ("", -1)) for body in contact.bodies]
            if any(kind not in ("object", "fixture") for kind, _ in kinds):
                continue
            if not any(kind == "object" and k in self._moving for kind, k in kinds):
                continue
            first, second = contact.shapes
            apart = self._apart.get((first, second), 0.0) - way
            if apart <= 0.0:
                met = deepest_place(contact, self._known)
                apart = FAR if met is None else -met.depth
                if met is not None and met.depth > SUNK:
                    sunk.append((met, contact.bodies))
            self._apart[first, second] = apart
        # PhysX lists contacts in an order of its own, on which nothing may depend.
        for met, bodies in sorted(sunk, key=lambda each: -each[0].depth):
            without_nearing(world, bodies, met)


def without_nearing(world: World, bodies: Sequence[physx.PhysxRigidBaseComponent], met: DeepestPlace) -> None:
    """Take from two bodies the speed at which they near each other where they meet.

    Args:
        world: The world.
        bodies: The two. What is no object of its own goes on as it does: furniture, and its parts on joints.
        met: Where they meet.
    """
    nearing, mobility, loose = 0.0, 0.0, []
    for body, sign in zip(bodies, (1.0, -1.0), strict=True):
        nearing += sign * float(_velocity_at(body, met.place) @ met.normal)
        kind, k = world.bodies.get(body, ("", -1))
        if kind == "object" and hasattr(body, "set_linear_velocity"):  # a link of an articulation has none
            turning = np.cross(met.place - _centre(body), met.normal)
            spin = _inverse_inertia(world, k) @ turning
            mobility += 1.0 / body.mass + float(turning @ spin)
            loose.append((body, sign, spin))
    if nearing <= 0.0 or not loose:
        return
    impulse = nearing / mobility
    for body, sign, spin in loose:
        body.set_linear_velocity(np.asarray(body.linear_velocity) - sign * impulse / body.mass * met.normal)
        body.set_angular_velocity(np.asarray(body.angular_velocity) - sign * impulse * spin)


def _velocity_at(body: physx.PhysxRigidBaseComponent, place: Array) -> Array:
    """Velocity ``(3,)`` of a body's material at a place, m/s; none of what stands still."""
    if not hasattr(body, "linear_velocity"):
        return np.zeros(3)
    about = place - _centre(body)
    return np.asarray(body.linear_velocity) + np.cross(np.asarray(body.angular_velocity), about)


def _centre(body: physx.PhysxRigidDynamicComponent) -> Array:
    """A body's centre of mass ``(3,)``, metres."""
    return poses.multiply(array(body.entity_pose), array(body.get_cmass_local_pose()))[:3]


def _inverse_inertia(world: World, which: int) -> Array:
    """The inverse of an object's inertia ``(3, 3)`` about its centre of mass, along the world's axes."""
    axes, moments = world.inertia[which]
    turned = poses.multiply(array(world.objects[which].entity_pose), np.array(axes))
    rotation = poses.to_matrix(turned[3:])
    found: Array = rotation @ np.diag(1.0 / np.array(moments)) @ rotation.T
    return found
