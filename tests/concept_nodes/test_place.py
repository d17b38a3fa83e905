"""Place: each world as alone, down until the support is felt, and what it says when it cannot."""

import dataclasses

import numpy as np
import pytest
from py_trees.common import Status

from bt_tasksim.concept.leaf import ONE
from bt_tasksim.concept_nodes import Place
from bt_tasksim.concept_nodes.closer import DROPPED
from bt_tasksim.concept_nodes.holding import NOT_HELD
from bt_tasksim.concept_nodes.limits import FAR, gentler
from bt_tasksim.concept_nodes.place import (
    FELT,
    GENTLY,
    HARD,
    LATE,
    LEANING,
    LEANS_ON,
    MISSED,
    NOT_ABOVE,
    NOT_BESIDE,
    NOT_THERE,
    NOTHING_BELOW,
    SLOWEST,
    SLOWLY,
    UNSURE,
)
from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError, NoWayError
from bt_tasksim.core.outcomes import CANNOT_START, DONE, NO_WAY
from bt_tasksim.core.world import Obstacle
from bt_tasksim.planning.reference_motion import sample


@pytest.mark.parametrize("scenario", ["pick_and_place", "shelf_to_shelf"])
def test_each_world_is_treated_as_alone(situations, functions, scenario):
    answers = {name: situations(Place, scenario).check(name) for name in functions}
    for name in ("done", "maintained", "necessary_cost", "sufficient_cost"):
        assert len({float(np.squeeze(a)) for a in answers[name]}) > 1, name


def held(toy, leaf):
    stage = toy(leaf)
    stage.world.hold("cup")
    stage.look()
    return stage


def heights(stage):
    return np.array([c.tool[2] for c in stage.world.steps])


def follow(stage, floor=None, newtons=8.0, aside=0.0, lean=0.0):
    """The cup follows the tool, and pushes back where it meets a floor at this height of its centre.

    It comes down so far aside of where it should, and leans so far when it meets the floor.
    """
    step = stage.world.step

    def moved(command):
        before = stage.world.now.tool_pose.copy()
        step(command)
        now = stage.world.now
        objects = now.objects.copy()
        objects[0, :3] += now.tool_pose[:3] - before[:3]
        wrench = np.zeros(6)
        if not stage.world.steps[1:]:
            objects[0, 0] += aside
        if floor is not None and objects[0, 2] < floor:
            wrench[2] = -newtons  # in the tool's frame, whose z points down
            objects[0, 3:] = poses.from_rotation_vector(np.array([lean, 0.0, 0.0]))
        stage.world.now = dataclasses.replace(now, objects=objects, wrench=wrench)
        return stage.world.now

    stage.world.step = moved


def standing_height(stage):
    """Height of the cup's middle where it stands on the goal."""
    model = stage.world.model
    return model.place("goal").pose[2] + model.object("cup").extent[2] / 2


def test_it_stops_when_the_support_is_felt(toy):
    leaf = Place("cup", on="goal")
    stage = held(toy, leaf)
    floor = standing_height(stage) + 0.02
    follow(stage, floor)
    assert stage.tick(400) == Status.SUCCESS
    assert floor - 0.01 < heights(stage)[-1] < floor
    assert leaf.outcome.is_a(DONE) and leaf.outcome.detail.numbers["felt"] == pytest.approx(8.0)


def test_what_stops_far_above_its_support_is_not_there(toy):
    leaf = Place("cup", on="goal")
    stage = held(toy, leaf)
    follow(stage, floor=0.2)
    assert stage.tick(400) == Status.FAILURE and leaf.outcome.is_a(NOT_THERE)
    assert heights(stage)[-1] == pytest.approx(0.2, abs=0.03) and heights(stage)[-1] > 0.15
    where = [*stage.world.model.place("goal").pose[:2], standing_height(stage)]
    missed = np.linalg.norm(stage.world.now.objects[0, :3] - where)
    assert leaf.outcome.detail.numbers["value"] == pytest.approx(missed, abs=1e-3)


