"""The table of docs/taxonomy.md: classes, tasks, their nodes, an example each, and what was measured.

Classes, tasks and nodes come from `bt_tasksim.concept_nodes.contact_tasks`, examples from the ready-made
scenarios: the one that is called like the node, else of those in whose tree it stands the one with the
fewest leaves. Measured successes are what `benchmarks.concepts` found on the last block,
``concept-<scenario>-<robot>-<engine>.json``.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.concept_nodes.contact_tasks import tasks
from bt_tasksim.trees.load import load_source, scenarios
from bt_tasksim.trees.walk import nodes_of

COLUMNS = {
    "panda-sapien": "Panda, SAPIEN",
    "panda-mujoco": "Panda, MuJoCo",
    "xarm7_ability-sapien": "Ability hand, SAPIEN",
}


def taxonomy(results: dict[str, Any]) -> str:
    """The table."""
    lines = [
        f"| motion | class | task | contact | node | example | {' | '.join(COLUMNS.values())} |",
        f"|{'---|' * (6 + len(COLUMNS))}",
    ]
    for each in tasks():
        example = _example(each.node) if each.node else ""
        cells = [_said(results.get(f"concept-{example}-{column}")) for column in COLUMNS]
        change = f"{each.before.name} to {each.after.name}"
        task = f"{each.change.value}: {(_snake(each.node) or each.name).replace('_', ' ')}"
        lines.append(
            f"| {each.motion} | {each.state.name} | {task} | {change} "
            f"| {_code(each.node)} | {_code(example)} | {' | '.join(cells)} |"
        )
    return "\n".join(lines)


def _said(found: dict[str, Any] | None) -> str:
    return "" if found is None else f"{found['successes']} of {found['episodes']}"


def _code(name: str) -> str:
    return f"`{name}`" if name else ""


def _snake(node: str) -> str:
    return "".join(f"_{c.lower()}" if c.isupper() else c for c in node).strip("_")


def _example(node: str) -> str:
    """The scenario that shows a concept best; empty where there is none."""
    fitting = [
        (not name.startswith(_snake(node)), len(leaves), name)
        for name, leaves in _leaves().items()
        if node in leaves
    ]
    return min(fitting, default=(True, 0, ""))[-1]


@lru_cache(maxsize=1)
def _leaves() -> dict[str, list[str]]:
    """Names of the concepts in each scenario's tree."""
    found = {}
    for name in scenarios():
        nodes = nodes_of(load_source(name).build())
        found[name] = [type(node.model).__name__ for node in nodes if isinstance(node, ConceptNode)]
    return found


TABLES = {"taxonomy": taxonomy}
