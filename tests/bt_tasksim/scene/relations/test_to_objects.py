"""Relations of an object to another object, and to a place's outline: by hand-made states."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bt_tasksim.core import poses
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import Goal, ObjectSpec, SpotSpec
from bt_tasksim.scene.success import evaluate_success
from tests.bt_tasksim.scene.states import drawn, state, tilted

SIZE = 0.05
CUBE = ((SIZE,) * 3,) * 2
RED = ObjectSpec(("cube",), on="table", centre=(0.0, -0.1), area=(0, 0), size=CUBE, yaw=0.0)
BLUE = ObjectSpec(("cube",), on="table", centre=(0.0, 0.1), area=(0, 0), size=CUBE, yaw=0.0)
BOWL = ObjectSpec(("cup",), on="table", centre=(0.15, 0.0), area=(0, 0), size=((0.12, 0.12, 0.08),) * 2)


def judged(goal, at, fixtures=(), **changes):
    scene = Scene(fixtures=fixtures, objects={"red": RED, "blue": BLUE, "bowl": BOWL}, goal=goal)
    configuration, world = drawn(scene)
    return evaluate_success(configuration, world, state(configuration, at, **changes))


def above(name_at, aside=(0.0, 0.0), up=SIZE, turn=(1.0, 0.0, 0.0, 0.0)):
    """A pose above another one."""
    x, y, z = name_at
    return poses.pose([x + aside[0], y + aside[1], z + up], turn)


MOVED = (0.42, 0.22, SIZE / 2)


@pytest.mark.parametrize(
    ("aside", "up", "turn", "reason"),
    [
        ((0.0, 0.0), SIZE, tilted(0), ""),
        ((0.0, 0.0), SIZE, tilted(73, axis=2), ""),
        ((0.0, 0.0), SIZE, tilted(90), ""),
        ((0.02, 0.02), SIZE, tilted(0), ""),
        ((0.04, 0.0), SIZE, tilted(0), "not_in_place"),
        ((0.0, 0.0), 2 * SIZE, tilted(0), "not_in_place"),
        ((0.0, 0.0), SIZE, tilted(12), "tilted_or_turned"),
    ],
)
def test_on_an_object_where_it_is_then(aside, up, turn, reason):
    at = {"blue": poses.pose(MOVED), "red": above(MOVED, aside, up, turn)}
    goal = Goal("red", on="blue")
    found = judged(goal, at)
    assert found.reason == (reason or "knocked_over")  # blue was moved, and no goal says so
    scene = Scene(objects={"red": RED, "blue": ObjectSpec(**{**vars(BLUE), "movable": True})}, goals=[goal])
    configuration, world = drawn(scene)
    found = evaluate_success(configuration, world, state(configuration, at))
    assert (found.success, found.reason) == (reason == "", reason)
    assert found.position_error == pytest.approx(np.linalg.norm([*aside, up - SIZE]), abs=1e-9)


def little(size, y):
    return ObjectSpec(("box",), on="table", centre=(0.0, y), area=(0, 0), size=(size,) * 2, yaw=0.0)


LITTLE = (0.02, 0.02, 0.016)


def test_of_small_things_one_next_to_another_one_does_not_stand_on_it():
    scene = Scene(objects={"a": little(LITTLE, -0.1), "b": little(LITTLE, 0.1)}, goal=Goal("a", on="b"))
    configuration, world = drawn(scene)
    b = np.array(configuration.objects[1].pose)
    for aside, up, reason in (
        (0.021, 0.0, "not_in_place"),
        (0.009, 0.016, ""),
        (0.011, 0.016, "not_in_place"),
    ):
        at = {"a": poses.shifted(b, np.array([aside, 0.0, up]))}
        found = evaluate_success(configuration, world, state(configuration, at))
        assert found.position_error < 0.03 and found.reason == reason


def test_what_stands_on_something_that_lies_on_the_spot_does_not_stand_there():
    objects = {"a": little(LITTLE, -0.1), "plate": little((0.06, 0.06, 0.012), 0.1)}
    spot = SpotSpec("spot", on="table", centre=(0.0, 0.1), area=(0, 0))
    configuration, world = drawn(Scene(objects=objects, spots=[spot], goal=Goal("a", on="spot")))
    plate = np.array(configuration.objects[1].pose)
    at = {"a": poses.shifted(plate, np.array([0.0, 0.0, 0.014]))}
    found = evaluate_success(configuration, world, state(configuration, at))
    assert found.reason == "on_something_else" and found.position_error < 0.03
    at["plate"] = poses.shifted(plate, np.array([0.0, 0.04, 0.0]))
    at["a"] = poses.shifted(plate, np.array([0.0, 0.0, 0.002]))
    assert evaluate_success(configuration, world, state(configuration, at)).success


@pytest.mark.parametrize(
    ("shift", "reason"),
    [
        ((0.0, 0.0, 0.0), ""),
        ((0.04, 0.0, 0.02), ""),
        ((0.07, 0.0, 0.0), "not_inside"),
        ((0.0, 0.0, 0.05), "not_inside"),
    ],
)
def test_inside_an_object(shift, reason):
    x, y, z = 0.65, 0.0, 0.04
    at = {"red": poses.pose([x + shift[0], y + shift[1], z + shift[2]])}
    found = judged(Goal("red", inside="bowl"), at)
    assert found.reason == reason and found.position_error == pytest.approx(np.hypot(*shift[:2]))


@pytest.mark.parametrize(
    ("pose", "reason"),
    [
        (poses.pose([0.5, 0.1 + SIZE + 0.03, SIZE / 2]), ""),
        (poses.pose([0.5 + SIZE + 0.09, 0.1, SIZE / 2], tilted(90, axis=2)), ""),
        (poses.pose([0.5, 0.1 + SIZE + 0.11, SIZE / 2]), "too_far_beside"),
        (poses.pose([0.5, 0.1, 1.5 * SIZE]), "other_level"),
        (poses.pose([0.5, 0.1 + SIZE - 0.01, SIZE / 2]), "over_one_another"),
        (poses.pose([0.5, 0.1 + 2 * SIZE, SIZE / 2 + 0.006], tilted(15)), "not_upright"),
    ],
)
def test_beside_an_object(pose, reason):
    found = judged(Goal("red", beside="blue"), {"red": pose})
    assert found.reason == reason


@given(st.floats(0.0, 0.2), st.floats(-np.pi, np.pi))
def test_beside_measures_between_the_outlines(gap, heading):
    """In every direction: a round thing's outline is as far from the middle everywhere."""
    way = np.array([np.cos(heading), np.sin(heading)])
    scene = Scene(
        objects={
            name: ObjectSpec(
                ("cylinder",), on="table", centre=(0.0, y), area=(0, 0), size=((0.05, 0.05, 0.1),) * 2
            )
            for name, y in (("a", -0.1), ("b", 0.1))
        },
        goal=Goal("a", beside="b"),
    )
    configuration, world = drawn(scene)
    pose = poses.pose([*(np.array([0.5, 0.1]) + way * (0.05 + gap)), 0.05])
    found = evaluate_success(configuration, world, state(configuration, {"a": pose}))
    assert found.position_error == pytest.approx(gap, abs=1.5e-3)
    assert found.success is (found.position_error <= 0.10)


