"""Ways: straight where that is clear, round what is in the way, and a sentence where there is none."""

import dataclasses

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.planning.bodies import bodies_of
from bt_tasksim.planning.collision import INSIDE, Collisions, bounds
from bt_tasksim.planning.route import Pace
from bt_tasksim.planning.things import Leave
from bt_tasksim.planning.ways import _LEANING, LEAVING, WayFinder

RIGHT, LEFT = (0.45, -0.3, 0.25), (0.45, 0.3, 0.25)
PACE = Pace(0.5)


def finder(bench, *things, start=RIGHT, held=None, leave=None):
    return WayFinder(bench.robot, bench.posture(*start), bench.hand, things, held, leave)


def test_a_straight_way_that_is_clear_is_taken_and_ends_where_asked(panda, fine):
    far = panda.box((0.45, 0.0, 0.9), (0.1, 0.1, 0.1))
    found = finder(panda, far)
    joints = found.straight([panda.pose(*RIGHT), panda.pose(*LEFT)])
    assert np.allclose(panda.arm.tool(joints[-1])[:3], LEFT, atol=1e-3)
    tools = panda.arm.tools(fine(np.concatenate([found.start[None], joints])))
    assert np.abs(tools[:, 0] - 0.45).max() < 5e-3 and np.abs(tools[:, 2] - 0.25).max() < 5e-3


def test_a_straight_way_through_something_is_none_and_a_thing_moved_away_frees(panda, wall):
    way = [panda.pose(*RIGHT), panda.pose(*LEFT)]
    assert finder(panda, wall).straight(way) is None
    aside = panda.box((0.45, 1.2, 0.2), wall.size, wall.margin)
    assert finder(panda, aside).straight(way) is not None


@settings(max_examples=6, deadline=None)
@given(high=st.floats(0.2, 0.42), at=st.floats(-0.08, 0.08))
@example(high=0.333984375, at=-0.07421875)
def test_a_way_round_is_free_at_finer_steps_than_it_was_checked_at(panda, fine, high, at):
    """In the example a finger grazed the barrier between two questions, 10 mm of margin or not."""
    size = (0.4, 0.04, high)
    barrier = panda.box((0.45, at, high / 2), size, 0.01)
    found = finder(panda, barrier)
    route = found.search(panda.pose(*LEFT)[None], PACE)
    assert np.allclose(route.tools[-1, :3], LEFT, atol=1e-3)
    bare = Collisions(bodies_of(panda.robot), panda.hand, [panda.box((0.45, at, high / 2), size)])
    assert all(bare.free(q) for q in fine(route.joints))


def test_the_same_request_has_the_same_way(panda, wall):
    first, again = (finder(panda, wall).search(panda.pose(*LEFT)[None], PACE) for _ in range(2))
    assert np.array_equal(first.joints, again.joints) and first.duration == again.duration


def test_what_is_held_counts_on_the_way(panda, fine):
    low = panda.box((0.45, 0.0, 0.09), (0.4, 0.04, 0.14), 0.01)
    way = [panda.pose(*RIGHT), panda.pose(*LEFT)]
    long = panda.held((0.04, 0.04, 0.3))
    assert finder(panda, low).straight(way) is not None
    loaded = finder(panda, low, held=long)
    assert loaded.straight(way) is None
    route = loaded.search(panda.pose(*LEFT)[None], PACE)
    bare = Collisions(bodies_of(panda.robot), panda.hand, [panda.box((0.45, 0.0, 0.09), low.size)], long)
    assert all(bare.free(q) for q in fine(route.joints))
    assert finder(panda, low, held=long, leave=Leave(held={"box"})).straight(way) is not None


def test_what_is_held_leans_little_on_the_way(panda, wall):
    route = finder(panda, wall, held=panda.held((0.04, 0.04, 0.1))).search(panda.pose(*LEFT)[None], PACE)
    assert poses.angle_between(route.tools[:, 3:], route.tools[:1, 3:]).shape == (len(route.tools),)
    lean = poses.tilt(route.tools[:, 3:], route.tools[0, 3:])
    assert lean.max() < _LEANING + 0.1


def test_what_touches_at_the_beginning_may_be_left_but_not_come_back_to(panda):
    tight = panda.box((0.45, -0.3, 0.135), (0.1, 0.1, 0.02), 0.01, "board")
    held = panda.held((0.04, 0.04, 0.2))
    inside = finder(panda, tight, held=held)
    assert not inside.collisions.free(inside.start) and inside.on_the_way.free(inside.start)
    up = panda.pose(0.45, -0.3, 0.4)
    assert inside.straight([panda.pose(*RIGHT), up]) is not None
    assert not inside.ends(panda.pose(*RIGHT)[None]).free[0]


def test_nobody_goes_through_what_touches_at_the_beginning(panda):
    """A finger that seems to touch a post leaves it on its own side."""

    def posted(beside):
        return finder(panda, panda.box((RIGHT[0], RIGHT[1] + beside, RIGHT[2]), (0.02, 0.02, 0.02)))

    ways = [posted(beside) for beside in np.linspace(0.12, 0.0, 61)]
    found = next(way for way in ways if not way.collisions.free(way.start))
    across, back = (panda.pose(RIGHT[0], RIGHT[1] + by, RIGHT[2]) for by in (0.05, -0.05))
    assert found.on_the_way.free(found.start), "it may leave"
    assert found.straight([panda.pose(*RIGHT), across]) is None
    assert found.straight([panda.pose(*RIGHT), back]) is not None


