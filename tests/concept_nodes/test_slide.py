"""Slide, slide to a stop and off it, hold: in contact all the way, by what is felt."""

from types import SimpleNamespace

import numpy as np
import pytest
from draws import successes
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from py_trees.common import Status

from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept_nodes import (
    Against,
    ClearOf,
    Grasp,
    Hold,
    Place,
    Release,
    Slide,
    SlideOff,
    SlideToStop,
)
from bt_tasksim.concept_nodes.holding import NOT_HELD
from bt_tasksim.concept_nodes.pressing import GIVES_WAY
from bt_tasksim.concept_nodes.shoved_way import free_until
from bt_tasksim.concept_nodes.slid import LIGHT, NOT_FELT
from bt_tasksim.concept_nodes.slide_to_stop import NO_STOP
from bt_tasksim.concept_nodes.stops import nearest_stop
from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.facts import WorldFacts
from bt_tasksim.core.outcomes import CANNOT_START, DONE
from bt_tasksim.core.registry import parts
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import Runner
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.outlines import distance, hull, nearest_way
from bt_tasksim.scene.relations.base import FinalState
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import Goal, ObjectSpec
from bt_tasksim.trees import sequence
from bt_tasksim.trees.from_goals import tidy
from bt_tasksim.trees.load import load_source
from bt_tasksim.trees.stages import lasting
from bt_tasksim.trees.walk import nodes_of

FORWARD = (-1.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Slide("cup"), "give either"),
        (lambda: Slide("cup", to="goal", position=(0.5, 0.0, 0.0)), "give either"),
        (lambda: Slide("cup", distance=0.1), "go together"),
        (lambda: Slide("cup", direction=(0.0, 0.0, -1.0), distance=0.1), "should be level"),
        (lambda: SlideToStop("cup", direction=(0.0, 0.5, 0.5)), "should be level"),
        (lambda: SlideOff("cup", direction=(0.0, 0.5, 0.5)), "should be level"),
        (lambda: SlideToStop("cup"), "give 'direction', 'against', or both"),
        (lambda: SlideOff("cup"), "give 'direction', 'off', or both"),
        (lambda: Hold("cup"), "give 'direction', 'against', or both"),
        (lambda: Hold("cup", direction=FORWARD, least=9.0, most=8.0), "'least' should be less"),
    ],
)
def test_what_cannot_stand_together_is_refused(make, said):
    with pytest.raises(InputError, match=said):
        make()


@pytest.mark.parametrize(
    "leaf",
    [
        lambda: Slide("cup", direction=FORWARD, distance=0.05),
        lambda: SlideToStop("cup", direction=FORWARD),
        lambda: SlideOff("cup", direction=FORWARD),
        lambda: Hold("cup", direction=FORWARD),
    ],
)
def test_the_object_has_to_be_in_the_hand(toy, leaf):
    stage = toy(leaf())
    assert stage.tick() == Status.FAILURE
    assert stage.tree.outcome.is_a(CANNOT_START) and stage.tree.outcome.is_a(NOT_HELD)


def table_below(stage, stop=np.inf, stiff=5000.0):
    """A held cup that comes with the tool, and is pressed by a table 20 mm below, and by a wall ahead."""
    world, cup = stage.world, stage.world.model.index["cup"]
    tool, step = world.now.tool_pose.copy(), world.step
    tool[:3] = [0.55, -0.25, world.model.object("cup").extent[2] / 2 + 0.02]
    world.put(tool_pose=tool.copy())
    world.bend()
    world.hold("cup")
    stage.look()

    def pressed(command):
        step(command)
        now = world.now.tool_pose
        force = np.zeros(3)
        force[2] = stiff * max(0.0, tool[2] - 0.02 - now[2])
        force[0] = stiff * max(0.0, (tool[0] - now[0]) - stop)
        turned = poses.rotate(poses.quat_conjugate(now[3:]), force)
        objects = world.now.objects.copy()
        objects[cup, :3] = now[:3]
        world.put(wrench=np.concatenate([turned, np.zeros(3)]), objects=objects)
        return world.now

    world.step = pressed
    return stage, tool


