"""Bring: each world as alone, where it ends, which way it takes, and what it says when it cannot."""

import dataclasses
import math

import numpy as np
import pytest
from py_trees.common import Status

from bt_tasksim.concept.leaf import ONE
from bt_tasksim.concept_nodes import Bring, Place, Release
from bt_tasksim.concept_nodes.carried_way import WayEnds
from bt_tasksim.concept_nodes.closer import HIGHER
from bt_tasksim.concept_nodes.destination import standing_pose
from bt_tasksim.concept_nodes.holding import NOT_HELD
from bt_tasksim.concept_nodes.standing import ASIDE, FARTHER
from bt_tasksim.concept_nodes.view import views
from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.facts import WorldFacts
from bt_tasksim.core.outcomes import CANNOT_START, NO_WAY
from bt_tasksim.core.world import Obstacle, WorldModel
from bt_tasksim.scene.shapes import ShapeSize, object_model
from bt_tasksim.trees import sequence


@pytest.mark.physical
@pytest.mark.parametrize("scenario", ["shelf_to_shelf", "pick_and_throw"])
def test_each_world_is_treated_as_alone(situations, functions, scenario):
    answers = {name: situations(Bring, scenario).check(name) for name in functions}
    for name in ("done", "maintained", "necessary_cost", "sufficient_cost"):
        assert len({float(np.squeeze(a)) for a in answers[name]}) > 1, name


def carry(toy, leaf, name="cup", obstacles=None):
    stage = toy(leaf)
    if obstacles is not None:
        stage.context.begin([dataclasses.replace(stage.world.model, obstacles=tuple(obstacles))])
    stage.world.hold(name)
    stage.look()
    seen = stage.context.seen(ONE, np.zeros(1))
    grip = poses.relative(seen.tool, seen.object(name))[0]
    status = stage.tick(400)
    tools = np.array([c.tool for c in stage.world.steps])
    ends = poses.multiply(tools[-1], grip) if len(tools) else None
    return stage, status, tools, ends


def test_it_ends_upright_above_the_place_with_its_heading(toy):
    stage, status, _, cup = carry(toy, Bring("box", to="goal", hover=0.05), "box")
    assert status == Status.SUCCESS
    place, model = stage.world.model.place("goal"), stage.world.model.object("box")
    local = poses.multiply(poses.inverse(place.pose), cup)
    assert np.allclose(local[:3], [0, 0, model.extent[2] / 2 + 0.05], atol=1e-3)
    turned = min(float(poses.angle_between(local[3:], poses.yaw(k * np.pi))) for k in range(model.symmetry))
    assert turned < 1e-2


def test_above_another_object_and_to_a_position(toy):
    stage, status, _, cup = carry(toy, Bring("cup", to="box", hover=0.03))
    world = stage.world.model
    box = stage.world.now.objects[world.object_index("box")]
    top = box[2] + world.object("box").extent[2] / 2
    assert status == Status.SUCCESS and np.allclose(cup[:2], box[:2], atol=1e-3)
    assert cup[2] - world.object("cup").extent[2] / 2 == pytest.approx(top + 0.03, abs=1e-3)
    _, status, _, cup = carry(toy, Bring("cup", position=(0.5, 0.1, 0.4)))
    assert status == Status.SUCCESS and np.allclose(cup[:3], [0.5, 0.1, 0.4], atol=1e-3)


@pytest.mark.parametrize(
    ("more", "lower", "fits"), [(HIGHER[-1], 0.0, False), (HIGHER[-1], 0.07, True), (0.0, 0.0, True)]
)
@pytest.mark.parametrize("hover", [0.04, 0.12])
def test_how_far_it_goes_down_follows_from_where_the_object_is_in_the_hand(toy, more, lower, fits, hover):
    """Between ribs that are lower than the object there is room for it, and for a hand that holds it high.

    Where they are no higher than its middle, it may fall the rest.
    """
    leaf = Bring("cup", to="goal", hover=hover)
    stage = toy(sequence("put down", leaf, Place("cup", on="goal")))
    model = stage.world.model
    goal, cup = model.place("goal").pose, model.object("cup").extent
    middle = goal[2] + cup[2] / 2 + more
    inner, outer = cup[0] / 2 + 0.012, cup[0] / 2 + 0.1
    ribs = [
        Obstacle(
            poses.pose([*(goal[:2] + way * (inner + outer) / 2 * np.eye(2)[axis]), middle / 2]),
            (*np.where(np.arange(2) == axis, outer - inner, 2 * outer).tolist(), middle),
            "ribs",
        )
        for axis in (0, 1)
        for way in (-1, 1)
    ]
    stage.context.begin([dataclasses.replace(model, obstacles=(*model.obstacles, *ribs))])
    stage.world.hold("cup")
    objects = stage.world.now.objects.copy()
    objects[model.object_index("cup"), 2] -= lower
    stage.world.put(objects=objects)
    stage.look()
    status = stage.tick()
    assert (status == Status.RUNNING) == fits, leaf.feedback_message
    assert fits or (leaf.outcome.is_a(NO_WAY) and "ribs" in leaf.feedback_message)