def test_what_touches_at_the_beginning_is_one_board_and_not_all_of_its_shelf(panda):
    """A finger that seems to be deep in one board may leave that, and goes through no other one."""
    tip = panda.arm.tool(panda.posture(*RIGHT))[:3]
    own = panda.box(tip, (0.02, 0.2, 0.02), name="shelf")
    other = panda.box((RIGHT[0], RIGHT[1], RIGHT[2] + 0.3), (0.3, 0.3, 0.02), name="shelf")
    found = finder(panda, own, other)
    assert not found.collisions.free(found.start) and found.on_the_way.free(found.start)
    assert {name for _, name in found.collisions.touches(found.start)} == {"shelf"}
    through = panda.posture(RIGHT[0], RIGHT[1], RIGHT[2] + 0.3)
    assert not found.on_the_way.free(through)
    assert finder(panda, own).on_the_way.free(through)


def test_a_way_that_begins_close_to_something_keeps_the_usual_room_farther_on(panda):
    """A long wall beside the hand: it draws away, and does not go along that as closely as it began."""
    wall = panda.box((RIGHT[0] + 0.1, 0.0, 0.1), (0.02, 1.0, 0.35), 0.09, "wall")
    found = finder(panda, wall)
    assert not found.collisions.free(found.start) and found.on_the_way.free(found.start)
    goal = panda.pose(0.35, 0.3, 0.3)
    route = found.search(goal[None], PACE)
    far = np.abs(route.joints - found.start).max(axis=1) > LEAVING + 0.01
    assert far.any() and found.collisions.all_free(route.joints[far])


def test_the_nearest_of_several_ends_that_is_possible_is_taken(panda):
    blocked = panda.box(LEFT, (0.1, 0.1, 0.1))
    other = (0.45, 0.1, 0.45)
    route = finder(panda, blocked).search(np.array([panda.pose(*LEFT), panda.pose(*other)]), PACE)
    assert np.allclose(route.tools[-1, :3], other, atol=1e-3)


def test_no_way_says_why(panda):
    with pytest.raises(NoWayError, match=r"the arm does not reach \(2\.00, 0\.00, 0\.30\) m"):
        finder(panda).search(panda.pose(2.0, 0.0, 0.3)[None], PACE)
    with pytest.raises(
        NoWayError, match=r"at \(0\.45, 0\.30, 0\.25\) m \S+ would touch chest: make room there"
    ):
        finder(panda, panda.box(LEFT, (0.2, 0.2, 0.2), name="chest")).search(panda.pose(*LEFT)[None], PACE)


def test_what_the_arm_reaches_and_its_workspace_leaves_out_is_said_to_be_so(panda):
    low, high = panda.robot.safety.workspace
    narrow = dataclasses.replace(panda.robot.safety, workspace=np.array([low, [high[0], 0.1, high[2]]]))
    found = WayFinder(dataclasses.replace(panda.robot, safety=narrow), panda.posture(*RIGHT), panda.hand, ())
    wanted = panda.pose(*LEFT)[None]
    assert found.beyond(wanted) == pytest.approx(LEFT[1] - 0.1 + INSIDE)
    with pytest.raises(NoWayError, match=r"220 mm beyond where the tool may go in the workspace of 'panda'"):
        found.search(wanted, PACE)


def test_a_box_of_few_centimetres_is_not_turned_inside_out(panda):
    low = np.array([0.4, 0.0, 0.2])
    for side in (0.01, 0.03, 0.3):
        tiny = dataclasses.replace(panda.robot.safety, workspace=np.array([low, low + side]))
        lower, upper = bounds(
            dataclasses.replace(panda.robot, safety=tiny), np.array([*(low + side / 2), 1, 0, 0, 0])
        )
        assert (low <= lower).all() and (lower < upper).all() and (upper <= low + side).all()


def test_a_closed_wall_has_no_way(panda):
    walls = [panda.box((0.45, 0.12 * s, 0.6), (2.4, 0.02, 2.4), name="wall") for s in (1,)] + [
        panda.box((0.0, -0.9, 0.6), (2.4, 0.02, 2.4), name="wall")
    ]
    with pytest.raises(NoWayError):
        finder(panda, *walls).search(panda.pose(*LEFT)[None], PACE)


def test_it_says_what_would_touch(panda):
    chest = panda.box(LEFT, (0.2, 0.2, 0.2), name="chest")
    assert {other for _, other in finder(panda, chest).touched(panda.pose(*LEFT))} == {"chest"}
    assert finder(panda, chest).touched(panda.pose(*RIGHT)) == []
    assert finder(panda, chest).touched(panda.pose(3.0, 0.0, 0.0)) == []


def test_each_robot_finds_a_way_home(each):
    robot = each.robot
    away = np.clip(robot.rest + 0.15, robot.arm_lower, robot.arm_upper)
    found = WayFinder(robot, away, each.hand, [])
    route = found.search(each.arm.tool(robot.rest)[None], PACE)
    assert np.allclose(route.tools[-1, :3], each.arm.tool(robot.rest)[:3], atol=1e-3)
    assert np.array_equal(route.joints[0], away)
