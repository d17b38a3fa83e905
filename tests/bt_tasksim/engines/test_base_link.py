"""A robot whose base link is not its URDF's root stands at the same place for kinematics and for physics."""

import dataclasses

import numpy as np
import pytest

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics
from bt_tasksim.engines.physics.mujoco import MujocoPhysics
from bt_tasksim.engines.physics.sapien import SapienPhysics
from bt_tasksim.execution.pipelines import EngineOptions, build_pipeline
from bt_tasksim.robot.description import load_robot
from bt_tasksim.robot.urdf_links import load_links
from bt_tasksim.scene import Scene
from tests.bt_tasksim import small_arm

PHYSICS = {"sapien": SapienPhysics, "mujoco": MujocoPhysics}


@pytest.mark.parametrize("engine", PHYSICS)
@pytest.mark.parametrize("base_link", ["base", "floor"])
def test_kinematics_and_physics_agree(tmp_path, engine, base_link):
    robot = load_robot(small_arm.write(tmp_path, base_link))
    kinematics = PinocchioKinematics(robot)
    state = PHYSICS[engine](robot).reset(Scene(robot=str(robot.source)).sample(0))
    np.testing.assert_allclose(state.joint_position[:6], robot.rest, atol=1e-6)
    np.testing.assert_allclose(state.tool_pose[:3], kinematics.forward(robot.rest)[:3], atol=1e-5)
    assert poses.angle_between(state.tool_pose[3:], kinematics.forward(robot.rest)[3:]) < 1e-3


def test_the_base_frame_moves_with_the_base_link(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    on_base = PinocchioKinematics(load_robot(small_arm.write(tmp_path / "a", "base")))
    on_floor = PinocchioKinematics(load_robot(small_arm.write(tmp_path / "b", "floor")))
    rest = on_base.robot.rest
    mast = poses.pose(small_arm.MAST, poses.yaw(0.5))
    expected = poses.multiply(mast, on_base.forward(rest))
    np.testing.assert_allclose(on_floor.forward(rest), expected, atol=1e-9)


def test_a_joint_without_end_has_the_limits_of_the_robots_file(tmp_path):
    kinematics = PinocchioKinematics(load_robot(small_arm.write(tmp_path)))
    target = kinematics.forward(np.array([2.5, 0.5, 0.8, 0.1, 0.7, 0.2]))
    found = kinematics.inverse(target)
    np.testing.assert_allclose(kinematics.forward(found)[:3], target[:3], atol=1e-3)
    assert np.all(np.abs(found) <= 3.0)


def test_the_axis_of_a_fixed_joint_may_be_zero(tmp_path):
    small_arm.write(tmp_path)
    kinds = {item.joint: item.kind for item in load_links(tmp_path / "small.urdf")}
    assert kinds["mast"] == "fixed" and kinds["j0"] == "continuous"


def test_engines_with_different_robots_are_told_apart_at_the_reset(tmp_path):
    robot = load_robot(small_arm.write(tmp_path))
    pipeline = build_pipeline(robot, EngineOptions())
    world = Scene(robot=str(robot.source)).sample(0)
    model = world.world_model([tip.name for tip in robot.tips], robot.opening)
    pipeline.reset(world, model)
    other = dataclasses.replace(robot, base_link="floor")
    pipeline.kinematics = PinocchioKinematics(other)
    with pytest.raises(InputError, match=r"mm and 28.6 degrees apart.*base_link"):
        pipeline.reset(world, model)