def test_what_is_not_there_at_the_end_of_the_way_may_still_come_for_a_second(toy):
    leaf = Place("cup", on="goal")
    stage = held(toy, leaf)
    follow(stage, aside=MISSED + 0.01)
    assert stage.tick(600) == Status.FAILURE and leaf.outcome.is_a(NOT_THERE)
    still = np.linalg.norm(np.diff([c.tool[:3] for c in stage.world.steps], axis=0), axis=1) < 1e-9
    assert still.sum() * 0.05 == pytest.approx(LATE, abs=0.15), "it waits where the way ends"


@pytest.mark.parametrize("aside", [0.0, MISSED - 0.012])
def test_what_comes_down_a_little_beside_is_there(toy, aside):
    leaf = Place("cup", on="goal")
    stage = held(toy, leaf)
    follow(stage, aside=aside)
    assert stage.tick(600) == Status.SUCCESS and leaf.outcome.is_a(DONE)


@pytest.mark.parametrize("share", [0.8, 1.2])
def test_what_leans_has_not_been_put_down(toy, share):
    """It lies on something else, too."""
    leaf = Place("cup", on="goal")
    stage = held(toy, leaf)
    follow(stage, floor=standing_height(stage) + 0.01, lean=share * LEANING)
    status = stage.tick(400)
    if share < 1.0:
        assert status == Status.SUCCESS and leaf.outcome.is_a(DONE)
        return
    assert status == Status.FAILURE and leaf.outcome.is_a(LEANS_ON)
    numbers = leaf.outcome.detail.numbers
    assert numbers["value"] == pytest.approx(share * LEANING, abs=1e-3) and numbers["limit"] == LEANING


def half_way(memory):
    """In the middle of the way, where that is fastest."""
    return memory._replace(progress=0.5 * memory.path.duration)


@pytest.mark.parametrize(
    ("above", "share"), [(0.1, 1.0), (SLOWLY + UNSURE, 1.0), (0.75 * SLOWLY, 0.75), (0.0, 0.0), (-0.005, 0.0)]
)
def test_near_its_support_it_goes_slower(toy, above, share):
    stage = held(toy, Place("cup", on="goal"))
    stage.tick(3)
    seen, model = stage.context.seen(ONE, np.zeros(1)), stage.tree.model
    memory = half_way(model.begin(seen))
    objects = seen.observation.objects.copy()
    objects[0, 0, 2] = standing_height(stage) + above
    stage.world.put(objects=objects[0])
    stage.look()
    seen = stage.context.seen(ONE, np.zeros(1))
    on = model.advance(None, seen, memory).progress - memory.progress
    gentle = float(gentler(seen.tool)[0])
    sure = share - UNSURE * (1.0 - gentle) / SLOWLY if share < 1.0 else 1.0
    assert on[0] == pytest.approx(max(sure, GENTLY * gentle) * 0.05, rel=1e-6)


def test_where_it_cannot_go_straight_a_way_is_searched_for(toy):
    wall = Obstacle(poses.pose([0.5, 0.12, 0.05]), (0.3, 0.02, 0.1), "wall")
    ended = {}
    for obstacles in ((), (wall,)):
        leaf = Place("cup", on="goal")
        stage = toy(leaf)
        stage.context.begin([dataclasses.replace(stage.world.model, obstacles=obstacles)])
        tool = stage.world.now.tool_pose.copy()
        tool[:3] = [0.5, 0.0, 0.12]
        stage.world.put(tool_pose=tool)
        stage.world.bend()
        stage.world.hold("cup")
        stage.look()
        follow(stage)
        assert stage.tick(600) == Status.SUCCESS, leaf.feedback_message
        ended[len(obstacles)] = np.array([c.tool[:3] for c in stage.world.steps])
        assert all(np.isfinite(c.posture).all() for c in stage.world.steps), "the arm's joints are planned"
        planned = float(leaf.model.planned(leaf.memory)[0])
        assert 0.5 < planned <= 0.05 * len(stage.world.steps)
    # The cup's middle is at the tool.
    half = stage.world.model.object("cup").extent[2] / 2
    over = [tools[abs(tools[:, 1] - 0.12) < 0.02][:, 2].min() - half for tools in (ended[0], ended[1])]
    assert over[0] < 0.09 and over[1] > 0.1
    assert np.allclose(ended[0][-1], ended[1][-1], atol=1e-3)


