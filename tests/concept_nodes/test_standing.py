"""All poses in which an object may stand: upright, at its height, and each another one."""

import dataclasses

import numpy as np
import pytest

from bt_tasksim.concept.leaf import ONE
from bt_tasksim.concept_nodes import Grasp
from bt_tasksim.concept_nodes.standing import (
    ASIDE,
    HEADINGS,
    TIPPED,
    TURNED,
    aside_options,
    headings,
    nearest_first,
    standing_height,
    standing_options,
    supports_of,
    tipped,
)
from bt_tasksim.concept_nodes.surface import heading_of
from bt_tasksim.concept_nodes.view import views
from bt_tasksim.core import poses
from bt_tasksim.core.world import FURNITURE


@pytest.fixture
def view(toy):
    """The toy's world."""
    return views(toy(Grasp("cup")).context.seen(ONE, np.zeros(1)))[0]


@pytest.mark.parametrize("name", ["cup", "box"])
@pytest.mark.parametrize("hover", [0.0, 0.05])
def test_options_are_upright_over_the_place_at_the_objects_height(view, name, hover):
    options = standing_options(view, name, "goal", hover)
    place, model = view.world.place("goal"), view.model(name)
    assert np.allclose(poses.z_axis(options[:, 3:]), [0, 0, 1], atol=1e-9)
    assert np.allclose(options[:, :2], place.pose[:2])
    assert np.allclose(options[:, 2], place.pose[2] + model.extent[2] / 2 + hover)
    turns = [
        poses.angle_between(options[i, 3:], options[j, 3:]) for i in range(len(options)) for j in range(i)
    ]
    assert min(turns) > 0.1


def test_what_is_round_may_have_any_heading_and_a_box_those_of_its_symmetry(view):
    assert len(standing_options(view, "cup", "goal")) == HEADINGS
    assert len(standing_options(view, "box", "goal")) == view.model("box").symmetry


def test_a_little_aside_it_stands_nearer_to_the_arm_farther_to_either_side_or_turned(view):
    options = standing_options(view, "box", "goal", 0.05)
    every, place = aside_options(view, "goal", options), view.world.place("goal")
    found, turned = np.split(every, [4 * len(options)])
    assert len(turned) == 2 * len(options) and np.allclose(every[:, 2], options[0, 2])
    assert np.allclose(turned[:, :3], options[0, :3])
    angles = [poses.angle_between(options[:, 3:], each[None, 3:]).min() for each in turned]
    assert np.allclose(angles, TURNED)
    moved = found[:, :2] - options[0, :2]
    assert np.allclose(np.linalg.norm(moved, axis=-1), ASIDE)
    far = np.linalg.norm(found[:, :2], axis=-1) - np.linalg.norm(options[0, :2])
    assert far.min() == pytest.approx(-ASIDE) and far.max() == pytest.approx(ASIDE)
    assert {tuple(r) for r in np.round(found[:, 3:], 6)} == {tuple(r) for r in np.round(options[:, 3:], 6)}
    both = aside_options(view, "goal", options, held=True)
    assert np.array_equal(both[: len(every)], every) and len(both) == len(every) + len(found)
    small = dataclasses.replace(place, extent=(1.5 * ASIDE, 1.5 * ASIDE))
    container = dataclasses.replace(place, kind="bin")
    for other, left in ((small, turned), (container, turned[:0])):
        world = dataclasses.replace(view.world, places={**view.world.places, "goal": other})
        assert np.array_equal(aside_options(view._replace(world=world), "goal", options), left)


def test_on_another_object_which_may_be_no_larger_it_is_only_turned_by_any_angle(view):
    options = standing_options(view, "box", "cup")
    found = aside_options(view, "cup", options)
    assert np.allclose(found[:, :3], options[0, :3])
    every = np.concatenate([options, found])
    assert len(every) == HEADINGS
    turns = [poses.angle_between(every[i, 3:], every[j, 3:]) for i in range(len(every)) for j in range(i)]
    assert min(turns) > 0.9 * 2 * np.pi / HEADINGS
    round_ones = standing_options(view, "cup", "box")
    assert len(aside_options(view, "box", round_ones)) == 0, "it has every heading already"


def test_on_another_object_it_stands_on_its_top(view):
    options, box = standing_options(view, "cup", "box"), view.objects["box"]
    top = box[2] + standing_height(view.model("box"))
    assert np.allclose(options[:, :2], box[:2])
    assert np.allclose(options[:, 2], top + view.model("cup").extent[2] / 2)


def test_it_touches_the_fixture_of_the_place_or_the_other_object(view):
    place = view.world.place("goal")
    assert supports_of(view, "goal") == {place.fixture or FURNITURE}
    assert supports_of(view, "box") == {"box"}


def test_a_cube_stands_on_its_longest_half():
    from bt_tasksim.scene.shapes import ShapeSize, object_model

    cube = object_model("die", "cube", ShapeSize((0.06, 0.06, 0.06), (1.0, 1.0), None))
    assert standing_height(cube) == pytest.approx(0.03)
    assert standing_height(dataclasses.replace(cube, cubic=False)) == pytest.approx(0.03)


@pytest.mark.parametrize("angle", np.linspace(-3.0, 3.0, 7))
def test_headings_of_what_stands_and_of_what_lies(angle):
    upright = poses.pose([0, 0, 0], poses.yaw(angle))
    assert np.cos(heading_of(upright[None])[0] - angle) == pytest.approx(1.0)
    lying = poses.quat_multiply(poses.yaw(angle), poses.from_rotation_vector(np.array([0.0, np.pi / 2, 0.0])))
    assert np.cos(heading_of(poses.pose([0, 0, 0], lying)[None])[0] - angle) == pytest.approx(1.0, abs=1e-6)


def test_the_least_turned_come_first():
    options = np.concatenate([np.zeros((HEADINGS, 3)), headings()], axis=1)
    found = nearest_first(options, poses.yaw(1.0))
    angles = poses.angle_between(found[:, 3:], poses.yaw(1.0)[None])
    assert np.all(np.diff(angles) >= -1e-12) and angles[0] <= np.pi / HEADINGS + 1e-9


def test_tipped_poses_lean_about_the_tools_x_axis_the_least_first(view):
    options = standing_options(view, "box", "goal")[:3]
    grip = poses.relative(view.objects["box"], view.tool)
    found = tipped(options, grip).reshape(-1, len(options), 7)
    assert len(found) == 2 * len(TIPPED) and np.allclose(found[..., :3], options[:, :3])
    tools = poses.multiply(options, grip[None])
    for leaning, angle in zip(found, np.repeat(TIPPED, 2), strict=True):
        turned = poses.multiply(leaning, grip[None])
        assert np.allclose(poses.angle_between(leaning[:, 3:], options[:, 3:]), angle)
        for before, after in zip(tools, turned, strict=True):
            assert np.allclose(poses.to_matrix(before[3:])[:, 0], poses.to_matrix(after[3:])[:, 0])
