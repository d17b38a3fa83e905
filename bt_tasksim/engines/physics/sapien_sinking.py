"""What sinks into something in SAPIEN is stopped, where PhysX pushes it only in another direction.

Where the tilted edge of a box comes down on the rim of a container, or one cup on another, PhysX may take the
wall's side for what it meets: along that normal the two part, so it does nothing, and the thing falls into
the wall by several millimetres. The least way that parts them (`bt_tasksim.engines.physics.sapien_overlap`)
tells where they truly meet. Along that, the nearing at the place where they are deepest is taken from them by
an impulse, as by a contact without bouncing or friction (D. Baraff, "Analytical methods for dynamic
simulation of non-penetrating rigid bodies", SIGGRAPH 1989, with several contacts one after the other).
"""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.engines.physics.sapien_overlap import deepest_place
from bt_tasksim.engines.physics.sapien_world import World, array

if TYPE_CHECKING:
    from sapien import physx

SUNK = 0.0008
"""Metres of overlap from which on things are stopped: PhysX itself keeps what it stops well below that."""


def stop_sinking(world: World, moving: Collection[int]) -> None:
    """Stop what overlaps something and still sinks into it, in its velocity for the steps to come.

    Args:
        world: The world.
        moving: Indices of the objects that are looked at.
    """
    for contact in world.system.get_contacts():
        kinds = [world.bodies.get(body, ("", -1)) for body in contact.bodies]
        if any(kind not in ("object", "fixture") for kind, _ in kinds):
            continue
        if not any(kind == "object" and k in moving for kind, k in kinds):
            continue
        if min(point.separation for point in contact.points) > 0.0:  # along its own normal it may be little
            continue
        met = deepest_place(contact)
        if met is not None and met.depth > SUNK:
            _stop(world, contact, met.place, met.normal)


def _stop(world: World, contact: physx.PhysxContact, place: Array, normal: Array) -> None:
    """Take from two bodies the speed at which they near each other at a place.

    Args:
        world: The world.
        contact: The contact of the two.
        place: Where ``(3,)``, metres.
        normal: Along which direction ``(3,)``, from the first to the second.
    """
    nearing, mobility, loose = 0.0, 0.0, []
    for body, sign in zip(contact.bodies, (1.0, -1.0), strict=True):
        kind, k = world.bodies[body]
        if kind != "object":
            continue
        about = place - _centre(body)
        inverse = _inverse_inertia(world, k)
        turning = np.cross(about, normal)
        nearing += sign * float(
            np.asarray(body.linear_velocity) @ normal + np.asarray(body.angular_velocity) @ turning
        )
        mobility += 1.0 / body.mass + float(turning @ inverse @ turning)
        loose.append((body, sign, inverse @ turning))
    if nearing <= 0.0:
        return
    impulse = nearing / mobility
    for body, sign, spin in loose:
        body.set_linear_velocity(np.asarray(body.linear_velocity) - sign * impulse / body.mass * normal)
        body.set_angular_velocity(np.asarray(body.angular_velocity) - sign * impulse * spin)


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
