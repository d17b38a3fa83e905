"""A concept in several worlds: whatever happens in them in one tick, each one goes on as it would alone."""

from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from py_trees.behaviours import Running

from bt_tasksim.concept.activation import LOST_TICKS, Activation, no_action
from bt_tasksim.concept.context import Context, Refusal
from bt_tasksim.concept.limit import Limit
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import ObjectName
from bt_tasksim.core import poses
from bt_tasksim.core.batch_leaf import FAILURE, RUNNING, SUCCESS
from bt_tasksim.core.bundles import taken
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.outcomes import (
    CANNOT_START,
    DONE,
    GOAL_LOST,
    LIMIT_VIOLATED,
    NO_WAY,
    OUT_OF_REACH,
    TIMED_OUT,
    Form,
    register_reason,
)
from bt_tasksim.core.units import METRES, NEWTONS, SECONDS
from bt_tasksim.core.world import Command, ObjectModel, WorldModel
from bt_tasksim.policy.policy import Action
from bt_tasksim.robot.description import load_robot
from tests.array_libraries import elsewhere

ROBOT = load_robot("panda")
TOO_HIGH = register_reason("test_starts_too_high", "the tool is {value} high", value=METRES)
TOO_HARD = register_reason("test_too_hard", "{value}, more than {limit}", value=NEWTONS, limit=NEWTONS)
STANDS = Form("{gone:.2f} gone, {what}", {"gone": SECONDS})
PERIOD = 0.05


class TaskMemory(NamedTuple):
    ticks: np.ndarray
    start: np.ndarray


class Task(ConceptModel[TaskMemory]):
    """Everything that can happen to a concept happens to it, by what is seen."""

    target: ObjectName = "cup"
    actions = 1
    maintains = ("holding",)
    reaches = ("moved",)
    ends = ("holding",)
    default_timeout = 0.42

    def initial_state(self, seen):
        return TOO_HIGH.where(seen.tool[:, 2] > 0.6, value=seen.tool[:, 2])

    def begin(self, seen):
        if (seen.tool[:, 0] < 0.0).any():
            raise NoWayError("no way back")
        return TaskMemory(np.zeros(len(seen.tool), int), seen.tool)

    def advance(self, action, seen, memory):
        return memory._replace(ticks=memory.ticks + 1)

    def programmed_motion(self, seen, memory):
        return np.sin(10.0 * seen.tool[:, 2:3] + memory.ticks[:, None])

    def command(self, action, seen, memory):
        by = action * np.array([0.01, 0.02, 0.03])
        return Command(tool=poses.shifted(poses.multiply(memory.start, seen.object("cup")), by))

    def done(self, seen, memory):
        return seen.closure > 0.9

    def limits(self, seen, memory):
        force = poses.norm(seen.wrench[:, :3])
        return (Limit(TOO_HARD, force, 50.0, counts=seen.elapsed > 0.0),)

    def maintained(self, goal, seen, memory):
        return seen.contacts[:, 0]

    def explain(self, seen, memory):
        heights = tuple(f"{height:.3f} m high" for height in seen.tool[:, 2].tolist())
        return STANDS(gone=seen.elapsed, what=heights)


def world(k):
    """Unlike ones: some have a second object."""
    cup = ObjectModel("cup", "cup", (0.1, 0.1, 0.1 + 0.01 * k), 0, ((0.0, 1.0, 0.0),), (0.05,))
    box = ObjectModel("box", "box", (0.1, 0.1, 0.1), 2, ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0)), (0.05, 0.06))
    return WorldModel((cup, box) if k % 2 else (cup,), {}, ("left", "right"), 0.08, PERIOD)


class Story:
    """What is seen in so many worlds at so many ticks; nothing happens unless it is told."""

    def __init__(self, worlds, ticks, seed=0):
        rng, shape = np.random.default_rng(seed), (ticks, worlds)
        self.worlds, self.ticks = worlds, ticks
        self.tool = np.concatenate(
            [rng.uniform(0.1, 0.5, (*shape, 3)), rng.normal(size=(*shape, 4))], axis=-1
        )
        self.tool[..., 3:] = poses.normalise(self.tool[..., 3:])
        self.objects = np.concatenate(
            [rng.uniform(0.1, 0.5, (*shape, 2, 3)), rng.normal(size=(*shape, 2, 4))], axis=-1
        )
        self.objects[..., 3:] = poses.normalise(self.objects[..., 3:])
        self.wrench = rng.normal(size=(*shape, 6))
        self.closure = np.zeros(shape)
        self.contacts = np.ones((*shape, 2), bool)
        self.ticked = np.ones(shape, bool)
        self.refused = np.zeros(shape, bool)
        self.starts = rng.integers(0, 40, worlds) * PERIOD
        """When each world's episode is by its own clock at the first tick."""

    def at(self, tick, who):
        return SimpleNamespace(
            time=tick * PERIOD + self.starts[who],
            tool_pose=self.tool[tick, who],
            objects=self.objects[tick, who],
            wrench=self.wrench[tick, who],
            closure=self.closure[tick, who],
            contacts=self.contacts[tick, who],
        )


