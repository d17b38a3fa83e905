"""Balls, bowls and jugs: what they are made of, and that physics has balls as balls."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.hollows import hollow
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.shapes import BallPiece, ShapeSize, object_model, shape
from bt_tasksim.scene.specs import ObjectSpec
from tests.bt_tasksim.scene.solids import solids


@settings(max_examples=30, deadline=None)
@given(solids(("ball", "bowl", "jug")))
def test_pieces_and_visual_fill_the_bounding_box(case):
    geometry, extent = shape(*case), np.array(object_model("it", *case).extent)
    for points in (np.concatenate(geometry.pieces), geometry.visual.vertices):
        assert np.ptp(points, axis=0) == pytest.approx(extent, abs=1e-6)
        assert np.abs(points).max(axis=0) == pytest.approx(extent / 2, abs=1e-6)
    assert 0.0 < geometry.volume <= np.prod(extent)
    moments = sorted(geometry.mass.inertia)
    assert moments[0] > 0.0 and moments[2] <= moments[0] + moments[1] + 1e-12


def test_a_ball_weighs_what_a_ball_does():
    geometry = shape("ball", ShapeSize((0.04,) * 3))
    assert geometry.volume == pytest.approx(4 / 3 * math.pi * 0.02**3)
    assert np.allclose(geometry.mass.inertia, 0.4 * 0.02**2)
    assert isinstance(geometry.collision[0], BallPiece) and not len(geometry.hollow)


@settings(max_examples=4, deadline=None)
@given(st.floats(0.1, 0.2), st.floats(0.04, 0.09))
def test_a_bowl_says_its_hollow_as_it_would_be_found(across, height):
    geometry = shape("bowl", ShapeSize((across, across, height)))
    said, found = geometry.hollow, hollow(geometry.pieces, geometry.extent)
    volume = [float(np.sum(4 * b[:, 2] * b[:, 3] * (b[:, 5] - b[:, 4]))) for b in (said, found)]
    assert volume[0] == pytest.approx(volume[1], rel=0.12)


def test_a_jug_is_hollow_in_its_body_and_in_its_spout_and_not_in_its_handle():
    boxes = shape("jug", ShapeSize((0.1, 0.062, 0.105))).hollow
    deep = boxes[:, 5] - boxes[:, 4] > 0.08
    assert np.abs(boxes[deep, :2]).max() < 0.031 and boxes[~deep, 0].min() > 0.02
    assert boxes[:, 0].max() > 0.036 and boxes[:, 0].min() > -0.031


@pytest.mark.parametrize(
    ("kind", "size", "why"),
    [
        ("ball", (0.04, 0.04, 0.05), "as wide as it is long and high"),
        ("bowl", (0.04, 0.04, 0.05), "no room inside its walls"),
        ("jug", (0.06, 0.06, 0.1), "longer than wide by its spout"),
        ("jug", (0.06, 0.02, 0.1), "no room inside its walls"),
    ],
)
def test_sizes_that_make_none_are_refused(kind, size, why):
    with pytest.raises(InputError, match=why):
        shape(kind, ShapeSize(size))


@pytest.mark.physical
@pytest.mark.parametrize("engine", ["sapien", "mujoco"])
def test_physics_has_a_ball_as_a_ball(engine):
    drawn = Scene(objects={"pea": ObjectSpec(("ball",), on="table")}).sample(3)
    if engine == "sapien":
        from bt_tasksim.engines.physics.sapien_world import build_world

        (form,) = build_world(drawn, 10).objects[0].get_collision_shapes()
        assert type(form).__name__ == "PhysxCollisionShapeSphere"
        assert form.radius == pytest.approx(drawn.objects[0].size[0] / 2)
    else:
        import mujoco

        from bt_tasksim.engines.physics.mujoco_model import build_world as build

        model = build(mujoco, load_robot("panda"), drawn).model
        geom = model.geom("object/0/0")
        assert geom.type[0] == mujoco.mjtGeom.mjGEOM_SPHERE
        assert geom.size[0] == pytest.approx(drawn.objects[0].size[0] / 2)
        assert np.allclose(poses.pose(geom.pos)[:3], 0.0)
