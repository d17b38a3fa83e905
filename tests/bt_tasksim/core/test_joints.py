"""Laws of the joints of parts of fixtures, for slides and hinges anywhere."""

import math

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bt_tasksim.core import poses
from bt_tasksim.core.joints import JointModel, Joints
from tests.array_libraries import agree

number = st.floats(-2.0, 2.0)
vector = st.tuples(number, number, number)
direction = vector.filter(lambda v: math.hypot(*v) > 0.1)


@st.composite
def models(draw):
    kind = draw(st.sampled_from(["slide", "hinge"]))
    axis = np.array(draw(direction))
    low = draw(st.floats(-1.5, 0.0))
    zero = poses.pose(np.array(draw(vector)), poses.from_rotation_vector(np.array(draw(vector))))
    return JointModel(
        kind=kind,
        origin=draw(vector),
        axis=tuple(axis / np.linalg.norm(axis)),
        zero=tuple(zero.tolist()),
        limits=(low, low + draw(st.floats(0.1, 6.2 if kind == "hinge" else 2.0))),
    )


share = st.floats(0.0, 1.0)


def at(joints, part):
    return joints.limits[:, 0] + part * (joints.limits[:, 1] - joints.limits[:, 0])


@settings(suppress_health_check=[HealthCheck.too_slow])  # the first draw imports what arrays need
@given(models(), share)
def test_the_value_of_the_pose_of_a_value_is_the_value(model, part):
    joints = Joints.of([model])
    value = at(joints, part)
    assert np.allclose(joints.value(joints.pose(value)), value, atol=1e-6)
    assert np.allclose(joints.pose(np.zeros(1)), model.zero, atol=1e-9)


@given(models(), share, share, vector)
def test_a_point_that_goes_along_tells_how_far(model, before, after, point):
    joints = Joints.of([model])
    was, now = at(joints, before), at(joints, after)
    local = np.array([point])
    axis, lever = joints.axis[0], local[0] - joints.origin[0]
    from_axis = np.linalg.norm(lever - (lever @ axis) * axis)
    if model.turns and (from_axis < 1e-3 or abs(now - was)[0] > 3.1):
        return  # on the axis nothing tells, and a half turn and more may be the other way round
    moved = (poses.transform(joints.pose(value), local) for value in (was, now))
    assert np.allclose(joints.shift(was, *moved), now - was, atol=1e-6)


@given(models(), share, st.floats(-0.3, 0.3))
def test_a_value_is_within_the_limits_and_nearest(model, part, aside):
    """An error across a slide, or of the position of what turns, changes nothing."""
    joints = Joints.of([model])
    value = at(joints, part)
    pose = joints.pose(value)
    across = np.cross(model.axis, np.roll(model.axis, 1) + np.array([0.3, 0.0, 0.0]))
    pose[:, :3] += aside * poses.rotate(pose[:, 3:], across[None])
    assert np.allclose(joints.value(pose), value, atol=1e-6)
    beyond = joints.pose(joints.limits[:, 1] + 0.02)
    assert joints.limits[0, 0] <= joints.value(beyond)[0] <= joints.limits[0, 1] + 1e-12


@settings(max_examples=20)
@given(st.lists(st.tuples(models(), share, vector, vector), min_size=2, max_size=5))
def test_worlds_do_not_feel_each_other(rows):
    joints = Joints.of([model for model, *_ in rows])
    value = at(joints, np.array([part for _, part, *_ in rows]))
    points = np.array([(a, b) for *_, a, b in rows])
    pose = joints.pose(value)
    every = joints.value(pose), joints.shift(value, points[:, 0], points[:, 1])
    for i in range(len(rows)):
        one = Joints(*(field[i : i + 1] for field in joints))
        assert np.array_equal(one.pose(value[i : i + 1]), pose[i : i + 1])
        assert np.array_equal(one.value(pose[i : i + 1]), every[0][i : i + 1])
        shift = one.shift(value[i : i + 1], points[i : i + 1, 0], points[i : i + 1, 1])
        assert np.array_equal(shift, every[1][i : i + 1])


DOOR = JointModel("hinge", (0.1, 0.0, 0.2), (0.0, 0.0, -1.0), (0.5, 0.1, 0.2, 1, 0, 0, 0), (0.0, 2.0))
DRAWER = JointModel("slide", (0.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.6, 0.0, 0.1, 1, 0, 0, 0), (0.0, 0.3))


def test_in_every_array_library():
    joints, value = Joints.of([DOOR, DRAWER]), np.array([1.0, 0.1])
    pose = agree(lambda joints, value: joints.pose(value), joints, value)
    agree(lambda joints, pose: joints.value(pose), joints, pose)
    points = poses.transform(pose, np.array([[0.0, 0.3, 0.0], [0.1, 0.0, 0.0]]))
    agree(lambda *given: given[0].shift(*given[1:]), joints, value, points, points + 0.02)
