"""Decomposes a demonstration, or a whole log, into tasks and their graph."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import networkx as nx
import numpy as np

from bt_tasksim.concept.task import Task
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.markup import html_table
from bt_tasksim.demos_decomp.graph import build_graph, graph_to_json, in_order
from bt_tasksim.demos_decomp.log import Demonstration, Log
from bt_tasksim.demos_decomp.picture import picture
from bt_tasksim.demos_decomp.recognition import recognise
from bt_tasksim.demos_decomp.remarks import Remark, RemarkKind
from bt_tasksim.demos_decomp.table import HEADS, task_rows, text_table


@dataclass(frozen=True)
class Decomposition:
    """What a log decomposes into.

    Attributes:
        tasks: Tasks of the one demonstration, or the merged ones where there are several.
        graph: Concept instances and their order, see `demos_decomp.graph`.
        demonstrations: Tasks of every demonstration by its name.
        remarks: What was seen and not understood, for people, by demonstration.
    """

    tasks: tuple[Task, ...]
    graph: nx.DiGraph[str]
    demonstrations: Mapping[str, tuple[Task, ...]]
    remarks: Mapping[str, tuple[Remark, ...]]

    @property
    def seen(self) -> tuple[int, ...]:
        """In how many of the demonstrations each of ``tasks`` was seen."""
        if len(self.demonstrations) == 1:
            return (1,) * len(self.tasks)
        return tuple(len(self.graph.nodes[name]["evidence"]) for name in in_order(self.graph))

    def table(self) -> str:
        """One line per task, see `text_table`; of merged ones, with the share of demonstrations."""
        return text_table(self.tasks, self._shares())

    def _repr_html_(self) -> str:
        """For notebooks: the tasks as a table, what was remarked, and below them the graph's picture."""
        rows: list[tuple[str, ...]] = [*task_rows(self.tasks)]
        heads: tuple[str, ...] = HEADS
        if shares := self._shares():
            heads = (*heads, "seen in")
            rows = [(*row, share) for row, share in zip(rows, shares, strict=True)]
        said = [
            (name, str(remark.kind), remark.text) for name, many in self.remarks.items() for remark in many
        ]
        return "\n".join(
            [
                html_table(heads, rows) if rows else "<p>No task was recognised.</p>",
                *([html_table(("demonstration", "remark", "what was seen"), said)] if said else []),
                picture(self.graph),
            ]
        )

    def _shares(self) -> list[str] | None:
        """In how many demonstrations each task was seen, in words; None where there is one."""
        count = len(self.demonstrations)
        return [f"{n} of {count}" for n in self.seen] if count > 1 else None

    def not_understood(self) -> list[str]:
        """Sentences about motion that no task explains; where nothing was found, about all that was seen."""
        return [
            f"{name}: {remark}"
            for name, said in self.remarks.items()
            for remark in said
            if remark.kind == RemarkKind.MOTION or not self.demonstrations[name]
        ]

    def to_json(self) -> dict[str, Any]:
        """``tasks`` and ``graph`` as plain JSON values, and the tasks of each demonstration if several."""
        merged = len(self.demonstrations) > 1
        several = {name: [t.to_json() for t in tasks] for name, tasks in self.demonstrations.items()}
        return {
            "tasks": [task.to_json() for task in self.tasks],
            "graph": graph_to_json(self.graph),
            **({"demonstrations": several} if merged else {}),
            "remarks": {name: [r.to_json() for r in said] for name, said in self.remarks.items() if said},
        }


def decompose(demonstration: Demonstration) -> list[Task]:
    """Tasks of one demonstration, in order of time."""
    return recognise(demonstration)[0]


def decompose_log(log: Log | Sequence[Log], episode: int | str | None = None) -> Decomposition:
    """Decomposes the demonstrations of one activity and merges them into one graph.

    Args:
        log: A log, or several whose demonstrations belong to one activity.
        episode: Number or name of the only demonstration to take; None for all.

    Returns:
        The decomposition. Where several demonstrations were merged, ``tasks`` are the graph's nodes in an
        order that agrees with it: their mean start and end (on each demonstration's own clock, from its
        first sample), mean confidence and merged parameters.

    Raises:
        InputError: There is no such demonstration, or a log is given twice.
    """
    logs = [log] if isinstance(log, Log) else list(log)
    paths = [each.path for each in logs if each.path]
    for path in paths:
        if paths.count(path) > 1:
            raise InputError(f"'{path}' is given twice: its demonstrations would count twice")
    demonstrations: dict[str, tuple[Task, ...]] = {}
    remarks: dict[str, tuple[Remark, ...]] = {}
    sources: dict[str, tuple[str, str]] = {}
    for number, each in enumerate(logs):
        chosen = each.demonstrations if episode is None else (each.demonstration(episode),)
        for shown in chosen:
            name = shown.name if len(logs) == 1 else f"{each.path or number}: {shown.name}"
            tasks, said = recognise(shown)
            demonstrations[name], remarks[name] = tuple(tasks), tuple(said)
            sources[name] = (each.path, shown.name)
    graph = build_graph(demonstrations, sources)
    if len(demonstrations) == 1:
        (tasks_in_time,) = demonstrations.values()
    else:
        tasks_in_time = _merged_tasks(graph)
    return Decomposition(tasks_in_time, graph, demonstrations, remarks)


def _merged_tasks(graph: nx.DiGraph[str]) -> tuple[Task, ...]:
    merged = []
    for name in in_order(graph):
        node = graph.nodes[name]
        start, end = (float(np.mean([piece[key] for piece in node["evidence"]])) for key in ("start", "end"))
        merged.append(Task(node["concept"], start, end, node["confidence"], node["parameters"]))
    return tuple(merged)
