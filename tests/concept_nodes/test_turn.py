"""Turn: the ways to turn something, how it is asked and judged, and what is refused."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim import Runner
from bt_tasksim.concept_nodes import Grasp, Oriented, Pick, PointingUp, Turn
from bt_tasksim.concept_nodes.orientation import missing_lean, missing_turn
from bt_tasksim.concept_nodes.turn_ways import turnings
from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.facts import WorldFacts
from bt_tasksim.scene import Goal, ObjectSpec, Scene, SpotSpec
from bt_tasksim.scene.relations import FinalState, relation_named
from bt_tasksim.scene.shapes import ShapeSize, object_model
from bt_tasksim.scene.success import evaluate_success
from bt_tasksim.trees import sequence
from tests.bt_tasksim.scene.states import drawn, state
from tests.concept_nodes.test_agreement_with_goals import seen_exactly

TURNS = st.tuples(*[st.floats(-2.0, 2.0)] * 3).map(lambda v: poses.from_rotation_vector(np.array(v)))
DIRECTIONS = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda v: np.linalg.norm(v) > 0.2)
BOX, CUP = (0.07, 0.05, 0.12), (0.07, 0.07, 0.1)
UPS = [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)]


def world(kind="box", size=BOX):
    """A thing on the table and a mark, and their facts."""
    scene = Scene(
        objects={"it": ObjectSpec((kind,), on="table", size=(size, size), yaw=0.0)},
        spots=[SpotSpec("mark", on="table", yaw=1.0)],
    )
    configuration, model = drawn(scene)
    return configuration, model, WorldFacts.of([model]).object("it")


@settings(max_examples=40, deadline=None)
@given(now=TURNS, should=TURNS, kind=st.sampled_from(["box", "cup", "cube"]))
def test_each_way_ends_as_it_should_up_to_symmetry_about_its_middle(now, should, kind):
    size = (0.05,) * 3 if kind == "cube" else CUP if kind == "cup" else BOX
    model, facts = object_model("it", kind, ShapeSize(size)), world(kind, size)[2]
    pose = poses.pose([0.4, 0.1, 0.3], now)
    found = turnings(pose, model, should=should)
    goal = poses.pose([0.0, 0.0, 0.0], should)[None]
    for way in found:
        assert np.allclose(way.poses[:, :3], pose[:3])
        assert np.linalg.norm(missing_turn(way.poses[-1:], goal, facts)) < 1e-5
    lengths = [float(poses.angle_between(way.poses[-1:, 3:], now[None])[0]) for way in found]
    assert lengths == pytest.approx(sorted(lengths), abs=1e-5)
    assert np.linalg.norm(missing_turn(pose[None], goal, facts)) == pytest.approx(lengths[0], abs=1e-5)


@settings(max_examples=40, deadline=None)
@given(now=TURNS, up=st.sampled_from(UPS) | DIRECTIONS)
def test_each_way_leads_an_axis_up_and_the_first_is_the_shortest(now, up):
    axis = np.array(up) / np.linalg.norm(up)
    pose = poses.pose([0.4, 0.1, 0.3], now)
    found = turnings(pose, object_model("it", "box", ShapeSize(BOX)), up=axis)
    for way in found:
        assert np.linalg.norm(missing_lean(way.poses[-1:], tuple(axis))) < 1e-5
    turn = missing_lean(pose[None], tuple(axis))
    after = poses.quat_multiply(poses.from_rotation_vector(turn), pose[None, 3:])
    assert np.allclose(poses.rotate(after, axis[None]), [[0.0, 0.0, 1.0]], atol=1e-6)
    first = float(poses.angle_between(found[0].poses[-1:, 3:], now[None])[0])
    assert np.linalg.norm(turn) == pytest.approx(first, abs=1e-5)


@pytest.mark.parametrize(
    ("goal", "turn", "reached"),
    [
        (Goal("it", relation="turned", axis=(1, 0, 0), value=1.0), (1.0, 0.0, 0.0), True),
        (Goal("it", relation="turned", axis=(1, 0, 0), value=1.0), (0.7, 0.0, 0.0), False),
        (Goal("it", relation="turned", value=math.pi), (0.0, 0.0, 0.05), True),  # a box looks the same
        (Goal("it", relation="pointing_up", axis=(0, 0, -1)), (math.pi, 0.0, 0.0), True),
        (Goal("it", relation="pointing_up", axis=(0, 1, 0)), (math.pi / 2, 0.0, 0.0), True),
        (Goal("it", relation="pointing_up"), (0.3, 0.0, 0.0), False),
    ],
)
def test_how_it_is_turned_in_the_hand_is_judged(goal, turn, reached):
    configuration, model, _ = world()
    now = np.array(configuration.objects[0].pose) + np.array([0.0, 0.0, 0.2, 0.0, 0.0, 0.0, 0.0])
    now[3:] = poses.quat_multiply(poses.from_rotation_vector(np.array(turn)), now[3:])
    held = {"hand_distance": np.zeros(1), "hand_force": np.full(1, 5.0)}
    asked = dataclasses.replace(configuration, goals=(goal,))
    judged = evaluate_success(asked, model, state(configuration, {"it": now}, **held))
    assert judged.success is reached, judged.outcome.sentence
    assert not evaluate_success(asked, model, state(configuration, {"it": now})).success  # in no hand


@settings(max_examples=30, deadline=None)
@given(turn=TURNS, value=st.floats(-3.0, 3.0), axis=DIRECTIONS)
def test_the_condition_asks_what_the_goal_judges(turn, value, axis):
    configuration, model, _ = world()
    at = poses.pose([0.45, 0.0, 0.4], turn)
    hidden = state(configuration, {"it": at})
    seen = seen_exactly(model, hidden)
    final = FinalState(configuration, model, hidden)
    for goal, kind in (
        (Goal("it", "mark", relation="oriented", value=value, axis=axis), Oriented),
        (Goal("it", relation="pointing_up", axis=axis), PointingUp),
    ):
        found = kind.value(**kind.from_goal(goal))._off(seen)
        assert float(found[0]) == pytest.approx(relation_named(goal.relation).off(goal, final), abs=1e-5)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({}, "it turns by nothing"),
        ({"like": "cup"}, "'like' is the object itself"),
        ({"up": (0, 0, -1), "angle": 1.0}, "leave out 'angle'"),
        ({"angle": 9.0}, "a full turn"),
    ],
)
def test_what_makes_no_sense_is_refused(arguments, words):
    with pytest.raises(InputError, match=words):
        Turn("cup", **arguments)


@pytest.mark.physical
def test_what_lies_in_a_cup_is_not_spilled():
    pea = ObjectSpec(("cube",), inside="cup", size=((0.02,) * 3,) * 2, area=(0.0, 0.0), mass=(0.01, 0.01))
    scene = Scene(objects={"cup": "on table", "pea": pea}, goal=Goal("cup", relation="pointing_up"))
    tree = sequence("spill", Grasp("cup"), Pick("cup", distance=0.15), Turn("cup", up=(0, 0, -1)))
    result = Runner(tree, scene).run(3)
    assert not result.success and "pea would fall out of cup as it is turned" in result.why
