"""Force features and the visual ones aligned with them."""

import dataclasses

import numpy as np
import pytest

from bt_tasksim.core import poses
from bt_tasksim.core.world import Observation, WorldState
from bt_tasksim.engines.perception.features import TOUCH, ObservationBuilder
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import ObjectSpec

SIZE = ((0.04, 0.06, 0.1),) * 2
SCENE = Scene(objects={"box": ObjectSpec(("box",), "table", size=SIZE), "far": ObjectSpec(("cup",), "table")})
BOX = poses.pose([0.5, 0.1, 0.2], poses.yaw(0.3))
FAR = poses.pose([0.2, -0.4, 0.05])


def situation(robot="panda", scene=SCENE):
    description, configuration = load_robot(robot), scene.sample(0)
    n, tips = len(description.joints), len(description.tips)
    rng = np.random.default_rng(0)
    state = WorldState(
        time=np.float64(1.0),
        joint_position=np.concatenate([description.rest, description.hand_open]),
        joint_velocity=rng.normal(size=n),
        joint_effort=description.drive_array("force_limit") * rng.uniform(-1, 1, n),
        tip_force=np.zeros((tips, 3)),
        wrench=rng.normal(size=6),
        tool_pose=poses.pose([0.5, 0.1, 0.25], poses.from_rotation_vector(np.array([3.0, 0.2, 0.1]))),
        tips=np.array([0.5, 0.1, 0.2]) + rng.normal(scale=0.05, size=(tips, 3)),
        objects=np.array([BOX, FAR]),
        velocities=np.zeros((2, 6)),
    )
    return ObservationBuilder(description, configuration), state, description


@pytest.mark.parametrize("robot", ["panda", "xarm7_ability"])
def test_each_force_feature_has_one_visual_counterpart(robot):
    builder, state, description = situation(robot)
    seen = builder.build(state, state.objects)
    n = len(description.tips)
    assert seen.contacts.shape == (n,) and seen.contacts.dtype == bool
    assert seen.contact_force.shape == seen.contact_points.shape == seen.tips.shape == (n, 3)
    assert seen.wrench.shape == seen.motion.shape == (6,)
    assert seen.arm_position.shape == seen.arm_velocity.shape == (len(description.arm_joints),)
    assert seen.hand_position.shape == seen.hand_effort.shape == (len(description.hand_joints),)
    assert np.all(np.abs(seen.hand_effort) <= 1)
    for field in dataclasses.fields(Observation):
        assert np.all(np.isfinite(getattr(seen, field.name))), field.name


def test_contact_is_a_force_above_a_threshold():
    builder, state, _ = situation()
    force = np.array([[0.0, 0, 0.9 * TOUCH], [0.8 * TOUCH, 0, -0.8 * TOUCH]])
    seen = builder.build(dataclasses.replace(state, tip_force=force), state.objects)
    assert seen.contacts.tolist() == [False, True] and np.array_equal(seen.contact_force, force)


def test_contact_points_lie_on_the_estimated_surface_nearest_to_the_tips():
    builder, state, _ = situation()
    outside = [poses.transform(BOX, np.array(p)) for p in ([0.05, 0.01, 0.02], [0.0, -0.09, 0.0])]
    state = dataclasses.replace(state, tips=np.array(outside))
    seen = builder.build(state, state.objects)
    local = poses.transform(poses.inverse(BOX)[None], seen.contact_points)
    assert np.allclose(local, [[0.02, 0.01, 0.02], [0.0, -0.03, 0.0]], atol=1e-6)
    shifted = state.objects + np.array([0.01, 0, 0, 0, 0, 0, 0])
    moved = builder.build(state, shifted).contact_points
    assert not np.allclose(moved, seen.contact_points), "the estimate counts, not the truth"


def test_the_nearest_object_is_the_one_that_is_looked_at():
    builder, state, _ = situation()
    at_far = dataclasses.replace(state, tool_pose=FAR, tips=np.tile(FAR[:3], (2, 1)))
    seen = builder.build(at_far, state.objects)
    assert np.linalg.norm(seen.contact_points - FAR[:3], axis=-1).max() < 0.1


def test_motion_is_the_twist_of_the_object_in_the_tool_frame():
    builder, state, _ = situation()
    first = builder.build(state, state.objects)
    assert not first.motion.any(), "nothing is known of motion at first"
    local = poses.multiply(poses.inverse(state.tool_pose), BOX)
    twist = np.array([0.1, -0.2, 0.3, 0.5, 0.0, -0.4])
    after = np.concatenate(
        [
            local[:3] + 0.05 * twist[:3],
            poses.quat_multiply(poses.from_rotation_vector(0.05 * twist[3:]), local[3:]),
        ]
    )
    moved = np.array([poses.multiply(state.tool_pose, after), FAR])
    seen = builder.build(dataclasses.replace(state, time=np.float64(1.05)), moved)
    assert np.allclose(seen.motion, twist, atol=1e-9)


def test_an_object_that_moves_with_the_tool_does_not_move():
    builder, state, _ = situation()
    builder.build(state, state.objects)
    move = poses.pose([0.02, 0.01, 0.03], poses.from_rotation_vector(np.array([0.1, 0.2, 0.0])))
    tool = poses.multiply(move, state.tool_pose)
    both = np.array([poses.multiply(move, BOX), FAR])
    seen = builder.build(dataclasses.replace(state, time=np.float64(1.05), tool_pose=tool), both)
    assert np.abs(seen.motion).max() < 1e-9


def test_a_world_without_objects():
    builder, state, _ = situation(scene=Scene())
    seen = builder.build(dataclasses.replace(state, objects=np.zeros((0, 7))), np.zeros((0, 7)))
    assert np.array_equal(seen.contact_points, seen.tips) and not seen.motion.any()
