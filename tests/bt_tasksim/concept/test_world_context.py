"""One world of a batch as a context of its own: it is the world's row, read and written."""

from types import SimpleNamespace

import numpy as np
import pytest

from bt_tasksim.concept.context import Context, Refusal
from bt_tasksim.concept.leaf import ONE
from bt_tasksim.concept.world_context import WorldContext
from bt_tasksim.core.errors import CommandConflictError, InputError, LeafError
from bt_tasksim.core.outcomes import OUT_OF_REACH
from bt_tasksim.core.world import Command, ObjectModel, WorldModel
from bt_tasksim.robot.description import load_robot


def world(*names):
    models = (ObjectModel(name, "cup", (0.1, 0.1, 0.1), 0, ((0.0, 1, 0),), (0.05,)) for name in names)
    return WorldModel(tuple(models), {}, ("l", "r"), 0.08, 0.05)


def observed(time):
    rng = np.random.default_rng(3)
    return SimpleNamespace(
        time=time + np.arange(2.0), tool_pose=rng.normal(size=(2, 7)), objects=rng.normal(size=(2, 2, 7))
    )


def hidden(rows):
    objects = np.arange(28.0).reshape(2, 2, 7)
    return SimpleNamespace(objects=objects if rows is None else objects[rows])


@pytest.fixture
def second():
    """A context of two worlds of unlike objects, and a view of the second."""
    context = Context(load_robot("panda"), 2)
    view = WorldContext(context, 1)
    with pytest.raises(RuntimeError, match="no episode has begun"):
        _ = view.observation
    context.ask_hidden = hidden
    context.begin([world("cup", "box"), world("box")])
    context.advance(observed(0.0))
    return context, view


def tools(*heights):
    return Command(tool=np.array([[0.0, 0, height, 1, 0, 0, 0] for height in heights]))


def test_it_sees_its_world_as_if_it_were_alone(second):
    context, view = second
    assert view.now == 1.0 and view.worlds == 1 and list(view.world.columns) == ["box"]
    seen = view.seen(ONE, np.array([0.5]))
    np.testing.assert_array_equal(seen.tool, context.observation.tool_pose[1:])
    np.testing.assert_array_equal(seen.object("box"), context.seen(ONE + 1, ONE).object("box"))
    with pytest.raises(InputError, match="no object 'cup'"):
        seen.object("cup")
    np.testing.assert_array_equal(view.hidden().objects, hidden(None).objects[1:, :1])
    context.advance(observed(5.0))
    assert view.now == 6.0 and view.observation.tool_pose.shape == (1, 7)
    np.testing.assert_array_equal(view.looked.tool_pose, context.looked.tool_pose[1:])
    context.begin([world("cup")], np.array([1]))
    assert list(view.world.columns) == ["cup"]


def test_goals_are_the_worlds_own_whoever_reached_them(second):
    context, view = second
    context.reach("holding", "box", np.array([0, 1]))
    assert view.reached("holding", "box", ONE).tolist() == [True]
    view.end("holding", "box", ONE)
    assert context.reached("holding", "box", context.rows).tolist() == [True, False]
    view.reach("holding", "cup", ONE)
    assert context.reached("holding", "cup", context.rows).tolist() == [False, True]


def test_what_it_writes_is_its_worlds_command(second, act):
    context, view = second
    a, b = act("a"), act("b")
    context.write(tools(0.1), ONE, a)
    assert view.command == Command() and view.tool_writer() is None
    view.write(tools(0.2), ONE, b)
    assert context.written.tool[:, 2].tolist() == [0.1, 0.2] and context.tool_writer(1) is b
    assert view.command.tool[2] == 0.2 and view.tool_writer() is b
    assert view.written_in(0).tool[0, 2] == view.written.tool[0, 2] == 0.2
    with pytest.raises(CommandConflictError, match="'b' and 'a'"):
        context.write(tools(0.3), ONE + 1, a)
    view.withdraw(b, ONE)
    assert view.command == Command() and context.tool_writer(0) is a


def test_what_is_not_finite_is_refused_as_in_a_world_alone(second, act):
    _, view = second
    view.write(tools(np.nan), ONE, act("a"))
    with pytest.raises(LeafError, match="leaf 'a' commands a tool target that is not finite"):
        _ = view.command


def test_a_refusal_is_its_worlds(second, act):
    context, view = second
    refusal = Refusal(act("a"), OUT_OF_REACH(what="it", distance=0.1, angle=0.0))
    context.refused[0] = refusal
    assert view.refused == {}
    context.refused[1] = refusal
    assert view.refused == {0: refusal}


def test_it_does_not_begin_by_itself(second):
    _, view = second
    for call in (lambda: view.begin([world("cup")]), lambda: view.advance(observed(0.0))):
        with pytest.raises(RuntimeError, match="a world of a batch"):
            call()


def test_what_led_nowhere_is_counted_in_its_world_and_successes_of_copies_are_not_kept(second, act):
    context, view = second
    view.led_nowhere("holding", "cup", 0)
    assert context.dead_ends("holding", "cup", np.arange(2)).tolist() == [0, 1]
    assert view.dead_ends("holding", "cup", ONE).tolist() == [1]
    model = act("a").model
    view.note(model, True, ONE)
    assert not view.succeeded([model], ONE).any() and not context.succeeded([model], np.arange(2)).any()
