"""What comes after a leaf: later siblings in sequences at any height, never a fallback's other children."""

from py_trees.composites import Selector, Sequence

from bt_tasksim.concept.following import following
from bt_tasksim.trees.nodes.any_order import any_order


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
