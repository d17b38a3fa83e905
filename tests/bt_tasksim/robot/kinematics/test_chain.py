"""The arm as a chain of joints, against Pinocchio's own forward kinematics, Jacobians and logarithms."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from bt_tasksim.core.poses import Array
from bt_tasksim.robot.description import load_robot
from bt_tasksim.robot.kinematics.chain import Chain, difference, placements, poses_of, turned
from bt_tasksim.robot.kinematics.linear import solve_symmetric, total
from bt_tasksim.robot.kinematics.models import arm_model, full_model
from tests.array_libraries import agree

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


# ---- libraries, devices and company -----------------------------------------------------------------------

ROWS = 65


def some_poses(seed: int) -> Array:
    """Poses ``(7, ROWS)``; some turned by nothing, and some by half a turn."""
    out = np.random.default_rng(seed).normal(size=(7, ROWS))
    out[3:, ::9] = np.array([[1.0, 0, 0, 0]]).T
    out[3:, 1::9] = np.array([[0.0, 0, 1, 0]]).T
    out[3:] /= np.sqrt((out[3:] ** 2).sum(axis=0))
    return out


def way(here: Array, there: Array) -> Array:
    """From one pose to another; its last three numbers may have either sign at half a turn."""
    found = difference(placements(here), placements(there))
    return found[:3, ...], abs(found[3:, ...])


def through(name: str, q: Array) -> tuple[Array, Array]:
    chain = Chain.of(model(name), "tool", q)
    seen = chain.seen(q)
    return seen, chain.jacobian(seen)


def columns_of(array: Array, rows: Array) -> Array:
    return np.ascontiguousarray(array[..., rows])


@pytest.mark.parametrize("name", ["panda", "xarm7_ability", "so100", "crane"])
def test_every_library_and_device_sees_the_same_chain(rows_alike, name: str) -> None:
    q = np.random.default_rng(3).uniform(-1.5, 1.5, (model(name).nq, ROWS))
    agree(lambda q: through(name, q), q, close=1e-12, single_close=1e-4)
    whole = rows_alike(lambda rows: [np.moveaxis(x, -1, 0) for x in through(name, columns_of(q, rows))], ROWS)
    np.testing.assert_array_equal(np.moveaxis(whole[0], 0, -1), through(name, q)[0])


def test_every_library_and_device_gives_the_same_placements_and_ways(rows_alike) -> None:
    here, there, points = some_poses(4), some_poses(5), np.random.default_rng(6).normal(size=(4, 3, ROWS))
    agree(placements, here, close=1e-12)
    agree(poses_of, placements(here), close=1e-12, single_close=None)
    agree(turned, placements(here), points, close=1e-12)
    with np.errstate(invalid="raise", divide="raise"):
        agree(way, here, there, close=1e-9, single_close=None)
    single = way(*(x.astype(np.float32) for x in (here, there)))
    for part, exact in zip(single, way(here, there), strict=True):
        np.testing.assert_allclose(part, exact, atol=1e-2)

    def each(rows: Array) -> list[Array]:
        a, b, p = (columns_of(x, rows) for x in (here, there, points))
        found = (placements(a), turned(placements(a), p), *way(a, b))
        return [poses_of(placements(a)), *(np.moveaxis(x, -1, 0) for x in found)]

    rows_alike(each, ROWS)


@pytest.mark.parametrize("m", [3, 6])
def test_every_library_and_device_solves_the_same_systems(rows_alike, m: int) -> None:
    rng = np.random.default_rng(7)
    root = rng.normal(size=(m, m + 4, ROWS))
    matrix = np.einsum("ikn,jkn->ijn", root, root) + np.eye(m)[..., None]
    right = rng.normal(size=(m, ROWS))
    agree(solve_symmetric, matrix, right, close=1e-9, single_close=1e-2)
    agree(total, matrix, close=1e-12)
    rows_alike(lambda rows: solve_symmetric(columns_of(matrix, rows), columns_of(right, rows)).T.copy(), ROWS)