def test_a_hand_that_has_no_room_turns_what_looks_the_same_then(toy):
    """Beside a wall there is room for a cup, and for the hand across the wall there is not."""
    wall = Obstacle(poses.pose([0.45, 0.345, 0.15]), (0.6, 0.02, 0.3), "wall")
    turned = {}
    for obstacles in ((), (wall,)):
        leaf = Place("cup", on="goal")
        stage = toy(leaf)
        stage.context.begin([dataclasses.replace(stage.world.model, obstacles=obstacles)])
        tool = stage.world.now.tool_pose.copy()
        tool[:3] = [0.45, 0.0, 0.3]
        stage.world.put(tool_pose=tool)
        stage.world.bend()
        stage.world.hold("cup")
        stage.look()
        follow(stage)
        assert stage.tick(600) == Status.SUCCESS, leaf.feedback_message
        closing = poses.to_matrix(stage.world.steps[-1].tool[3:])[:, 1]
        turned[len(obstacles)] = np.degrees(np.arccos(min(1.0, abs(closing[1]))))
    assert turned[0] < 5.0 and turned[1] > 30.0


def test_what_would_be_touched_where_it_is_put_down_is_said(toy):
    lid = Obstacle(poses.pose([0.45, 0.25, 0.15]), (0.6, 0.6, 0.02), "lid")
    leaf = Place("cup", on="goal")
    stage = toy(leaf)
    stage.context.begin([dataclasses.replace(stage.world.model, obstacles=(lid,))])
    stage.world.hold("cup")
    stage.look()
    assert stage.tick() == Status.FAILURE and leaf.outcome.is_a(NO_WAY)
    assert "no way straight down onto goal" in leaf.feedback_message and "lid" in leaf.feedback_message


def test_less_than_the_pressing_force_is_no_support(toy):
    leaf = Place("cup", on="goal", press=10.0)
    stage = held(toy, leaf)
    follow(stage, floor=0.2)
    assert stage.tick(400) == Status.SUCCESS and heights(stage)[-1] < 0.1


def test_it_ends_a_little_below_where_the_support_should_be(toy):
    leaf = Place("cup", on="goal", overshoot=0.007, speed=0.12)
    stage = held(toy, leaf)
    follow(stage)
    assert stage.tick(400) == Status.SUCCESS
    model = stage.world.model
    half = model.object("cup").extent[2] / 2
    assert heights(stage)[-1] == pytest.approx(model.place("goal").pose[2] + half - 0.007, abs=1e-3)
    assert np.abs(np.diff([c.tool[:3] for c in stage.world.steps], axis=0)).max() / 0.05 < 0.12 * 1.05


def test_a_distance_limits_how_far_it_goes(toy):
    leaf = Place("cup", on="goal", distance=0.05, overshoot=0.0)
    stage = held(toy, leaf)
    start = stage.world.now.tool_pose[2]
    follow(stage)
    assert stage.tick(400) == Status.SUCCESS
    assert heights(stage)[-1] == pytest.approx(start - 0.05, abs=1e-3)


def test_without_the_object_in_the_hand_it_cannot_start(toy):
    stage = toy(Place("cup", on="goal"))
    assert stage.tick() == Status.FAILURE
    assert stage.tree.outcome.is_a(CANNOT_START) and stage.tree.outcome.is_a(NOT_HELD)


def test_the_cost_falls_to_nothing_where_it_stands(recorded_run):
    decisions = [d for d in recorded_run("pick_and_place") if type(d.leaf.model) is Place]
    cost = [float(d.leaf.model.necessary_cost(d.seen, d.memory)[0]) for d in decisions]
    assert cost[0] > 0.04 and cost[-1] < 0.012


