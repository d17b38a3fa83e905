"""What comes after a leaf: later siblings in sequences at any height, never a fallback's other children."""

import dataclasses

import numpy as np
from py_trees.composites import Selector, Sequence

from bt_tasksim import load_robot
from bt_tasksim.concept.batch_leaves import leaf_in_batch
from bt_tasksim.concept.context import Context
from bt_tasksim.concept.following import following
from bt_tasksim.core.batch_leaf import SUCCESS
from bt_tasksim.execution.batch import BatchTree
from bt_tasksim.execution.leaf_errors import set_up
from bt_tasksim.trees.nodes.any_order import any_order
from tests.conftest import SCENE, ToyWorld


def seq(*children):
    return Sequence("s", memory=True, children=list(children))


def either(*children):
    return Selector("f", memory=True, children=list(children))


def names(leaf):
    return [model.name_of for model in following(leaf)]


def leaves(act, *letters):
    out = []
    for letter in letters:
        leaf = act(letter)
        leaf.model.name_of = letter
        out.append(leaf)
    return out


def test_later_siblings_come_in_order_and_earlier_ones_do_not(act):
    a, b, c = leaves(act, "a", "b", "c")
    seq(a, b, c)
    assert [names(leaf) for leaf in (a, b, c)] == [["b", "c"], ["c"], []]


def test_those_of_each_sequence_above_follow(act):
    a, b, c, d = leaves(act, "a", "b", "c", "d")
    seq(seq(a, b), c, seq(d))
    assert names(a) == ["b", "c", "d"] and names(b) == ["c", "d"] and names(d) == []


def test_other_children_of_a_fallback_do_not_follow_but_what_is_under_a_later_one_may(act):
    a, b, c, d = leaves(act, "a", "b", "c", "d")
    seq(either(a, b), either(c, d))
    assert names(a) == names(b) == ["c", "d"]


def test_a_leaf_alone_is_followed_by_nothing(act):
    (a,) = leaves(act, "a")
    assert following(a) == ()


def test_a_concept_sees_what_follows(toy, act):
    a, b = leaves(act, "a", "b")
    found = []
    begin = a.model.begin
    a.model.begin = lambda seen: (found.append(tuple(seen.later)), begin(seen))[1]
    toy(seq(a, b)).tick()
    assert found == [(b.model,)]


def test_where_all_have_to_succeed_in_any_order_all_others_may_follow(act):
    a, b, c, d = leaves(act, "a", "b", "c", "d")
    seq(any_order("all", seq(a, b), c), d)
    assert names(a) == ["b", "c", "d"] and names(b) == ["c", "d"] and names(c) == ["a", "b", "d"]


def coming(leaf, said):
    """Write what is to come, by name, whenever a leaf begins: one list for each world."""
    begin = leaf.model.begin

    def asked(seen):
        rows = range(len(seen.tool))
        said.append((leaf.model.name_of, [[m.name_of for m in seen.to_come(k)] for k in rows]))
        return begin(seen)

    leaf.model.begin = asked


def test_what_has_succeeded_in_any_order_is_not_to_come_until_all_begins_anew(toy, act):
    a, b, c, d = leaves(act, "a", "b", "c", "d")
    said = []
    for leaf in (a, b, c, d):
        coming(leaf, said)
    tree = toy(seq(any_order("all", seq(a, b), c), d))
    expected = [("a", [["b", "c", "d"]]), ("b", [["c", "d"]]), ("c", [["d"]]), ("d", [[]])]
    tree.tick(100)
    assert said == expected
    tree.tick(100)
    assert said == 2 * expected, "all were stopped, and come again"
    tree.runner.begin(1)
    tree.tick(100)
    assert said == 3 * expected


def test_in_a_batch_each_world_has_what_is_to_come_there(act):
    a, b = leaves(act, "a", "b")
    said = []
    for leaf in (a, b):
        coming(leaf, said)
    robot = load_robot("panda")
    context = Context(robot, 2)
    tree = any_order("all", a, b)
    set_up(tree, context=context)
    batch = BatchTree(tree, 2, lambda leaf: leaf_in_batch(leaf, context))
    worlds = [ToyWorld() for _ in range(2)]
    drawn = [SCENE.sample(k) for k in range(2)]
    models = [d.world_model([tip.name for tip in robot.tips], robot.opening) for d in drawn]
    seen = [world.reset(d, m) for world, d, m in zip(worlds, drawn, models, strict=True)]
    context.begin(models)
    context.advance(both(seen))
    rows = np.arange(2)
    for _ in range(2):  # only the first world goes on
        batch.tick(rows[:1], context.times[:1])
        context.advance(both(seen), rows[:1])
    while (batch.status[:, 0] != SUCCESS).any():
        going = rows[batch.status[:, 0] != SUCCESS]
        batch.tick(going, context.times[going])
        context.advance(both(seen), going)
    assert said == [("a", [["b"]]), ("a", [["b"]]), ("b", [[]]), ("b", [[]])]
    batch.reset(rows)
    batch.tick(rows, context.times)
    assert said[4:] == [("a", [["b"], ["b"]])]


def both(seen):
    """Observations of two worlds as one."""
    return type(seen[0])(
        **{f.name: np.stack([getattr(one, f.name) for one in seen]) for f in dataclasses.fields(seen[0])}
    )
