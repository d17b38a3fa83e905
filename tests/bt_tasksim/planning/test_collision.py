"""What touches: by margins, by what is held, by what may touch, and not by what is far away."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.core import poses
from bt_tasksim.planning.arm import arm_of
from bt_tasksim.planning.bodies import bodies_of
from bt_tasksim.planning.collision import INSIDE, OWN, Collisions, bounds
from bt_tasksim.planning.things import Leave, Thing, box_corners
from bt_tasksim.robot.description import load_robot


def among(bench, *things, held=None, leave=None):
    return Collisions(bodies_of(bench.robot), bench.hand, things, held, leave)


@settings(max_examples=25, deadline=None)
@given(gap=st.floats(0.001, 0.05), margin=st.floats(0.0, 0.05))
def test_nearer_than_the_margin_touches_and_farther_is_free(panda, gap, margin):
    """What is held ends 0.1 m below the tool; the board is so far below that."""
    if abs(gap - margin) < 2e-4:
        return
    q = panda.posture(0.45, 0.0, 0.4)
    board = panda.box((0.45, 0.0, 0.3 - gap - 0.01), (0.1, 0.1, 0.02), margin)
    held = panda.held((0.04, 0.04, 0.2))
    assert among(panda, board, held=held).free(q) == (gap > margin)


def test_what_is_held_counts_and_may_be_allowed_to_touch(panda):
    q, board = panda.posture(0.45, 0.0, 0.4), panda.box((0.45, 0.0, 0.31), (0.1, 0.1, 0.02), name="board")
    assert among(panda, board).free(q)
    touching = among(panda, board, held=panda.held())
    assert not touching.free(q) and touching.touches(q) == [("held", "board")]
    for leave in (Leave(held={"board"}), Leave(pairs={("held", "board")})):
        assert among(panda, board, held=panda.held(), leave=leave).free(q)
    assert not among(panda, board, held=panda.held(), leave=Leave(hand={"board"})).free(q)


def test_the_hand_may_be_allowed_to_touch_and_the_arm_still_may_not(panda):
    q = panda.posture(0.45, 0.0, 0.4)
    at_hand, at_arm = (
        panda.box((0.45, 0.0, 0.46), (0.03,) * 3, name="small"),
        panda.box((0.45, 0.0, 0.62), (0.3, 0.3, 0.2), name="small"),
    )
    for thing, free in ((at_hand, True), (at_arm, False)):
        assert not among(panda, thing).free(q)
        assert among(panda, thing, leave=Leave(hand={"small"})).free(q) == free


def test_what_is_held_counts_against_the_arm_itself(panda):
    long = panda.held((1.6, 0.04, 0.04), "pole")
    assert ("panda_link" in str(among(panda, held=long).touches(panda.posture(0.35, 0.0, 0.25)))) is True


@pytest.mark.parametrize("away", [(2.0, 0.0, 0.0), (0.0, 0.0, -2.0)])
def test_a_thing_moved_away_frees(each, away):
    tool = each.arm.tool(each.robot.rest)
    away = np.array(away)
    inside = each.box(tool[:3], (0.03, 0.03, 0.03))
    outside = each.box(tool[:3] + away, (0.03, 0.03, 0.03))
    held = each.held((0.02, 0.02, 0.02))
    assert not among(each, inside, held=held).free(each.robot.rest)
    assert among(each, outside, held=held).free(each.robot.rest)


def test_all_free_is_free_at_each(panda):
    rng, board = np.random.default_rng(0), panda.box((0.5, 0.0, 0.3), (0.4, 0.4, 0.02))
    robot, found = panda.robot, among(panda, board)
    for _ in range(20):
        arms = robot.rest + rng.normal(scale=0.15, size=(int(rng.integers(1, 9)), len(robot.rest)))
        assert found.all_free(arms) == all(found.free(q) for q in arms)
        assert all(found.free(q) != bool(found.touches(q)) for q in arms)


@pytest.mark.parametrize("aside", [0.0, 0.001, 0.002, -0.001])
def test_one_thing_inside_another_touches(each, aside):
    """Coal calls some of these 2e-12 m apart."""
    tool = each.arm.tool(each.robot.rest)
    around = each.box(tool[:3] + aside, (0.03, 0.03, 0.03))
    found = among(each, around, held=each.held((0.02, 0.02, 0.02)))
    assert not found.free(each.robot.rest) and ("held", "box") in found.touches(each.robot.rest)


def test_pieces_are_where_their_pose_puts_them(panda):
    pose = poses.pose([0.45, 0.0, 0.4], poses.yaw(0.4))
    corners = box_corners((0.05, 0.05, 0.05))
    pieces = (
        Thing("one", pose, pieces=(corners,)),
        Thing("other", poses.pose([0, 0, 0]), pieces=(poses.transform(pose, corners),)),
    )
    q = panda.posture(0.45, 0.0, 0.4)
    for piece in pieces:
        assert not among(panda, piece, held=panda.held()).free(q)
    assert among(panda, Thing("one", poses.pose([0.45, 0.4, 0.4]), pieces=(corners,))).free(q)


def test_what_is_held_counts_against_the_robots_base(panda):
    q = panda.posture(0.45, 0.0, 0.4)
    assert among(panda, held=panda.held()).free(q)
    wide = panda.held((1.2, 0.2, 0.9))  # so large that it reaches into the base
    assert any("panda_link0" in touch for touch in among(panda, held=wide).touches(q))


@pytest.mark.parametrize("name", ["so100", "panda", "xarm7_ability"])
def test_a_robot_keeps_a_little_room_from_itself(name):
    robot = load_robot(name)
    bodies = bodies_of(robot)
    near, touching = (Collisions(bodies, robot.hand_open, [], own=own) for own in (OWN, 0.0))
    drawn = np.random.default_rng(1).uniform(robot.arm_lower, robot.arm_upper, (1500, len(robot.rest)))
    free = np.array([[near.free(q), touching.free(q)] for q in drawn])
    assert near.free(robot.rest) and not (free[:, 0] & ~free[:, 1]).any()
    only_near = np.flatnonzero(~free[:, 0] & free[:, 1])
    assert len(only_near) > 0, "the margin tells none apart"
    assert all(near.touches(q) and not touching.touches(q) for q in drawn[only_near])


def test_a_tool_beyond_the_border_of_its_workspace_counts_as_touching():
    robot = load_robot("panda")
    box = bounds(robot, arm_of(robot).tool(robot.rest))
    low, high = robot.safety.workspace
    assert np.allclose(box[0] - low, [INSIDE, INSIDE, 0.0]) and np.allclose(box[1], high - INSIDE)
    x = arm_of(robot).tool(robot.rest)[0]
    for workspace, inside in ((box, True), (np.array([box[0], [x - 0.01, *box[1][1:]]]), False)):
        among = Collisions(bodies_of(robot), robot.hand_open, (), workspace=workspace)
        assert among.free(robot.rest) is inside
        assert ("border" in str(among.touches(robot.rest))) is not inside


def test_who_begins_beyond_the_border_may_go_back():
    robot = load_robot("panda")
    out = np.array([-0.9, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0])
    assert bounds(robot, out)[0, 0] == -0.9
    assert bounds(dataclasses.replace(robot, safety=None), out) is None