@pytest.mark.parametrize("more", [True, False])
def test_into_a_small_container_it_leaves_room_for_what_the_tree_brings_there_later(toy, more):
    first = Bring("box", to="goal")
    later = [Bring("cup", to="goal"), Release("cup", into="goal")] if more else [Bring("cup", to="table")]
    stage = toy(sequence("two", first, Release("box", into="goal"), *later))
    model = stage.world.model
    side = max(model.object("box").extent[:2]) + max(model.object("cup").extent[:2]) + 0.04
    bin_ = dataclasses.replace(
        model.place("goal"), kind="bin", extent=(side, side), centre=(0.0, 0.0), height=0.05
    )
    stage.context.begin([dataclasses.replace(model, places={**model.places, "goal": bin_})])
    stage.world.hold("box")
    stage.look()
    seen = stage.context.seen(ONE, np.zeros(1))
    grip = poses.relative(seen.object("box"), seen.tool)[0]
    assert stage.tick() == Status.RUNNING, first.feedback_message
    end = first.memory.path.table[0, -1]
    aside = poses.localise(bin_.pose, poses.multiply(end, poses.inverse(grip))[:3])[:2]
    assert (np.linalg.norm(aside) > 0.01) == more


@pytest.mark.parametrize(("overlap", "aside"), [(-0.01, 0.0), (0.004, ASIDE), (0.012, FARTHER)])
def test_what_cannot_stand_exactly_there_is_put_down_a_little_aside(toy, overlap, aside):
    """A kerb stands some millimetres into the place of a cup, on the side away from the arm."""
    bring, place = Bring("cup", to="goal"), Place("cup", on="goal")
    stage = toy(sequence("put down", bring, place))
    model = stage.world.model
    goal, cup = np.asarray(model.place("goal").pose), model.object("cup").extent
    away = goal[:2] / np.linalg.norm(goal[:2])
    middle = goal[:2] + away * (cup[0] / 2 - overlap + 0.01)
    kerb = poses.pose([*middle, goal[2] + 0.01], poses.yaw(math.atan2(away[1], away[0])))
    obstacles = (*model.obstacles, Obstacle(kerb, (0.02, 0.1, 0.02), "kerb"))
    stage.context.begin([dataclasses.replace(model, obstacles=obstacles)])
    stage.world.hold("cup")
    stage.look()
    assert stage.tick() == Status.RUNNING, bring.feedback_message
    brought = bring.memory.path.table[0, -1]
    stage.world.put(tool_pose=brought)
    stage.world.bend()
    stage.world.hold("cup")
    stage.look()
    put_down = place.model.begin(stage.context.seen(ONE, np.zeros(1))).path.table[0, -1]
    for end in (brought, put_down):  # the toy holds objects at the tool's origin
        off = float((end[:2] - goal[:2]) @ away)
        assert off == pytest.approx(-aside, abs=2e-3)


def test_via_points_are_passed_in_order(toy):
    via = [(0.0, -0.2, 0.15), (0.05, -0.1, 0.2)]
    leaf = Bring("cup", position=(0.5, 0.2, 0.3), via=via)
    _, status, tools, _ = carry(toy, leaf)
    cup = tools[:, :3]  # the toy holds objects at the tool's origin
    assert status == Status.SUCCESS
    near = [np.linalg.norm(cup - (np.array([0.5, 0.2, 0.3]) + v), axis=-1) for v in via]
    assert all(n.min() < 0.04 for n in near) and near[0].argmin() < near[1].argmin()


def test_it_goes_round_what_is_in_the_way(toy):
    wall = Obstacle(poses.pose([0.45, 0.22, 0.2]), (0.6, 0.03, 0.5), "wall")
    leaf = Bring("cup", position=(0.45, 0.45, 0.35))
    _, status, straight, _ = carry(toy, leaf, obstacles=[])
    assert status == Status.SUCCESS and straight[:, 2].max() < 0.36
    stage, status, tools, _ = carry(toy, Bring("cup", position=(0.45, 0.45, 0.35)), obstacles=[wall])
    assert status == Status.SUCCESS, stage.tree.feedback_message
    assert tools[:, 2].max() > 0.45


def test_no_way_is_a_failure_that_others_can_act_upon(toy):
    shut = [Obstacle(poses.pose([0.45, 0.0, 0.35 + s * 0.35]), (0.8, 0.8, 0.02), "cage") for s in (-1, 1)] + [
        Obstacle(poses.pose([0.45 + s * a * 0.35, s * (1 - a) * 0.35, 0.35]), size, "cage")
        for s in (-1, 1)
        for a, size in ((1, (0.02, 0.8, 0.8)), (0, (0.8, 0.02, 0.8)))
    ]
    leaf = Bring("cup", position=(0.45, 0.6, 0.35))
    _, status, _, _ = carry(toy, leaf, obstacles=shut)
    assert status == Status.FAILURE
    assert leaf.outcome.is_a(CANNOT_START) and leaf.outcome.is_a(NO_WAY)


