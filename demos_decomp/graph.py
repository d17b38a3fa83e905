"""The decomposition graph: concept instances, their order, and the evidence for each.

A `networkx.DiGraph` with one node per task. Node attributes:

* ``concept``, ``parameters``, ``uncertainty`` (see `demos_decomp.merging.merged_parameters`);
* ``evidence``: dictionaries with ``log``, ``demonstration``, ``start``, ``end`` (seconds), ``confidence``;
* ``confidence``: mean over the evidence;
* ``share``: in how many of the demonstrations it was seen, from 0 to 1.

An edge says that one task came before the other in every demonstration that has both; edges that follow
from others are left out. Tasks without a path between them have no order, or exclude each other:
``graph.graph["alternatives"]`` lists sets of branches (lists of nodes in order), of which every demonstration
shows at most one.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from itertools import combinations, pairwise
from typing import Any

import networkx as nx
import numpy as np

from bt_tasksim.concept.task import Task, plain
from bt_tasksim.demos_decomp.concepts import goes_to
from bt_tasksim.demos_decomp.merging import Column, aligned, merged_parameters


def build_graph(
    demonstrations: Mapping[str, Sequence[Task]], sources: Mapping[str, tuple[str, str]] | None = None
) -> nx.DiGraph[str]:
    """Merges the tasks of demonstrations of one activity.

    Args:
        demonstrations: Tasks in order, by the demonstration's name.
        sources: For the evidence: path of the log and name in it of each demonstration.

    Returns:
        The graph; nodes in an order that agrees with the edges.
    """
    sources = sources or {name: ("", name) for name in demonstrations}
    columns = aligned(demonstrations)
    when = {
        name: {id(task): place for place, task in enumerate(tasks)} for name, tasks in demonstrations.items()
    }
    columns.sort(key=lambda column: float(np.mean([when[name][id(task)] for name, task in column.items()])))
    names = _names(columns)
    graph: nx.DiGraph[str] = nx.DiGraph(demonstrations=list(demonstrations), alternatives=[])
    for name, column in zip(names, columns, strict=True):
        values, spread = merged_parameters(list(column.values()))
        graph.add_node(
            name,
            concept=next(iter(column.values())).concept,
            parameters=values,
            uncertainty=spread,
            evidence=[_evidence(task, *sources[shown]) for shown, task in column.items()],
            confidence=float(np.mean([task.confidence for task in column.values()])),
            share=len(column) / len(demonstrations),
        )
    before = {
        (a, b): sum(when[d][id(first[d])] < when[d][id(second[d])] for d in first.keys() & second.keys())
        for a, first in zip(names, columns, strict=True)
        for b, second in zip(names, columns, strict=True)
        if a != b
    }
    _add_order(graph, before)
    presence = {name: frozenset(column) for name, column in zip(names, columns, strict=True)}
    graph.graph["alternatives"] = _alternatives(graph, presence, frozenset(demonstrations))
    return graph


def in_order(graph: nx.DiGraph[str]) -> list[str]:
    """Nodes in an order that agrees with the edges; where they leave it open, as mostly shown."""
    place = {name: i for i, name in enumerate(graph)}
    return list(nx.lexicographical_topological_sort(graph, key=lambda name: place[name]))


def graph_to_json(graph: nx.DiGraph[str]) -> dict[str, Any]:
    """Nodes, edges and alternatives as plain JSON values."""
    nodes = []
    for name in in_order(graph):
        node = graph.nodes[name]
        nodes.append(
            {
                "id": name,
                "concept": node["concept"],
                "confidence": round(node["confidence"], 4),
                "share": round(node["share"], 4),
                "parameters": {key: plain(value) for key, value in node["parameters"].items()},
                "uncertainty": {key: plain(value) for key, value in node["uncertainty"].items()},
                "evidence": [
                    {k: round(v, 4) if isinstance(v, float) else v for k, v in piece.items()}
                    for piece in node["evidence"]
                ],
            }
        )
    return {
        "demonstrations": graph.graph.get("demonstrations", []),
        "nodes": nodes,
        "edges": [
            {"from": a, "to": b, "demonstrations": edge["demonstrations"]}
            for a, b, edge in graph.edges(data=True)
        ],
        "alternatives": graph.graph.get("alternatives", []),
    }


def _names(columns: Sequence[Column]) -> list[str]:
    """Names such as ``place cup``; where that is not enough ``place cup on tray``; then with a number."""
    first = [next(iter(column.values())) for column in columns]
    short = [f"{task.concept} {task.parameters['target']}" for task in first]
    long = [
        " ".join([name, *(f"{key} {place}" for key, place in goes_to(task).items())])
        for name, task in zip(short, first, strict=True)
    ]
    differ = {name for name, group in _grouped(short, long).items() if len(set(group)) > 1}
    chosen = [b if a in differ else a for a, b in zip(short, long, strict=True)]
    used: dict[str, int] = defaultdict(int)
    names = []
    for name in chosen:
        used[name] += 1
        names.append(name if used[name] == 1 else f"{name} #{used[name]}")
    return names


def _evidence(task: Task, log: str, demonstration: str) -> dict[str, Any]:
    seconds = {"start": task.start, "end": task.end, "confidence": task.confidence}
    return {"log": log, "demonstration": demonstration, **seconds}


def _grouped(keys: Sequence[str], values: Sequence[str]) -> dict[str, list[str]]:
    groups: dict[str, list[str]] = defaultdict(list)
    for key, value in zip(keys, values, strict=True):
        groups[key].append(value)
    return groups


def _add_order(graph: nx.DiGraph[str], before: Mapping[tuple[str, str], int]) -> None:
    """Adds the edges that all demonstrations agree with, without those that follow from others."""
    full: nx.DiGraph[str] = nx.DiGraph()
    full.add_nodes_from(graph)
    for (a, b), number in before.items():
        if number and not before[b, a]:
            full.add_edge(a, b, demonstrations=number)
    while not nx.is_directed_acyclic_graph(full):  # a < b < c < a, each from other demonstrations
        _drop_weakest(full, [edge[:2] for edge in nx.find_cycle(full)])
    for a, b in before:
        while before[a, b] and before[b, a] and nx.has_path(full, a, b):
            path = nx.shortest_path(full, a, b)
            _drop_weakest(full, list(pairwise(path)))
    for a, b in nx.transitive_reduction(full).edges:
        graph.add_edge(a, b, demonstrations=before[a, b])


def _drop_weakest(graph: nx.DiGraph[str], edges: Sequence[tuple[str, str]]) -> None:
    graph.remove_edge(*min(edges, key=lambda edge: graph.edges[edge]["demonstrations"]))


def _alternatives(
    graph: nx.DiGraph[str], presence: Mapping[str, frozenset[str]], everyone: frozenset[str]
) -> list[list[list[str]]]:
    """Sets of branches that stand at the same place between tasks that all demonstrations have."""
    always = {name for name in graph if presence[name] == everyone}
    branches: dict[tuple[frozenset[str], frozenset[str], frozenset[str]], list[str]] = defaultdict(list)
    for name in in_order(graph):
        if name not in always:
            earlier = frozenset(nx.ancestors(graph, name) & always)
            later = frozenset(nx.descendants(graph, name) & always)
            branches[earlier, later, presence[name]].append(name)
    places: dict[tuple[frozenset[str], frozenset[str]], list[tuple[frozenset[str], list[str]]]]
    places = defaultdict(list)
    for (earlier, later, shown), branch in branches.items():
        places[earlier, later].append((shown, branch))
    found = []
    for rivals in places.values():
        exclusive = all(not a & b for (a, _), (b, _) in combinations(rivals, 2))
        if len(rivals) > 1 and exclusive:
            rivals.sort(key=lambda rival: -len(rival[0]))
            found.append([branch for _, branch in rivals])
    return found
