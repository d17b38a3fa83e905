"""Worlds of one batch that hold unlike objects: what concepts see of each has its names."""

import dataclasses

import numpy as np
import pytest

from bt_tasksim.concept.context import Context
from bt_tasksim.concept.seen import Known
from bt_tasksim.core.errors import UnreachableError
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.worlds import BatchWorlds, hidden_of
from bt_tasksim.robot.description import load_robot
from tests.unlike_worlds import holding

pytestmark = pytest.mark.physical
ROBOT = load_robot("panda")
TIPS = [tip.name for tip in ROBOT.tips]
UNLIKE = [
    holding("target", "box"),
    holding("box", "target"),
    holding("box"),
    holding("tall", "box", "target", fixtures=("stand",)),
]


class Batch:
    """Worlds and the context of a tree in them."""

    def __init__(self, count, engines="sapien"):
        self.worlds = BatchWorlds(ROBOT, EngineOptions(engines=engines), count, 1)
        self.context = Context(ROBOT, count)
        self.context.ask_hidden = self.worlds.hidden

    def begin(self, drawn):
        """Begin worlds by row, and look at those that could."""
        rows = np.array(list(drawn))
        models = [world.world_model(TIPS, ROBOT.opening) for world in drawn.values()]
        self.context.begin(models, rows)
        self.worlds.reset(rows, list(drawn.values()))
        failed = self.worlds.errors(rows)
        begun = np.array([row for row in rows.tolist() if row not in failed], int)
        if len(begun):
            self.look(begun)
        return failed

    def look(self, rows):
        self.context.advance(self.worlds.observe(rows), rows)

    def names(self, row, drawn):
        """What is known of a world, by name."""
        rows = np.array([row])
        seen = self.context.seen(rows, np.zeros(1))
        known = Known(self.context.hidden(rows), seen.world)
        out = [seen.tool, seen.observation.contact_points, seen.observation.motion]
        for actor in drawn.objects:
            name = actor.name
            out += [seen.object(name), known.object(name), known.velocity(name), known.hand_force(name)]
            out += [known.supported(name), seen.model(name).extent]
        return out + [seen.place(place.name).pose for place in drawn.places]


def drawn(k, seed=0):
    return UNLIKE[k].sample(seed)


def alone(k, seed=0):
    """What is known of a world that is alone in its batch."""
    batch = Batch(1)
    batch.begin({0: drawn(k, seed)})
    return batch.names(0, drawn(k, seed))


def same(found, expected):
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_array_equal(a, b)
        assert a.shape == b.shape and not np.isnan(np.asarray(a, float)).any()


@pytest.mark.parametrize("order", [(0, 1, 2, 3), (3, 2, 1, 0), (2, 1, 0), (1, 0)])
def test_what_is_seen_has_the_names_of_its_world(order):
    batch = Batch(len(order))
    batch.begin({row: drawn(k) for row, k in enumerate(order)})
    for row, k in enumerate(order):
        same(batch.names(row, drawn(k)), alone(k))
    n = len(batch.context.world.columns)
    hidden = batch.context.hidden()
    assert batch.context.observation.objects.shape == (len(order), n, 7)
    assert [getattr(hidden, name).shape[1] for name in ("objects", "velocities", "support")] == [n] * 3
    present = batch.context.world.object_facts.present
    np.testing.assert_array_equal(np.isnan(hidden.objects).all(axis=-1), ~present)
    assert not hidden.support[~present].any()


def test_a_world_that_begins_later_may_have_more_or_the_same_in_another_order():
    batch, now = Batch(3), {0: (2, 0), 1: (2, 1), 2: (2, 2)}
    batch.begin({row: drawn(*at) for row, at in now.items()})
    for row, at in ((1, (0, 1)), (0, (3, 4)), (1, (1, 5)), (0, (2, 6)), (2, (1, 7)), (0, (0, 0))):
        now[row] = at
        batch.begin({row: drawn(*at)})
        for row, at in now.items():
            same(batch.names(row, drawn(*at)), alone(*at))


def test_one_world_after_the_other_may_order_its_objects_otherwise():
    batch = Batch(1)
    for k in (0, 1, 3, 0):
        batch.begin({0: drawn(k)})
        same(batch.names(0, drawn(k)), alone(k))


def test_what_an_object_touches_is_said_of_objects_by_column_and_then_of_the_worlds_own_fixtures():
    batch, order = Batch(2), (3, 1)
    batch.begin({row: drawn(k) for row, k in enumerate(order)})
    batch.worlds.step(batch.worlds.observation.tool_pose, np.zeros((2, 1)), np.arange(2))
    support, columns = batch.context.hidden().support, batch.context.world.columns
    for row, k in enumerate(order):
        world = drawn(k)
        own = hidden_of(batch.worlds.hidden(), row, len(world.objects), len(world.fixtures)).support
        objects = [columns[actor.name] for actor in world.objects]
        bodies = [*objects, *(len(columns) + f for f in range(len(world.fixtures)))]
        np.testing.assert_array_equal(support[row][objects][:, bodies], own)
        assert support[row].sum() == own.sum() >= len(objects), "each stands on something"


def test_worlds_that_order_their_objects_alike_are_seen_as_they_are():
    batch = Batch(3)
    batch.begin({row: drawn(0, row) for row in range(3)})
    assert batch.context.observation is batch.worlds.observation
    batch.begin({1: drawn(0, 7)})
    assert batch.context.observation is batch.worlds.observation


@pytest.mark.parametrize("first", [[1], [2, 0], [2]])
def test_the_first_look_at_some_worlds_is_of_all(first):
    batch = Batch(3)
    batch.begin({row: drawn(0, row) for row in first})
    seen, others = batch.worlds.observation, np.setdiff1d(np.arange(3), first)
    assert {getattr(seen, field.name).shape[0] for field in dataclasses.fields(seen)} == {3}
    assert np.isnan(seen.time[others]).all() and np.isnan(seen.objects[others]).all()
    assert not seen.contacts[others].any() and seen.contacts.dtype == bool
    for row in first:
        same(batch.names(row, drawn(0, row)), alone(0, row))
    batch.begin({row: drawn(1, row) for row in others.tolist()})
    for row in range(3):
        k = 0 if row in first else 1
        same(batch.names(row, drawn(k, row)), alone(k, row))


@pytest.mark.parametrize("row", [0, 1])
def test_a_world_that_cannot_begin_leaves_the_others_alone_whatever_it_holds(row):
    far = dataclasses.replace(drawn(3), hand_start=(3.0, 0.0, 0.3, 0.0))
    other = 1 - row
    for rounds in ([{row: far, other: drawn(0)}], [{other: drawn(0)}, {row: far}]):
        batch = Batch(2)
        for some in rounds:
            failed = batch.begin(dict(sorted(some.items())))
        assert list(failed) == [row] and isinstance(failed[row], UnreachableError)
        same(batch.names(other, drawn(0)), alone(0))
        batch.look(np.array([other]))
        same(batch.names(other, drawn(0))[3:], alone(0)[3:])
        assert list(batch.worlds.errors(np.arange(2))) == [row], "it has not begun so far"
        assert not batch.begin({row: drawn(1)}) and not batch.worlds.errors(np.arange(2))
