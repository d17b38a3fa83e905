"""How far parts of furniture are open, from depth images."""

from __future__ import annotations

import numpy as np
import pytest
from raycast import CAMERA, box, image

from bt_tasksim.core import poses
from bt_tasksim.core.joints import Joints
from bt_tasksim.engines.perception.camera_errors import PERFECT
from bt_tasksim.engines.perception.looking import Capture, Looker
from bt_tasksim.engines.perception.part_sight import PartView, seen_part
from bt_tasksim.engines.perception.registration import sample_surface
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import FixtureSpec, ObjectSpec

HIDDEN = (0.2, 0.2, 0.2)


def world_with(name, sensed=False, **objects):
    fixture = FixtureSpec(name, at=(0.6, 0.1), sensed=sensed)
    return Scene("panda", objects=objects, fixtures=[fixture]).sample(2)


def picture(world, value, *more):
    """What a camera sees where the last object, a part, is open so far."""
    boxes = [(b.pose, b) for fixture in world.fixtures for b in fixture.boxes]
    part = world.objects[-1]
    pose = Joints.of([part.model().joint]).pose(np.array([value]))[0]
    boxes += [(poses.multiply(pose, np.array(b.pose)), b) for b in part.boxes]
    things = [(box(np.array(pose), b.size), b.colour) for pose, b in boxes]
    things += [(box(np.array(a.pose), a.size), a.colour) for a in world.objects[:-1]]
    return image([*things, *more])[0]


def looked(world, value, *more):
    part = world.objects[-1]
    shown = PartView(CAMERA, picture(world, value, *more).depth)
    return seen_part(Joints.of([part.model().joint]), sample_surface(part.shape()), {"scene": shown})


@pytest.mark.parametrize(
    ("name", "within"), [("drawer", 0.003), ("door", 0.03), ("panel", 0.003), ("lidded_box", 0.05)]
)
def test_it_is_as_far_open_as_it_is(name, within):
    world = world_with(name)
    low, high = world.objects[-1].joint.limits
    for share in (0.0, 0.4, 0.9):
        value = low + share * (high - low)
        found = looked(world, value)
        assert found is not None and found.camera == "scene"
        assert found.value == pytest.approx(value, abs=within)


def test_what_stands_before_it_says_nothing():
    world = world_with("drawer")
    middle = np.array(Joints.of([world.objects[-1].model().joint]).pose(np.array([0.1]))[0])
    towards = CAMERA.pose[:3] - middle[:3]
    aside = np.cross(towards, [0.0, 0.0, 1.0])
    aside /= np.linalg.norm(aside)
    before = middle[:3] + 0.4 * towards
    half = (box(poses.pose(before + 0.12 * aside), (0.2, 0.2, 0.2)), HIDDEN)
    assert looked(world, 0.1, half).value == pytest.approx(0.1, abs=0.003)
    assert looked(world, 0.1, (box(poses.pose(before), (0.6, 0.6, 0.6)), HIDDEN)) is None


@pytest.mark.parametrize("sensed", [False, True])
def test_a_look_finds_the_part_and_takes_nothing_of_it_for_an_object(sensed):
    cube = ObjectSpec(("cube",), on="table", centre=(-0.15, 0.3), area=(0, 0))
    world = world_with("drawer", sensed, cube=cube)
    looker = Looker(world, world.world_model(["left", "right"], 0.08), PERFECT, ["scene"])
    shown, handled = {"scene": picture(world, 0.1)}, ((False, False),) * 2
    first = looker.look(Capture(shown, np.full((2, 7), np.nan), handled)).sightings
    assert first[0].fit.pose[:3] == pytest.approx(world.objects[0].pose[:3], abs=0.004)
    joints = Joints.of([world.objects[1].model().joint])
    assert float(joints.value(first[1].fit.pose[None])[0]) == pytest.approx(0.1, abs=0.003)
    known = np.array([first[k].fit.pose for k in (0, 1)])
    later = looker.look(Capture({"scene": picture(world, 0.2)}, known, handled)).sightings
    assert (1 in later) is sensed, "what is not sensed is seen at the beginning alone"
    if sensed:
        assert float(joints.value(later[1].fit.pose[None])[0]) == pytest.approx(0.2, abs=0.003)
