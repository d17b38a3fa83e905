"""Trees in a few lines, and the check that they make sense."""

from __future__ import annotations

import subprocess
import sys
import warnings

import numpy as np
import py_trees
import pytest

from bt_tasksim import trees
from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import ObjectName
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.world import Command
from bt_tasksim.trees.check import DEEPEST


class Poke(ConceptModel):
    """A concept."""

    target: ObjectName

    def command(self, action, seen, memory):
        return Command()

    def done(self, seen, memory):
        return np.True_


class Near(Condition):
    """A condition."""

    target: ObjectName

    def holds(self, seen):
        return np.True_


def test_helpers_make_plain_py_trees_nodes():
    tree = trees.sequence("all", Near("cup"), trees.fallback("either", Poke("a"), Poke("b")))
    assert isinstance(tree, py_trees.composites.Sequence)
    assert tree.memory
    assert tree.children[1].memory
    assert not trees.reactive_sequence("r", Near("cup")).memory
    assert [n.name for n in tree.children] == ["near cup", "either"]


def test_plain_py_trees_mixes_in():
    guarded = py_trees.decorators.Inverter("not", Near("cup"))
    trees.check_tree(trees.sequence("all", guarded, py_trees.behaviours.Success("yes"), Poke("cup")))


def test_a_node_has_one_parent():
    node = Near("cup")
    trees.sequence("first", node)
    with pytest.raises(InputError, match=r"'second': node 'near cup' already stands under 'first'"):
        trees.sequence("second", node)
    with pytest.raises(InputError, match="already stands under 'first'"):
        trees.invert(node)
    other = Near("box")
    with pytest.raises(InputError, match="'twice': node 'near box' already stands under 'twice'"):
        trees.sequence("twice", other, other)
    assert other.parent is None


def test_what_is_no_behaviour_is_refused():
    with pytest.raises(InputError, match="'s': a child should be a behaviour, found 'cup'"):
        trees.sequence("s", "cup")
    with pytest.raises(InputError, match="the name comes before the children"):
        trees.sequence(Near("cup"), Near("box"))


@pytest.mark.parametrize(
    "make",
    [
        lambda n: trees.retry(0, n),
        lambda n: trees.retry(-2, n),
        lambda n: trees.retry(1.5, n),
        lambda n: trees.retry(True, n),
        lambda n: trees.repeat(0, n),
        lambda n: trees.timeout(0, n),
        lambda n: trees.timeout(float("nan"), n),
        lambda n: trees.timeout("3", n),
        lambda n: trees.parallel("p", n, success=2),
        lambda n: trees.parallel("p", n, failure=0),
    ],
)
def test_counts_and_times_that_do_not_fit_are_refused(make):
    with pytest.raises(InputError, match=r"should (be|lie)"):
        make(Near("cup"))


@pytest.mark.parametrize("make", [trees.reactive_sequence, trees.reactive_fallback])
def test_concepts_stand_last_below_nodes_without_memory(make):
    trees.check_tree(make("ok", Near("cup"), trees.invert(Near("box")), Poke("cup")))
    trees.check_tree(make("ok", Near("cup"), trees.sequence("s", Poke("cup"), Poke("box"))))
    trees.check_tree(make("ok", Near("cup"), trees.retry(2, trees.parallel("p", Poke("cup"), Near("box")))))
    trees.check_tree(
        make("ok", make("conditions", Near("cup"), Near("box")), make("last", Near("a"), Poke("b")))
    )
    for first in (Poke("cup"), trees.retry(2, Poke("cup")), trees.sequence("s", Near("a"), Poke("cup"))):
        with pytest.raises(
            InputError, match="'bad' has no memory and would start 'poke cup' anew at every tick"
        ):
            trees.check_tree(make("bad", first, Poke("box")))


def test_the_error_of_a_node_without_memory_names_the_child():
    tree = trees.sequence(
        "all", trees.reactive_sequence("bad", trees.sequence("inner", Poke("cup")), Near("a"))
    )
    with pytest.raises(InputError, match=r"reactive sequence 'bad' .* 'poke cup' .* or put 'inner' last"):
        trees.check_tree(tree)


def test_py_trees_parallel_may_not_start_concepts_anew():
    policy = py_trees.common.ParallelPolicy
    for good in (policy.SuccessOnAll(), policy.SuccessOnOne()):
        trees.check_tree(py_trees.composites.Parallel("p", good, [Poke("a"), Poke("b")]))
    with pytest.raises(InputError, match="parallel 'p' has no memory"):
        trees.check_tree(
            py_trees.composites.Parallel("p", policy.SuccessOnAll(False), [Poke("a"), Poke("b")])
        )


def test_shapes_that_are_no_trees_are_refused():
    node = Near("cup")
    twice = trees.sequence("all", node, trees.sequence("inner", Near("box")))
    twice.children[1].children.append(node)
    with pytest.raises(InputError, match="node 'near cup' stands in two places"):
        trees.check_tree(twice)
    circle = trees.sequence("all", trees.sequence("inner", Near("box")))
    circle.children[0].children.append(circle)
    with pytest.raises(InputError, match="node 'all' stands among its own descendants"):
        trees.check_tree(circle)
    with pytest.raises(InputError, match="sequence 'empty' has no children"):
        trees.check_tree(trees.sequence("all", Near("cup"), trees.sequence("empty")))


def test_trees_that_are_too_deep_are_refused():
    def deep(levels):
        tree = Near("cup")
        for _ in range(levels - 1):
            tree = trees.invert(tree)
        return tree

    trees.check_tree(deep(DEEPEST))
    for levels in (DEEPEST + 1, 3000):
        with pytest.raises(InputError, match="more than 200 levels"):
            trees.check_tree(deep(levels))


def test_importing_trees_is_light():
    code = (
        "import sys, trees; print([m for m in ('py_trees', 'numpy', 'torch', 'sapien') if m in sys.modules])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "[]"


def test_every_public_name_is_there():
    for name in trees.__all__:
        assert getattr(trees, name).__doc__
    assert "sequence" in dir(trees)
    with pytest.raises(AttributeError, match="no attribute 'Retry'; did you mean 'retry'"):
        trees.Retry  # noqa: B018  # the class, or its name in XML
    with pytest.raises(AttributeError, match="no attribute 'RetryUntilSuccessful'; did you mean 'retry'"):
        trees.RetryUntilSuccessful  # noqa: B018
    with pytest.raises(AttributeError, match="no attribute 'sequense'; did you mean 'sequence'"):
        _ = trees.sequense


def test_nodes_that_count_wall_clock_time_are_warned_of():
    with pytest.warns(UserWarning, match=r"wall-clock.*timeout\("):
        trees.check_tree(py_trees.decorators.Timeout("slow", Near("cup"), duration=3.0))
    with pytest.warns(UserWarning, match=r"wall-clock.*Wait\("):
        trees.check_tree(trees.sequence("s", py_trees.timers.Timer("later", 0.1), Near("cup")))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        trees.check_tree(trees.timeout(3.0, Near("cup")))
