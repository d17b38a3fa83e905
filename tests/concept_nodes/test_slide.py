"""Slide, slide to a stop and off it, hold: in contact all the way, by what is felt."""

import numpy as np
import pytest
from draws import successes
from py_trees.common import Status

from bt_tasksim.concept_nodes import Hold, Slide, SlideOff, SlideToStop
from bt_tasksim.concept_nodes.hold import GIVES_WAY
from bt_tasksim.concept_nodes.holding import NOT_HELD
from bt_tasksim.concept_nodes.slid import LIGHT, NOT_FELT
from bt_tasksim.concept_nodes.slide_to_stop import NO_STOP
from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.outcomes import CANNOT_START, DONE
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import Runner
from bt_tasksim.trees.load import load_source

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
    assert begin[0] - stage.world.now.tool_pose[0] == pytest.approx(0.053, abs=3e-3)
    stage, _ = table_below(toy(SlideToStop("cup", direction=FORWARD, distance=0.06)))
    assert stage.tick(300) == Status.FAILURE and stage.tree.outcome.is_a(NO_STOP)


def test_a_support_that_is_not_there_is_not_looked_for_for_ever(toy):
    stage, _ = table_below(toy(SlideOff("cup", direction=FORWARD)), stiff=0.0)
    assert stage.tick(300) == Status.FAILURE and stage.tree.outcome.is_a(NOT_FELT)


def test_hold_counts_the_time_between_its_limits(toy):
    stage, _ = table_below(toy(Hold("cup", direction=FORWARD, duration=1.0)), stop=0.0)
    assert stage.tick(200) == Status.SUCCESS and stage.context.now > 1.0
    stage, _ = table_below(toy(Hold("cup", direction=FORWARD, duration=1.0)), stop=0.5)
    assert stage.tick(200) == Status.FAILURE and stage.tree.outcome.is_a(GIVES_WAY)


@pytest.mark.physical
def test_in_mujoco_too():
    source = load_source("slide_to_stop")
    runner = Runner(source.build(), source.scene, EngineOptions(engines="mujoco"))
    (result,) = successes(runner.run, range(7, 10), n=1)
    assert result.verdict.penetration < 0.002