def test_one_of_on_and_beside():
    for arguments in ({}, {"on": "goal", "beside": "box"}):
        with pytest.raises(InputError, match="place: give either 'on' or 'beside'"):
            Place("cup", **arguments)
    with pytest.raises(InputError, match="'anywhere' goes with 'on'"):
        Place("cup", beside="box", anywhere=True)


def over(toy, leaf, at):
    """The cup is held so far ``(3,)`` from the goal's middle, in metres."""
    stage = held(toy, leaf)
    middle = stage.world.model.place("goal").pose[:3]
    stage.world.put(tool_pose=poses.pose(middle + np.array(at), stage.world.now.tool_pose[3:]))
    stage.world.bend()
    stage.world.hold("cup")
    stage.look()
    return stage


def test_without_a_place_it_goes_down_to_what_is_below(toy):
    stage = over(toy, Place("cup", anywhere=True), (-0.1, -0.05, 0.3))
    follow(stage)
    start = stage.world.now.tool_pose.copy()
    assert stage.tick(400) == Status.SUCCESS
    assert stage.world.now.tool_pose[:2] == pytest.approx(start[:2], abs=1e-3)
    assert heights(stage)[-1] == pytest.approx(standing_height(stage), abs=0.01)


def test_where_something_stands_below_it_goes_beside_that(toy):
    stage = over(toy, Place("cup", anywhere=True), (-0.1, -0.05, 0.3))
    follow(stage)
    objects = stage.world.now.objects.copy()
    objects[1, :2] = stage.world.now.tool_pose[:2]
    stage.world.put(objects=objects)
    stage.look()
    assert stage.tick(600) == Status.SUCCESS
    apart = np.linalg.norm(stage.world.now.tool_pose[:2] - objects[1, :2])
    assert 0.05 < apart < 0.25


def test_over_nothing_that_carries_it_cannot_start(toy):
    stage = over(toy, Place("cup", anywhere=True), (0.0, 5.0, 0.3))
    assert stage.tick() == Status.FAILURE and stage.tree.outcome.is_a(NOTHING_BELOW)


def test_where_it_is_not_above_the_place_or_not_beside_the_other_it_cannot_start(toy):
    stage = held(toy, Place("cup", on="goal", anywhere=True))
    assert stage.tick() == Status.FAILURE and stage.tree.outcome.is_a(NOT_ABOVE)
    assert "beyond the edge of goal" in stage.tree.feedback_message
    stage = held(toy, Place("cup", beside="box"))
    objects = stage.world.now.objects.copy()
    objects[1, 1] += 0.5
    stage.world.put(objects=objects)
    stage.look()
    assert stage.tick() == Status.FAILURE and stage.tree.outcome.is_a(NOT_BESIDE)


def pace(toy, far, above):
    """Seconds by which a way goes on in a period, the tool so far from the base, metres above its end."""
    stage = held(toy, Place("cup", on="goal"))
    stage.tick(3)
    seen, model = stage.context.seen(ONE, np.zeros(1)), stage.tree.model
    memory = half_way(model.begin(seen))
    objects, tool = seen.observation.objects[0].copy(), seen.tool[0].copy()
    objects[0, 2], tool[:2] = standing_height(stage) + above, (far, 0.0)
    stage.world.put(objects=objects, tool_pose=tool)
    stage.look()
    on = model.advance(None, stage.context.seen(ONE, np.zeros(1)), memory).progress - memory.progress
    return on[0]


@pytest.mark.parametrize(("far", "share"), [(2 * FAR, GENTLY), (FAR, GENTLY), (0.5 * FAR, 0.25 * GENTLY)])
def test_near_the_base_of_the_arm_it_goes_slower_still(toy, far, share):
    assert pace(toy, far, above=0.0) == pytest.approx(share * 0.05, rel=1e-6)


@pytest.mark.parametrize(("far", "share"), [(FAR, 0.5), (0.2 * FAR, 0.26)])
def test_a_stiff_arm_goes_slowly_before_what_may_stand_higher_than_it_is_seen_to(toy, far, share):
    assert pace(toy, far, above=0.5 * SLOWLY) == pytest.approx(share * 0.05, rel=1e-6)


