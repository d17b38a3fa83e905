"""Hand-made states at the end of a run, for tests of goals."""

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.world import Hidden
from bt_tasksim.robot.description import load_robot


def drawn(scene, seed=3):
    """A drawn world and its model."""
    configuration = scene.sample(seed)
    robot = load_robot("panda")
    return configuration, configuration.world_model([t.name for t in robot.tips], robot.opening)


def state(configuration, at=None, time=5.0, **changes):
    """All at rest where it was drawn, but for the poses ``at`` by name, and the hand far away."""
    objects = np.array([actor.pose for actor in configuration.objects])
    names = [actor.name for actor in configuration.objects]
    for name, pose in (at or {}).items():
        objects[names.index(name)] = pose
    n = len(objects)
    values = {
        "time": np.float64(time),
        "objects": objects,
        "velocities": np.zeros((n, 6)),
        "hand_force": np.zeros(n),
        "hand_distance": np.full(n, np.inf),
        "support": np.zeros((n, n + len(configuration.fixtures)), bool),
        "penetration": np.float64(0.0005),
        "tool_pose": poses.pose([0.4, 0, 0.5]),
    }
    return Hidden(**{**values, **changes})


def tilted(degrees, axis=0):
    """A turn ``(4,)`` about a level axis."""
    vector = np.zeros(3)
    vector[axis] = np.deg2rad(degrees)
    return poses.from_rotation_vector(vector)
