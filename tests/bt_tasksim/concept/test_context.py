"""What leaves read and write: one writer a part and tick, and what an interrupted leaf wrote is dropped."""

from types import SimpleNamespace

import numpy as np
import pytest
from py_trees.behaviours import Failure
from py_trees.common import Status

from bt_tasksim.concept.context import Context, Refusal, one_world
from bt_tasksim.concept.leaf import ONE
from bt_tasksim.concept_nodes import Grasp, TimePassed
from bt_tasksim.core.errors import CommandConflictError, InputError, LeafError
from bt_tasksim.core.outcomes import INTERRUPTED, OUT_OF_REACH, TIMED_OUT
from bt_tasksim.core.world import Command, ObjectModel, WorldModel
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


# ---- several worlds ---------------------------------------------------------------------------------------

ROBOT = load_robot("panda")


def world(name="cup"):
    return WorldModel(
        (ObjectModel(name, "cup", (0.1, 0.1, 0.1), 0, ((0.0, 1, 0),), (0.05,)),), {}, ("l", "r"), 0.08, 0.05
    )


@pytest.fixture
def three(act):
    """A context of three worlds at their first tick, and two leaves."""
    context = Context(ROBOT, 3)
    context.begin([world(), world(), world()])
    context.advance(observed(3))
    return context, act("a"), act("b")


def observed(n, time=0.0):
    rng = np.random.default_rng(3)
    return SimpleNamespace(
        time=np.full(n, time) + np.arange(n),
        tool_pose=rng.normal(size=(n, 7)),
        objects=rng.normal(size=(n, 2, 7)),
    )


def rows(*numbers):
    return np.array(numbers)


def tools(*heights):
    return Command(tool=np.array([[0.0, 0, height, 1, 0, 0, 0] for height in heights]))


def test_leaves_write_in_their_own_worlds(three):
    context, a, b = three
    context.write(tools(0.1, 0.3), rows(0, 2), a)
    context.write(Command(hand=np.array([[0.5]])), rows(1), b)
    context.write(tools(0.2), rows(1), b)
    found = context.written
    assert found.tool[:, 2].tolist() == [0.1, 0.2, 0.3]
    assert [found.of_world(k).hand is None for k in range(3)] == [True, False, True]
    assert found.of_world(1).hand.tolist() == [0.5]
    assert [context.tool_writer(k) for k in range(3)] == [a, b, a]
    context.advance(observed(3, 0.05))
    assert context.written.tool is None and context.tool_writer(1) is None


def test_a_conflict_in_one_world_is_a_conflict_and_apart_they_are_none(three):
    context, a, b = three
    context.write(tools(0.1, 0.2), rows(0, 1), a)
    context.write(tools(0.3), rows(2), b)
    with pytest.raises(CommandConflictError, match="two leaves command the tool in one tick: 'b' and 'a'"):
        context.write(tools(0.4), rows(2), a)
    with pytest.raises(CommandConflictError, match="'a' and 'b'"):
        context.write(tools(0.4, 0.5), rows(1, 2), b)


def test_what_is_withdrawn_in_one_world_stays_in_the_others(three):
    context, a, b = three
    given = tools(0.1, 0.2, 0.3)
    context.write(given, rows(0, 1, 2), a)
    context.withdraw(a, rows(1))
    context.withdraw(b, rows(0))
    context.write(tools(0.9), rows(1), b)
    assert context.written.tool[:, 2].tolist() == [0.1, 0.9, 0.3]
    assert [context.tool_writer(k) for k in range(3)] == [a, b, a]
    assert given.tool[:, 2].tolist() == [0.1, 0.2, 0.3], "what was given is not changed"
    context.withdraw(b, rows(1))
    assert context.written.of_world(1) == Command() and context.written.of_world(2).tool[2] == 0.3


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_target_that_is_not_finite_in_one_world_is_said_with_its_leaf(three, value):
    context, a, b = three
    context.write(tools(0.1, 0.2), rows(0, 1), a)
    context.write(tools(value), rows(2), b)
    with pytest.raises(LeafError, match="leaf 'b' commands a tool target that is not finite"):
        _ = context.written
    context.withdraw(b, rows(2))
    assert context.written.of_world(2) == Command()


@pytest.mark.parametrize(
    "command",
    [
        Command(tool=np.zeros(7)), Command(tool=np.zeros((3, 7))), Command(tool=np.zeros((2, 6))),
        Command(hand=np.zeros(2)), Command(hand=np.zeros((1, 1))), Command(hand=np.zeros((2, 0))),
    ],
)  # fmt: skip
def test_a_target_without_a_row_for_each_of_its_worlds_is_refused(three, command):
    context, a, _ = three
    with pytest.raises(
        LeafError, match=r"leaf 'a' \(conftest.py:\d+\) commands (tool|hand)=.* of each world"
    ):
        context.write(command, rows(0, 2), a)
    assert context.written.of_world(0) == Command()


@pytest.mark.parametrize(
    "hand", [np.array([["much"], ["more"]]), np.zeros((2, 50)), np.zeros((2, 1), complex), [["a"], ["b"]]]
)
@pytest.mark.parametrize("where", [(0, 2), (0, 1)])
def test_a_hand_target_that_is_no_number_or_too_many_is_refused(act, hand, where):
    context, a = Context(ROBOT, where[1] + 1), act("a")
    with pytest.raises(LeafError, match=r"leaf 'a' .* commands hand=.* 1 at most"):
        context.write(Command(hand=hand), rows(*where), a)