@pytest.mark.parametrize(
    "arguments", [{}, {"to": "goal", "position": (0.4, 0, 0.3)}, {"to": "goal", "beside": "box"}]
)
def test_one_of_to_and_position(arguments):
    with pytest.raises(InputError, match="bring: give either 'to', 'position' or 'beside'"):
        Bring("cup", **arguments)


@pytest.mark.parametrize("arguments", [{"hover": -0.1}, {"speed": -1.0}])
def test_lengths_and_speeds_below_zero_are_refused(arguments):
    with pytest.raises(InputError, match="should not be below 0"):
        Bring("cup", to="goal", **arguments)


def test_without_the_object_in_the_hand_it_cannot_start(toy):
    stage = toy(Bring("cup", to="goal"))
    assert stage.tick() == Status.FAILURE
    assert stage.tree.outcome.is_a(CANNOT_START) and stage.tree.outcome.is_a(NOT_HELD)


# ---- how an object stands ---------------------------------------------------------------------------------


KINDS = ("box", "cube", "cylinder", "cup", "oval", "diamond")


def thing(kind):
    size = (
        (0.06, 0.06, 0.06) if kind == "cube" else (0.05, 0.05 if kind in ("cylinder", "cup") else 0.07, 0.1)
    )
    return object_model("thing", kind, ShapeSize(size, (1.0, 1.0), None))


def facts(models):
    """What is known of a thing in so many worlds."""
    return WorldFacts.of([WorldModel((model,), {}, ("a", "b"), 0.08, 0.05) for model in models]).object(
        "thing"
    )


def random_poses(n):
    now = np.random.default_rng(0).normal(size=(n, 7))
    now[:, 3:] = poses.normalise(now[:, 3:])
    return now


@pytest.mark.parametrize("kind", KINDS)
def test_standing_poses_are_upright_and_near(kind):
    torch = pytest.importorskip("torch")
    model, now = thing(kind), random_poses(40)
    frame = np.repeat(poses.pose([0.4, 0.1, 0.2], poses.yaw(0.7))[None], 40, axis=0)
    known = facts([model] * 40)
    stands = standing_pose(frame, now, known, 0.03)
    in_torch = standing_pose(
        torch.from_numpy(frame), torch.from_numpy(now), known.map(torch.from_numpy), 0.03
    )
    assert np.allclose(in_torch.numpy(), stands, atol=1e-12)
    half = model.extent[2] / 2
    assert np.allclose(stands[:, :3], [0.4, 0.1, 0.23 + half])
    turns = poses.angle_between(now[:, 3:], stands[:, 3:])
    if kind == "cube":  # some face is down, and no orientation of a cube is further away than this
        assert turns.max() < np.deg2rad(62.8)
        assert np.allclose(
            np.sort(np.abs(poses.to_matrix(stands[:, 3:])[:, 2]), axis=-1), [0, 0, 1], atol=1e-9
        )
    else:
        assert np.allclose(poses.z_axis(stands[:, 3:]), [0, 0, 1], atol=1e-9)
    if model.symmetry == 0:  # the shortest turn to upright is the tilt itself
        assert np.allclose(turns, poses.tilt(now[:, 3:]), atol=1e-6)


def test_things_of_unlike_kinds_stand_in_one_batch_as_each_one_alone(rows_alike):
    models, now = [thing(KINDS[k % len(KINDS)]) for k in range(30)], random_poses(30)
    frame, height = random_poses(30)[::-1].copy(), np.linspace(0.0, 0.1, 30)
    with np.errstate(all="raise"):
        rows_alike(
            lambda rows: standing_pose(
                frame[rows], now[rows], facts([models[k] for k in rows]), height[rows]
            ),
            30,
        )


def test_over_a_container_that_has_something_in_it_it_ends_beside_that(toy):
    stage = toy(Bring("cup", to="bin"))
    stage.world.hold("cup")
    stage.look()
    view = views(stage.context.seen(ONE, np.zeros(1)))[0]
    goal = view.world.place("goal")
    place = dataclasses.replace(goal, name="bin", kind="bin", extent=(0.3, 0.3), height=0.1)
    world = dataclasses.replace(view.world, places={"bin": place})
    middle = poses.transform(np.asarray(place.pose), np.array([*place.centre, 0.0]))
    for beside, empty in ((1.0, True), (0.0, False)):
        there = poses.pose(middle + np.array([beside, 0.0, 0.02]))
        now = view._replace(world=world, objects={**view.objects, "box": there})
        model = stage.tree.model
        goals = model._low(now, WayEnds(view.tool, model._options(now), None, frozenset()), [])
        assert np.array_equal(goals.first, view.tool) is empty
        ends = poses.multiply(goals.first, poses.inverse(poses.relative(now.objects["cup"], now.tool)))
        assert empty or 0.05 < abs(ends[:2] - middle[:2]).max() < 0.15
        heights = goals.options[:, 2] - min(goals.options[:, 2])
        assert empty or (abs(heights[0]) < 1e-9 and np.all(np.diff(heights) > -1e-9)), "the lowest first"
