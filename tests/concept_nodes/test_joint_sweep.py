"""What a part of furniture meets on its way, and what goes along with it."""

import numpy as np
import pytest

from bt_tasksim.concept_nodes.joint_way import JointWay, carried_by
from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core import poses
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene import FixtureSpec, ObjectSpec, Scene

DOOR = {"side": "right", "radius": 0.26}


def seen(*fixtures, **scene):
    """A world as it is drawn."""
    drawn, robot = Scene(fixtures=fixtures, **scene).sample(3), load_robot("panda")
    objects = {actor.name: np.array(actor.pose) for actor in drawn.objects}
    return WorldView(robot, drawn.world_model(["l", "r"], 0.08), objects, *(np.zeros(7),) * 3)


@pytest.mark.parametrize(
    ("part", "parameters", "neighbour", "least", "most"),
    [
        ("door", DOOR, (0.3, -0.32), 0.3, 1.6),
        ("door", DOOR, (0.3, -0.60), None, None),
        ("door", {**DOOR, "side": "left"}, (0.3, -0.32), None, None),
        ("drawer", {}, (0.1, 0.0), 0.05, 0.2),
        ("drawer", {}, (0.1, 0.4), None, None),
    ],
)
def test_a_part_meets_the_furniture_that_it_would_swing_or_slide_into(
    part, parameters, neighbour, least, most
):
    own = FixtureSpec(part, at=(0.6, 0.0), parameters=parameters)
    view = seen(own, FixtureSpec("chest", name="other", at=neighbour))
    end = 1.75 if part == "door" else 0.22
    found = JointWay(view, part).met(0.0, end)
    if least is None:
        assert found is None
    else:
        assert found is not None and found[1] == "other" and least < found[0] < most
    assert JointWay(view, part).met(0.0, 0.02) is None


@pytest.mark.parametrize("name", ["door", "drawer", "panel", "knob", "valve", "lever", "button"])
def test_its_own_fixture_is_not_met(name):
    view = seen(FixtureSpec(name))
    end = view.model(name).joint.limits[1]
    assert JointWay(view, name).met(0.0, end) is None and JointWay(view, name).met(end, 0.0) is None


@pytest.mark.parametrize(("up", "goes"), [(0.0, True), (0.08, True), (-0.12, False), (0.4, False)])
def test_what_stands_in_a_part_or_on_it_goes_along_and_what_is_below_does_not(up, goes):
    cup = ObjectSpec(kinds=("cup",), on="table", centre=(-0.1, -0.25), area=(0.0, 0.0))
    view = seen(FixtureSpec("drawer"), objects={"cup": cup})
    at = poses.shifted(view.objects["drawer"], np.array([0.0, 0.0, up]))
    view = view._replace(objects={**view.objects, "cup": at})
    assert (carried_by(view, "drawer") == {"cup"}) == goes
