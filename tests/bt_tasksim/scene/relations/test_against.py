"""Against, held against, pressed: by hand-made physics states."""

import dataclasses

import numpy as np
import pytest

from bt_tasksim.core.world import Hidden
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.relations import FinalState, relation_named
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import Goal, ObjectSpec

CUBE = ObjectSpec(kinds=("cube",), on="ledge", area=(0.0, 0.0), yaw=0.0, size=(0.05, 0.05, 0.05))
SCENE = Scene(
    fixtures=["ledge"],
    objects={"it": CUBE, "other": dataclasses.replace(CUBE, centre=(0.0, 0.15))},
    goal=Goal("it", "ledge", relation="against"),
)
RIM = 0.52 + 0.14
"""Where the rim's near face is, x in metres."""


def final(gap, held=False, borne=True):
    configuration = SCENE.sample(3)
    robot = load_robot("panda")
    world = configuration.world_model([tip.name for tip in robot.tips], robot.opening)
    objects = np.array([thing.pose for thing in configuration.objects])
    objects[0, 0] = RIM - gap - 0.025
    count = len(objects)
    hidden = Hidden(
        time=np.float64(5.0),
        objects=objects,
        velocities=np.zeros((count, 6)),
        hand_force=np.zeros(count),
        hand_distance=np.array([0.0 if held else 0.1] + [0.1] * (count - 1)),
        support=np.full((count, count + len(configuration.fixtures)), borne),
        penetration=np.float64(0.0),
        tool_pose=objects[0],
    )
    return FinalState(configuration, world, hidden)


def asked(relation, state, place="ledge", **limits):
    return relation_named(relation).evaluate(Goal("it", place, relation=relation, **limits), state)


@pytest.mark.parametrize(("gap", "there"), [(0.0, True), (0.002, True), (-0.001, True), (0.01, False)])
def test_against_is_within_some_millimetres_of_the_rim(gap, there):
    found = asked("against", final(gap))
    assert found.reached is there and found.position_error == pytest.approx(max(gap, 0.0), abs=1e-6)
    assert asked("held_against", final(gap, held=True)).reached is there
    assert not asked("held_against", final(gap, held=False)).reached


def test_the_board_below_is_no_wall_and_another_thing_may_be_one():
    assert not asked("against", final(0.10)).reached
    assert not asked("against", final(0.10), "other").reached
    state = final(0.10)
    objects = state.hidden.objects.copy()
    objects[0, :2] = objects[1, :2] - [0.0501, 0.0]
    beside = dataclasses.replace(state, hidden=dataclasses.replace(state.hidden, objects=objects))
    assert asked("against", beside, "other").reached


def test_a_table_has_no_walls():
    found = asked("against", final(0.0), "table")
    assert not found.reached and found.outcome.reason.name == "no_wall"


def test_pressed_is_between_the_hand_and_the_place():
    gap = RIM - 0.025 - (0.52 - 0.01)
    assert asked("pressed", final(gap, held=True)).reached
    assert not asked("pressed", final(gap, held=False)).reached
    assert not asked("pressed", final(gap, held=True, borne=False)).reached
    assert not asked("pressed", final(gap - 0.05, held=True)).reached
