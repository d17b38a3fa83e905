"""Train: what it marks, that it changes nothing in execution, and what follows it."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from py_trees.behaviour import Behaviour
from py_trees.common import Status
from toys import Below, Check, Move, Raise, Turn, Unprogrammed

from bt_tasksim.concept_nodes import Grasp, Pick, Wait
from bt_tasksim.core.errors import InputError
from bt_tasksim.trees import (
    fallback,
    force_failure,
    force_success,
    invert,
    parallel,
    reactive_sequence,
    retry,
    sequence,
    subtree,
    timeout,
)
from bt_tasksim.trees.nodes.train import Train, concepts_in, follower_of, train_nodes

ANSWERS = {"R": Status.RUNNING, "S": Status.SUCCESS, "F": Status.FAILURE}


class Scripted(Behaviour):
    """Answers by a script, over and over, and notes what happens to it."""

    def __init__(self, script):
        super().__init__(script)
        self.script, self.asked, self.log = script, 0, []

    def update(self):
        answer = self.script[self.asked % len(self.script)]
        self.asked += 1
        self.log.append(answer)
        return ANSWERS[answer]

    def terminate(self, new_status):
        self.log.append(new_status.name)


@settings(max_examples=80, deadline=None)
@given(st.lists(st.text("RSF", min_size=1, max_size=4), min_size=1, max_size=3), st.integers(0, 7))
def test_ticks_and_statuses_pass_through(scripts, where):
    def grown(mark):
        leaves = [Scripted(s) for s in scripts]
        marked = leaves[where % len(leaves)]
        children = [mark(leaf) if leaf is marked else leaf for leaf in leaves]
        return sequence("root", fallback("f", *children[:2]), *children[2:]), leaves

    plain, expected = grown(lambda leaf: leaf)
    tree, leaves = grown(Train)
    for _ in range(8):
        plain.tick_once()
        tree.tick_once()
        assert tree.status == plain.status
    tree.stop(Status.INVALID)
    plain.stop(Status.INVALID)
    assert [leaf.log for leaf in leaves] == [leaf.log for leaf in expected]


def test_a_marked_tree_runs_as_an_unmarked_one(toy):
    def run(mark):
        stage = toy(sequence("root", mark(Raise()), Move(0.4)))
        statuses = [stage.tick() for _ in range(12)]
        return statuses, [c.tool.tolist() for c in stage.world.steps]

    found = run(Train)
    assert found == run(lambda leaf: leaf)
    assert Status.SUCCESS in found[0] and len(found[1]) > 5


def test_what_it_takes():
    leaf = Raise()
    assert Train(leaf).name == "train raise 0.45"
    assert Train(Raise(), "mine").name == "mine"
    with pytest.raises(InputError, match=r"already has a parent, 'train raise 0.45'"):
        Train(leaf)
    with pytest.raises(InputError, match="takes a leaf or a subtree, found <class"):
        Train(Raise)


def test_learners_have_something_unknown_and_are_not_told_to_be_programmed():
    first, told, second = Raise(name="a"), Raise(name="b", policy="programmed"), Raise(name="c")
    node = Train(sequence("s", Move(), first, told, retry(2, second)))
    assert node.learners() == [first, second]
    assert [leaf.name for leaf in node.concepts()] == ["move 0.3", "a", "b", "c"]


def test_nothing_to_learn_is_one_sentence():
    node = Train(sequence("s", Pick("cup"), Grasp("cup", policy="programmed")))
    with pytest.raises(InputError, match=r"nothing below 'train s' can learn \('pick cup', 'grasp cup'\)"):
        node.learners()
    with pytest.raises(InputError, match="no concept at all"):
        Train(Below()).learners()


def test_one_inside_another_is_refused():
    with pytest.raises(InputError, match="'inner' stands below 'outer': one Train inside another"):
        Train(sequence("s", Train(Raise(), "inner"), Move()), "outer").learners()


def test_a_concept_without_features_cannot_learn():
    class Blind(Move):
        """Has something unknown, and nothing to see it by."""

        is_task_model = False

    with pytest.raises(InputError, match=r"cannot learn: Blind has no features\(\) with its layout\(\)"):
        Train(Blind()).learners()


def test_nodes_are_found_from_left_to_right():
    a, b, c = (Train(Raise(), name) for name in "abc")
    tree = sequence("root", retry(2, a), fallback("f", sequence("s", b), timeout(1.0, c)))
    assert train_nodes(tree) == [a, b, c]
    assert [leaf.name for leaf in concepts_in(tree)] == ["raise 0.45"] * 3


def followed(tree, train):
    found = follower_of(train)
    return None if found is None else (found[0].name, found[1].name)


@pytest.mark.parametrize(
    "around",
    [
        lambda node: node,
        lambda node: sequence("inner", Move(), node),
        lambda node: sequence("inner", sequence("innermost", node)),
        lambda node: fallback("f", node, Check(name="another way")),
        lambda node: parallel("p", node, Check(name="beside")),
        lambda node: retry(2, timeout(3.0, force_success(node))),
        lambda node: invert(force_failure(node)),
        lambda node: subtree("s", sequence("inner", node)),
        lambda node: reactive_sequence("guarded", Below(), node),
        lambda node: sequence("inner", node, Wait(0.2), Below()),
    ],
)
@pytest.mark.parametrize("between", [(), (Below,), (lambda: Wait(0.1), Below), (Move,)])
def test_the_follower_is_the_next_one_in_a_sequence_above(around, between):
    train = Train(Raise())
    tree = sequence("outer", Check(name="before"), around(train), *(make() for make in between), Check())
    assert followed(tree, train) == ("check 0.45", "outer")


def test_the_nearest_sequence_comes_first():
    train = Train(Raise())
    tree = sequence("outer", sequence("inner", train, retry(2, Check(name="near"))), Check(name="far"))
    assert followed(tree, train) == ("RetryUntilSuccessful", "inner")


def test_a_composite_that_holds_a_judge_is_a_follower():
    train = Train(Raise())
    tree = sequence("outer", train, sequence("then", Below(), Check()))
    assert followed(tree, train) == ("then", "outer")


@pytest.mark.parametrize(
    "tree_of",
    [
        lambda node: node,
        lambda node: sequence("s", Check(), node),
        lambda node: fallback("f", node, Check()),
        lambda node: parallel("p", node, Check()),
        lambda node: sequence("s", node, Wait(0.1), Below()),
    ],
)
def test_nothing_follows(tree_of):
    train = Train(Raise())
    assert followed(tree_of(train), train) is None


def test_what_has_no_policy_yet_ends_the_search():
    train, later = Train(Raise()), Unprogrammed()
    tree = sequence("s", train, sequence("t", Check(), later), Check(name="after"))
    assert followed(tree, train) == ("t", "s")
    later.lacks_policy = True
    assert followed(tree, train) is None, "nothing behind it can be reached"


def test_what_sees_other_things_may_stand_elsewhere():
    a, b = Train(Raise()), Train(Turn())
    sequence("s", a, b)
    assert a.learners() != b.learners()
    assert followed(None, a) == ("train turn 0.45", "s")
