"""What leaves read and write: one writer a part and tick, and what an interrupted leaf wrote is dropped."""

import numpy as np
import pytest
from py_trees.behaviours import Failure
from py_trees.common import Status

from bt_tasksim.concept.context import Context
from bt_tasksim.concept.leaf import ONE
from bt_tasksim.concept_nodes import Grasp, TimePassed
from bt_tasksim.core.errors import CommandConflictError, InputError, LeafError
from bt_tasksim.core.outcomes import INTERRUPTED, TIMED_OUT
from bt_tasksim.core.world import Command
from bt_tasksim.robot.description import load_robot
from bt_tasksim.trees import fallback, parallel, reactive_fallback, sequence

TOOL, HAND = Command(tool=np.arange(7.0)[None]), Command(hand=np.array([[0.3]]))


def test_parts_are_written_apart(toy, act):
    a, b = act("a"), act("b")
    stage = toy(sequence("root", a, b))
    context = stage.context
    context.write(TOOL, ONE, a)
    context.write(HAND, ONE, b)
    assert np.array_equal(context.command.tool, TOOL.tool[0])
    assert np.array_equal(context.command.hand, HAND.hand[0])
    assert context.tool_writer() is a
    context.withdraw(a, ONE)
    assert context.command.tool is None and np.array_equal(context.command.hand, HAND.hand[0])
    assert context.tool_writer() is None
    context.write(TOOL, ONE, b)
    assert np.array_equal(context.command.tool, TOOL.tool[0])
    stage.look()
    assert context.command == Command()


@pytest.mark.parametrize("part", ["tool", "hand", "tool hand"])
def test_two_leaves_that_write_one_part_are_both_named(toy, act, part):
    tree = parallel("both", act("left arm", part), act("right arm", part))
    first = part.split()[0]
    with pytest.raises(
        CommandConflictError, match=f"two leaves command the {first} in one tick: 'left arm' and 'right arm'"
    ):
        toy(tree).tick()
    assert all(node.status != Status.RUNNING for node in tree.iterate())


def test_leaves_of_one_name_are_two_leaves(toy, act):
    with pytest.raises(CommandConflictError, match="'move' and 'move'"):
        toy(parallel("both", act("move"), act("move"))).tick()


def test_two_leaves_that_write_different_parts_act_together(toy, act):
    stage = toy(parallel("both", act("move", "tool"), act("close", "hand")))
    stage.runner.tick()
    assert stage.context.command.tool[2] == 0.4 and stage.context.command.hand[0] == 0.5


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_target_that_is_not_finite_is_refused_by_the_leafs_name(toy, act, value):
    stage = toy(sequence("root", act("move", height=value)))
    with pytest.raises(LeafError, match=r"leaf 'move' .*commands a tool target that is not finite"):
        stage.tick()
    assert all(n.status != Status.RUNNING for n in stage.tree.iterate())
    assert stage.context.command == Command() and stage.world.steps == []


# ---- what an interrupted leaf has written -----------------------------------------------------------------


def test_a_fallback_acts_in_the_tick_in_which_a_parallel_fails(toy, act):
    first, instead = act("first", height=0.5), act("instead", height=0.3)
    tree = fallback("root", parallel("both", first, Failure("watch")), instead)
    stage = toy(tree)
    stage.runner.tick()
    assert first.status == Status.INVALID and instead.status == Status.RUNNING
    assert stage.context.command.tool[2] == 0.3


def test_the_same_later_on_and_with_the_hand(toy, act):
    first, watch = act("first", "tool hand", ticks=50), act("watch", "", ticks=50, timeout=0.12)
    instead = act("instead", "tool", ticks=50, height=0.3)
    stage = toy(fallback("root", parallel("both", first, watch), instead))
    stage.tick(3)
    assert first.status == Status.RUNNING
    stage.runner.tick()
    assert watch.outcome.is_a(TIMED_OUT) and watch.outcome.numbers == {"limit": 0.12}
    assert stage.context.command.tool[2] == 0.3
    assert stage.context.command.hand is None, (
        "the interrupted leaf's hand target is dropped: it keeps its last"
    )


def test_a_reactive_node_that_switches_leaves_one_command(toy, act):
    late, early = act("late", ticks=50, height=0.3), act("early", ticks=50, height=0.5)
    tree = sequence("root", reactive_fallback("until", TimePassed(0.1), early), late)
    stage = toy(tree)
    stage.tick(2)
    assert early.status == Status.RUNNING
    stage.runner.tick()
    assert early.status == Status.INVALID and early.outcome.is_a(INTERRUPTED)
    assert late.status == Status.RUNNING and stage.context.command.tool[2] == 0.3


# ---- goals and episodes -----------------------------------------------------------------------------------


def test_goals_are_reached_ended_and_forgotten_with_the_episode(toy, act):
    stage = toy(act("move"))
    stage.context.reach("holding", "cup", ONE)
    assert stage.context.reached("holding", "cup", ONE) and not stage.context.reached("holding", "box", ONE)
    stage.context.end("holding", "box", ONE)
    assert stage.context.reached("holding", "cup", ONE)
    stage.runner.begin(1)
    assert not stage.context.reached("holding", "cup", ONE)


def test_outside_an_episode_nothing_can_be_read():
    context = Context(load_robot("panda"))
    for read in (lambda: context.world, lambda: context.observation, lambda: context.seen(ONE, np.zeros(1))):
        with pytest.raises(RuntimeError, match="no episode has begun"):
            read()


def test_a_leaf_without_a_context_says_what_to_do():
    with pytest.raises(
        InputError, match=r"leaf 'grasp cup' needs a context: run the tree with bt_tasksim.run"
    ):
        Grasp("cup").setup()
    with pytest.raises(RuntimeError, match="'grasp cup' was ticked before it was set up"):
        Grasp("cup").tick_once()


def test_names_are_resolved_or_refused_with_the_nearest(toy, act):
    stage = toy(act("move"))
    seen = stage.context.seen(ONE, np.zeros(1))
    assert np.array_equal(seen.object("box"), stage.world.now.objects[None, 1])
    with pytest.raises(InputError, match="no object 'bax' in the scene; did you mean 'box'"):
        seen.object("bax")
    with pytest.raises(InputError, match="no place 'gaol' in the scene; did you mean 'goal'"):
        seen.place("gaol")