def test_it_comes_down_until_it_presses_and_goes_on_only_then(toy):
    stage, begin = table_below(toy(Slide("cup", direction=FORWARD, distance=0.08, press=5.0)))
    assert stage.tick(300) == Status.SUCCESS and stage.tree.outcome.is_a(DONE)
    tools = np.array([command.tool for command in stage.world.steps])
    gone, lowered = begin[0] - tools[:, 0], begin[2] - tools[:, 2]
    assert gone[-1] == pytest.approx(0.08, abs=1e-3)
    assert np.all(gone[lowered < 0.02] < 1e-9), "it does not go before it touches"
    pressing = 5000.0 * (lowered - 0.02)[gone > 0.02]
    assert pressing.min() > LIGHT * 5.0 and pressing.max() < 10.0
    jerk = np.diff(tools[:, :3], n=3, axis=0) / 0.05**3
    assert np.quantile(np.linalg.norm(jerk, axis=-1), 0.95) < 40.0


def test_a_stop_is_felt_and_where_there_is_none_it_says_so(toy):
    stage, begin = table_below(toy(SlideToStop("cup", direction=FORWARD, distance=0.15)), stop=0.05)
    assert stage.tick(300) == Status.SUCCESS
    gone = np.diff([command.tool[0] for command in stage.world.steps]) / 0.05
    assert abs(gone).max() < 0.016, "nothing is known to hold it up: it is met anywhere, and so slowly"
    assert begin[0] - stage.world.now.tool_pose[0] == pytest.approx(0.053, abs=3e-3)
    stage, _ = table_below(toy(SlideToStop("cup", direction=FORWARD, distance=0.06)))
    assert stage.tick(400) == Status.FAILURE and stage.tree.outcome.is_a(NO_STOP)


def test_a_support_that_is_not_there_is_not_looked_for_for_ever(toy):
    stage, _ = table_below(toy(SlideOff("cup", direction=FORWARD)), stiff=0.0)
    assert stage.tick(300) == Status.FAILURE and stage.tree.outcome.is_a(NOT_FELT)


def test_hold_counts_the_time_between_its_limits(toy):
    stage, _ = table_below(toy(Hold("cup", direction=FORWARD, duration=1.0)), stop=0.0)
    assert stage.tick(200) == Status.SUCCESS and stage.context.now > 1.0
    stage, _ = table_below(toy(Hold("cup", direction=FORWARD, duration=1.0)), stop=0.5)
    assert stage.tick(200) == Status.FAILURE and stage.tree.outcome.is_a(GIVES_WAY)


# ---- what stops there are --------------------------------------------------------------------------------


def on_the_ledge(aside, heading=0.0, size=(0.05, 0.05, 0.06)):
    """A block on the board, so many metres from its rim, as a world and as it truly stands."""
    scene = Scene(
        fixtures=["ledge"],
        objects={"block": ObjectSpec(("box",), on="ledge", size=(size, size), area=(0.0, 0.0))},
        goal=Goal("block", "ledge", relation="against"),
    )
    drawn = scene.sample(3)
    (ledge,) = (fixture for fixture in drawn.fixtures if fixture.name == "ledge")
    rim = ledge.pose_array()[0] + 0.14
    half = (abs(np.cos(heading)) * size[0] + abs(np.sin(heading)) * size[1]) / 2
    pose = poses.pose([rim - half - aside, 0.0, drawn.objects[0].pose[2]], poses.yaw(heading))
    world = drawn.world_model(["left", "right"], 0.08)
    robot = load_robot("panda")
    tool = np.array([0.4, 0, 0.4, 0, 1, 0, 0.0])
    return WorldView(robot, world, {"block": pose}, tool, robot.rest, robot.hand_open), drawn