def test_it_arrives_where_the_way_itself_is_slow(toy):
    """Near the end of a way that is a hundred times as long, right above the support, near the arm's base."""
    stage = held(toy, Place("cup", on="goal"))
    stage.tick(3)
    seen, model = stage.context.seen(ONE, np.zeros(1)), stage.tree.model
    begun = model.begin(seen)
    slow = begun.path._replace(duration=100.0 * begun.path.duration)
    memory = begun._replace(path=slow, progress=0.5 * slow.duration)
    objects, tool = seen.observation.objects[0].copy(), seen.tool[0].copy()
    objects[0, 2], tool[:2] = standing_height(stage), (0.2 * FAR, 0.0)
    stage.world.put(objects=objects, tool_pose=tool)
    stage.look()
    later = model.advance(None, stage.context.seen(ONE, np.zeros(1)), memory).progress
    down = sample(slow, memory.progress) - sample(slow, later)
    whole = sample(slow, memory.progress) - sample(slow, memory.progress + 0.05)
    assert down[0, 2] == pytest.approx(min(SLOWEST * 0.05, whole[0, 2]), rel=1e-3)


@pytest.mark.parametrize(("newtons", "ticks"), [(4.0, 1), (0.9 * HARD * 3.0, 1), (1.1 * HARD * 3.0, FELT)])
def test_a_hard_force_is_felt_at_once(toy, newtons, ticks):
    stage = held(toy, Place("cup", on="goal"))
    stage.tick(10)
    model = stage.tree.model
    memory = model.begin(stage.context.seen(ONE, np.zeros(1)))
    stage.world.put(wrench=np.array([0.0, 0.0, -newtons, 0.0, 0.0, 0.0]))
    stage.look()
    seen = stage.context.seen(ONE, np.ones(1))
    assert model.advance(None, seen, memory).felt[0] == ticks


@pytest.mark.parametrize(
    ("serves", "tried"),
    [
        (lambda above, around, turned: not around and above <= DROPPED and not turned, 1),
        (lambda above, around, turned: not around and above <= DROPPED and turned, 2),
        (lambda above, around, turned: not around and above > DROPPED, 3),
        (lambda above, around, turned: around, 5),
    ],
)
def test_it_comes_down_aside_or_lets_go_higher_before_it_goes_around(toy, monkeypatch, serves, tried):
    """As it is held and then otherwise: straight, from a little higher, and only then around something."""
    stage = held(toy, Place("cup", on="goal"))
    model, goals, asked = stage.tree.model, [np.zeros(7), np.ones(7)], []
    monkeypatch.setattr(type(model), "_other_ends", lambda self, view: goals[1:])

    def down(self, view, goal, rooms, around):
        asked.append((max(above for _, above in rooms), around))
        if serves(max(above for _, above in rooms), around, goal[0] > 0.5):
            return "a way"
        raise NoWayError("no way")

    monkeypatch.setattr(type(model), "_down", down)
    _, way, around = model._found(None, goals[0])
    assert way == "a way" and len(asked) == tried and around == (tried == 5)


@pytest.mark.parametrize(("around", "felt"), [(False, 1), (True, 0)])
def test_on_a_way_around_nothing_bears_it_that_is_aside(toy, around, felt):
    stage = held(toy, Place("cup", on="goal"))
    stage.tick(10)
    model = stage.tree.model
    memory = model.begin(stage.context.seen(ONE, np.zeros(1)))._replace(around=np.array([around]))
    for aside, ticks in ((MISSED + 0.01, felt), (0.0, 1)):
        objects = stage.world.now.objects.copy()
        objects[0, :2] = stage.world.model.place("goal").pose[:2] + np.array([aside, 0.0])
        stage.world.put(objects=objects, wrench=np.array([0.0, 0.0, -4.0, 0.0, 0.0, 0.0]))
        stage.look()
        seen = stage.context.seen(ONE, np.ones(1))
        assert model.advance(None, seen, memory).felt[0] == ticks