class Told(NamedTuple):
    """What became of a concept in one world in one tick."""

    tick: int
    status: int
    outcome: object
    command: bytes
    memory: object
    activations: int
    moved: bool
    holding: bool


def told(story, who, model=None):
    """What becomes of the worlds ``who`` of a story in each tick, in one batch."""
    who = np.asarray(who)
    context = Context(ROBOT, len(who))
    leaf, model = Running("leaf"), Task.value() if model is None else model
    activation = Activation(leaf, model, context)
    context.begin([world(k) for k in who.tolist()])
    context.reach("holding", "cup", context.rows)
    running, out = np.zeros(len(who), bool), [[] for _ in who]
    for tick in range(story.ticks):
        context.advance(story.at(tick, who))
        for row in np.flatnonzero(story.refused[tick, who]).tolist():
            context.refused[row] = Refusal(leaf, OUT_OF_REACH(what=f"{who[row]}", distance=0.1, angle=0.2))
        rows = np.flatnonzero(story.ticked[tick, who])
        if not len(rows):
            continue
        judged = activation.judge(rows, ~running[rows])
        motion = model.programmed_motion(judged.seen, judged.memory) if len(judged.rows) else np.zeros((0, 1))
        done = model.done(judged.seen, judged.memory) if len(judged.rows) else np.zeros(0, bool)
        statuses = activation.act(judged, Action(motion, done))
        running[rows] = statuses == RUNNING
        written = context.written
        for row, status in zip(rows.tolist(), statuses.tolist(), strict=True):
            outcome = activation.outcomes.get(row)
            command = written.of_world(row).tool
            memory = (
                [part.tolist() for part in taken(activation.memory, np.array([row]))]
                if running[row]
                else None
            )
            goals = [bool(context.reached(g, "cup", np.array([row]))[0]) for g in ("moved", "holding")]
            out[row].append(
                Told(
                    tick, status, None if outcome is None else outcome.to_data(),
                    b"" if command is None else command.tobytes(),
                    memory, int(activation.activations[row]), *goals,
                )
            )  # fmt: skip
    return out


def each_as_alone(story, *orders):
    """In any order and company each world is told as it is alone; gives what is told of all."""
    alone = [told(story, [k])[0] for k in range(story.worlds)]
    for order in (np.arange(story.worlds), *orders):
        for k, of_world in zip(order, told(story, order), strict=True):
            assert of_world == alone[k], f"world {k}"
    return alone


EVENT = LOST_TICKS + 3


def eventful():
    """In one tick, `EVENT`, each world has something else."""
    story = Story(9, EVENT + 3)
    began = story.ticked
    began[:EVENT, [0, 1, 8]] = False
    story.tool[EVENT, 0, 2] = 0.7
    story.tool[EVENT, 1, 0] = -0.1
    story.wrench[EVENT, 2, 0] = 80.0
    story.contacts[EVENT - LOST_TICKS + 1 : EVENT + 1, 3] = False
    began[: EVENT - 2, 4] = False
    story.closure[EVENT, 4] = 1.0
    story.refused[EVENT, 5] = True
    return story