@settings(max_examples=30, deadline=None)
@given(aside=st.floats(0.001, 0.15), heading=st.floats(-3.1, 3.1))
def test_the_nearest_wall_is_the_rim_and_not_the_board_below(aside, heading):
    view, _ = on_the_ledge(aside, heading)
    for other in ("ledge", None):
        stop = nearest_stop(view, "block", other)
        assert stop.gap == pytest.approx(aside, abs=1e-6)
        assert stop.towards == pytest.approx([1.0, 0.0, 0.0], abs=1e-6)


@settings(max_examples=10, deadline=None)
@given(aside=st.floats(0.01, 0.12), heading=st.floats(-0.8, 0.8))
def test_where_it_meets_the_rim_is_known_to_a_millimetre(aside, heading):
    view, _ = on_the_ledge(aside, heading)
    free = 0.2 * free_until(view, "block", np.array([0.0, 0.0, 0.003]), np.array([0.2, 0.0, 0.0]))
    assert aside - 0.001 < free < aside + 1e-6


@pytest.mark.physical
@pytest.mark.parametrize("seed", [1, 2])
def test_no_grasp_is_taken_with_which_a_finger_would_meet_the_rim_first(seed):
    turned = (np.pi / 4, np.pi / 4)
    scene = Scene(
        fixtures=["ledge"],
        objects={"block": ObjectSpec(("box",), on="ledge", size=((0.05, 0.05, 0.06),) * 2, yaw=turned)},
        goal=Goal("block", "ledge", relation="held_against"),
    )
    slide = SlideToStop("block", direction=(1.0, 0.0, 0.0), distance=0.25, against="ledge")
    with Runner(sequence("turned", Grasp("block"), slide), scene) as runner:
        result = runner.run(seed)
    assert result.success if result.status == Status.SUCCESS else "no grasp of block serves" in result.why


def test_what_has_no_wall_beside_it_holds_nothing_up():
    view, _ = on_the_ledge(0.05)
    assert nearest_stop(view, "block", "table") is None
    high = {"block": poses.shifted(view.objects["block"], np.array([0.0, 0.0, 0.2]))}
    assert nearest_stop(view._replace(objects=high), "block", "ledge") is None
    nowhere = {"block": np.full(7, np.nan)}
    assert nearest_stop(view._replace(objects=nowhere), "block", "ledge") is None


@settings(max_examples=40, deadline=None)
@given(
    points=st.lists(
        st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1)), min_size=4, max_size=8, unique=True
    ),
    away=st.floats(-3.1, 3.1),
)
def test_the_nearest_way_leads_there_and_no_other_is_shorter(points, away):
    square = hull(np.array([[0.0, 0.0], [0.05, 0.0], [0.05, 0.05], [0.0, 0.05]]))
    other = hull(np.array(points) + 0.4 * np.array([np.cos(away), np.sin(away)]))
    assume(len(other) > 2)
    gap, way = nearest_way(square, other)
    assert gap > 0.0 and np.linalg.norm(way) == pytest.approx(1.0)
    assert distance(square + (gap - 0.002) * way, other) == pytest.approx(0.002, abs=1e-6)


@pytest.mark.parametrize(
    ("aside", "against", "clear"), [(0.0, True, False), (0.01, False, False), (0.05, False, True)]
)
def test_conditions_say_of_a_block_at_a_rim_what_goals_do(aside, against, clear):
    view, drawn = on_the_ledge(aside)
    truly = FinalState(drawn, view.world, SimpleNamespace(objects=np.array([view.objects["block"]])))
    facts = WorldFacts.of([view.world])
    observed = SimpleNamespace(
        tool_pose=view.tool[None],
        arm_position=view.arm[None],
        hand_position=view.hand[None],
        objects=truly.hidden.objects[None],
        contacts=np.zeros((1, 2), bool),
    )
    seen = Seen(observed, facts, view.robot, np.zeros(1))
    for condition, relation, wanted in (
        (Against.value("block", "ledge"), "against", against),
        (ClearOf.value("block", "ledge"), "clear_of", clear),
    ):
        goal = Goal("block", "ledge", relation=relation, distance=ClearOf.gap)
        assert parts("goal relation")[relation]().evaluate(goal, truly).reached == wanted
        assert condition.holds(seen).tolist() == [wanted]
    assert ClearOf.value("block").holds(seen).tolist() == [clear]


