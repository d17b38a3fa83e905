"""Spin: which ways round there are; in physics it is a scenario's test."""

import math

import numpy as np
import pytest
from draws import successes
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.concept_nodes import Grasp, Release, Spin
from bt_tasksim.concept_nodes.spin import _from_heading
from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core import poses
from bt_tasksim.core.bundles import mapped
from bt_tasksim.core.errors import InputError, NoWayError
from bt_tasksim.core.fact_making import object_facts, rotations
from bt_tasksim.execution.runner import Runner
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import Goal, ObjectSpec, SpotSpec
from bt_tasksim.trees import sequence

ROBOT = load_robot("panda")
BOX = ((0.07, 0.05, 0.09),) * 2


def view_of(heading, mark, kind="box"):
    """A box, or a thing of another kind, that is turned so, and a mark below it that is turned so."""
    scene = Scene(
        objects={
            "it": ObjectSpec((kind,), on="table", size=BOX if kind == "box" else None, yaw=(heading, heading))
        },
        spots=[SpotSpec("mark", on="table", yaw=(mark, mark))],
    )
    drawn = scene.sample(1)
    known = drawn.world_model([tip.name for tip in ROBOT.tips], ROBOT.opening)
    now = np.array(drawn.objects[0].pose)
    return WorldView(ROBOT, known, {"it": now}, poses.pose([0.4, 0.0, 0.4]), ROBOT.rest, ROBOT.hand_open)


@settings(max_examples=15, deadline=None)
@given(heading=st.floats(-3.0, 3.0), mark=st.floats(-1.5, 1.5))
def test_every_way_round_ends_as_the_place_is_turned(heading, mark):
    view = view_of(heading, mark)
    now, known = view.objects["it"], view.world
    ways = Spin.value("it", like="mark")._ways(view)
    frame = np.asarray(known.place("mark").pose)
    assert len(ways) == 4  # two headings look alike, each either way round
    lengths = []
    for way in ways:
        every = np.concatenate([now[None], way])
        assert np.allclose(way[:, :3], now[:3]) and np.allclose(poses.z_axis(way[:, 3:])[:, 2], 1.0)
        local = poses.quat_multiply(poses.quat_conjugate(frame[3:]), way[-1, 3:])
        angle = abs(float(poses.angle_between(local[None], np.array([[1.0, 0.0, 0.0, 0.0]]))[0]))
        assert min(angle, math.pi - angle) < 1e-6
        lengths.append(float(poses.angle_between(every[1:, 3:], every[:-1, 3:]).sum()))
    assert lengths == pytest.approx(sorted(lengths))


@settings(max_examples=25, deadline=None)
@given(
    heading=st.floats(-3.0, 3.0),
    mark=st.floats(-1.5, 1.5),
    face=st.integers(0, 23),
    tilt=st.tuples(st.floats(-0.05, 0.05), st.floats(-0.05, 0.05)),
)
def test_a_cube_on_any_face_goes_to_the_heading_by_the_shortest_way_first(heading, mark, face, tilt):
    view = view_of(0.0, mark, kind="cube")
    model, frame = view.model("it"), np.asarray(view.world.place("mark").pose)
    lies = poses.quat_multiply(poses.yaw(heading), rotations(model)[face])
    lies = poses.quat_multiply(poses.from_rotation_vector(np.array([*tilt, 0.0])), lies)
    now = np.array([*view.objects["it"][:3], *lies])
    ways = Spin.value("it", like="mark")._ways(view._replace(objects={"it": now}))
    assert len(ways) == 8
    facts = object_facts([view.world], ["it"])
    column = mapped(lambda values: values[:, 0], facts)
    for way in ways:
        off = _from_heading(way[-1:], frame[None], column)[0]
        assert off < 0.08  # what it leans stays
    lengths = [poses.angle_between(w[:, 3:], np.concatenate([now[None], w[:-1]])[:, 3:]).sum() for w in ways]
    assert lengths == pytest.approx(sorted(lengths)) and lengths[0] <= math.pi / 4 + 1e-2


@pytest.mark.parametrize("kind", ["box", "can"])
def test_what_lies_is_not_turned_to_a_heading_but_refused(kind):
    view = view_of(0.0, 0.5, kind=kind)
    lying = poses.quat_multiply(
        view.objects["it"][3:], poses.from_rotation_vector(np.array([1.57, 0.0, 0.0]))
    )
    view = view._replace(objects={"it": np.array([*view.objects["it"][:3], *lying])})
    spin = Spin.value("it", like="mark")
    assert spin.aim(view) is None
    with pytest.raises(NoWayError, match="it does not stand upright"):
        spin._found(view)


@pytest.mark.parametrize("given", [{}, {"like": "mark", "angle": 0.5}])
def test_either_a_heading_or_an_angle_is_given(given):
    with pytest.raises(InputError, match="give either 'like' or 'angle'"):
        Spin("it", **given)


@pytest.mark.parametrize("angle", [0.7, -1.1, 4.0])
def test_by_an_angle_there_is_one_way_round(angle):
    view = view_of(heading=0.4, mark=0.0)
    (way,) = Spin.value("it", angle=angle)._ways(view)
    every = np.concatenate([view.objects["it"][None], way])
    turned = poses.quat_multiply(every[1:, 3:], poses.quat_conjugate(every[:-1, 3:]))
    assert poses.rotation_vector(turned).sum(axis=0) == pytest.approx([0.0, 0.0, angle])


@pytest.mark.physical
def test_in_physics_a_cube_is_turned_like_a_mark():
    scene = Scene(
        objects={"it": ObjectSpec(("cube",), on="table", area=(0.0, 0.0), yaw=(-0.35, -0.35))},
        spots=[SpotSpec("mark", on="table", yaw=(0.5, 0.5))],
        goal=Goal("it", "mark", angle_tolerance=0.1),
    )
    tree = sequence("turn", Grasp("it"), Spin("it", like="mark"), Release("it"))
    successes(Runner(tree, scene).run, range(7, 10), n=1)


@pytest.mark.physical
def test_in_physics_it_is_turned_by_that_angle():
    scene = Scene(
        objects={"it": ObjectSpec(("box",), on="table", size=BOX, area=(0.0, 0.0), yaw=(0.2, 0.2))},
        spots=[SpotSpec("mark", on="table", yaw=(0.9, 0.9))],
        goal=Goal("it", "mark"),
    )
    tree = sequence("turn", Grasp("it"), Spin("it", angle=0.7), Release("it"))
    successes(Runner(tree, scene).run, range(7, 10), n=1)
