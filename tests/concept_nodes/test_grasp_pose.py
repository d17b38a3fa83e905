"""Where the tool has to be: of unlike objects on unlike places, each world as alone."""

import dataclasses
import itertools
from types import SimpleNamespace

import numpy as np
import pytest

from bt_tasksim.checking.bundles import frozen
from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes import Bring, Grasp, Pick, Place
from bt_tasksim.concept_nodes.destination import destination
from bt_tasksim.concept_nodes.grasp_pose import (
    grasp_pose,
    half_extent,
    neutral_rotation,
    place_below,
    resting_place,
)
from bt_tasksim.core import poses
from bt_tasksim.core.bundles import taken
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.facts import WorldFacts
from bt_tasksim.core.world import Obstacle, PlaceModel, WorldModel
from bt_tasksim.planning.arm import arm_of
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.shapes import ShapeSize, object_model

KINDS = ("box", "cube", "cylinder", "cup", "oval", "diamond")
N = 36


def place(name, at, access, kind="board"):
    exit = np.array([0.0, 0.0, 1.0]) if kind == "bin" else np.array([-1.0, 0.0, 0.0])
    return PlaceModel(
        name, kind, poses.pose(at), (0.5, 0.6), (0.0, 0.0), 0.35, np.array(access), exit, "f", 0.3
    )


PLACES = {
    "table": place("table", [0.5, 0.0, 0.0], (0.0, 0.0, -1.0)),
    "shelf": place("shelf", [0.5, 0.0, 0.4], (1.0, 0.0, 0.0)),
    "bin": place("bin", [0.5, 0.6, 0.0], (0.0, 0.0, -1.0), "bin"),
}
SETS = (("table",), ("shelf", "table"), (), ("bin", "table", "shelf"))


def world(k):
    kind = KINDS[k % len(KINDS)]
    size = (
        (0.06, 0.06, 0.06) if kind == "cube" else (0.05, 0.05 if kind in ("cylinder", "cup") else 0.07, 0.1)
    )
    if k % 11 == 10:  # too wide for the hand in every way
        size = (0.12, 0.12, 0.12)
    model = object_model("thing", kind, ShapeSize(size, (1.0, 1.0), None))
    boxes = tuple(Obstacle(poses.pose([0.5, 0.3, 0.1 * j]), (0.1, 0.2, 0.02), "f") for j in range(k % 4))
    places = {name: PLACES[name] for name in SETS[k % len(SETS)]}
    return WorldModel((model,), places, ("left", "right"), 0.08, 0.05, boxes)


WORLDS = [world(k) for k in range(N)]
PLACE_NAMES = tuple(PLACES)


