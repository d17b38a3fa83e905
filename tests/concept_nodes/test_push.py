"""Push and pull: how the hand stands behind a thing, how it leads it, and what it says when it cannot."""

import dataclasses

import numpy as np
import pytest
from draws import successes
from py_trees.common import Status

from bt_tasksim.concept_nodes import Pull, Push
from bt_tasksim.concept_nodes.pusher import CLOSURES, stances, tops
from bt_tasksim.concept_nodes.shove import (
    DRIFTED,
    HAND_FULL,
    NOTHING_UNDER_GOAL,
    OTHER_HEIGHT,
    PASSED_BY,
    ROLLS,
)
from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.outcomes import CANNOT_START, NO_WAY
from bt_tasksim.core.world import Obstacle
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import Runner
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.relations.base import lean
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import Goal, ObjectSpec, SpotSpec
from bt_tasksim.trees import retry
from bt_tasksim.trees.from_goals import tidy
from bt_tasksim.trees.walk import nodes_of


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, "give either 'to', 'position', or 'direction' and 'distance'"),
        ({"to": "goal", "position": (0.5, 0.0, 0.0)}, "give either"),
        ({"direction": (1.0, 0.0, 0.0)}, "go together"),
        ({"direction": (0.0, 0.0, 1.0), "distance": 0.1}, "should be level"),
        ({"to": "goal", "tool": "cup"}, "the target itself"),
    ],
)
def test_what_cannot_stand_together_is_refused(given, said):
    for concept in (Push, Pull):
        with pytest.raises(InputError, match=said):
            concept("cup", **given)


def view_of(kind, size=None, robot="panda", seed=3):
    robot = load_robot(robot)
    drawn = Scene(robot.name, objects={"it": ObjectSpec(kinds=(kind,), on="table", size=size)}).sample(seed)
    world = drawn.world_model([tip.name for tip in robot.tips], robot.opening)
    there = {"it": np.array(drawn.objects[0].pose)}
    return WorldView(robot, world, there, np.array([0.4, 0, 0.4, 0, 1, 0, 0.0]), robot.rest, robot.hand_open)


@pytest.mark.parametrize("heading", [0.0, 1.0, 3.5])
def test_the_hand_stands_low_behind_the_middle_of_a_thing(heading):
    view = view_of("cylinder")
    along = np.array([np.cos(heading), np.sin(heading), 0.0])
    for _, stance in zip(range(5), stances(view, "it", along), strict=False):
        offset = stance.tool[:3] - view.objects["it"][:3]
        assert offset @ along < -view.model("it").extent[0] / 2
        assert stance.closure in CLOSURES and stance.width >= 0.0
        assert poses.z_axis(stance.tool[3:])[2] < -0.5, "it points down, and leans at most"
    first = next(stances(view, "it", along))
    across = np.array([-along[1], along[0], 0.0])
    assert abs((first.tool[:3] - view.objects["it"][:3]) @ across) < 5e-3
    assert first.width > 0.02, "two fingers apart hold what is round from rolling aside"


def test_a_hand_leans_back_from_what_is_taller_than_its_fingers_are_long():
    low = next(stances(view_of("cube"), "it", np.array([1.0, 0.0, 0.0])))
    tall = next(stances(view_of("box", (0.06, 0.06, 0.12)), "it", np.array([1.0, 0.0, 0.0])))
    assert poses.z_axis(low.tool[3:])[2] == pytest.approx(-1.0, abs=1e-9)
    assert poses.z_axis(tall.tool[3:])[0] > 0.2 and tall.tool[2] < 0.035


def test_a_fist_finds_its_place_too():
    assert next(stances(view_of("box", robot="xarm7_ability"), "it", np.array([1.0, 0.0, 0.0]))).closure > 0.9


def test_from_above_the_fingertips_touch_the_top():
    along = np.array([1.0, 0.0, 0.0])
    view = view_of("box", (0.12, 0.12, 0.03))
    (first, *_) = tops(view, "it", along)
    assert not tops(view_of("cube"), "it", along), "which would tip over"
    top = view.objects["it"][2] + view.model("it").extent[2] / 2
    assert 0.0 < first.tool[2] - top < 0.02 and np.allclose(first.tool[:2], view.objects["it"][:2])


def test_what_is_in_the_hand_has_to_be_put_down_first(toy):
    stage = toy(Push("cup", direction=(1.0, 0.0, 0.0), distance=0.1))
    stage.world.hold("cup")
    stage.look()
    assert stage.tick() == Status.FAILURE and stage.tree.outcome.is_a(HAND_FULL)


