"""Level frames on what stands: on top of it, turned as it is, whichever face of a cube is up."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.concept.leaf import ONE
from bt_tasksim.concept_nodes import Grasp
from bt_tasksim.concept_nodes.destination import destination
from bt_tasksim.concept_nodes.standing import reference_frame
from bt_tasksim.concept_nodes.surface import heading_of, top_frame, upright
from bt_tasksim.concept_nodes.view import views
from bt_tasksim.core import poses
from tests.array_libraries import agree

FACES = [
    poses.from_rotation_vector(np.pi / 2 * turns * np.array(axis))
    for axis, counts in (((1.0, 0, 0), (0, 1, 2, 3)), ((0, 1.0, 0), (1, 3)))
    for turns in counts
]
"""Rotations that put each of a cube's faces down."""

angles = st.floats(-np.pi, np.pi)
metres = st.floats(-1.0, 1.0)


@settings(max_examples=200, deadline=None)
@given(
    face=st.sampled_from(FACES), angle=angles, at=st.tuples(metres, metres, metres), height=st.floats(0, 0.2)
)
def test_what_lies_on_any_face_has_a_level_top(face, angle, at, height):
    pose = poses.pose(np.array(at), poses.quat_multiply(poses.yaw(angle), face))
    frame = top_frame(pose[None], np.array([height]))[0]
    assert np.allclose(frame[:3] - np.array(at), [0.0, 0.0, height])
    assert np.allclose(poses.z_axis(frame[3:]), [0, 0, 1], atol=1e-9)
    # Its sides are those of the cube, whichever of them is which.
    square = 4 * (heading_of(frame[None])[0] - angle)
    assert np.cos(square) == pytest.approx(1.0, abs=1e-6)


@settings(max_examples=200, deadline=None)
@given(angle=angles, lean=st.floats(-0.3, 0.3), towards=angles)
def test_what_leans_a_little_has_nearly_its_own_heading(angle, lean, towards):
    tilt = poses.from_rotation_vector(lean * np.array([np.cos(towards), np.sin(towards), 0.0]))
    pose = poses.pose([0.1, 0.2, 0.3], poses.quat_multiply(tilt, poses.yaw(angle)))
    frame = top_frame(pose[None], np.array([0.05]))[0]
    assert np.allclose(poses.z_axis(frame[3:]), [0, 0, 1], atol=1e-9)
    assert np.cos(heading_of(pose[None])[0] - angle) > np.cos(lean**2 / 2 + 1e-6)


def test_it_is_the_same_in_every_library():
    rng = np.random.default_rng(0)
    now = rng.normal(size=(40, 7))
    now[:, 3:] = poses.normalise(now[:, 3:])
    height = rng.uniform(0.0, 0.1, 40)
    found = agree(top_frame, now, height)
    assert np.allclose(found[0], top_frame(now[:1], height[:1])[0])


@pytest.mark.parametrize("face", FACES)
def test_a_cube_that_lies_on_another_face_carries_as_an_upright_one(toy, face):
    """On its top, level, and as high as half its edge; the search for ways and the concepts agree on it."""
    stage = toy(Grasp("cup"))
    model = stage.world.model
    cube = dataclasses.replace(model.object("box"), extent=np.array([0.06, 0.06, 0.06]), cubic=True)
    others = [cube if m.name == "box" else m for m in model.objects]
    stage.context.begin([dataclasses.replace(model, objects=tuple(others))])
    objects, k = stage.world.now.objects.copy(), model.object_index("box")
    objects[k, 2], objects[k, 3:] = 0.03, poses.quat_multiply(poses.yaw(0.4), face)
    stage.world.put(objects=objects)
    stage.look()
    seen = stage.context.seen(ONE, np.zeros(1))
    frame, rim = destination(seen, "box")
    assert np.allclose(frame[0, :3] - objects[k, :3], [0.0, 0.0, 0.03], atol=1e-9) and rim[0] == 0.0
    assert np.allclose(poses.z_axis(frame[0, 3:]), [0, 0, 1], atol=1e-9)
    assert np.cos(4 * (heading_of(frame)[0] - 0.4)) == pytest.approx(1.0, abs=1e-6)
    view = views(seen)[0]
    assert np.allclose(reference_frame(view, "box")[0], frame[0], atol=1e-8)


@pytest.mark.parametrize("heading", [0.0, 0.5, 2.0])
@pytest.mark.parametrize("tilted", [0.0, 1.0, np.pi - 1e-3, np.pi])
def test_whatever_was_tilted_is_set_upright_and_what_is_upside_down_too(heading, tilted):
    axis = np.array([np.cos(heading), np.sin(heading), 0.0])
    turn = poses.quat_multiply(poses.from_rotation_vector(tilted * axis), poses.yaw(heading))
    now, frame = (poses.pose([0.0, 0.0, 0.05], rotation)[None] for rotation in (turn, poses.yaw(0.3)))
    found = upright(frame, now)
    assert poses.z_axis(found)[0] == pytest.approx([0.0, 0.0, 1.0], abs=1e-6)
    assert poses.angle_between(found, now[:, 3:])[0] == pytest.approx(tilted, abs=1e-6)
