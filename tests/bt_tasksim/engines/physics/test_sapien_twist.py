"""Soft pads: what they hold does not turn between them, up to what friction allows."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from py_trees.common import Status

from bt_tasksim.core import poses
from bt_tasksim.engines.physics.sapien_twist import Twist
from bt_tasksim.execution.runner import Runner
from bt_tasksim.robot.description import Pads
from bt_tasksim.trees.load import load_source

STILL, Y, STEP = [1.0, 0.0, 0.0, 0.0], np.array([0.0, 1.0, 0.0]), 0.01
PADS = Pads(friction=1.2, patch_radius=0.02, min_patch_radius=0.01)
FIRMLY = [[0.0, 30.0, 0.0], [0.0, -30.0, 0.0]]
MOST = 2 / 3 * 1.2 * 0.01 * 60.0
MOMENT = 1e-3


class Pose(SimpleNamespace):
    """A pose of SAPIEN's at the origin."""

    def __getstate__(self):
        return (0.0, 0.0, 0.0, *np.asarray(self.q).tolist())


def body(turn=STILL):
    """Something in PhysX that notes the torques on it."""
    torques = []
    found = SimpleNamespace(entity_pose=Pose(q=np.array(turn)), torques=torques)
    found.add_force_torque = lambda force, torque: torques.append(np.array(torque))
    return found


def held(hand=None):
    """Pads that hold one of two things, and the things."""
    things = [body(), body()]
    inertia = [([0.0, 0.0, 0.0, *STILL], [MOMENT] * 3)] * 2
    twist = Twist(PADS, [[0], [1]], hand or body(), Y, things, inertia)
    twist.look(FIRMLY, [0.0, 60.0])
    return twist, things


def turned(thing, axis, angle):
    thing.entity_pose.q = poses.from_rotation_vector(angle * np.array(axis))


@given(st.floats(-0.02, 0.02))
def test_turning_about_the_closing_axis_is_resisted(angle):
    twist, (other, thing) = held()
    turned(thing, Y, angle)
    twist.resist(STEP)
    (torque,) = thing.torques
    assert not other.torques and torque[0] == torque[2] == 0.0
    assert torque[1] * angle <= 0.0 and abs(torque[1]) <= MOST + 1e-12
    assert (torque[1] != 0.0) == (abs(angle) > 1e-12) or abs(angle) < 1e-9


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, 0.0, 1.0)])
def test_turning_about_other_axes_is_left_to_friction(axis):
    twist, (_, thing) = held()
    turned(thing, axis, 0.1)
    twist.resist(STEP)
    assert np.allclose(thing.torques[0], 0.0, atol=1e-12)


def test_what_turns_with_the_hand_is_not_resisted():
    hand = body()
    twist, (_, thing) = held(hand)
    for moved in (hand, thing):
        turned(moved, Y, 0.5)
    twist.resist(STEP)
    assert np.allclose(thing.torques[0], 0.0, atol=1e-9)


def test_it_slips_at_what_friction_allows_and_stays_where_it_slipped_to():
    twist, (_, thing) = held()
    turned(thing, Y, 1.0)
    for _ in range(3):
        twist.resist(STEP)
    assert thing.torques[-1][1] == pytest.approx(-MOST), "it is bent as far as it may be"
    turned(thing, Y, 0.5)
    for _ in range(3):
        twist.resist(STEP)
    assert thing.torques[-1][1] == pytest.approx(MOST), "it is held where it was, and not at the beginning"


@pytest.mark.parametrize(
    ("tips", "force"),
    [([[0.0, 30.0, 0.0], [0.0, 0.0, 0.0]], [0.0, 30.0]), (FIRMLY, [0.0, 0.0]), (FIRMLY, [])],
)
def test_nothing_is_held_by_one_finger_or_by_fingers_on_one_another(tips, force):
    twist, _ = held()
    assert twist.holds
    twist.look(tips, force)
    assert not twist.holds


def test_nothing_is_held_by_pads_that_part_until_they_are_read_again():
    twist, (_, thing) = held()
    turned(thing, Y, 0.1)
    twist.let_go()
    assert not twist.holds
    twist.look(FIRMLY, [0.0, 60.0])
    twist.resist(STEP)
    assert np.allclose(thing.torques[0], 0.0, atol=1e-12), "it is held as it is then"


@pytest.mark.physical
@pytest.mark.parametrize("seed", [620003, 620007])
def test_a_lid_that_is_let_go_beyond_its_highest_point_is_not_thrown_back(seed):
    """It turned between the pads as it was opened, and they part within a period of the robot's."""
    source, seen = load_source("open_lid"), []

    def record(step):
        (pose,) = step.pipeline.hidden().objects
        seen.append((poses.tilt(pose[3:]), bool(step.observation.contacts.any())))

    assert Runner(source.build(), source.scene).run(seed, record=record).status == Status.SUCCESS
    angles, touched = np.array(seen).T
    last = int(np.flatnonzero(touched)[-1])
    assert angles[last] > np.radians(93.0)
    assert angles[last:].min() > angles[last] - np.radians(1.0)
