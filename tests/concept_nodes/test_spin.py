"""Spin: which ways round there are; in physics it is a scenario's test."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.concept_nodes import Spin
from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core import poses
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import ObjectSpec, SpotSpec

ROBOT = load_robot("panda")
BOX = ((0.07, 0.05, 0.09),) * 2


@settings(max_examples=15, deadline=None)
@given(heading=st.floats(-3.0, 3.0), mark=st.floats(-1.5, 1.5))
def test_every_way_round_ends_as_the_place_is_turned(heading, mark):
    scene = Scene(
        objects={"it": ObjectSpec(("box",), on="table", size=BOX, yaw=(heading, heading))},
        spots=[SpotSpec("mark", on="table", yaw=(mark, mark))],
    )
    drawn = scene.sample(1)
    known = drawn.world_model([tip.name for tip in ROBOT.tips], ROBOT.opening)
    now = np.array(drawn.objects[0].pose)
    view = WorldView(ROBOT, known, {"it": now}, poses.pose([0.4, 0.0, 0.4]), ROBOT.rest, ROBOT.hand_open)
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