@pytest.mark.parametrize(
    ("leaf", "reason"),
    [
        (Push("cup", direction=(1.0, 0.0, 0.0), distance=3.0), NOTHING_UNDER_GOAL),
        (Pull("cup", to="box"), OTHER_HEIGHT),
    ],
)
def test_a_goal_beyond_the_edge_or_on_another_level_is_refused(toy, leaf, reason):
    stage = toy(leaf)
    assert stage.tick() == Status.FAILURE
    assert stage.tree.outcome.is_a(CANNOT_START) and stage.tree.outcome.is_a(reason)


def test_a_ball_is_not_pushed():
    scene = Scene(
        objects={"it": ObjectSpec(kinds=("ball",), on="table")}, goal=Goal("it", "table", relation="anywhere")
    )
    result = Runner(Push("it", direction=(0.0, 1.0, 0.0), distance=0.1), scene).run(3)
    assert result.outcome.is_a(CANNOT_START) and result.outcome.is_a(ROLLS)
    turned = poses.from_rotation_vector(np.array([0.4, 0.3, 0.0]))
    assert lean(turned, result.configuration.objects[0].true_model()) == 0.0, "it cannot lean"


def test_what_is_there_already_is_left_alone(toy):
    stage = toy(Push("cup", direction=(1.0, 0.0, 0.0), distance=0.005))
    tool = stage.world.now.tool_pose.copy()
    assert stage.tick(3) == Status.SUCCESS
    assert np.allclose(stage.world.now.tool_pose, tool, atol=1e-6)


def test_something_in_the_way_is_named(toy):
    stage = toy(Push("cup", direction=(-1.0, 0.0, 0.0), distance=0.2))
    at = stage.world.now.objects[stage.world.model.index["cup"]][:3] - [0.12, 0.0, 0.0]
    wall = Obstacle(poses.pose(at), (0.02, 0.3, 0.1), "wall")
    stage.context.begin([dataclasses.replace(stage.world.model, obstacles=(wall,))])
    stage.look()
    stage.tick()
    assert stage.tree.outcome.is_a(NO_WAY) and "against wall" in stage.tree.feedback_message


def test_a_thing_that_does_not_come_along_is_noticed(toy):
    """In the toy world nothing moves that is not held: the hand goes past it."""
    stage = toy(Push("cup", direction=(-1.0, 0.0, 0.0), distance=0.1))
    assert stage.tick(400) == Status.FAILURE
    assert stage.tree.outcome.is_a(PASSED_BY) or stage.tree.outcome.is_a(DRIFTED)


def test_trees_from_goals_take_things_before_they_push_them():
    tree = tidy([Goal("cup", "table", "anywhere")])
    names = {type(node).__name__ for node in nodes_of(tree)}
    assert "Place" in names and not names & {"Push", "Pull"}


SPOT = SpotSpec("goal", on="table", centre=(0.0, 0.12), area=(0.02, 0.02), extent=(0.06, 0.06))


@pytest.mark.physical
@pytest.mark.parametrize(
    ("concept", "engines", "kind"), [(Push, "sapien", "cylinder"), (Pull, "mujoco", "cube")]
)
def test_in_physics_it_comes_to_its_goal_and_the_hand_presses_little(concept, engines, kind):
    scene = Scene(
        objects={"it": ObjectSpec(kinds=(kind,), on="table", centre=(0.03, -0.08), area=(0.02, 0.02))},
        spots=[SPOT],
        goal=Goal("it", "goal", relation="anywhere"),
    )
    tree = retry(2, concept("it", to="goal"))
    results = successes(Runner(tree, scene, EngineOptions(engines=engines)).run, range(7, 10), n=1)
    assert results[0].verdict.penetration < 0.002


@pytest.mark.physical
def test_where_nothing_comes_behind_it_the_fingertips_draw_it_by_its_top():
    """A wall behind the box leaves the hand no room there."""
    flat = ObjectSpec(kinds=("box",), size=(0.12, 0.09, 0.03), on="table", area=(0.0, 0.0), yaw=0.0)
    scene = Scene(
        objects={"it": flat},
        goal=Goal("it", "table", relation="anywhere"),
    )
    runner = Runner(Pull("it", direction=(-1.0, 0.0, 0.0), distance=0.08), scene)
    drawn = scene.sample(7)
    world = runner.reset(drawn)
    at = np.array(drawn.objects[0].pose[:3])
    wall = Obstacle(poses.pose([at[0] + 0.09, at[1], 0.1]), (0.02, 0.5, 0.2), "wall")
    runner.context.begin([dataclasses.replace(world, obstacles=(*world.obstacles, wall))])
    result = runner.finish(drawn, world)
    assert result.status == Status.SUCCESS, result.why
