"""Inserted: between the walls of a hole, whichever way it points, and near its stop; by hand-made states."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.scene.hole_laws import beyond_hole, in_hole
from bt_tasksim.scene.relations.inserted import IS_INSERTED, NOT_INSERTED
from bt_tasksim.scene.relations.out_of import IS_OUT, STILL_IN
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.spatial_laws import Hollow, PlacedObject
from bt_tasksim.scene.specs import Goal, ObjectSpec
from bt_tasksim.scene.success import evaluate_success
from tests.bt_tasksim.scene.states import drawn, state

GOAL = Goal("peg", "hole", relation="inserted", position_tolerance=0.01)
SCENE = Scene(
    fixtures=["peg_block"],
    objects={"peg": ObjectSpec(("peg",), on="table", size=(0.03, 0.03, 0.12))},
    goal=GOAL,
)
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
HALF = np.array([0.015, 0.015, 0.06])


def at(place, x=0.0, y=0.0, up=0.0, turn=(0.0, 0.0, 0.0)):
    local = poses.pose([x, y, 0.06 + up], poses.from_rotation_vector(np.array(turn)))
    return poses.multiply(place.pose, local)


@pytest.mark.parametrize(
    ("how", "reason"),
    [
        ({}, IS_INSERTED),
        ({"up": 0.009}, IS_INSERTED),
        ({"up": 0.011}, NOT_INSERTED),
        ({"x": 0.0045}, IS_INSERTED),
        ({"y": 0.0055}, NOT_INSERTED),
        ({"up": 0.09}, NOT_INSERTED),
        ({"turn": (0.0, 0.0, np.pi / 2)}, IS_INSERTED),
        ({"turn": (0.0, 0.0, np.pi / 4)}, NOT_INSERTED),
        ({"turn": (np.pi, 0.0, 0.0)}, IS_INSERTED),
    ],
)
def test_judged_by_where_it_is(how, reason):
    configuration, world = drawn(SCENE)
    hidden = state(configuration, {"peg": at(world.place("hole"), **how)})
    verdict = evaluate_success(configuration, world, hidden)
    assert verdict.success == (reason is IS_INSERTED)
    assert verdict.outcome.cause.reason is reason


class Turned:
    """A peg and a hole, turned anyhow."""

    def __init__(self, frame, pose):
        self.frame, self.pose = frame, pose

    def body(self, name):
        return PlacedObject(self.pose[None], (CORNERS * HALF)[None], np.array([False]))

    def hollow(self, name):
        return Hollow(self.frame[None], np.array([[[0.0, 0.0, 0.018, 0.018, 0.0, 0.05]]]))


@settings(max_examples=50)
@given(st.integers(0, 2**32 - 1), st.floats(-0.01, 0.08), st.floats(-0.01, 0.01))
def test_a_hole_may_point_anywhere(seed, up, x):
    rng = np.random.default_rng(seed)
    frame = poses.pose(rng.normal(size=3), poses.from_rotation_vector(rng.normal(size=3)))
    pose = poses.multiply(frame, poses.pose([x, 0.0, 0.06 + up]))
    found = in_hole(Turned(frame, pose), "peg", "hole")
    assert found.missing[0] == pytest.approx(up, abs=1e-9)
    assert found.depth[0] == pytest.approx(0.05 - up, abs=1e-9)
    assert found.aside[0] == pytest.approx(abs(x) + 0.015 - 0.018, abs=1e-9)


def test_a_goal_in_what_is_no_hole_is_refused():
    with pytest.raises(InputError, match="is no hole: name one, such as hole"):
        Scene(fixtures=["peg_block"], objects={"peg": "on table"}, goal=Goal("peg", "table", "inserted"))


def test_only_a_hole_may_be_turned(tmp_path):
    file = tmp_path / "odd.yaml"
    turn = "[0.7071068, 0.7071068, 0, 0]"
    entry = f"{{name: odd, kind: board, position: [0, 0, 0], extent: [0.1, 0.1], turn: {turn}}}"
    file.write_text(f"name: odd\nboxes: []\nplaces:\n  - {entry}\n", encoding="utf-8")
    with pytest.raises(InputError, match="only a hole may be turned"):
        Scene(fixtures=[str(file)])
    file.write_text(file.read_text().replace("board", "hole"), encoding="utf-8")
    scene = Scene(fixtures=[str(file)], objects={"box": "on table"})
    (hole,) = [place for place in scene.sample(1).places if place.name == "odd"]
    assert poses.z_axis(hole.pose[3:]) == pytest.approx([0.0, -1.0, 0.0], abs=1e-6)
    assert not hole.carries and not hole.container


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    way=st.sampled_from([(1, 0, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]),
    far=st.floats(0.0, 0.3),
)
def test_it_is_out_as_soon_as_nothing_of_it_is_between_the_walls(seed, way, far):
    """Whichever way the hole points, and out of its mouth, aside of it, or behind it."""
    rng = np.random.default_rng(seed)
    frame = poses.pose(rng.normal(size=3), poses.from_rotation_vector(rng.normal(size=3)))
    pose = poses.multiply(frame, poses.pose(np.array([0.0, 0.0, 0.06]) + far * np.array(way)))
    gap = float(beyond_hole(Turned(frame, pose), "peg", "hole")[0])
    needed = {0: 0.018 + 0.015, 1: 0.018 + 0.015, 2: 0.05 if way[2] > 0 else 0.12}
    assert gap == pytest.approx(max(0.0, far - needed[int(np.abs(way).argmax())]), abs=1e-9)


def test_out_of_is_judged_by_the_state_and_names_a_hole():
    goal = Goal("peg", "hole", relation="out_of")
    scene = Scene(fixtures=SCENE.fixtures, objects=SCENE.objects, goal=goal)
    configuration, world = drawn(scene)
    for up, reason in ((0.03, STILL_IN), (0.06, IS_OUT)):
        hidden = state(configuration, {"peg": at(world.place("hole"), up=up)})
        assert evaluate_success(configuration, world, hidden).outcome.cause.reason is reason
    with pytest.raises(InputError, match="is out of 'table', which is no hole"):
        Scene(objects=SCENE.objects, goal=Goal("peg", "table", relation="out_of"))
