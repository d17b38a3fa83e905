"""Parts of fixtures in scenes: what files may say, names, starts, goals, and worlds for other processes."""

import dataclasses
import json
import math

import numpy as np
import pytest

from bt_tasksim.concept_nodes import Grasp
from bt_tasksim.core.errors import FieldError, InputError
from bt_tasksim.engines.remote.configurations import as_received, for_sending
from bt_tasksim.execution.replay import replay
from bt_tasksim.execution.runner import Runner
from bt_tasksim.report.write import write_run
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.fixtures import Fixture
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import FixtureSpec, Goal, ObjectSpec
from bt_tasksim.trees import sequence

PART = {
    "name": "flap",
    "joint": "hinge",
    "axis": [0, 1, 0],
    "limits": [0, 1.5],
    "boxes": [{"position": [0, 0, 0], "size": [0.1, 0.1, 0.01]}],
}
FILE = {"name": "thing", "boxes": [], "places": [], "parts": [PART]}
SMALL = ((0.04, 0.04, 0.05),) * 2


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"joint": "ball"}, "'parts.0..joint' should be 'slide' or 'hinge'"),
        ({"axis": [0, 0, 0]}, "should be a direction, and not zero"),
        ({"limits": [1.0, 0.0]}, "should be the lower one first, found 1 and 0"),
        ({"limits": [0.0, 7.0]}, "at most 6 rad apart, found 7"),
        ({"joint": "slide", "limits": [0.0, 3.0]}, "at most 2 m apart, found 3"),
        ({"value": 2.0}, "'value', how far it is open at the start, should be between 0 and 1.5 rad"),
        ({"value": [1.0, 0.5]}, "'value', how far it is open at the start, should be between 0 and 1.5 rad"),
        ({"value": [0.1, math.inf]}, r"'parts\[0\].value' should be a number or two, the lower one first"),
        ({"value": [0.1, 0.2, 0.3]}, r"'parts\[0\].value' should be a number or two, the lower one first"),
        ({"value": [0.1, 1e3]}, r"'parts\[0\].value' should be a number or two.* from -100 to 100"),
        ({"value": "half"}, r"'parts\[0\].value' should be a number or two"),
        ({"value": True}, r"'parts\[0\].value' should be a number or two"),
        ({"boxes": []}, "boxes"),
        ({"mass": 0}, "mass"),
        ({"friction": -1}, "friction"),
        ({"springiness": 1}, "unknown field"),
    ],
)
def test_parts_that_cannot_be_are_refused_in_one_sentence(fields, words):
    with pytest.raises(InputError, match=words) as refused:
        Fixture.from_data({**FILE, "parts": [PART | fields]})
    assert "\n" not in str(refused.value)


def test_parts_and_places_have_names_of_their_own():
    spot = {"name": "flap", "kind": "spot", "position": [0, 0, 0], "extent": [1, 1]}
    for more in ({"places": [spot]}, {"parts": [PART, PART]}):
        with pytest.raises(InputError, match="two parts, or a part and a place, are called 'flap'"):
            Fixture.from_data(FILE | more)


def test_names_of_scenes_mean_one_thing():
    twice = [FixtureSpec("chest", at=(0.62, y), name=name) for y, name in ((-0.3, ""), (0.3, "other"))]
    assert Scene(fixtures=twice).object_names == ["drawer", "other_drawer"]
    with pytest.raises(FieldError, match=r"two things of the fixtures are called 'drawer'|both have a place"):
        Scene(fixtures=["chest", FixtureSpec("drawer", at=(0.62, 0.5))])
    with pytest.raises(FieldError, match="an object and a part of a fixture are both called 'drawer'"):
        Scene(fixtures=["chest"], objects={"drawer": ObjectSpec(("box",), on="table")})
    with pytest.raises(InputError, match="did you mean 'drawer'"):
        Scene(fixtures=["chest"], goals=[Goal("drawr", relation="open")])


def test_starts_in_a_part_and_how_far_it_is_open():
    scene = Scene(fixtures=["chest"], objects={"box": ObjectSpec(("box",), inside="drawer", size=SMALL)})
    world = scene.sample(0)
    box, drawer = world.objects
    local = np.array(box.pose[:3]) - np.array(drawer.pose[:3])
    assert np.all(np.abs(local) < np.array(drawer.size) / 2)
    assert not drawer.joint.sensed
    seen = Scene(fixtures=[FixtureSpec("chest", sensed=True)]).sample(0)
    assert seen.objects[0].joint.sensed


def test_json_keeps_every_number():
    world = Scene(fixtures=["chest", FixtureSpec("door", at=(0.5, 0.6))]).sample(3)
    again = ActorConfiguration.from_json(world.to_json())
    assert again.to_json() == world.to_json() and again.objects == world.objects
    assert all(math.isclose(np.linalg.norm(o.joint.axis), 1.0) for o in again.objects)


def test_a_world_with_parts_goes_to_another_process():
    robot, world = load_robot("panda"), Scene(fixtures=["chest"]).sample(0)
    arrived = as_received(for_sending(world, robot), robot)
    assert dataclasses.replace(arrived, robot="panda").to_json() == world.to_json()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"joint": None}, "a part of a fixture has boxes and a joint"),
        ({"boxes": ()}, "a part of a fixture has boxes and a joint"),
        ({"kind": "box"}, "only parts of fixtures have boxes and a joint"),
        ({"joint.kind": "ball"}, "its joint is of unknown kind 'ball'"),
        ({"joint.axis": (1.0, 1.0, 0.0)}, "the axis of its joint is a unit vector"),
        ({"joint.limits": (1.0, 0.0)}, "the lower one first"),
        ({"joint.stiffness": 1e9}, "friction, damping, stiffness and latch"),
        ({"joint.friction": float("nan")}, "friction, damping, stiffness and latch"),
    ],
)
def test_parts_that_no_engine_should_build(change, words):
    robot, world = load_robot("panda"), Scene(fixtures=["chest"]).sample(0)
    (part,) = world.objects
    for name, value in change.items():
        if name.startswith("joint."):
            name, value = "joint", dataclasses.replace(part.joint, **{name[6:]: value})
        part = dataclasses.replace(part, **{name: value})
    with pytest.raises(InputError, match=words):
        as_received(for_sending(dataclasses.replace(world, objects=(part,)), robot), robot)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run in which a drawer's handle is grasped."""
    path = tmp_path_factory.mktemp("runs") / "drawer"
    drawer = FixtureSpec("drawer", parameters={"handle": "bar"})
    box = ObjectSpec(("box",), inside="drawer", size=SMALL)
    scene = Scene(fixtures=[drawer], objects={"box": box}, goals=[Goal("drawer", relation="shut")])
    result = write_run(path, Runner(sequence("hold", Grasp("drawer")), scene), 500000)
    return path, result


def test_a_handle_is_grasped_and_the_run_is_the_same_again(run):
    path, _ = run
    told = json.loads((path / "result.json").read_text())
    assert told["success"] and told["seed"] == 500000
    found = replay(path)
    assert found.identical and found.result.success


@pytest.mark.parametrize(
    ("fixture", "part", "place"), [("drawer", "drawer", "chest"), ("knob", "knob", "table")]
)
def test_nothing_starts_on_a_part(fixture, part, place):
    with pytest.raises(FieldError, match=f"is on '{part}', which is a part that moves.*such as '{place}'"):
        Scene(fixtures=[fixture], objects={"c": f"cup on {part}"})
