"""TipUp and LayDown: the edge stays, one face comes down; what has no end is refused."""

import math

import numpy as np
import pytest
from draws import successes
from hypothesis import given, settings
from hypothesis import strategies as st
from py_trees.common import Status

from bt_tasksim.concept_nodes import Grasp, LayDown, Release, TipUp
from bt_tasksim.concept_nodes.contents import spilling_none
from bt_tasksim.concept_nodes.tipping import long_axis, swing
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.execution.runner import Runner
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.shapes import ShapeSize, object_model
from bt_tasksim.scene.spatial_laws import rise_of_long_axis
from bt_tasksim.scene.specs import Goal, ObjectSpec
from bt_tasksim.trees import sequence
from tests.concept_nodes.test_pour import CUP, world

SIDES = st.sampled_from([(k, sign) for k in range(3) for sign in (1.0, -1.0)])
SIZES = st.tuples(*[st.floats(0.03, 0.2)] * 3)


@settings(max_examples=60, deadline=None)
@given(size=SIZES, heading=st.floats(-3.0, 3.0), side=SIDES, kind=st.sampled_from(["box", "cylinder"]))
def test_a_thing_turns_about_its_edge_until_its_side_is_down(size, heading, side, kind):
    if kind == "cylinder":
        size = (size[0], size[0], size[2])
    model, down = object_model("it", kind, ShapeSize(size)), side[1] * np.eye(3)[side[0]]
    pose = poses.pose([0.5, 0.1, size[2] / 2], poses.yaw(heading))
    found = swing(pose, model, down)
    if side[0] == 2:  # it is down already, or up
        assert found is None
        return
    corners = np.concatenate(model.solid.pieces)
    lowest = poses.transform(found.poses[:, None, :], corners)[..., 2].min(axis=1)
    assert np.abs(lowest).max() < 1e-6  # neither in the table nor off it
    assert np.allclose(poses.rotate(found.poses[-1, 3:], down), [0.0, 0.0, -1.0], atol=1e-6)
    every = np.concatenate([pose[None], found.poses])
    turned = poses.angle_between(every[1:, 3:], every[:-1, 3:])
    assert turned.sum() == pytest.approx(math.pi / 2) and turned.max() < 0.11


def test_ends_are_those_of_the_longest_axis():
    assert long_axis(object_model("it", "box", ShapeSize((0.2, 0.05, 0.04)))) == 0
    assert long_axis(object_model("it", "cylinder", ShapeSize((0.05, 0.05, 0.12)))) == 2
    assert long_axis(object_model("it", "box", ShapeSize((0.06, 0.059, 0.04)))) is None
    pegs = [object_model("it", "box", ShapeSize((0.2, 0.05, 0.04)))]
    assert len(TipUp.sides(pegs[0])) == 2 and len(LayDown.sides(pegs[0])) == 4
    assert len(LayDown.sides(object_model("it", "cylinder", ShapeSize((0.05, 0.05, 0.12))))) == 16


def test_what_lies_in_a_cup_stays_there():
    view = world("cup", CUP)
    with pytest.raises(NoWayError, match="a would fall out of jug as it is turned"):
        LayDown.value(target="jug")._found(view)
    lies = poses.pose([0.4, 0.1, 0.04], poses.from_rotation_vector(np.array([0.0, math.pi / 2, 0.0])))
    ball = poses.multiply(lies, poses.pose([0.0, 0.0, -0.02]))
    lying = view._replace(objects=view.objects | {"jug": lies, "a": ball})
    ways = TipUp.value(target="jug")._swings(lying)
    (upright,) = spilling_none(lying, "jug", ways)  # not onto its rim
    assert len(ways) == 2 and np.allclose(upright.down, [0.0, 0.0, -1.0])
    assert (
        len(spilling_none(lying._replace(objects=lying.objects | {"a": view.objects["b"]}), "jug", ways)) == 2
    )


@settings(max_examples=30, deadline=None)
@given(st.floats(-1.5, 1.5), st.floats(-3.0, 3.0))
def test_the_rise_of_the_longest_axis(pitch, heading):
    turn = poses.quat_multiply(poses.yaw(heading), poses.from_rotation_vector(np.array([0.0, pitch, 0.0])))
    rotations, extent = np.array([turn, turn]), np.array([[0.2, 0.05, 0.04], [0.05, 0.05, 0.2]])
    assert rise_of_long_axis(rotations, extent) == pytest.approx([abs(pitch), math.pi / 2 - abs(pitch)])


@pytest.mark.physical
def test_a_cube_is_refused():
    scene = Scene(objects={"cube": "on table"}, goal=Goal("cube", relation="on_end"))
    result = Runner(sequence("tip", Grasp("cube"), TipUp("cube")), scene).run(3)
    assert result.status == Status.FAILURE and "cube has no ends" in result.outcome.sentence


@pytest.mark.physical
def test_what_stands_is_laid_down_and_tipped_up_again():
    """Towards the side that was asked for, and released there."""
    size = ((0.05, 0.045, 0.16),) * 2
    tall = ObjectSpec(kinds=("box",), on="table", area=(0.03, 0.03), yaw=0.1, size=size)
    scene = Scene(
        objects={"tall": tall},
        goals=[Goal("tall", relation="lying", when="once"), Goal("tall", relation="on_end")],
    )
    tree = sequence(
        "down and up",
        Grasp("tall"),
        LayDown("tall"),
        Release("tall"),
        Grasp("tall"),
        TipUp("tall"),
        Release("tall"),
    )
    for result in successes(Runner(tree, scene).run, range(20, 23), n=2):
        assert result.verdict.penetration < 0.002
