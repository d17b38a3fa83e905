"""Lifted: in the hand alone, high enough, and upright; by hand-made physics states."""

import dataclasses
import math

import numpy as np
import pytest

from bt_tasksim.core import poses
from bt_tasksim.core.world import Hidden
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.relations.lifted import HELD_UP, NOT_LIFTED, SLIPPED, TILTED
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import Goal, ObjectSpec
from bt_tasksim.scene.success import PENETRATION, evaluate_success
from tests.bt_tasksim.scene.states import drawn, state

SCENE = Scene(
    objects={"cup": ObjectSpec(("cup",), on="table")},
    goal=Goal("cup", "table", relation="lifted", height=0.3),
)


@pytest.fixture
def held():
    """A world and its final state, with the cup 0.3 m up in the hand and moving a little."""
    configuration = SCENE.sample(3)
    robot = load_robot("panda")
    world = configuration.world_model([t.name for t in robot.tips], robot.opening)
    pose = np.array(configuration.objects[0].pose)
    pose[2] += 0.3
    hidden = Hidden(
        time=np.float64(5.0),
        objects=pose[None],
        velocities=np.full((1, 6), 0.05),
        hand_force=np.array([5.0]),
        hand_distance=np.zeros(1),
        support=np.zeros((1, 2), bool),
        penetration=np.float64(0.0005),
        tool_pose=pose,
    )
    return configuration, world, hidden


def lower(hidden, way):
    return {"objects": hidden.objects - [0, 0, way, 0, 0, 0, 0]}


def tilted(hidden, degrees):
    turn = poses.from_rotation_vector(np.array([math.radians(degrees), 0, 0]))
    pose = hidden.objects[0]
    return {"objects": poses.pose(pose[:3], poses.quat_multiply(turn, pose[3:]))[None]}


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda h: {}, HELD_UP),
        (lambda h: lower(h, 0.02), HELD_UP),
        (lambda h: tilted(h, 9), HELD_UP),
        (lambda h: lower(h, 0.04), SLIPPED),
        (lambda h: tilted(h, 11), TILTED),
        (lambda h: {"support": np.array([[False, True]])}, NOT_LIFTED),
        (lambda h: {"hand_distance": np.array([0.01])}, NOT_LIFTED),
        (lambda h: {"penetration": np.float64(0.003)}, PENETRATION),
    ],
)
def test_each_reason_and_nothing_else_wrong(held, change, reason):
    configuration, world, hidden = held
    found = evaluate_success(configuration, world, dataclasses.replace(hidden, **change(hidden)))
    assert found.outcome.is_a(reason) and found.success is (reason is HELD_UP)
    assert found.reason == ("" if found.success else reason.name)


@pytest.mark.parametrize(
    ("touching", "success"),
    [
        ([("pea", "cup")], True),  # it lies in the cup
        ([("pea", "cup"), ("crumb", "pea")], True),  # and one on it
        ([("cup", "table")], False),
        ([("pea", "cup"), ("pea", "table")], False),  # the cup stands on it, or leans on it
        ([("cup", "pea"), ("crumb", "pea"), ("crumb", "table")], False),
        ([("pea", "cup"), ("crumb", "table")], True),
    ],
)
def test_what_it_holds_comes_along_and_what_bears_it_does_not(touching, success):
    small = ObjectSpec(("cube",), on="cup", size=((0.02,) * 3,) * 2, area=(0, 0))
    objects = {**SCENE.objects, "pea": small, "crumb": dataclasses.replace(small, on="pea")}
    configuration, world = drawn(dataclasses.replace(SCENE, objects=objects, goals=SCENE.goals))
    up = [poses.shifted(np.array(a.pose), np.array([0.0, 0.0, 0.3])) for a in configuration.objects]
    names = [*world.index, "table"]
    support = np.zeros((3, 4), bool)
    for one, other in touching:
        support[names.index(one), names.index(other)] = True
    at = dict(zip(world.index, up, strict=True))
    hidden = state(configuration, at, hand_distance=np.array([0.0, np.inf, np.inf]), support=support)
    found = evaluate_success(configuration, world, hidden)
    assert (found.success, found.reason) == (success, "" if success else "not_lifted")


@pytest.mark.parametrize(
    ("way", "words"), [(0.021, "21 mm below"), (-0.001, "1 mm above"), (-0.04, "40 mm above")]
)
def test_the_sentence_says_whether_it_is_too_low_or_too_high(held, way, words):
    configuration, world, hidden = held
    outcome = evaluate_success(
        configuration, world, dataclasses.replace(hidden, **lower(hidden, way))
    ).outcome
    assert words in outcome.sentence and outcome.numbers["missing"] == pytest.approx(way)
    assert words in outcome.values["missing"]
