"""The hand's way along a joint: what may turn between the fingers, and where the tool stays."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bt_tasksim.concept_nodes.joint_way import PIVOTS, SUPPLE, gone_along, gone_anyhow, pivoted, pivots
from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core import poses
from bt_tasksim.core.joints import JointModel, Joints
from bt_tasksim.planning.arm import arm_of
from bt_tasksim.planning.ways import WayFinder
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.scene import Scene

UP = np.array([0.0, 0.0, 1.0])
angles = st.floats(-2.5, 2.5).filter(lambda a: abs(a) > 0.05)


def led(angle, n=40):
    """Tool poses of a hand that holds something 0.3 m from a hinge, and the hinge's angles."""
    model = JointModel("hinge", (0.0, 0.3, 0.0), (0.0, 0.0, 1.0), (0.5, 0.0, 0.2, 1, 0, 0, 0), (-3.0, 3.0))
    values = np.linspace(0.0, angle, n)
    return Joints.of([model]).pose(values), values


@given(angles, st.floats(0.0, 1.0))
def test_what_turns_in_the_hand_is_led_the_same_way(angle, share):
    tools, values = led(angle)
    found = pivoted(tools, UP, share)
    assert found[:, :3] == pytest.approx(tools[:, :3])
    turned = poses.angle_between(found[:1, 3:], found[:, 3:])
    assert turned == pytest.approx((1.0 - share) * abs(values), abs=1e-6)
    assert found[0] == pytest.approx(tools[0])


def test_nothing_free_turns_about_a_hinge_between_the_fingers():
    robot = load_robot("panda")
    world = (
        Scene(objects={"it": "box on table"})
        .sample(1)
        .world_model([tip.name for tip in robot.tips], robot.opening)
    )
    view = WorldView(robot, world, {}, poses.pose([0.4, 0.0, 0.4]), robot.rest, robot.hand_open)
    assert pivots(view, "it", view.tool) == PIVOTS[:1]


STIFF = np.array([-1.56, 0.0, 1.70, -2.56, -2.20, 2.21, -0.97])
"""Joints of a Panda whose tool, level and half a metre before it, hardly moves along its own axis."""


def test_an_arm_that_stands_stiff_takes_a_supple_posture_first():
    """With a knob in its hand, which turns by half a radian."""
    robot = load_robot("panda")
    arm, finder = arm_of(robot), WayFinder(robot, STIFF, robot.hand_open, [])
    tool = arm.tool(STIFF)
    turns = poses.from_rotation_vector(np.linspace(0.05, 0.5, 10)[:, None] * np.array([0.0, 0.0, 1.0]))
    turned = poses.quat_multiply(np.tile(tool[3:], (10, 1)), turns)
    tools = np.concatenate([np.tile(tool[:3], (10, 1)), turned], axis=-1)
    as_it_is = gone_along(finder, STIFF, tools)
    assert as_it_is is not None and float(arm.supple(as_it_is).min()) < 0.7 * SUPPLE
    found = gone_anyhow(finder, tools)
    assert found is not None and float(arm.supple(found[-10:]).min()) >= SUPPLE
    assert np.allclose(arm.tools(found)[:, :3], tool[:3], atol=2e-3)
