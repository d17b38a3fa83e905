"""What is done with an object until it is let go, and whether a grasp serves that."""

from types import SimpleNamespace

import numpy as np
import pytest

from bt_tasksim.concept.aim import Aim
from bt_tasksim.concept.leaf import ONE
from bt_tasksim.concept_nodes import Grasp
from bt_tasksim.concept_nodes.grasp_aims import Around, Served, aims_of, goes_aside
from bt_tasksim.concept_nodes.holding import HOLDING
from bt_tasksim.concept_nodes.view import views
from bt_tasksim.core import poses
from bt_tasksim.planning.ways import WayFinder

DOWN = np.array([0.0, 0.0, -1.0])


@pytest.fixture
def view(toy):
    """The toy's world."""
    return views(toy(Grasp("cup")).context.seen(ONE, np.zeros(1)))[0]


def later(name, aim, ends=()):
    return SimpleNamespace(actor=name, aim=lambda view: aim, ends=ends)


def test_what_is_done_with_a_thing_until_it_is_let_go(view):
    first, last, after = (Aim(view.objects["box"][None], words) for words in ("lift", "place", "again"))
    row = [later("box", first), later("cup", first), later("box", None), later("box", last, (HOLDING,))]
    assert [aim.words for aim in aims_of(view, "box", [*row, later("box", after)])] == ["lift", "place"]


def test_it_goes_aside_where_one_of_the_aims_has_poses_for_that(view):
    pose = view.objects["box"][None]
    aim = Aim(pose, "be put down there", aside=pose)
    assert goes_aside([aim._replace(aside=None), aim])
    assert not goes_aside([aim._replace(aside=None), aim._replace(aside=pose[:0])])


def test_the_tools_at_which_an_aim_is_served_are_where_the_hand_has_room_and_in_reach(view):
    """Straight down on the box where it stands; lifted; and inside the table, where nothing has room."""
    now, hand = view.objects["box"], view.robot.hand_open
    goal = np.concatenate([now[:3], poses.frame_from_axes(DOWN, np.array([0.0, 1.0, 0.0]))])
    heights = [np.array([0.0, 0.0, z, 0, 0, 0, 0]) for z in (0.1, -0.2)]
    around = Around(view, "box", 1.0)
    for ends, tools in ((heights, 1), (heights[:1], 1), (heights[1:], 0)):
        served = Served(around, Aim(np.array([now + end for end in ends]), "go"), False, False)
        assert len(served.tools(goal, hand)) == tools and served.by(goal, hand) == (tools > 0)
    far = Served(around, Aim((now + np.array([0.3, 0.75, 0.9, 0, 0, 0, 0]))[None], "go"), False, False)
    assert len(far.tools(goal, hand)) == 1 and not far.by(goal, hand), "room there, and out of reach"
    beyond = Served(around, Aim((now + np.array([2.0, 0, 0.3, 0, 0, 0, 0]))[None], "go"), False, False)
    assert not len(beyond.tools(goal, hand)) and "outside the workspace of 'panda'" in beyond.why


def test_where_many_grasps_are_asked_no_joints_are_looked_for_where_the_arm_surely_is_not(view, monkeypatch):
    now, hand = view.objects["box"], view.robot.hand_open
    goal = np.concatenate([now[:3], poses.frame_from_axes(DOWN, np.array([0.0, 1.0, 0.0]))])
    moved = [np.array([x, 0.0, 0.1, 0, 0, 0, 0]) for x in (0.0, 2.0)]
    monkeypatch.setattr(WayFinder, "ends", lambda *asked, **more: pytest.fail("joints are looked for"))
    for some, left in ((moved, 1), (moved[1:], 0)):
        served = Served(
            Around(view, "box", 1.0), Aim(np.array([now + by for by in some]), "go"), False, False
        )
        served.screens = True
        assert len(served.tools(goal, hand)) == left and bool(served.why) == (left == 0)
    assert not served.by(goal, hand)
