"""One name for one thing: no two public classes or types of the same name in different modules."""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = ("bt_tasksim", "concept_nodes", "trees", "demos_decomp")

ALIKE = {
    "Beside": "the goal relation, as physics tells it; the condition, as a robot sees it",
    "Command": "what a tick asks of the robot; a command of the command line, as Typer calls it",
    "ContactReader": "the same of two simulators",
    "Inside": "the goal relation, as physics tells it; the condition, as a robot sees it",
    "Inserted": "the goal relation, as physics tells it; the condition, as a robot sees it",
    "Lifted": "the goal relation, as physics tells it; the condition, as a robot sees it",
    "Lying": "the goal relation, as physics tells it; the condition, as a robot sees it",
    "OnEnd": "the goal relation, as physics tells it; the condition, as a robot sees it",
    "Oriented": "the goal relation, as physics tells it; the condition, as a robot sees it",
    "OutOf": "the goal relation, as physics tells it; the condition, as a robot sees it",
    "PointingUp": "the goal relation, as physics tells it; the condition, as a robot sees it",
    "Policy": "what decides in a leaf; what a limit of a robot does, in its file",
    "World": "the same of two simulators",
}
"""Names that several modules give, and to what."""


def test_one_name_is_given_to_one_thing():
    given: defaultdict[str, set[str]] = defaultdict(set)
    for package in PACKAGES:
        for path in (ROOT / package).rglob("*.py"):
            for node in ast.parse(path.read_text(encoding="utf-8")).body:
                if isinstance(node, ast.ClassDef):
                    given[node.name].add(str(path.resolve()))
                elif isinstance(node, ast.Assign) and _is_literal(node.value):
                    given[ast.unparse(node.targets[0])].add(str(path.resolve()))
    twice = {name: sorted(paths) for name, paths in given.items() if len(paths) > 1 and name[0] != "_"}
    assert {name: paths for name, paths in twice.items() if name not in ALIKE} == {}
    assert ALIKE.keys() <= twice.keys(), "a row too many"


def _is_literal(value: ast.expr) -> bool:
    return isinstance(value, ast.Subscript) and ast.unparse(value.value) == "Literal"
