"""Pour: where a vessel pours, how it is tilted, what it refuses; in physics it is a scenario's test."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.concept_nodes import Emptied, Pour
from bt_tasksim.concept_nodes.pouring import CLEARANCE, lips, mouth_of, pours_from, tilts
from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError, NoWayError
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.shapes import ShapeSize, object_model, shape
from bt_tasksim.trees.load import load_source

JUG, CUP, BOWL = (0.1, 0.062, 0.105), (0.068, 0.068, 0.1), (0.14, 0.14, 0.055)


def world(kind="jug", size=JUG, up=0.4, into="bowl"):
    """A vessel in the air, with two balls in it, and a bowl on the table."""
    robot = load_robot("panda")
    plain = (
        Scene(objects={"box": "on table"}).sample(1).world_model([t.name for t in robot.tips], robot.opening)
    )
    objects = (
        object_model("jug", kind, ShapeSize(size)),
        object_model("bowl", "bowl", ShapeSize(BOWL)),
        object_model("a", "ball", ShapeSize((0.012,) * 3)),
        object_model("b", "ball", ShapeSize((0.012,) * 3)),
    )
    at = {
        "jug": poses.pose([0.45, -0.2, up]),
        "bowl": poses.pose([0.5, 0.1, 0.0275]),
        "a": poses.pose([0.45, -0.2, up - size[2] / 2 + 0.012]),
        "b": poses.pose([0.3, -0.3, 0.006]),
    }
    known = type(plain)(objects, plain.places, plain.obstacles, plain.tips, plain.opening)
    return WorldView(robot, known, at, at["jug"], robot.rest, robot.hand_open)


def test_a_jug_pours_over_its_spout_and_a_cup_all_around():
    (spout,) = lips(shape("jug", ShapeSize(JUG)).hollow)
    assert np.allclose(spout.way, [1.0, 0.0]) and np.allclose(spout.point, [0.05, 0.0, 0.0525], atol=0.006)
    found = lips(shape("cup", ShapeSize(CUP)).hollow)
    assert len(found) > 8
    assert {round(float(np.hypot(*lip.point[:2])), 2) for lip in found} <= {0.03, 0.04}


@settings(max_examples=8, deadline=None)
@given(most=st.floats(1.7, 2.6), height=st.floats(0.0, 0.08), cup=st.booleans())
def test_the_lip_stays_over_the_opening_and_the_vessel_above_its_rim(most, height, cup):
    view = world("cup", CUP) if cup else world()
    mouth, outer = mouth_of(view, "bowl"), view.model("jug").solid.outer
    edges = np.array([lip.point for lip in lips(view.model("jug").solid.hollow)])
    for tilt in tilts(view, "jug", "bowl", most, height)[::9]:
        ups = poses.z_axis(tilt.poses[:, 3:])
        assert np.allclose(np.arccos(np.clip(ups[:, 2], -1, 1)), tilt.angles, atol=1e-6)
        assert tilt.angles[0] == 0.0 and tilt.angles[-1] == pytest.approx(most)
        reach = poses.transform(tilt.poses[:, None, :], outer)
        assert (reach[..., 2].min(axis=1) >= mouth.middle[2] + min(height, CLEARANCE) - 0.006).all()
        at = poses.transform(tilt.poses[:, None, :], edges)
        aside = np.linalg.norm(at[..., :2] - mouth.middle[:2], axis=-1).max(axis=0).min()
        assert aside < mouth.half  # one and the same lip, all the time


def test_what_lies_in_it_moves_with_it_and_says_when_it_may_come_out():
    view = world()
    assert view.contents("jug") == ["a"]
    assert 0.6 < pours_from(view, "jug", ["a"]) < math.pi / 2
    assert pours_from(view, "jug", []) == 0.0
    held = view.finder(["jug"], held=view.held("jug"))
    assert {thing.name for thing in held._things} >= {"bowl", "b"}
    assert "a" not in {thing.name for thing in held._things}


def test_what_has_no_hollow_is_refused():
    with pytest.raises(NoWayError, match="nothing can be poured out of jug: it has no hollow"):
        tilts(world("box", (0.06, 0.05, 0.1)), "jug", "bowl", 2.3, 0.03)
    with pytest.raises(NoWayError, match="nothing can be poured into a: it has no hollow"):
        tilts(world(), "jug", "a", 2.3, 0.03)
    fallen = world()
    fallen.objects["bowl"][3:] = [math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0]
    with pytest.raises(NoWayError, match="into bowl: it does not stand upright"):
        tilts(fallen, "jug", "bowl", 2.3, 0.03)


def test_parameters_that_make_no_sense_are_refused():
    with pytest.raises(InputError, match="'into' is the vessel itself"):
        Pour("jug", into="jug")
    with pytest.raises(InputError, match="between a right angle and a half turn"):
        Pour("jug", into="bowl", most=1.0)
    assert Emptied("jug").model.target == "jug"


def test_the_scenario_draws_balls_in_the_jug():
    scene = load_source("pour").scene
    for seed in range(3, 6):
        drawn = {actor.name: actor for actor in scene.sample(seed).objects}
        jug = drawn["jug"]
        for name in ("ball_1", "ball_5"):
            local = poses.localise(np.array(jug.pose), np.array(drawn[name].pose[:3]))
            assert local[2] < 0.0 and np.hypot(*local[:2]) < jug.size[1] / 2