def test_whatever_happens_in_one_tick_each_world_is_as_it_is_alone():
    story = eventful()
    alone = each_as_alone(story, np.arange(9)[::-1], np.random.default_rng(1).permutation(9))
    now = [next(t for t in of_world if t.tick == EVENT) for of_world in alone]
    assert [t.status for t in now] == [FAILURE] * 4 + [SUCCESS, FAILURE, RUNNING, RUNNING, RUNNING]
    reasons = [t.outcome and t.outcome["reason"] for t in now]
    assert reasons == [
        CANNOT_START.name, CANNOT_START.name, LIMIT_VIOLATED.name, GOAL_LOST.name, DONE.name,
        OUT_OF_REACH.name, None, None, None,
    ]  # fmt: skip
    assert now[0].outcome["detail"]["reason"] == TOO_HIGH.name
    assert now[0].outcome["detail"]["numbers"] == {"value": 0.7}
    assert now[1].outcome["detail"]["reason"] == NO_WAY.name
    assert now[2].outcome["detail"]["reason"] == TOO_HARD.name
    assert now[2].outcome["detail"]["detail"]["names"]["what"].endswith("m high"), "what was measured is kept"
    assert now[4].outcome["numbers"] == pytest.approx({"elapsed": 2 * PERIOD})
    assert [bool(t.command) for t in now] == [False] * 6 + [True] * 3
    assert [(t.moved, t.holding) for t in now[2:6]] == [
        (False, True), (False, False), (True, False), (False, True)
    ]  # fmt: skip
    assert [t.activations for t in now] == [1] * 9


class Elsewhere(Task):
    """The same, whose answers are on another device."""

    def initial_state(self, seen):
        high = elsewhere(seen.tool[:, 2])
        return TOO_HIGH.where(high > 0.6, value=high)

    def violated(self, seen, memory):
        return elsewhere(super().violated(seen, memory))

    def maintained(self, goal, seen, memory):
        return elsewhere(super().maintained(goal, seen, memory))

    def done(self, seen, memory):
        return elsewhere(super().done(seen, memory))


def test_answers_are_taken_from_whatever_device_they_are_on():
    assert told(eventful(), range(9), Elsewhere.value()) == told(eventful(), range(9))


def test_a_time_out_counts_from_the_begin_in_each_world():
    story = Story(3, 14)
    for k in range(3):
        story.ticked[:k, k] = False
    story.closure[9, 0] = 1.0  # done in the tick in which it is late: it is done
    alone = each_as_alone(story, [2, 0, 1])
    ends = [next(t for t in of_world if t.status != RUNNING) for of_world in alone]
    assert [(t.tick, t.status) for t in ends] == [(9, SUCCESS), (10, FAILURE), (11, FAILURE)]
    assert [t.outcome["reason"] for t in ends[1:]] == [TIMED_OUT.name] * 2
    assert ends[1].outcome["numbers"] == {"limit": 0.42}
    again = [
        next(t for t in of_world if t.tick > end.tick) for of_world, end in zip(alone, ends, strict=True)
    ]
    assert [(t.status, t.activations) for t in again] == [(RUNNING, 2)] * 3, "and it begins anew"


@pytest.mark.parametrize("seed", range(6))
def test_random_stories_are_told_of_each_world_as_alone(seed):
    rng, worlds, ticks = np.random.default_rng(seed), 7, 60
    story, shape = Story(worlds, ticks, seed), (ticks, worlds)
    story.tool[..., 2][rng.random(shape) < 0.1] = 0.8
    story.tool[..., 0][rng.random(shape) < 0.1] *= -1.0
    story.wrench[..., 1][rng.random(shape) < 0.03] = -90.0
    story.contacts[..., 0] = rng.random(shape) < 0.7
    story.closure[rng.random(shape) < 0.05] = 1.0
    story.ticked = rng.random(shape) < 0.9
    story.refused = rng.random(shape) < 0.02
    alone = each_as_alone(story, rng.permutation(worlds))
    assert {t.status for of_world in alone for t in of_world} == {RUNNING, SUCCESS, FAILURE}


def test_a_world_without_a_way_does_not_keep_the_others_from_beginning():
    story = Story(4, 3)
    story.tool[0, 2, 0] = -0.2
    alone = each_as_alone(story, [2, 3, 0, 1])
    assert [of_world[0].status for of_world in alone] == [RUNNING, RUNNING, FAILURE, RUNNING]
    assert [of_world[1].activations for of_world in alone] == [1, 1, 2, 1]


def test_a_refusal_of_a_leafs_command_is_not_that_of_another_ones():
    context = Context(ROBOT, 2)
    activation = Activation(Running("leaf"), Task.value(), context)
    context.begin([world(0), world(1)])
    context.advance(Story(2, 1).at(0, np.arange(2)))
    context.refused[1] = Refusal(Running("other"), OUT_OF_REACH(what="it", distance=0.1, angle=0.0))
    judged = activation.judge(np.arange(2), np.array([True, True]))
    assert judged.statuses.tolist() == [RUNNING, RUNNING] and not activation.outcomes


