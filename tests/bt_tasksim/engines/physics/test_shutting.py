"""Hands that press: the law alone, and what it does to a thin thing between the Panda's fingers."""

import dataclasses

import numpy as np
import pytest

from bt_tasksim.engines.physics.shutting import shutting
from bt_tasksim.robot.description import load_robot

PRESS = 30.0


def hand(name="panda", press=PRESS, **changes):
    return dataclasses.replace(load_robot(name), hand_press=press, **changes)


def told(robot, measured, closure=1.0, worlds=1):
    """Where the drives are told to go and where the hand is ``(n_hand,)``, in so many worlds alike."""
    to = np.concatenate([robot.rest + 0.1, robot.hand_position(np.array([closure]))])
    at = np.concatenate([robot.rest, np.broadcast_to(measured, robot.hand_closed.shape)])
    return np.tile(to, (worlds, 1)), np.tile(at, (worlds, 1))


def pressed(robot, position, measured):
    """What the drives' springs give of the hand's joints ``(N, n_hand)``, positive where they shut it."""
    stiffness, n = robot.drive_array("stiffness"), len(robot.arm_joints)
    way = np.sign(robot.hand_closed - robot.hand_open)
    return (stiffness * (position - measured))[:, n:] * way


def between(robot, closure):
    """Joints of the hand ``(n_hand,)`` that something stops on their way."""
    return robot.hand_open + closure * (robot.hand_closed - robot.hand_open)


def test_hands_without_a_force_of_their_own_are_told_what_they_were():
    robot = hand(press=0.0)
    position, measured = told(robot, 0.003)
    assert shutting(robot, position, measured) is position
    assert load_robot("xarm7_ability").hand_press == load_robot("so100").hand_press == 0.0


@pytest.mark.parametrize("half", [0.0, 0.003, 0.015, 0.029])
def test_a_thin_thing_is_pressed_with_at_least_the_force(half):
    robot = hand()
    position, measured = told(robot, half)
    assert pressed(robot, position, measured).max() < PRESS, "its spring alone gives less"
    found = shutting(robot, position, measured)
    assert pressed(robot, found, measured) == pytest.approx(PRESS)
    assert np.array_equal(found[:, : len(robot.rest)], position[:, : len(robot.rest)]), "the arm goes its way"


@pytest.mark.parametrize("half", [0.031, 0.04])
def test_a_thick_one_is_pressed_as_before(half):
    robot = hand()
    position, measured = told(robot, half)
    assert pressed(robot, position, measured).min() > PRESS
    assert np.array_equal(shutting(robot, position, measured), position)


@pytest.mark.parametrize("closure", [0.0, 0.5, 0.999])
def test_a_hand_that_is_not_told_to_be_shut_does_not_press(closure):
    robot = hand()
    position, measured = told(robot, 0.0, closure)
    assert np.array_equal(shutting(robot, position, measured), position)


@pytest.mark.parametrize("name", ["panda", "xarm7_ability", "so100"])
def test_joints_press_whichever_way_they_shut(name):
    """Some hands shut towards larger numbers and some towards smaller ones, in newtons or newton metres."""
    robot = load_robot(name)
    stiffness = robot.drive_array("stiffness")[len(robot.rest) :]
    span = abs(robot.hand_closed - robot.hand_open)
    robot = hand(name, press=0.5 * float((stiffness * span)[span > 0.0].min()))
    position, measured = told(robot, between(robot, 0.99))
    found = shutting(robot, position, measured)
    n = len(robot.rest)
    moves = robot.hand_closed != robot.hand_open
    assert np.array_equal(found[:, n:][:, ~moves], position[:, n:][:, ~moves])
    assert pressed(robot, found, measured)[:, moves] == pytest.approx(robot.hand_press)


def test_both_ways_occur():
    ways = {
        float(way)
        for name in ("panda", "xarm7_ability", "so100")
        for way in np.sign(load_robot(name).hand_closed - load_robot(name).hand_open)
    }
    assert {-1.0, 1.0} <= ways


def test_each_joint_and_each_world_as_it_is_told(rows_alike):
    robot, rng = hand(), np.random.default_rng(0)
    position, measured = told(robot, 0.0, worlds=20)
    n = len(robot.rest)
    measured[:, n:] = rng.uniform(0.0, 0.04, (20, 2))
    position[::3, n:] = 0.02
    position[1, n] = 0.01
    found = rows_alike(lambda rows: shutting(robot, position[rows], measured[rows]), 20)
    asked = position[:, n:] == robot.hand_closed
    assert np.array_equal(found[:, n:][~asked], position[:, n:][~asked])
    assert np.all(pressed(robot, found, measured)[asked] >= PRESS - 1e-9)
    assert np.any(pressed(robot, found, measured)[asked] > PRESS + 1e-9)
