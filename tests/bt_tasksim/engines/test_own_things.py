"""Meshes of several convex pieces in every physics engine: an L stands, and a mug is hollow."""

import dataclasses

import numpy as np
import pytest
from physics_cases import PHYSICS, Still

from bt_tasksim.core import poses
from bt_tasksim.core.world import JointTarget
from bt_tasksim.engines.base import EngineSetup, engine_class
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import ObjectSpec

pytestmark = pytest.mark.physical


def world():
    """A mug, a bracket beside it, and a small cube in the mug's opening, above its floor."""
    placed = {"yaw": 0.0, "area": (0.0, 0.0)}
    side = (0.02, 0.02, 0.02)
    drawn = Scene(
        objects={
            "mug": ObjectSpec(on="table", file="mug.yaml", centre=(0.0, -0.2), **placed),
            "bracket": ObjectSpec(on="table", file="bracket.yaml", centre=(0.0, 0.2), **placed),
            "die": ObjectSpec(("cube",), "table", centre=(0.2, 0.3), size=(side, side), mass=(0.01, 0.01)),
        }
    ).sample(0)
    mug, bracket, die = drawn.objects
    assert len(mug.shape().collision) == 32 and len(bracket.shape().collision) == 2
    middle = np.array(mug.pose[:3]) + np.array([-(mug.size[0] - mug.size[1]) / 2, 0.0, 0.03])
    die = dataclasses.replace(die, pose=(*middle.tolist(), 1.0, 0.0, 0.0, 0.0))
    return dataclasses.replace(drawn, objects=(mug, bracket, die))


def check(configuration, end):
    """At the end ``(3, 7)`` the mug and the bracket stand where they stood, and the die is in the mug."""
    for k in range(2):
        pose = np.array(configuration.objects[k].pose)
        assert np.linalg.norm(end[k, :3] - pose[:3]) < 0.004
        turn = poses.rotation_vector(poses.quat_multiply(end[k, 3:], poses.quat_conjugate(pose[3:])))
        assert np.linalg.norm(turn) < 0.05
    mug = configuration.objects[0]
    inside = poses.transform(poses.inverse(end[0]), end[2, :3])
    floor = -mug.size[2] / 2 + 0.006
    assert floor + 0.008 < inside[2] < floor + 0.02, (
        "on the floor of the mug, and not on a lid or in the wall"
    )
    assert np.hypot(inside[0] + (mug.size[0] - mug.size[1]) / 2, inside[1]) < 0.022


@pytest.mark.parametrize("engine", PHYSICS)
def test_an_l_stands_and_what_is_dropped_into_a_mug_lies_in_it(engine):
    configuration = world()
    still = Still(configuration, engine)
    check(configuration, still.step(40).objects)


def test_mujoco_warp_holds_as_many_pieces():
    pytest.importorskip("mujoco_warp", reason="MuJoCo Warp is not installed: pip install 'bt-tasksim[warp]'")
    configuration, robot = world(), load_robot("panda")
    physics, rows = (
        engine_class("physics", "mujoco_warp").batch(robot, EngineSetup("mujoco_warp"), 2, 1),
        [0, 1],
    )
    physics.reset(rows, [configuration, configuration])
    assert physics.errors == [None, None]
    still = np.array(physics.state(rows).joint_position)
    for _ in range(12):
        physics.step(JointTarget(still, np.zeros_like(still)), rows)
    for end in physics.state(rows).objects:
        check(configuration, np.asarray(end))
