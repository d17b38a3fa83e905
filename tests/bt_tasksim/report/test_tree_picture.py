"""Pictures and listings of trees."""

from __future__ import annotations

import itertools
import xml.etree.ElementTree as ET

import numpy as np
import py_trees
import pytest
from py_trees.common import Status

from bt_tasksim import trees
from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import Direction, Metres, ObjectName, Points
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.world import Command
from bt_tasksim.report.tree_picture import _arranged, _boxes, node_ids, tree_svg, tree_text
from bt_tasksim.trees.nodes.train import Train
from bt_tasksim.trees.vocabulary import node_kinds

SVG = "{http://www.w3.org/2000/svg}"


class Poke(ConceptModel):
    """A concept."""

    target: ObjectName
    direction: Direction = (0.0, 0.0, 1.0)
    distance: Metres = 0.1
    via: Points = ()

    def command(self, action, seen, memory):
        return Command()

    def done(self, seen, memory):
        return np.True_


class Near(Condition):
    """A condition."""

    target: ObjectName

    def holds(self, seen):
        return np.True_


def tree():
    return trees.sequence(
        "shelf to shelf",
        trees.retry(3, trees.reactive_sequence("ReactiveSequence", Near("cup"), Poke("cup", distance=0.08))),
        trees.parallel("both", trees.invert(Near("cup")), trees.timeout(2.5, Poke("box")), success=1),
        trees.subtree("again", Poke("can", name="a <b> & 'c'", uncertainty={"distance": 0.01}, timeout=3)),
        py_trees.behaviours.Success("plain"),
    )


def groups(svg):
    return {g.get("id"): g for g in ET.fromstring(svg).iter(f"{SVG}g")}


def test_every_node_has_a_group_by_its_id():
    found = groups(tree_svg(tree()))
    assert list(found) == list(node_ids(tree()))
    assert {g.get("data-status") for g in found.values()} == {"INVALID"}
    assert [g.get("class") for g in found.values()] == [
        "control", "decorator", "control", "condition", "concept", "control", "decorator", "condition",
        "decorator", "concept", "subtree", "concept", "other",
    ]  # fmt: skip


def test_labels_are_there_and_escaped():
    texts = [t.text for t in ET.fromstring(tree_svg(tree())).iter(f"{SVG}text")]
    for expected in (
        "shelf to shelf",
        "retry up to 3 times",
        "Poke cup",
        "distance 0.08 m",
        "parallel, 1 of 2 must succeed",
        "time-out 2.5 s",
        "a <b> & 'c'",
        "distance ± 0.01 m",
        "timeout 3 s",
        "plain",
    ):
        assert expected in texts


def test_what_is_to_be_learned_is_marked():
    root = trees.sequence("root", Train(Poke("cup")), Train(Poke("box"), "Train"))
    svg = tree_svg(root)
    assert [g.get("class") for g in groups(svg).values()] == ["control", *("decorator", "concept") * 2]
    texts = [t.text for t in ET.fromstring(svg).iter(f"{SVG}text")]
    assert texts.count("✎") == 2 and texts.count("train") == 2, "a sign and a word, named or not"
    assert "train poke cup" in texts
    assert tree_text(root).splitlines()[1] == "├─ ✎ train poke cup  (train)"


def test_statuses_colour_the_nodes():
    svg = tree_svg(tree(), {"node-0": Status.RUNNING, "node-3": "SUCCESS"})
    found = groups(svg)
    assert found["node-0"].get("data-status") == "RUNNING"
    assert found["node-3"].get("data-status") == "SUCCESS"
    assert found["node-1"].get("data-status") == "INVALID"
    with pytest.raises(InputError, match="no node 'node-99'"):
        tree_svg(tree(), {"node-99": "RUNNING"})
    with pytest.raises(InputError, match="unknown status 'DONE'"):
        tree_svg(tree(), {"node-0": "DONE"})


def wide_and_deep():
    return trees.sequence(
        "root",
        trees.fallback("a", *(Poke(f"object {i}") for i in range(5))),
        Near("x"),
        trees.sequence(
            "b", trees.sequence("c", *(Near("a very long name of an object " * 3) for _ in range(3)))
        ),
        trees.invert(trees.invert(trees.fallback("d", Poke("y"), Poke("z")))),
    )


@pytest.mark.parametrize("make", [tree, wide_and_deep])
def test_boxes_do_not_overlap_and_stay_inside(make):
    top, _ = _boxes(make())
    boxes = _arranged(top)
    view = [float(v) for v in ET.fromstring(tree_svg(make())).get("viewBox").split()]
    for box in boxes:
        assert box.x - box.width / 2 >= 0
        assert box.x + box.width / 2 <= view[2]
        assert box.y >= 0
        assert box.y + box.height <= view[3]
        for child in box.children:
            assert child.y >= box.y + box.height + 10
    for level in range(max(b.depth for b in boxes) + 1):
        row = sorted((b for b in boxes if b.depth == level), key=lambda b: b.x)
        for left, right in itertools.pairwise(row):
            assert left.x + left.width / 2 + 10 <= right.x - right.width / 2


def test_a_picture_is_the_same_each_time():
    assert tree_svg(tree()) == tree_svg(tree())


def test_deep_trees_are_drawn():
    node = Near("cup")
    for _ in range(199):
        node = trees.invert(node)
    assert len(groups(tree_svg(node))) == 200
    assert len(tree_text(node).splitlines()) == 200


def test_every_kind_of_node_has_a_symbol_and_a_word():
    symbols = [kind.symbol for kind in node_kinds().values()]
    assert all(symbols) and len(set(symbols)) == len(symbols) == 14
    assert all(kind.label for kind in node_kinds().values())


def test_the_listing():
    assert tree_text(tree()) == "\n".join(
        (
            "→ shelf to shelf  (sequence)",
            "├─ ↺ retry up to 3 times",
            "│  └─ →ᴿ reactive sequence",
            "│     ├─ Near cup",
            "│     └─ Poke cup  (distance 0.08 m)",
            "├─ ⇉ both  (parallel, 1 of 2 must succeed)",
            "│  ├─ ¬ not",
            "│  │  └─ Near cup",
            "│  └─ ◷ time-out 2.5 s",
            "│     └─ Poke box",
            "├─ again  (subtree)",
            "│  └─ a <b> & 'c'  (Poke can, timeout 3 s, distance ± 0.01 m)",
            "└─ plain  (Success)",
        )
    )
