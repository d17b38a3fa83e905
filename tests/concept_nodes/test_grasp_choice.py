"""Which grasp: the usual one where it serves, else another; one that serves what follows; none says why."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from bt_tasksim.concept.aim import Aim
from bt_tasksim.concept.leaf import ONE
from bt_tasksim.concept_nodes import Grasp, grasp_choice
from bt_tasksim.concept_nodes.closer import CLOSER, ROOMS
from bt_tasksim.concept_nodes.grasp_aims import aims_of
from bt_tasksim.concept_nodes.grasp_candidates import Candidates, candidates
from bt_tasksim.concept_nodes.grasp_choice import (
    FARTHEST,
    NARROWER,
    Chooser,
    _straight,
    rooms,
)
from bt_tasksim.concept_nodes.grasp_firmness import HARDLY
from bt_tasksim.concept_nodes.grasp_opening import Opening
from bt_tasksim.concept_nodes.holding import HOLDING
from bt_tasksim.concept_nodes.view import views
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.world import Obstacle
from bt_tasksim.planning.arm import arm_of
from bt_tasksim.planning.bodies import bodies_of
from bt_tasksim.planning.collision import Collisions
from bt_tasksim.planning.route import Pace
from bt_tasksim.robot.description import load_robot
from bt_tasksim.robot.kinematics.hand import SPARE
from bt_tasksim.scene.grips import GivenGrip

DOWN = np.array([0.0, 0.0, -1.0])


@pytest.fixture
def view(toy):
    """The toy's world."""
    return views(toy(Grasp("cup")).context.seen(ONE, np.zeros(1)))[0]


def chosen(view, name="box", later=()):
    chooser = Chooser(view, name, 0.1, Pace(0.5), aims_of(view, name, later), CLOSER)
    return chooser.other(candidates(view, name, DOWN, view.tool[3:]))


def with_obstacles(view, *boxes):
    world = dataclasses.replace(view.world, obstacles=(*view.world.obstacles, *boxes))
    return view._replace(world=world)


def later(name, aims, ends=()):
    return SimpleNamespace(actor=name, aim=lambda view: aims, ends=ends)


def test_a_grasp_touches_nothing_and_ends_at_its_goal(view):
    choice = chosen(view)
    assert np.allclose(choice.routes[-1].tools[-1, :3], choice.goal[:3], atol=1e-3)
    assert np.allclose(choice.routes[0].joints[0], view.arm)
    first, last = choice.routes
    assert np.allclose(first.joints[-1], last.joints[0])


def test_a_hand_has_little_room_where_something_is_close_beside_a_finger(view):
    assert not chosen(view).tight
    goal = chosen(view).goal
    closing = poses.to_matrix(goal[3:])[:, 1]
    beside = goal[:3] + (view.robot.opening / 2 + 0.03) * closing
    post = Obstacle(poses.pose(beside, goal[3:]), (0.01, 0.01, 0.06), "post")
    assert Opening(with_obstacles(view, post), "box", view.robot.hand_open, close=False).tight(goal)


@pytest.mark.parametrize("height", [0.028, 0.036])
def test_a_grasp_that_somebody_gave_takes_the_place_of_the_usual_one(view, height):
    goal = chosen(view).goal
    way = [view.tool, poses.shifted(goal, -0.1 * poses.z_axis(goal[3:]))]
    assert Chooser(view, "box", 0.1, Pace(0.5), (), CLOSER).usual(goal, way) is not None
    model = view.model("box")
    grip = GivenGrip((0.0, 0.0, height), (0.0, 1.0, 0.0), float(model.extent[1]), (0.0, 0.0, -1.0))
    other = dataclasses.replace(model, solid=dataclasses.replace(model.solid, given=(grip,)))
    objects = tuple(other if known.name == "box" else known for known in view.world.objects)
    given = view._replace(world=dataclasses.replace(view.world, objects=objects))
    chooser = Chooser(given, "box", 0.1, Pace(0.5), (), CLOSER)
    assert chooser.usual(goal, way) is None
    assert chosen(given).goal[2] == pytest.approx(view.objects["box"][2] + height, abs=1e-6)