def test_a_goal_that_nobody_reached_in_a_world_is_not_maintained_there():
    story = Story(2, LOST_TICKS + 1)
    story.contacts[:] = False
    context = Context(ROBOT, 2)
    activation = Activation(Running("leaf"), Task.value(), context)
    context.begin([world(0), world(0)])
    context.reach("holding", "cup", np.array([1]))
    for tick in range(LOST_TICKS):
        context.advance(story.at(tick, np.arange(2)))
        judged = activation.judge(np.arange(2), np.full(2, tick == 0))
        activation.act(judged, no_action(judged, 1))
    assert judged.statuses.tolist() == [RUNNING, FAILURE]
    assert activation.outcomes[1].is_a(GOAL_LOST) and 0 not in activation.outcomes


def test_shares_of_done_add_up_in_each_world_for_itself():
    story, context = Story(3, 5), Context(ROBOT, 3)
    activation = Activation(Running("leaf"), Task.value(), context)
    context.begin([world(k) for k in range(3)])
    said = []
    for tick in range(4):
        context.advance(story.at(tick, np.arange(3)))
        judged = activation.judge(np.arange(3), np.full(3, tick == 0))
        shares = np.array([0.25, 0.5, 0.0])[judged.going]
        said.append(activation.act(judged, Action(np.zeros((len(shares), 1)), shares)).tolist())
    assert [s[0] for s in said] == [RUNNING] * 3 + [SUCCESS] and said[1][1] == SUCCESS
    assert [s[2] for s in said] == [RUNNING] * 4


def test_no_action_is_the_middle_of_an_action_and_not_done():
    context = Context(ROBOT, 2)
    activation = Activation(Running("leaf"), Task.value(), context)
    context.begin([world(0), world(1)])
    context.advance(Story(2, 1).at(0, np.arange(2)))
    action = no_action(activation.judge(np.array([1]), np.array([True])), 3)
    assert action.motion.tolist() == [[0.0] * 3] and action.terminate.tolist() == [False]


class Take(Task):
    """What comes before: it reaches what a task maintains."""

    maintains = ()
    reaches = ("holding",)
    ends = ()


def test_a_task_without_a_way_counts_against_what_came_before_it_in_its_own_world():
    story, context = Story(2, 1), Context(ROBOT, 2)
    story.tool[0, 1, 0] = -0.2
    worlds, fresh = np.arange(2), np.array([True, True])
    take, task = (Activation(Running("leaf"), kind.value(), context) for kind in (Take, Task))
    other = Activation(Running("leaf"), Take.value(target="box"), context)
    context.begin([world(1), world(1)])
    context.advance(story.at(0, worlds))
    assert take.seen(worlds).failures.tolist() == [0, 0]
    task.judge(worlds, fresh)
    assert take.seen(worlds).failures.tolist() == [0, 1]
    assert other.seen(worlds).failures.tolist() == [0, 0], "that is about another object"
    context.begin([world(1)], np.array([1]))
    context.advance(story.at(0, worlds))
    assert take.seen(worlds).failures.tolist() == [0, 0], "and another episode"


@pytest.mark.parametrize(
    ("end", "counted"),
    [(TIMED_OUT, [1, 2, 3]), (TOO_HARD, [1, 2, 3]), (GOAL_LOST, [0, 1, 1])],
    ids=["late", "broken", "lost"],
)
def test_a_task_that_fails_counts_against_what_came_before_it_and_every_second_loss_does(end, counted):
    """What is lost once may have been knocked out of the hand."""
    story, row, ticks = Story(1, 60), np.array([0]), iter(range(60))
    story.contacts[:] = end is not GOAL_LOST
    story.wrench[..., 0] = 60.0 if end is TOO_HARD else 0.0
    context = Context(ROBOT, 1)
    take, task = (Activation(Running("leaf"), kind.value(), context) for kind in (Take, Task))
    context.begin([world(1)])
    for wanted in counted:
        fresh, ended = True, False
        while not ended:
            context.advance(story.at(next(ticks), row))
            if fresh:
                context.reach("holding", "cup", row)
            judged = task.judge(row, np.array([fresh]))
            ended = not len(judged.rows) or int(task.act(judged, no_action(judged, 1))[0]) != RUNNING
            fresh = False
        assert task.outcomes[0].is_a(end)
        assert take.seen(row).failures.tolist() == [wanted]
