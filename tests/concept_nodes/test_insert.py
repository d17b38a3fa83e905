"""Insert: which ways round something fits, where the mouth is searched for, refusals, and real pushes."""

import numpy as np
import pytest
from draws import successes

from bt_tasksim import Runner
from bt_tasksim.concept.leaf import ONE
from bt_tasksim.concept_nodes import Grasp, Insert, Pick
from bt_tasksim.concept_nodes.insert import FEELS, InsertMemory
from bt_tasksim.concept_nodes.insertion import (
    PLACES,
    SURE,
    UNSURE,
    box_turns,
    fitting_poses,
    in_fingers,
    places_to_try,
)
from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError, NoWayError
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene import Goal, ObjectSpec, Scene
from bt_tasksim.trees import sequence
from bt_tasksim.trees.load import load_source
from tests.bt_tasksim.scene.states import drawn


def view(size=(0.03, 0.03, 0.12), kind="peg", turn=(0.0, 0.0, 0.1), tool=None):
    """A world with a peg block and a box, turned anyhow in the air."""
    spec = ObjectSpec((kind,), on="table", size=size)
    _, world = drawn(Scene(fixtures=["peg_block"], objects={"peg": spec}))
    robot = load_robot("panda")
    pose = poses.pose([0.4, 0.0, 0.3], poses.from_rotation_vector(np.array(turn)))
    tool = pose if tool is None else tool
    return WorldView(robot, world, {"peg": pose}, tool, robot.rest, robot.hand_open)


def test_a_boxs_turns_are_all_24():
    turns = box_turns()
    assert len(turns) == 24
    axes = poses.to_matrix(turns)
    assert np.allclose(np.sort(abs(axes), axis=2), np.array([0.0, 0.0, 1.0]), atol=1e-12)


@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.1), (np.pi, 0.0, 0.3), (0.0, np.pi / 2, 0.0)])
def test_it_fits_eight_ways_round_and_the_least_turn_comes_first(turn):
    world = view(turn=turn)
    hole = world.world.place("hole")
    found = fitting_poses(world, "peg", hole)
    assert len(found) == 8
    angles = poses.angle_between(found[:, 3:], world.objects["peg"][None, 3:])
    assert (np.diff(angles) >= -1e-6).all()
    low = [
        poses.localise(hole.pose, poses.transform(p, np.array([[0, 0, 0.06], [0, 0, -0.06]]))) for p in found
    ]
    assert np.min(low, axis=(1, 2)) == pytest.approx(0.0, abs=1e-9)


def test_the_end_that_is_named_goes_in_first():
    world = view()
    found = fitting_poses(world, "peg", world.world.place("hole"), np.array([0.0, 0.0, 1.0]))
    assert len(found) == 4
    assert poses.z_axis(found[:, 3:]) == pytest.approx(np.tile([0.0, 0.0, -1.0], (4, 1)), abs=1e-9)


def test_what_is_round_keeps_its_heading():
    world = view(kind="cylinder", turn=(0.0, 0.0, 0.123))
    found = fitting_poses(world, "peg", world.world.place("hole"))
    assert poses.angle_between(found[0, 3:], world.objects["peg"][3:]) == pytest.approx(0.0, abs=1e-6)


def test_what_does_not_fit_and_what_is_no_hole_is_refused():
    wide = view(size=(0.04, 0.04, 0.12))
    with pytest.raises(NoWayError, match=r"peg \(40 x 40 x 120 mm\) does not fit into hole \(36 x 36 mm\)"):
        fitting_poses(wide, "peg", wide.world.place("hole"))
    with pytest.raises(InputError, match="parameter 'into' is missing"):
        Insert("peg")


def test_fingers_know_where_flat_faces_are():
    straight = poses.pose([0.4, 0.0, 0.3], np.array([0.0, 1.0, 0.0, 0.0]))
    found = in_fingers(view(turn=(0.0, 0.0, 0.05), tool=straight), "peg")
    assert poses.angle_between(found[3:], np.array([1.0, 0.0, 0.0, 0.0])) == pytest.approx(0.0, abs=1e-9)
    tool = poses.pose([0.402, 0.003, 0.31], np.array([0.0, 1.0, 0.0, 0.0]))
    found = in_fingers(view(turn=(0.0, 0.0, 0.05), tool=tool), "peg")
    assert found[:3] == pytest.approx([0.4, 0.003, 0.3], abs=1e-9), "midway between them, and as seen else"


def test_the_places_that_are_tried_go_outwards_and_lie_close():
    assert PLACES[0].tolist() == [0.0, 0.0]
    assert len(np.unique(PLACES.round(9), axis=0)) == len(PLACES)
    far = np.hypot(PLACES[:, 0] / UNSURE, PLACES[:, 1] / SURE)
    assert (np.diff(far.round(1)) >= 0.0).all() and far.max() <= 1.0 + 1e-9
    rng = np.random.default_rng(0)
    angle, share = rng.uniform(0, 2 * np.pi, 200), np.sqrt(rng.uniform(size=200)) * 0.9
    points = (share * np.array([UNSURE * np.cos(angle), SURE * np.sin(angle)])).T
    assert np.linalg.norm(points[:, None] - PLACES[None], axis=-1).min(axis=1).max() < 0.0011


def test_each_place_about_the_mouth_is_tried_once(toy):
    seen = toy(Grasp("cup")).context.seen(ONE, np.zeros(1))
    model, places = Insert.value("peg", into="hole"), places_to_try(seen.robot)
    memory = InsertMemory(*[np.zeros(1)] * len(InsertMemory._fields))
    memory = memory._replace(sides=np.eye(3)[None, :2], centre=np.zeros((1, 3)), offset=np.zeros((1, 3)))
    force, inward, nothing = np.zeros((1, 3)), np.array([[0.0, 0.0, -1.0]]), np.zeros(1)
    begun, visited = np.zeros(1, bool), []
    memory = memory._replace(inward=inward, begun=begun, tried=nothing + FEELS)
    while not (limit := model.limits(seen, memory)[1]).applies[0]:
        offset, _ = model._aside(force, nothing, memory.tried - FEELS, memory, 10.0, places)
        visited.append(offset[0, :2])
        memory = memory._replace(tried=memory.tried + 1.0)
    assert np.allclose(visited, places, atol=1e-12)
    assert f"{FEELS + len(places):.0f} places were tried, and there are no more" in limit.at(0).sentence


@pytest.mark.physical
@pytest.mark.parametrize("engines", ["sapien", "mujoco"])
def test_a_peg_goes_into_its_hole(engines):
    source = load_source("insert")
    runner = Runner(source.build(), source.scene, EngineOptions(engines=engines))
    results = successes(runner.run, range(5), n=1)
    assert results[0].verdict.outcome.cause.reason.name == "is_inserted"


def test_a_peg_does_not_go_into_what_is_no_hole():
    scene = Scene(objects={"box": ObjectSpec(("box",), on="table")}, goal=Goal("box", "table"))
    tree = sequence("no hole", Grasp("box"), Pick("box"), Insert("box", into="table"))
    result = Runner(tree, scene, EngineOptions(noise="none")).run(3)
    assert not result.success
    assert "'table' is no hole but a table: things are put there with Place, or fall there with" in result.why