def test_the_same_world_has_the_same_grasp(view):
    one, other = chosen(view), chosen(view)
    assert np.array_equal(one.goal, other.goal)
    assert all(np.array_equal(a.joints, b.joints) for a, b in zip(one.routes, other.routes, strict=True))


def test_a_lid_above_an_object_turns_the_hand_aside_or_says_what_is_touched(view):
    box = view.objects["box"]
    top = float(box[2]) + view.model("box").extent[2] / 2
    lid = Obstacle(poses.pose([box[0], box[1], top + 0.03]), (0.3, 0.3, 0.01), "lid")
    try:
        choice = chosen(with_obstacles(view, lid))
    except NoWayError as error:
        assert "touch lid" in str(error)
    else:
        assert poses.z_axis(choice.goal[3:]) @ DOWN < 0.9


def test_none_says_how_many_were_excluded_by_what(view):
    far = {**view.objects, "box": poses.pose([3.0, 0.0, 0.05])}
    view = view._replace(objects=far)
    most = min(FARTHEST, len(candidates(view, "box", DOWN, view.tool[3:]).tools))
    with pytest.raises(
        NoWayError, match=rf"no grasp of box serves: of {most}, {most} outside the workspace of 'panda'"
    ):
        chosen(view)


def test_a_grasp_serves_what_follows(view):
    """What is to be laid out of reach can be held in no way; one of several ends will do."""
    now = view.objects["box"]
    away = now + np.array([2.0, 0, 0, 0, 0, 0, 0])
    aside = now + np.array([0.0, -0.1, 0.1, 0, 0, 0, 0])
    with pytest.raises(NoWayError, match="that cannot also be put down there"):
        chosen(view, later=[later("box", Aim(away[None], "be put down there"))])
    both = Aim(np.array([away, aside]), "be put down there")
    assert np.isfinite(chosen(view, later=[later("box", both)]).goal).all()


def test_where_no_grasp_serves_exactly_it_may_be_put_down_a_little_aside(view):
    now = view.objects["box"]
    away, aside = (now + np.array([x, -0.1, 0.1, 0, 0, 0, 0]) for x in (2.0, 0.0))
    aim = Aim(away[None], "be put down there", aside=aside[None])
    after = [later("box", aim)]
    aims = aims_of(view, "box", after)
    tools = candidates(view, "box", DOWN, view.tool[3:])
    exactly = Chooser(view, "box", 0.1, Pace(0.5), aims, CLOSER)
    with pytest.raises(NoWayError, match="that cannot also be put down there"):
        exactly.other(tools)
    chooser = Chooser(view, "box", 0.1, Pace(0.5), aims, CLOSER, aside=True)
    assert np.isfinite(chooser.other(candidates(view, "box", DOWN, view.tool[3:])).goal).all()


def test_what_others_do_and_what_comes_after_letting_go_does_not_count(view):
    away = Aim((view.objects["box"] + np.array([2.0, 0, 0, 0, 0, 0, 0]))[None], "be put down there")
    after = [later("cup", away), later("box", None, ends=(HOLDING,)), later("box", away)]
    assert np.array_equal(chosen(view, later=after).goal, chosen(view).goal)


def test_the_last_piece_of_the_usual_way_is_looked_at_in_the_posture_in_which_the_arm_comes():
    """An arm of seven joints has others: one of them may be clear, and the arm not in it."""
    here, way = np.arange(7.0), [poses.pose([x, 0.0, 0.3]) for x in (0.1, 0.2, 0.3)]
    asked = []

    def straight(poses_, start=None):
        asked.append((len(poses_), start))
        return None if start is not None else here[None]

    finder = SimpleNamespace(goes_straight=True, straight=straight)
    assert not _straight(way, finder, finder)
    assert asked[0] == (2, None) and asked[1][0] == 2 and np.array_equal(asked[1][1], here)


