"""Parts of fixtures on a real robot: only those that the scene says are sensed have a topic."""

from types import SimpleNamespace

import numpy as np

from bt_tasksim.hardware.ros.engine import RosRobot, _is_tracked
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import FixtureSpec


def test_a_part_that_is_not_sensed_is_not_waited_for():
    told = ((0.3, "a", True), (-0.3, "b", False))
    doors = [FixtureSpec("door", at=(0.6, y), name=name, sensed=sensed) for y, name, sensed in told]
    world = Scene(fixtures=doors, objects={"cup": "on table"}).sample(0)
    seen = np.array([_is_tracked(actor) for actor in world.objects])
    assert dict(zip([actor.name for actor in world.objects], seen.tolist(), strict=True)) == {
        "cup": True,
        "a": True,
        "b": False,
    }
    sensors = SimpleNamespace(poses=lambda: np.ones((2, 7)))
    poses = RosRobot._objects(SimpleNamespace(_seen=seen, sensors=sensors))
    assert np.array_equal(np.isfinite(poses).all(axis=1), seen)
