"""The arm as a chain of joints, against Pinocchio's own forward kinematics, Jacobians and logarithms."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from bt_tasksim.core.poses import Array
from bt_tasksim.engines.kinematics.chain import Chain, difference, placements, poses_of
from bt_tasksim.engines.kinematics.linear import solve_symmetric
from bt_tasksim.engines.kinematics.models import arm_model, full_model
from bt_tasksim.robot.description import load_robot

SLIDING = """<robot name="crane"><link name="a"/><link name="b"/><link name="c"/><link name="d"/>
  <joint name="turn" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0 0 1" rpy="0.1 0.2 0"/>
    <axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="slide" type="prismatic"><parent link="b"/><child link="c"/><origin xyz="0.3 0 0" rpy="0 1 0"/>
    <axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="lean" type="revolute"><parent link="c"/><child link="d"/><origin xyz="0 0.2 0" rpy="0 0 1"/>
    <axis xyz="0.6 0 -0.8"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint></robot>"""


def model(name: str) -> pin.Model:
    if name == "crane":
        made = pin.buildModelFromXML(SLIDING)
        link = made.frames[made.getFrameId("d")]
        tool = pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.2, 0.5), np.array([0.1, 0.0, 0.2]))
        made.addFrame(pin.Frame("tool", link.parentJoint, link.placement * tool, pin.FrameType.OP_FRAME))
        return made
    robot = load_robot(name)
    return arm_model(robot, full_model(robot)[0])


def as_array(placement: pin.SE3) -> Array:
    return np.column_stack([placement.rotation, placement.translation])


@pytest.mark.parametrize("name", ["panda", "xarm7_ability", "so100", "crane"])
def test_tool_and_jacobian_are_those_of_pinocchio(name: str) -> None:
    arm = model(name)
    data, frame = arm.createData(), arm.getFrameId("tool")
    q = np.random.default_rng(0).uniform(-1.5, 1.5, (arm.nq, 40))
    chain = Chain.of(arm, "tool", np.empty(0))
    seen = chain.seen(q)
    jacobian = chain.jacobian(seen)
    for i in range(40):
        expected = pin.computeFrameJacobian(arm, data, q[:, i].copy(), frame, pin.ReferenceFrame.LOCAL)
        np.testing.assert_allclose(jacobian[:, :, i].T, expected, atol=1e-12)
        pin.forwardKinematics(arm, data, q[:, i].copy())
        expected = as_array(pin.updateFramePlacement(arm, data, frame))
        np.testing.assert_allclose(seen[0, :, :, i], expected, atol=1e-12)
    np.testing.assert_allclose(placements(poses_of(seen[0]).T.copy()), seen[0], atol=1e-12)


@pytest.mark.parametrize("left", [1.5, 0.1, 1e-2, 1e-4, 1e-8, 0.0])
def test_the_way_from_one_pose_to_another_up_to_half_a_turn(left: float) -> None:
    rng = np.random.default_rng(1)
    axes = np.concatenate([np.eye(3), -np.eye(3), rng.normal(size=(60, 3))])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    here = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(size=3))
    steps = [pin.SE3(pin.exp3((np.pi - left) * axis), rng.normal(size=3)) for axis in axes]
    there = np.stack([as_array(here * step) for step in steps], axis=-1)
    way = difference(np.repeat(as_array(here)[..., None], len(axes), axis=-1), there)
    for i, step in enumerate(steps):
        np.testing.assert_allclose(way[:3, i], step.translation, atol=1e-12)
        np.testing.assert_allclose(pin.exp3(way[3:, i].copy()), step.rotation, atol=1e-7)
        if left > 1e-3:
            np.testing.assert_allclose(way[3:, i], (np.pi - left) * axes[i], atol=1e-9)


def test_no_way_at_all_is_zero() -> None:
    here = as_array(pin.SE3.Identity())[..., None]
    assert not difference(here, here).any()


@pytest.mark.parametrize("m", [3, 5, 6])
def test_small_systems_are_solved(m: int) -> None:
    rng = np.random.default_rng(2)
    root = rng.normal(size=(50, m, m + 1))
    matrix, x = root @ root.transpose(0, 2, 1) + 1e-6 * np.eye(m), rng.normal(size=(50, m))
    right = np.einsum("nij,nj->ni", matrix, x)
    found = solve_symmetric(matrix.transpose(1, 2, 0).copy(), right.T.copy())
    np.testing.assert_allclose(found.T, x, atol=1e-6)