@pytest.mark.parametrize("aside", [False, True])
@pytest.mark.parametrize("robot", ["xarm7_ability", "so100"])
def test_a_hand_that_loses_what_it_holds_poorly_rather_goes_closely_past_things(robot, aside):
    asked = rooms(load_robot(robot), aside)
    firm, others = asked[: len(asked) // 2], asked[len(asked) // 2 :]
    assert all(firmly for _, firmly, _ in firm) and not any(firmly for _, firmly, _ in others)
    exactly = [(closer, False) for closer in ROOMS]
    for half in (firm, others):
        assert [(c, a) for c, _, a in half] == [*exactly, *([(ROOMS[-1], True)] if aside else [])]


def test_a_hand_that_finds_no_other_room_may_come_next_to_its_own_arm(view):
    robot = view.robot
    apart = Collisions(bodies_of(robot), robot.hand_open, [])
    drawn = np.random.default_rng(1).uniform(robot.arm_lower, robot.arm_upper, (1500, len(robot.rest)))
    next_to = [q for q in drawn if not apart.free(q)]
    usual, close = (Opening(view, "box", robot.hand_open, close).beside.collisions for close in (False, True))
    assert not any(usual.free(q) for q in next_to) and any(close.free(q) for q in next_to)


def test_a_gripper_of_two_fingers_rather_keeps_room():
    exactly = [(closer, False, False) for closer in ROOMS]
    assert rooms(load_robot("panda")) == exactly
    assert rooms(load_robot("panda"), aside=True) == [*exactly, (ROOMS[-1], False, True)]


def test_what_would_hardly_be_held_is_no_firm_grasp(view):
    """Without a firm one it is taken where others may be, too."""
    poor = SimpleNamespace(
        holds=lambda tool: HARDLY, centred=lambda tool: tool, risk=lambda tool, width: 0.0, asks=False
    )
    tools = candidates(view, "box", DOWN, view.tool[3:])
    found = []
    for firmly in (False, True):
        chooser = Chooser(view, "box", 0.1, Pace(0.5), (), CLOSER, firmly)
        chooser.__dict__["_firm"] = poor
        found.append(chooser)
    assert np.isfinite(found[0].other(tools).goal).all()
    with pytest.raises(NoWayError, match="that would hardly be held"):
        found[1].other(candidates(view, "box", DOWN, view.tool[3:]))


@pytest.mark.parametrize(
    ("closer", "swings", "spare"),
    [(ROOMS[1], True, NARROWER[0]), (ROOMS[0], True, None), (ROOMS[1], False, None)],
)
def test_a_jaw_that_swings_comes_less_wide_open_where_it_has_no_room(
    view, monkeypatch, closer, swings, spare
):
    """As in the hole of a ring; the hand is a number here: the metres by which it is wider open."""
    monkeypatch.setattr(grasp_choice, "opened_about", lambda robot, width, spare=SPARE: spare)
    chooser = Chooser(view, "box", 0.1, Pace(0.5), (), closer)
    chooser.__dict__["_slide"] = 0.004 if swings else 0.0
    chooser._has_room = lambda tool, hand: hand.free(tool)
    chooser._opened = lambda wide: SimpleNamespace(closure=-wide, wide=wide, free=lambda tool: wide < SPARE)
    found = chooser._with_room(view.tool, 0.03)
    assert (None if found is None else found.wide) == spare


def test_a_hand_of_many_fingers_takes_a_round_thing_about_its_middle_from_the_side():
    """Held 20 mm before its axis, as deep as the robot's file lets any hand reach, a cup slips out."""
    from bt_tasksim import Scene
    from bt_tasksim.concept_nodes.grasp_firmness import SURELY, Firm
    from bt_tasksim.scene import ObjectSpec

    size = (0.067, 0.067, 0.1)
    scene = Scene(
        "xarm7_ability", objects={"cup": ObjectSpec(kinds=("cylinder",), on="table", size=(size, size))}
    )
    found = scene.sample(0).world_model(["cup"], 0.1).object("cup")
    cup = poses.pose([0.45, 0.0, 0.05])
    level, side = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    neutral = poses.frame_from_axes(level, side)
    robot = load_robot("xarm7_ability")
    world = SimpleNamespace(
        robot=robot, objects={"cup": cup}, model=lambda name: found, things=lambda without: ()
    )
    tools = candidates(world, "cup", level, neutral).tools
    firm = Firm(world, "cup")
    from_side = tools[np.abs(poses.z_axis(tools[:, 3:])[:, 2]) < 0.1]
    before = np.array([poses.localise(tool, cup[:3])[2] for tool in from_side])
    deepest = from_side[np.argmin(before)]
    assert before.min() < 0.008 and firm.holds(deepest) == SURELY
    assert firm.holds(poses.shifted(deepest, -0.03 * poses.z_axis(deepest[3:]))) != SURELY


def between_walls(apart, robot="xarm7_ability"):
    """A robot's view of a bar that stands between walls so many metres apart."""
    from bt_tasksim import Scene
    from bt_tasksim.concept_nodes.view import WorldView
    from bt_tasksim.scene import ObjectSpec

    robot = load_robot(robot)
    bar = ObjectSpec(kinds=("box",), on="table", size=((0.1, 0.02, 0.03),) * 2)
    model = Scene(robot.name, objects={"bar": bar}).sample(0).world_model(["bar"], robot.opening)
    walls = [
        Obstacle(
            pose=poses.pose([0.45, side * (apart + 0.02) / 2, 0.02]), size=(0.3, 0.02, 0.04), fixture="tray"
        )
        for side in (1.0, -1.0)
    ]
    world = dataclasses.replace(model, obstacles=(*model.obstacles, *walls))
    tool = arm_of(robot).tool(robot.rest)
    objects = {"bar": poses.pose([0.45, 0.0, 0.015])}
    return WorldView(robot, world, objects, tool, robot.rest, robot.hand_open)


@pytest.mark.parametrize(("robot", "apart"), [("xarm7_ability", 0.105), ("panda", 0.08)])
def test_a_hand_that_has_no_room_wide_open_comes_partly_closed_where_nothing_else_serves(robot, apart):
    view = between_walls(apart, robot)
    neutral = poses.frame_from_axes(DOWN, np.array([0.0, 1.0, 0.0]))
    found = candidates(view, "bar", DOWN, neutral)
    lengthwise = abs(poses.to_matrix(found.tools[:, 3:])[:, 1, 1]) > 0.9

    def asked(thoroughly):
        chooser = Chooser(view, "bar", 0.1, Pace(0.5), (), ROOMS[-1], thoroughly=thoroughly)
        return chooser.other(found.keeping(lengthwise))

    with pytest.raises(NoWayError, match="touch tray"):
        asked(thoroughly=False)
    assert 0.1 < asked(thoroughly=True).closure < 0.9


def over_an_edge():
    """The Panda's view of a bar 3 cm high of which 4 cm lie over the front edge of a board, at x = 0.56 m."""
    board = Obstacle(pose=poses.pose([0.71, 0.0, 0.44]), size=(0.3, 0.3, 0.02), fixture="board")
    view = with_obstacles(between_walls(0.6, "panda"), board)
    return view._replace(objects={"bar": poses.pose([0.57, 0.0, 0.465])})


@pytest.mark.parametrize(("forward", "closes"), [(0.535, True), (0.55, False)])
def test_fingers_that_would_meet_something_as_they_close_do_not_take_hold_there(forward, closes):
    view = over_an_edge()
    level = poses.frame_from_axes(np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]))
    goal = np.array([forward, 0.0, 0.465, *level])
    opening = Opening(view, "bar", view.robot.hand_open, close=True, beside=0.0)
    assert opening.free(goal), "wide open they have room"
    chooser = Chooser(view, "bar", 0.1, Pace(0.5), (), ROOMS[-1])
    only = Candidates(goal[None], np.zeros(1), np.array([0.03]))
    if closes:
        assert np.allclose(chooser.other(only).goal, goal)
    else:
        with pytest.raises(NoWayError, match="close on board"):
            chooser.other(only)


def test_grasps_with_which_the_arm_comes_to_what_follows_have_their_turn_where_nothing_else_serves(view):
    """None but those from the side can be brought there, and all the usual ones come from above."""
    view = between_walls(apart=0.6)
    neutral = poses.frame_from_axes(DOWN, np.array([0.0, 1.0, 0.0]))
    found = candidates(view, "bar", DOWN, neutral)
    high = Aim(poses.pose([0.5, -0.45, 0.78])[None], "be put down on a tower")
    chooser = Chooser(view, "bar", 0.1, Pace(0.5), [high], ROOMS[-1], thoroughly=True)
    level = abs(poses.z_axis(chooser._in_reach(found).tools[:100, 3:])[:, 2]) < 0.6
    assert level.mean() > 0.5 > (abs(poses.z_axis(found.tools[:100, 3:])[:, 2]) < 0.6).mean()