def things():
    """Objects that stand upright, lie, and are held askew, on the table, on the shelf and in the air."""
    rng = np.random.default_rng(2)
    out = np.zeros((N, 7))
    for k, model in enumerate(WORLDS):
        half = model.objects[0].extent[2] / 2
        height = (half, 0.4 + half, 0.25)[(k // 2) % 3]
        askew = (np.zeros(3), rng.normal(size=3), np.array([np.pi / 2, 0, 0]))[(k // 3) % 3]
        turn = poses.quat_multiply(poses.yaw(rng.uniform(-3, 3)), poses.from_rotation_vector(askew))
        out[k] = poses.pose([rng.uniform(0.35, 0.6), rng.uniform(-0.2, 0.2), height], turn)
    return out


@pytest.fixture(params=["panda", "xarm7_ability"])
def seen_of(request):
    """What is seen of some of the worlds: ``seen_of(rows)``."""
    robot, rng = load_robot(request.param), np.random.default_rng(3)
    tips, arm = len(robot.tips), arm_of(robot)
    down = arm.tool(robot.rest)[3:]
    tools = np.concatenate([rng.uniform([0.3, -0.3, 0.3], [0.6, 0.3, 0.5], (N, 3)), [down] * N], 1)
    bent = [arm.joints(tool, robot.rest) for tool in tools]
    observed = {
        "objects": things()[:, None],
        "tool_pose": tools,
        "arm_position": np.array([robot.rest if q is None else q for q in bent]),
        "hand_position": np.tile(robot.hand_open, (N, 1)),
        "closure": rng.uniform(0.0, 1.0, N),
        "contacts": np.ones((N, tips), bool),
        "wrench": rng.normal(size=(N, 6)),
        "time": rng.uniform(0.0, 5.0, N),
    }

    def get(rows):
        models = [WORLDS[k] for k in np.asarray(rows).tolist()]
        world = WorldFacts.of(models, ["thing"], PLACE_NAMES)
        return Seen(SimpleNamespace(**taken(observed, rows)), world, robot, 0.1 * np.arange(N)[rows])

    return get


ASKED = {
    "grasp_pose": lambda seen: grasp_pose(seen, "thing"),
    "from the side": lambda seen: grasp_pose(seen, "thing", (1.0, 0.0, 0.0)),
    "slanted": lambda seen: grasp_pose(seen, "thing", (0.6, 0.0, -0.8)),
    "along an axis": lambda seen: grasp_pose(seen, "thing", None, (1.0, 0.0, 0.0)),
    "resting_place": lambda seen: resting_place(seen, "thing").found,
    "place_below": lambda seen: place_below(seen, "thing").found,
    "neutral": lambda seen: neutral_rotation(seen, poses.z_axis(seen.tool[:, 3:]), seen.tool[:, :3]),
    "half_extent": lambda seen: half_extent(seen.object("thing"), seen.model("thing"), seen.tool[:, :3]),
    "on top": lambda seen: destination(seen, "thing"),
    "on the table": lambda seen: destination(seen, "table"),
    "grasp, initial": lambda seen: [p.applies for p in Grasp.value("thing").initial_state(seen)],
}
BEGUN = {
    "grasp": Grasp.value("thing"),
    "pick": Pick.value("thing"),
    "place": Place.value("thing", on="table"),
    "place, no further": Place.value("thing", on="shelf", distance=0.05),
    "bring, via": Bring.value("thing", position=(0.5, 0, 0.4), via=[(0, 0, 0.1)]),
    "bring, round what is in the way": Bring.value("thing", position=(0.5, 0.45, 0.35)),
}
MOST = 6
"""Worlds that are asked how a concept begins there."""


@pytest.mark.parametrize("name", ASKED)
def test_unlike_worlds_are_asked_as_each_one_alone(seen_of, rows_alike, name):
    with np.errstate(all="raise"):
        whole = rows_alike(lambda rows: ASKED[name](seen_of(rows)), N)
    assert frozen(whole) != frozen(taken(whole, np.zeros(N, int))), "the worlds differ"


@pytest.mark.parametrize("name", BEGUN)
def test_a_concept_begins_in_unlike_worlds_as_in_each_one_alone(seen_of, rows_alike, name):
    """Some go straight and some round: those are padded with their last waypoint."""
    rows = np.array(list(itertools.islice(_possible(BEGUN[name], seen_of), MOST)))
    assert len(rows) > 2, "there is a way in some worlds"
    whole = rows_alike(lambda some: BEGUN[name].begin(seen_of(rows[some])), len(rows))
    assert len(set(whole.path.duration.tolist())) > 1, "the worlds differ"


def _possible(model, seen_of):
    """Worlds in which a concept can begin."""
    for k in range(N):
        try:
            model.begin(seen_of(np.array([k])))
        except NoWayError:
            continue
        yield k


def test_a_grasp_is_at_the_object_and_the_tool_comes_as_its_place_says(seen_of):
    seen = seen_of(np.arange(N))
    goal, thing, stands = grasp_pose(seen, "thing"), seen.object("thing"), resting_place(seen, "thing")
    assert np.isfinite(goal).all() and np.allclose(np.linalg.norm(goal[:, 3:], axis=-1), 1.0)
    expected = np.where(stands.found[:, None], stands.place.access, [0.0, 0.0, -1.0])
    assert np.allclose(poses.z_axis(goal[:, 3:]), expected, atol=1e-9)
    assert 3 < stands.found.sum() < N
    assert (poses.norm(np.cross(goal[:, :3] - thing[:, :3], expected)) < 1e-9).all(), (
        "straight along the approach"
    )


def test_where_no_world_has_a_place_nothing_stands_on_one(seen_of):
    rows = np.array([k for k in range(N) if not WORLDS[k].places])
    seen = seen_of(rows)
    alone = Seen(seen.observation, WorldFacts.of([WORLDS[k] for k in rows]), seen.robot, seen.elapsed)
    assert alone.world.place_facts.present.shape == (len(rows), 0)
    assert not resting_place(alone, "thing").found.any() and not place_below(alone, "thing").found.any()
    assert np.array_equal(grasp_pose(alone, "thing"), grasp_pose(seen, "thing"))
    grasp = Grasp.value("thing")
    some = np.array([next(k for k in _possible(grasp, seen_of) if not WORLDS[k].places)])
    seen = seen_of(some)
    alone = Seen(seen.observation, WorldFacts.of([WORLDS[k] for k in some]), seen.robot, seen.elapsed)
    assert frozen(grasp.begin(alone)) == frozen(grasp.begin(seen))


def test_of_places_at_one_height_it_is_the_first_of_its_own_world(seen_of):
    """A spot lies on its board: whatever columns others give them, the world's own order counts."""
    seen = seen_of(np.arange(N))
    stands = np.flatnonzero(resting_place(seen, "thing").found)[:2].tolist()
    models = []
    for turn, k in zip((1, -1), stands, strict=True):
        name, on = next((n, p) for n, p in WORLDS[k].places.items() if _stands_on(seen_of, k, n))
        spot = dataclasses.replace(on, name="spot", clearance=on.clearance + 0.1)
        models.append(dataclasses.replace(WORLDS[k], places=dict([(name, on), ("spot", spot)][::turn])))
    expected = []
    for k, model in zip(stands, models, strict=True):
        one = seen_of(np.array([k]))
        alone = Seen(one.observation, WorldFacts.of([model]), one.robot, one.elapsed)
        expected += resting_place(alone, "thing").place.clearance.tolist()
    for rows in (np.array([0, 1]), np.array([1, 0])):
        some = seen_of(np.array(stands)[rows])
        facts = WorldFacts.of([models[k] for k in rows])
        found = resting_place(Seen(some.observation, facts, some.robot, some.elapsed), "thing")
        assert found.found.all() and found.place.clearance.tolist() == [expected[k] for k in rows]


def _stands_on(seen_of, k, name):
    one = seen_of(np.array([k]))
    model = dataclasses.replace(WORLDS[k], places={name: WORLDS[k].places[name]})
    return resting_place(
        Seen(one.observation, WorldFacts.of([model]), one.robot, one.elapsed), "thing"
    ).found.all()
