"""Spin: which ways round there are; in physics it is a scenario's test."""

import math

import numpy as np
import pytest
from draws import successes
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.concept_nodes import Grasp, Release, Spin
from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.execution.runner import Runner
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import Goal, ObjectSpec, SpotSpec
from bt_tasksim.trees import sequence

ROBOT = load_robot("panda")
BOX = ((0.07, 0.05, 0.09),) * 2


def view_of(heading, mark):
    """A box that is turned so, and a mark below it that is turned so."""
    scene = Scene(
        objects={"it": ObjectSpec(("box",), on="table", size=BOX, yaw=(heading, heading))},
        spots=[SpotSpec("mark", on="table", yaw=(mark, mark))],
    )
    drawn = scene.sample(1)
    known = drawn.world_model([tip.name for tip in ROBOT.tips], ROBOT.opening)
    now = np.array(drawn.objects[0].pose)
    return WorldView(ROBOT, known, {"it": now}, poses.pose([0.4, 0.0, 0.4]), ROBOT.rest, ROBOT.hand_open)


@settings(max_examples=15, deadline=None)
@given(heading=st.floats(-3.0, 3.0), mark=st.floats(-1.5, 1.5))
def test_every_way_round_ends_as_the_place_is_turned(heading, mark):
    view = view_of(heading, mark)
    now, known = view.objects["it"], view.world
    ways = Spin.value("it", like="mark")._ways(view)
    frame = np.asarray(known.place("mark").pose)
    assert len(ways) == 4  # two headings look alike, each either way round
    lengths = []
    for way in ways:
        every = np.concatenate([now[None], way])
        assert np.allclose(way[:, :3], now[:3]) and np.allclose(poses.z_axis(way[:, 3:])[:, 2], 1.0)
        local = poses.quat_multiply(poses.quat_conjugate(frame[3:]), way[-1, 3:])
        angle = abs(float(poses.angle_between(local[None], np.array([[1.0, 0.0, 0.0, 0.0]]))[0]))
        assert min(angle, math.pi - angle) < 1e-6
        lengths.append(float(poses.angle_between(every[1:, 3:], every[:-1, 3:]).sum()))
    assert lengths == pytest.approx(sorted(lengths))


@pytest.mark.parametrize("given", [{}, {"like": "mark", "angle": 0.5}])
def test_either_a_heading_or_an_angle_is_given(given):
    with pytest.raises(InputError, match="give either 'like' or 'angle'"):
        Spin("it", **given)


@pytest.mark.parametrize("angle", [0.7, -1.1, 4.0])
def test_by_an_angle_there_is_one_way_round(angle):
    view = view_of(heading=0.4, mark=0.0)
    (way,) = Spin.value("it", angle=angle)._ways(view)
    every = np.concatenate([view.objects["it"][None], way])
    turned = poses.quat_multiply(every[1:, 3:], poses.quat_conjugate(every[:-1, 3:]))
    assert poses.rotation_vector(turned).sum(axis=0) == pytest.approx([0.0, 0.0, angle])


@pytest.mark.physical
def test_in_physics_it_is_turned_by_that_angle():
    scene = Scene(
        objects={"it": ObjectSpec(("box",), on="table", size=BOX, area=(0.0, 0.0), yaw=(0.2, 0.2))},
        spots=[SpotSpec("mark", on="table", yaw=(0.9, 0.9))],
        goal=Goal("it", "mark"),
    )
    tree = sequence("turn", Grasp("it"), Spin("it", angle=0.7), Release("it"))
    successes(Runner(tree, scene).run, range(7, 10), n=1)
