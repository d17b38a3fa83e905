"""Known shapes are found where they are, from one side, through noise and behind other things."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from raycast import CAMERA, box, cloud, cylinder, image

from bt_tasksim.core import poses
from bt_tasksim.core.world import Obstacle
from bt_tasksim.engines.perception.camera_errors import CameraErrors
from bt_tasksim.engines.perception.fixture_faces import boxes_near
from bt_tasksim.engines.perception.pose_estimation import Target, estimate_pose, follow
from bt_tasksim.engines.perception.registration import UPRIGHT, DepthView, judge_fit, register, sample_surface
from bt_tasksim.scene.fixtures import load_fixture
from bt_tasksim.scene.shapes import ShapeSize, object_model, shape

PLACES = load_fixture("table").place_models()
RED = (0.86, 0.16, 0.15)
BOX, ROUND = (0.072, 0.046, 0.1), (0.05, 0.05, 0.09)
ERRORS = CameraErrors(position=0, rotation=0)
TABLE = Obstacle(poses.pose([0.5, 0.0, -0.02]), (0.8, 1.2, 0.04), "table")
spots = st.tuples(st.floats(0.35, 0.65), st.floats(-0.3, 0.3), st.floats(-3.1, 3.1))


def target(kind, size):
    return Target(object_model("it", kind, ShapeSize(size)), shape(kind, ShapeSize(size)))


def view(depth, occluder=None, noise=None):
    things = [(depth, RED)] + ([] if occluder is None else [(occluder, (0.5, 0.5, 0.5))])
    seen, which = image(things)
    metres = seen.depth if noise is None else noise.depth(seen.depth, np.random.default_rng(0))
    points = cloud(CAMERA, metres)[which == 1]
    points = points[points[:, 2] > 0.005]
    return DepthView(CAMERA, metres, np.random.default_rng(1).permutation(points))


def turned(found, true, symmetry):
    return min(
        float(poses.angle_between(found, poses.quat_multiply(true, poses.yaw(2 * np.pi * k / symmetry))))
        for k in range(symmetry)
    )


@settings(max_examples=12, deadline=None, derandomize=True)
@given(spots)
def test_a_standing_box_is_found_exactly_without_noise(spot):
    x, y, yaw = spot
    pose = poses.pose([x, y, BOX[2] / 2], poses.yaw(yaw))
    fit = estimate_pose(target("box", BOX), view(box(pose, BOX)), PLACES)
    assert np.linalg.norm(fit.pose[:3] - pose[:3]) < 0.001
    assert turned(fit.pose[3:], pose[3:], 2) < np.deg2rad(1)
    assert fit.cost < 0.2


@settings(max_examples=12, deadline=None, derandomize=True)
@given(spots)
def test_a_standing_cylinder_is_found_through_noise(spot):
    pose = poses.pose([*spot[:2], ROUND[2] / 2])
    seen = view(cylinder(pose, ROUND[0] / 2, ROUND[2]), noise=ERRORS)
    fit = estimate_pose(target("cylinder", ROUND), seen, PLACES)
    assert np.linalg.norm(fit.pose[:3] - pose[:3]) < 0.003
    assert np.allclose(poses.rotate(fit.pose[3:], np.array([0, 0, 1.0])), [0, 0, 1], atol=1e-9)


@settings(max_examples=6, deadline=None, derandomize=True)
@given(spots)
def test_a_lying_box_is_found(spot):
    x, y, yaw = spot
    tip = poses.from_rotation_vector(np.array([np.pi / 2, 0, 0]))
    pose = poses.pose([x, y, BOX[1] / 2], poses.quat_multiply(poses.yaw(yaw), tip))
    fit = estimate_pose(target("box", BOX), view(box(pose, BOX), noise=ERRORS), PLACES)
    assert np.linalg.norm(fit.pose[:3] - pose[:3]) < 0.004
    flips = [
        np.array([1.0, 0, 0, 0]),
        np.array([0, 1.0, 0, 0]),
        np.array([0, 0, 1.0, 0]),
        np.array([0, 0, 0, 1.0]),
    ]
    off = min(float(poses.angle_between(fit.pose[3:], poses.quat_multiply(pose[3:], f))) for f in flips)
    assert off < np.deg2rad(3)


def test_a_half_hidden_box_is_found():
    pose = poses.pose([0.5, 0.0, BOX[2] / 2], poses.yaw(0.5))
    hand = box(poses.pose([0.47, 0.16, 0.2]), (0.06, 0.02, 0.3))
    whole, part = view(box(pose, BOX)), view(box(pose, BOX), occluder=hand)
    assert 0.25 < len(part.points) / len(whole.points) < 0.75
    fit = estimate_pose(target("box", BOX), part, PLACES)
    assert np.linalg.norm(fit.pose[:3] - pose[:3]) < 0.003
    assert turned(fit.pose[3:], pose[3:], 2) < np.deg2rad(2)


@pytest.mark.parametrize("heading", [0.4, 0.4 + np.pi / 2])
def test_of_poses_that_look_alike_the_one_that_was_believed_stays(heading):
    nearly_square = (0.06, 0.059, 0.08)
    seen = view(box(poses.pose([0.5, 0.0, 0.04], poses.yaw(0.4)), nearly_square), noise=ERRORS)
    before = poses.pose([0.503, -0.002, 0.042], poses.yaw(heading + 0.05))
    fit = estimate_pose(target("box", nearly_square), seen, PLACES, before)
    assert turned(fit.pose[3:], poses.yaw(heading), 2) < np.deg2rad(4)
    assert np.linalg.norm(fit.pose[:3] - [0.5, 0.0, 0.04]) < 0.003


def test_what_was_moved_is_found_where_it_is_now():
    pose = poses.pose([0.5, 0.0, BOX[2] / 2], poses.yaw(0.4))
    before = poses.pose([0.46, 0.03, BOX[2] / 2], poses.yaw(1.2))
    fit = estimate_pose(target("box", BOX), view(box(pose, BOX), noise=ERRORS), PLACES, before)
    assert np.linalg.norm(fit.pose[:3] - pose[:3]) < 0.003
    assert turned(fit.pose[3:], pose[3:], 2) < np.deg2rad(2)


def test_a_pose_within_a_fixture_is_left():
    """Of a box that lies only the top is seen: it might stand as well, most of it in the table."""
    tip = poses.from_rotation_vector(np.array([np.pi / 2, 0, 0]))
    lying, sunk = poses.pose([0.5, 0.0, 0.023], tip), poses.pose([0.5, 0.0, -0.004])
    seen = view(box(lying, BOX))
    top = replace(seen, points=seen.points[seen.points[:, 2] > 0.045])
    near = replace(top, fixtures=boxes_near([TABLE], top.points[0], 0.1))
    points = sample_surface(target("box", BOX).shape)
    assert judge_fit(points, top, sunk).overlap == 0.0
    assert judge_fit(points, near, sunk).overlap > 0.003 > judge_fit(points, near, lying).overlap
    out = register(points.thinned(1000), near, poses.pose([0.5, 0.0, 0.012], tip), (2,))
    assert out[2] == pytest.approx(0.023, abs=0.004)


def test_something_else_of_the_same_colour_is_not_taken_for_it():
    stick = box(poses.pose([0.5, 0.0, 0.006], poses.yaw(1.0)), (0.3, 0.012, 0.012))
    assert estimate_pose(target("box", BOX), view(stick), PLACES) is None


def test_what_lies_open_behind_the_model_speaks_against_a_pose():
    pose = poses.pose([0.5, 0.0, BOX[2] / 2], poses.yaw(0.5))
    seen, points = view(box(pose, BOX)), sample_surface(target("box", BOX).shape)
    right = judge_fit(points, seen, pose)
    aside = judge_fit(points, seen, poses.pose([0.5, 0.03, BOX[2] / 2], pose[3:]))
    assert right.missing < 0.03
    assert aside.missing > 0.15
    assert aside.cost > right.cost + 0.3


def test_a_held_box_is_followed_in_the_air():
    pose = poses.pose([0.5, 0.0, 0.3], poses.from_rotation_vector(np.array([0.3, -0.2, 0.6])))
    start = poses.pose(pose[:3] + 0.006, poses.quat_multiply(poses.yaw(0.08), pose[3:]))
    fit = follow(target("box", BOX), view(box(pose, BOX), noise=ERRORS), start)
    assert np.linalg.norm(fit.pose[:3] - pose[:3]) < 0.003
    assert float(poses.angle_between(fit.pose[3:], pose[3:])) < np.deg2rad(2)


def test_a_motion_that_the_shape_does_not_show_stays_still():
    pose = poses.pose([0.5, 0.0, ROUND[2] / 2], poses.yaw(0.7))
    points = sample_surface(target("cylinder", ROUND).shape)
    seen = view(cylinder(pose, ROUND[0] / 2, ROUND[2]))
    start = poses.pose([0.51, -0.01, ROUND[2] / 2], poses.yaw(0.7))
    found = register(points, seen, start, UPRIGHT)
    assert np.linalg.norm(found[:3] - pose[:3]) < 0.001
    assert float(poses.angle_between(found[3:], pose[3:])) < 0.1


@pytest.mark.parametrize("kind", ["box", "cup", "diamond"])
def test_samples_lie_on_the_surface_with_their_normals_outwards(kind):
    it = shape(kind, ShapeSize((0.07, 0.07, 0.1)))
    points = sample_surface(it)
    assert np.all(np.abs(points.points) <= np.array(it.extent) / 2 + 1e-9)
    assert np.allclose(np.linalg.norm(points.normals, axis=-1), 1)
    # The flow of the position through a closed surface is three times its volume.
    flow = np.mean(np.sum(points.points * points.normals, axis=-1)) * points.area
    assert flow == pytest.approx(3 * it.volume, rel=0.05)
    assert sample_surface(it) is points


def test_errors_of_a_camera():
    depth = np.full((120, 160), 1.5)
    depth[0] = 0.0
    noisy = CameraErrors(smooth=0).depth(depth, np.random.default_rng(3))
    assert np.all(noisy[0] == 0)
    assert np.std(noisy[1:] - 1.5) == pytest.approx(0.0025, rel=0.05)
    assert np.allclose(noisy * 1000, np.round(noisy * 1000))
    smooth = CameraErrors(constant=0, proportional=0, quantum=0).depth(depth, np.random.default_rng(3))[1:]
    assert np.std(smooth - 1.5) > 0.0002
    assert np.max(np.abs(np.diff(smooth, axis=1))) < 0.0003
    again = CameraErrors().depth(depth, np.random.default_rng(3))
    assert np.array_equal(again, CameraErrors().depth(depth, np.random.default_rng(3)))