@pytest.mark.parametrize(("aside", "held", "costs"), [(0.0, 1.0, 0.0), (0.005, 1.0, 5 / 3), (0.0, 0.0, 0.0)])
def test_costs_of_stops_are_true_gaps_and_not_that_the_board_is_touched(aside, held, costs):
    view, _ = on_the_ledge(aside)
    hidden = SimpleNamespace(
        objects=np.array([[view.objects["block"]]]),
        tool_pose=view.tool[None],
        support=np.ones((1, 1, 2), bool),
        hand_force=np.array([[held]]),
    )
    known = Known(hidden, WorldFacts.of([view.world]))
    for model in (SlideToStop.value("block", against="ledge"), SlideToStop.value("block", direction=FORWARD)):
        assert model.sufficient_cost(known, None)[0] == pytest.approx(costs, abs=1e-3)
    hold = Hold.value("block", against="ledge").sufficient_cost(known, None)[0]
    assert hold == pytest.approx(max(costs, 1.0 - held), abs=1e-3)
    off = SlideOff.value("block", off="ledge").sufficient_cost(known, None)[0]
    assert off == pytest.approx(1.0 - aside / ClearOf.gap, abs=1e-3)
    there = view.objects["block"][:2] + np.array([0.06, 0.0])
    slide = Slide.value("block", position=(*there, 0.0)).sufficient_cost(known, None)[0]
    assert slide == pytest.approx(2.0)


def test_trees_from_goals_slide_things_against_and_off_their_stops():
    for relation, concept in (("against", SlideToStop), ("clear_of", SlideOff), ("pressed", Slide)):
        tree = tidy([Goal("block", "ledge", relation=relation)])
        kinds = [type(node.model) for node in nodes_of(tree) if hasattr(node, "model")]
        assert kinds.index(concept) > kinds.index(Grasp)
        assert (Release in kinds) == (relation != "pressed")


def test_what_is_slid_on_does_not_stay_against_its_stop():
    begun = [Grasp("block"), SlideToStop("block", against="ledge")]
    assert lasting(begun, "block").condition == "HeldAgainst"
    assert lasting([*begun, Place("block", anywhere=True), Release("block")], "block").condition == "Against"
    held = Hold("block", direction=FORWARD)
    assert lasting([*begun, held, Release("block")], "block").condition == "Against"
    off = SlideOff("block", direction=FORWARD)
    assert lasting([*begun, off, Release("block")], "block") is None
    assert lasting([*begun, SlideOff("block", off="ledge"), Release("block")], "block").condition == "ClearOf"


@pytest.mark.physical
def test_in_mujoco_too():
    source = load_source("slide_to_stop")
    runner = Runner(source.build(), source.scene, EngineOptions(engines="mujoco"))
    (result,) = successes(runner.run, range(7, 10), n=1)
    assert result.verdict.penetration < 0.002


@pytest.mark.physical
def test_a_block_that_is_slid_to_the_rim_and_not_held_there_misses_the_goal_of_hold():
    source = load_source("hold")
    begun = [child.model.arguments() for child in source.build().children[:2]]
    leaves = [Grasp(**begun[0]), SlideToStop(**begun[1]), Place("block", anywhere=True), Release("block")]
    with Runner(sequence("not held", *leaves), source.scene) as runner:
        result = runner.run(7)
    assert result.status == Status.SUCCESS and result.verdict.reason == "not_kept", result.why
