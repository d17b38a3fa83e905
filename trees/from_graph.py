"""From a decomposition graph to a tree.

Common order becomes a sequence, alternatives become a selector. What a hand's own build decides is left to
the robot's: the closing axis, and an approach that is upright to within the accuracy of a demonstration.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from py_trees.behaviour import Behaviour

from bt_tasksim.concept.demonstrated import rounded
from bt_tasksim.concept.task import Task
from bt_tasksim.core.errors import InputError, nearest
from bt_tasksim.demos_decomp.concepts import concepts
from bt_tasksim.demos_decomp.graph import in_order
from bt_tasksim.trees.nodes.fallback import fallback
from bt_tasksim.trees.nodes.sequence import sequence

if TYPE_CHECKING:
    import networkx as nx


def tree_from_graph(graph: nx.DiGraph[str], name: str = "demonstration") -> Behaviour:
    """The tree of a decomposition graph.

    Args:
        graph: From `demos_decomp.graph`; of alternatives the one that was shown most often is tried first.
        name: Name of the tree's root.

    Raises:
        InputError: The graph is empty, or names a concept that does not exist.
    """
    order = in_order(graph)
    if not order:
        raise InputError(f"'{name}': no task was recognised, so there is no tree to make")
    tasks = [_task(graph.nodes[node]) for node in order]
    leaves = {
        node: _leaf(tasks[i], tasks[i + 1 :], graph.nodes[node].get("uncertainty") or {})
        for i, node in enumerate(order)
    }
    branches: dict[str, list[list[str]]] = {}
    for group in graph.graph.get("alternatives", []):
        ranked = sorted((list(b) for b in group), key=lambda b: -min(graph.nodes[n]["share"] for n in b))
        for branch in ranked:
            branches.update(dict.fromkeys(branch, ranked))
    children: list[Behaviour] = []
    done: set[str] = set()
    for node in order:
        if node in done:
            continue
        group = branches.get(node, [[node]])
        done.update(n for branch in group for n in branch)
        ways = [_way([leaves[n] for n in branch]) for branch in group]
        children.append(ways[0] if len(ways) == 1 else fallback(f"one of {len(ways)} ways", *ways))
    return sequence(name, *children)


def _way(leaves: Sequence[Behaviour]) -> Behaviour:
    return leaves[0] if len(leaves) == 1 else sequence(leaves[0].name, *leaves)


def _leaf(task: Task, later: Sequence[Task], uncertainty: Mapping[str, Any]) -> Behaviour:
    known = concepts()
    if task.concept not in known:
        raise InputError(
            f"the graph names the concept '{task.concept}', which does not exist"
            f"{nearest(task.concept, known)}"
        )
    concept = known[task.concept]
    arguments = concept.from_task(task, later)
    declared = concept.parameters()
    spread = {
        key: rounded(np.linalg.norm(value))
        for key, value in uncertainty.items()
        if key in arguments and declared[key].quantity.kind in ("number", "vector")
    }
    return concept(**arguments, uncertainty={k: v for k, v in spread.items() if v > 0.0} or None)


def _task(data: Mapping[str, Any]) -> Task:
    return Task(str(data["concept"]), 0.0, 0.0, float(data.get("confidence", 1.0)), dict(data["parameters"]))
