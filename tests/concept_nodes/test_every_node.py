"""Each registered node in each tool that nobody told of it: XML, its picture, `check`, labels, goals.

What stands on runs (the report's page, replay, demonstrations) is asked of every scenario in
tests/trees/test_shipped.py.
"""

from __future__ import annotations

import re
from itertools import combinations

import pytest

from bt_tasksim import Goal
from bt_tasksim.checking.declaration import check_declaration
from bt_tasksim.checking.findings import ERROR, Case
from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.registry import parts
from bt_tasksim.report.tree_picture import tree_svg
from bt_tasksim.trees import (
    node_models,
    recovering,
    same_tree,
    sequence,
    tidy,
    tree_from_xml,
    tree_to_xml,
)
from bt_tasksim.trees.walk import nodes_of

VALUES = {
    "object": "thing",
    "place": "spot",
    "text": "word",
    "vector": (1.0, 0.0, 0.0),
    "points": ((0.1, 0.0, 0.2),),
    "flag": True,
}
"""A value of each kind; of numbers one within the limits."""


def value_of(parameter):
    quantity = parameter.quantity
    if quantity.kind != "number":
        return VALUES[quantity.kind]
    return min(max(0.1, quantity.low), quantity.high)


def leaf_of(node):
    """A leaf with what it requires, and with as little else as it is content with."""
    parameters = node.parameters()
    needed = {name: value_of(p) for name, p in parameters.items() if p.required}
    others = [name for name, p in parameters.items() if not p.required]
    for more in [(), *combinations(others, 1), *combinations(others, 2)]:
        try:
            return node(**needed, **{name: value_of(parameters[name]) for name in more})
        except InputError as error:
            said = error
    raise said


@pytest.mark.parametrize("name", parts("concept"))
def test_a_node_is_known_by_all_tools(name):
    node = parts("concept")[name]
    tree = sequence("all", leaf_of(node))
    (leaf,) = tree.children
    assert same_tree(tree_from_xml(tree_to_xml(tree)), tree)
    assert f'ID="{name}"' in node_models({name: node})
    assert name in tree_svg(tree) or leaf.name in tree_svg(tree)
    if issubclass(node, Condition):
        return
    case = Case(node)
    check_declaration(case)
    assert not [finding for finding in case.findings if finding.level == ERROR]
    known = {key: value for key, value in leaf.model.values.items() if value is not None}
    assert isinstance(node.describe_task(known), str)
    assert re.compile(node.presentation.spoken) and re.fullmatch("#[0-9a-f]{6}", node.presentation.colour)


def test_what_nodes_establish_and_require_are_conditions_that_can_be_asked():
    for name, node in parts("concept").items():
        for declared in (*node.establishes, *node.requires) if issubclass(node, ConceptModel) else ():
            condition = parts("concept")[declared.condition]
            assert issubclass(condition, Condition), name
            required = {key for key, p in condition.parameters().items() if p.required}
            assert required <= set(declared.parameters), f"{name} leaves {declared.condition} without a value"


@pytest.mark.parametrize(
    ("goal", "does"),
    [
        (Goal("it", relation="open"), ("OpenDrawer(target='it')", "OpenDoor(target='it')")),
        (
            Goal("it", relation="open", value=0.1),
            ("OpenDrawer(target='it', distance=0.1)", "OpenDoor(target='it', angle=0.1)"),
        ),
        (Goal("it", relation="shut"), ("CloseDrawer(target='it')", "CloseDoor(target='it')")),
        (
            Goal("it", relation="set", value=0.1),
            ("AdjustDrawer(target='it', distance=0.1)", "AdjustDoor(target='it', angle=0.1)"),
        ),
    ],
)
def test_goals_of_joints_become_trees_that_can_be_written_and_recovered(goal, does):
    for tree in (tidy([goal]), tidy([goal, Goal("cup", "spot")]), recovering(tidy([goal]))):
        leaves = {repr(node.model) for node in nodes_of(tree) if not node.children}
        assert set(does) <= leaves
        assert same_tree(tree_from_xml(tree_to_xml(tree)), tree)