@pytest.mark.parametrize(
    ("pose", "reason"),
    [
        ([0.66, 0.0, 0.22 + SIZE / 2], ""),
        ([0.58, -0.16, 0.22 + SIZE / 2], ""),
        ([0.66, 0.0, 0.60 + SIZE / 2], "not_on_it"),
        ([0.40, 0.0, SIZE / 2], "not_on_it"),
    ],
)
def test_anywhere_on_a_board(pose, reason):
    goal = Goal("red", on="lower_board", relation="anywhere")
    assert judged(goal, {"red": poses.pose(pose)}, ["shelf"]).reason == reason
    if not reason:
        leaning = poses.pose(pose, tilted(20))
        assert not judged(goal, {"red": leaning}, ["shelf"]).success


def test_anywhere_on_an_object_is_within_its_outline():
    on_edge = {"red": poses.pose([0.5 + 0.024, 0.1, 1.5 * SIZE])}
    beyond = {"red": poses.pose([0.5 + 0.026, 0.1, 1.5 * SIZE])}
    goal = Goal("red", on="blue", relation="anywhere")
    assert judged(goal, on_edge).success and judged(goal, beyond).reason == "not_on_it"


def test_beside_a_place_is_off_its_outline():
    goal = Goal("red", beside="tray")
    near = poses.pose([0.48, 0.30 - 0.118 - SIZE / 2 - 0.02, SIZE / 2])
    assert judged(goal, {"red": near}, ["tray"]).success
    assert (
        judged(goal, {"red": poses.pose([0.48, 0.30, 0.008 + SIZE / 2])}, ["tray"]).reason
        == "over_one_another"
    )


def test_what_bridges_two_slabs_on_the_table_does_not_stand_on_the_table():
    objects = {"a": little((0.02, 0.09, 0.05), -0.2), "one": little(LITTLE, 0.1), "two": little(LITTLE, 0.16)}
    configuration, world = drawn(Scene(objects=objects, goal=Goal("a", on="table", relation="anywhere")))
    middle = np.array(configuration.objects[1].pose)
    at = {"a": poses.shifted(middle, np.array([0.0, 0.03, 0.016 + 0.017]))}
    assert evaluate_success(configuration, world, state(configuration, at)).reason == "on_something_else"
    at["a"] = poses.shifted(middle, np.array([0.021, 0.03, 0.017]))  # it stands beside both of them
    assert evaluate_success(configuration, world, state(configuration, at)).success
