"""Open, shut and set: how far a part of a fixture truly is open, held or let go."""

import numpy as np
import pytest

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.world import Hidden
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.relations.joint_goals import IS_OPEN, IS_SET, IS_SHUT, NOT_OPEN, NOT_SET, NOT_SHUT
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import FixtureSpec, Goal
from bt_tasksim.scene.success import evaluate_success

DOOR = FixtureSpec("door", parameters={"opens": 1.5})
DRAWER = FixtureSpec("drawer", parameters={"opens": 0.2})


def judged(fixture, goal, value, force=0.0):
    world = Scene(fixtures=[fixture], objects={"cup": "on table"}, goals=[goal]).sample(0)
    robot = load_robot("panda")
    n, bodies = len(world.objects), len(world.objects) + len(world.fixtures)
    objects = [o.pose if o.joint is None else o.joint.pose(value) for o in world.objects]
    hidden = Hidden(
        time=np.float64(5.0),
        objects=np.array(objects, float),
        velocities=np.zeros((n, 6)),
        hand_force=np.array([0.0, force]),
        hand_distance=np.array([1.0, 0.0 if force else 0.1]),
        support=np.zeros((n, bodies), bool),
        penetration=np.float64(0.0),
        tool_pose=np.array([0.5, 0, 0.5, 1, 0, 0, 0]),
    )
    return evaluate_success(world, world.world_model([t.name for t in robot.tips], robot.opening), hidden)


@pytest.mark.parametrize(
    ("fixture", "goal", "value", "reason"),
    [
        (DOOR, {"relation": "open"}, 1.21, IS_OPEN["hinge"]),
        (DOOR, {"relation": "open"}, 1.19, NOT_OPEN["hinge"]),
        (DOOR, {"relation": "open", "value": 1.0, "angle_tolerance": 0.1}, 0.91, IS_OPEN["hinge"]),
        (DOOR, {"relation": "open", "value": 1.0, "angle_tolerance": 0.1}, 0.89, NOT_OPEN["hinge"]),
        (DRAWER, {"relation": "open", "value": 0.1, "position_tolerance": 0.01}, 0.15, IS_OPEN["slide"]),
        (DRAWER, {"relation": "shut"}, 0.004, IS_SHUT["slide"]),
        (DRAWER, {"relation": "shut"}, 0.006, NOT_SHUT["slide"]),
        (DOOR, {"relation": "shut"}, 0.03, IS_SHUT["hinge"]),
        (DOOR, {"relation": "shut"}, 0.04, NOT_SHUT["hinge"]),
        (DOOR, {"relation": "set", "value": 1.0}, 0.92, IS_SET["hinge"]),
        (DOOR, {"relation": "set", "value": 1.0}, 0.90, NOT_SET["hinge"]),
        (DRAWER, {"relation": "set", "value": 0.1}, 0.109, IS_SET["slide"]),
        (DRAWER, {"relation": "set", "value": 0.1}, 0.111, NOT_SET["slide"]),
        (DRAWER, {"relation": "open", "value": 0.12}, 0.111, IS_OPEN["slide"]),
        (DRAWER, {"relation": "open", "value": 0.12}, 0.109, NOT_OPEN["slide"]),
        (DOOR, {"relation": "set", "value": 0.7}, 0.78, IS_SET["hinge"]),
    ],
)
@pytest.mark.parametrize("force", [0.0, 5.0])
def test_by_the_true_state(fixture, goal, value, reason, force):
    name = "door" if fixture is DOOR else "drawer"
    found = judged(fixture, Goal(name, **goal), value, force)
    assert found.outcome.is_a(reason) and found.success is not reason.name.startswith("not")


def test_what_is_no_part_or_has_no_value_is_refused():
    with pytest.raises(InputError, match="'cup' is a free object"):
        judged(DOOR, Goal("cup", relation="shut"), 0.0)
    with pytest.raises(InputError, match="needs a 'value'"):
        judged(DOOR, Goal("door", relation="set"), 0.0)


@pytest.mark.parametrize(
    ("goal", "words"),
    [
        (Goal("cup", relation="shut"), "'cup' is a free object"),
        (Goal("drawer", relation="set"), "needs a 'value'"),
        (Goal("drawer", relation="open", value=50.0), "asks for 50000 mm, and it goes from 0 mm to"),
        (Goal("drawer", relation="open", value=-100.0), "it goes from 0 mm to"),
        (Goal("cup", relation="turned"), "needs a 'value', by how many radians"),
    ],
)
def test_goals_that_cannot_be_are_refused_before_anything_runs(goal, words):
    with pytest.raises(InputError, match=words):
        Scene(fixtures=["chest"], objects={"cup": "on table"}, goal=goal)


def test_a_goal_in_degrees_is_told_the_radians():
    with pytest.raises(InputError, match=r"3437\.7 degrees, .* radians, and 60 degrees are 1\.05$"):
        Scene(fixtures=["door"], goal=Goal("door", relation="open", value=60))


@pytest.mark.parametrize(
    ("fixture", "goal", "words"),
    [
        ("chest", {"value": 0.15, "position_tolerance": 0.2}, "150 mm and its position_tolerance is 200 mm"),
        ("chest", {"value": 0.01}, "10 mm and its position_tolerance is 10 mm"),
        ("door", {"value": 0.5, "angle_tolerance": 1.0}, "28.6 degrees and its angle_tolerance is 57.3"),
    ],
)
def test_a_tolerance_that_covers_all_that_is_asked_is_refused(fixture, goal, words):
    part = "drawer" if fixture == "chest" else fixture
    with pytest.raises(InputError, match=f"{words}.* reached with '{part}' shut: give it a smaller"):
        Scene(fixtures=[fixture], goal=Goal(part, relation="open", **goal))


def test_a_tolerance_that_leaves_something_to_do_is_taken():
    Scene(fixtures=["chest"], goal=Goal("drawer", relation="open", value=0.02))
    Scene(fixtures=["chest"], goal=Goal("drawer", relation="set", value=0.0, position_tolerance=0.01))