@pytest.mark.parametrize("first", [0, 1])
def test_a_hand_with_synergies_in_one_world_and_without_in_another(act, first):
    context, a, b = Context(load_robot("xarm7_ability"), 3), act("a"), act("b")
    context.begin([world(), world(), world()])
    context.advance(observed(3))
    writes = [
        (Command(hand=np.array([[0.5]])), rows(0), a),
        (Command(hand=np.array([[0.6, 0.2]])), rows(1), b),
    ]
    for write in (writes[first], writes[1 - first]):
        context.write(*write)
    found = context.written
    assert found.of_world(0).hand.tolist() == [0.5, 0.0] and found.of_world(1).hand.tolist() == [0.6, 0.2]
    assert found.of_world(2).hand is None


def test_goals_are_each_worlds_own(three):
    context, _, _ = three
    context.reach("holding", "cup", rows(0, 2))
    context.end("holding", "cup", rows(2))
    context.reach("holding", "box", rows(1))
    everywhere = rows(0, 1, 2)
    assert context.reached("holding", "cup", everywhere).tolist() == [True, False, False]
    assert context.reached("holding", "box", rows(2, 1)).tolist() == [False, True]
    context.reach("holding", "cup", everywhere)
    context.begin([world("box")], rows(1))
    assert context.reached("holding", "cup", everywhere).tolist() == [True, False, True]
    assert context.reached("holding", "box", everywhere).tolist() == [False] * 3


def test_a_world_that_begins_anew_forgets_its_refusal_and_has_other_objects(three):
    context, a, _ = three
    refusal = Refusal(a, OUT_OF_REACH(what="it", distance=0.1, angle=0.0))
    context.refused.update({0: refusal, 2: refusal})
    context.begin([world("box")], rows(2))
    assert list(context.refused) == [0]
    assert context.world.object("box").present.tolist() == [False, False, True]
    context.advance(observed(3))
    assert not context.refused


def test_what_is_seen_of_some_worlds_is_theirs(three):
    context, _, _ = three
    context.begin([world("box"), world()], rows(1, 2))
    whole, some = context.seen(context.rows, np.arange(3.0)), context.seen(rows(0, 2), np.array([0.5, 0.7]))
    assert np.array_equal(some.tool, whole.tool[[0, 2]]) and some.elapsed.tolist() == [0.5, 0.7]
    for name, column in (("cup", 0), ("box", 1)):
        np.testing.assert_array_equal(whole.observed(name), context.observation.objects[:, column])
        np.testing.assert_array_equal(some.observed(name), whole.observed(name)[[0, 2]])
        np.testing.assert_array_equal(some.object(name), whole.object(name)[[0, 2]])
    first = observed(3).objects[:, 0]
    np.testing.assert_array_equal(whole.observed("cup")[[0, 2]], first[[0, 2]])
    np.testing.assert_array_equal(whole.observed("box")[1], first[1], "its only object")
    assert np.isnan(whole.object("box")[[0, 2]]).all() and np.isnan(whole.object("cup")[1]).all()
    assert (
        some.model("cup").present.tolist() == [True, True]
        and some.model("box").present.tolist() == [False] * 2
    )
    again = whole.at(rows(0, 2))
    assert np.array_equal(again.tool, some.tool) and again.elapsed.tolist() == [0.0, 2.0]
    assert again.model("box").present.tolist() == [False] * 2
    assert context.times.tolist() == [0.0, 1.0, 2.0] and context.now == 0.0


def test_worlds_in_the_middle_of_a_tick_keep_what_was_written(three):
    context, a, b = three
    context.write(tools(0.1, 0.2, 0.3), rows(0, 1, 2), a)
    context.refused[0] = context.refused[1] = Refusal(a, OUT_OF_REACH(what="it", distance=0.1, angle=0.0))
    context.advance(observed(3), rows(1, 2))
    assert context.tool_writer(0) is a and context.tool_writer(1) is None and list(context.refused) == [0]
    context.write(tools(0.9), rows(2), b)
    found = context.written
    assert [found.of_world(k).tool is None for k in range(3)] == [False, True, False]
    assert found.tool[0, 2] == 0.1 and found.tool[2, 2] == 0.9


def test_a_single_world_has_an_axis_of_its_own():
    bundle = one_world(SimpleNamespace(tool_pose=np.arange(7.0), time=np.float64(2.0)))
    assert bundle.tool_pose.shape == (1, 7) and bundle.time.tolist() == [2.0]


@pytest.mark.parametrize("first", [np.array([[1]]), np.array([[0.7]], np.float32)])
def test_whole_numbers_and_short_ones_of_one_world_change_no_other(three, first):
    context, a, b = three
    context.write(Command(hand=first), rows(0), a)
    context.write(Command(hand=np.array([[1.0 / 3.0]])), rows(2), b)
    hand = context.written.hand
    assert hand[0, 0] == first[0, 0] and np.isnan(hand[1, 0]) and hand[2, 0] == 1.0 / 3.0
