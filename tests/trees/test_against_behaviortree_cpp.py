"""The nodes do, tick by tick, what those of BehaviorTree.CPP v4 do: both run the same file.

Runs where BehaviorTree.CPP's Python binding is installed (`pip install behaviortreepy`).
"""

from __future__ import annotations

import xml.etree.ElementTree as ET

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim import trees
from bt_tasksim.concept.condition import Condition, ConditionNode
from bt_tasksim.trees.nodes.train import Train

cpp = pytest.importorskip("behaviortreepy", reason="BehaviorTree.CPP's Python binding is not installed")

TICKS = 12
SCRIPTS = st.text("RSF", min_size=1, max_size=4)
STATUS = {"R": Status.RUNNING, "S": Status.SUCCESS, "F": Status.FAILURE}
CPP_STATUS = {"R": cpp.NodeStatus.RUNNING, "S": cpp.NodeStatus.SUCCESS, "F": cpp.NodeStatus.FAILURE}


class ScriptedLeaf(ConditionNode):
    """A leaf that answers by a script, over and over, and writes down what happens to it."""

    def __init__(self):
        super().__init__()
        self.log: list[str] = []
        self.asked = 0

    def setup(self, **kwargs):
        pass

    def update(self):
        script = self.model.script
        answer = script[self.asked % len(script)]
        self.asked += 1
        self.log.append(f"{type(self).__name__} {answer}")
        return STATUS[answer]

    def terminate(self, new_status):
        if new_status == Status.INVALID and self.status == Status.RUNNING:
            self.log.append(f"{type(self).__name__} halted")


class Scripted(Condition):
    """What the leaf is a leaf of."""

    script = "S"
    leaf_base = ScriptedLeaf

    def holds(self, seen):
        raise NotImplementedError


def shapes() -> st.SearchStrategy:
    def extend(inner):
        several = st.lists(inner, min_size=1, max_size=4)
        counts = st.sampled_from([-1, 1, 2, -2, 3])
        return st.one_of(
            st.tuples(
                st.sampled_from(["sequence", "fallback", "reactive_sequence", "reactive_fallback"]), several
            ),
            st.tuples(st.just("parallel"), several, counts, counts),
            st.tuples(
                st.sampled_from(["invert", "force_success", "force_failure", "subtree", "train"]), inner
            ),
            st.tuples(st.sampled_from(["retry", "repeat"]), inner, st.sampled_from([-1, 1, 2, 3])),
        )

    return st.recursive(SCRIPTS, extend, max_leaves=8)


def build(shape) -> tuple[Behaviour, list[ScriptedLeaf]]:
    leaves: list[ScriptedLeaf] = []

    def node(part) -> Behaviour:
        if isinstance(part, str):
            cls = type(f"L{len(leaves)}", (Scripted,), {"script": part, "__doc__": "A leaf of its own."})
            leaves.append(cls())
            return leaves[-1]
        kind = part[0]
        if kind in ("retry", "repeat"):
            return getattr(trees, kind)(part[2], node(part[1]))
        if kind == "parallel":
            children = [node(c) for c in part[1]]
            fit = [max(-len(children), min(len(children), c)) for c in part[2:]]
            return trees.parallel("p", *children, success=fit[0], failure=fit[1])
        if kind == "subtree":
            return trees.subtree("s", node(part[1]))
        if kind == "train":
            return Train(node(part[1]))
        if kind in ("invert", "force_success", "force_failure"):
            return getattr(trees, kind)(node(part[1]))
        return getattr(trees, kind)("n", *(node(c) for c in part[1]))

    return node(shape), leaves


def register(factory, leaf: ScriptedLeaf, log: list[str]) -> None:
    name, script, asked = type(leaf).__name__, leaf.model.script, [0]

    def answer(node):
        letter = script[asked[0] % len(script)]
        asked[0] += 1
        log.append(f"{name} {letter}")
        return CPP_STATUS[letter]

    factory.register_simple_stateful_action(name, answer, answer, lambda node: log.append(f"{name} halted"))


@settings(max_examples=200, deadline=None)
@given(shapes())
def test_both_tick_and_halt_the_same_leaves(shape):
    tree, leaves = build(shape)
    log: list[str] = []
    for leaf in leaves:
        leaf.log = log
    cpp_log: list[str] = []
    factory = cpp.BehaviorTreeFactory()
    for leaf in leaves:
        register(factory, leaf, cpp_log)
    factory.register_simple_decorator("Train", lambda status, node: status)
    text = trees.tree_to_xml(tree)
    factory.register_behavior_tree_from_text(text)
    cpp_tree = factory.create_tree(ET.fromstring(text).get("main_tree_to_execute"))
    for tick in range(TICKS):
        del log[:], cpp_log[:]
        try:
            expected = cpp_tree.tick_exactly_once()
        except RuntimeError as error:
            assert "only a single child can return RUNNING" in str(error)
            return
        tree.tick_once()
        assert sorted(log) == sorted(cpp_log), f"tick {tick}"
        assert [e for e in log if "halted" not in e] == [e for e in cpp_log if "halted" not in e], (
            f"tick {tick}"
        )
        assert tree.status.name == expected.name, f"tick {tick}"
