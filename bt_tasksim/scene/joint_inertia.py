"""What a part of a fixture weighs on its joint, and how far open it was drawn."""

from __future__ import annotations

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.joints import Joints
from bt_tasksim.scene.configuration import ObjectActor
from bt_tasksim.scene.joints import Joint


def value_of(actor: ObjectActor, joint: Joint) -> float:
    """How far open an actor was drawn, metres or radians."""
    return float(Joints.of([joint]).value(np.array(actor.pose)[None])[0])


def inertia_about(actor: ObjectActor, joint: Joint) -> float:
    """The mass of a part that slides; the moment of inertia about its axis of one that turns."""
    if not joint.turns:
        return actor.mass
    mass = actor.shape().mass
    axis = np.array(joint.axis)
    own = poses.rotate(poses.quat_conjugate(np.asarray(mass.pose, float)[3:]), axis)
    lever = np.asarray(mass.pose, float)[:3] - np.array(joint.origin)
    across = lever - float(lever @ axis) * axis
    return actor.mass * (float(np.sum(own**2 * mass.inertia)) + float(across @ across))
