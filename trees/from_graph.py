"""From a decomposition graph to a tree.

Common order becomes a sequence, alternatives become a selector. What a hand's own build decides is left to
the robot's: the closing axis, and an approach that is upright to within the accuracy of a demonstration.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from py_trees.behaviour import Behaviour

from bt_tasksim.concept import ConceptModel
from bt_tasksim.errors import InputError, nearest
from concept_nodes import catalogue
from trees.authoring import fallback, sequence

if TYPE_CHECKING:
    import networkx as nx

SNAP = math.radians(15.0)
"""A demonstrated direction this near to the vertical counts as vertical."""


def tree_from_graph(graph: nx.DiGraph[str], name: str = "demonstration") -> Behaviour:
    """The tree of a decomposition graph.

    Args:
        graph: From `demos_decomp.graph`; of alternatives the one that was shown most often is tried first.
        name: Name of the tree's root.

    Raises:
        InputError: The graph is empty, or names a concept that does not exist.
    """
    from demos_decomp.graph import in_order

    order = in_order(graph)
    if not order:
        raise InputError(f"'{name}': no task was recognised, so there is no tree to make")
    hover = _hovers(graph, order)
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
        ways = [_way([_leaf(graph.nodes[n], hover.get(n)) for n in branch]) for branch in group]
        children.append(ways[0] if len(ways) == 1 else fallback(f"one of {len(ways)} ways", *ways))
    return sequence(name, *children)


def _way(leaves: Sequence[Behaviour]) -> Behaviour:
    return leaves[0] if len(leaves) == 1 else sequence(leaves[0].name, *leaves)


def _hovers(graph: nx.DiGraph[str], order: list[str]) -> dict[str, float]:
    """Height at which each bring ends: where the place after it began."""
    out: dict[str, float] = {}
    for i, node in enumerate(order):
        if graph.nodes[node]["concept"] != "bring":
            continue
        for other in order[i + 1 :]:
            data = graph.nodes[other]
            if (
                data["concept"] == "place"
                and data["parameters"]["target"] == graph.nodes[node]["parameters"]["target"]
            ):
                out[node] = float(np.clip(data["parameters"]["distance"], 0.03, 0.12))
                break
    return out


def _leaf(data: Mapping[str, Any], hover: float | None) -> ConceptModel:
    known = {name.lower(): cls for name, cls in catalogue().items() if issubclass(cls, ConceptModel)}
    concept = str(data["concept"])
    if concept not in known:
        raise InputError(
            f"the graph names the concept '{concept}', which does not exist{nearest(concept, known)}"
        )
    given, sigma = dict(data["parameters"]), dict(data.get("uncertainty") or {})
    arguments: dict[str, Any] = {"target": given["target"]}
    match concept:
        case "grasp":
            approach = _snapped(given["approach"])
            if approach is not None:
                arguments["approach"] = approach
        case "pick":
            arguments["direction"] = _snapped(given["direction"]) or (0.0, 0.0, 1.0)
            arguments["distance"] = _rounded(given["distance"])
        case "bring":
            if given.get("to"):
                arguments["to"] = given["to"]
            else:
                arguments["position"] = tuple(_rounded(v) for v in given["position"])
            arguments["via"] = tuple(tuple(_rounded(v) for v in p) for p in given.get("via", ()))
            if hover is not None:
                arguments["hover"] = _rounded(hover)
        case "place":
            if not given.get("on"):
                raise InputError(
                    f"'{given['target']}' was placed on something that the log does not name: "
                    f"name the surface in the log's 'places'"
                )
            arguments["on"] = given["on"]
        case "release":
            if given.get("into"):
                arguments["into"] = given["into"]
    cls = known[concept]
    declared = cls.parameters()
    spread = {
        key: _rounded(np.linalg.norm(value))
        for key, value in sigma.items()
        if key in arguments and declared[key].quantity.kind in ("number", "vector")
    }
    return cls(**arguments, uncertainty={k: v for k, v in spread.items() if v > 0.0} or None)


def _snapped(direction: Any) -> tuple[float, float, float] | None:
    """The direction, or None where it is vertical as far as a demonstration can tell."""
    d = np.asarray(direction, float)
    d = d / np.linalg.norm(d)
    if math.acos(min(1.0, abs(float(d[2])))) < SNAP:
        return None
    return _rounded(d[0]), _rounded(d[1]), _rounded(d[2])


def _rounded(value: Any) -> float:
    """To tenths of a millimetre: a demonstration is no more accurate, and a person reads the file."""
    return round(float(value), 4)
