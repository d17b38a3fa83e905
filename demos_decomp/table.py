"""Recognised tasks as a table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from bt_tasksim.concept.demonstrated import plain_words
from bt_tasksim.concept.task import Task
from bt_tasksim.demos_decomp.concepts import concept_of

HEADS = ("time", "concept", "object", "what", "confidence")
"""What stands in the columns of `task_rows`."""


def task_rows(tasks: Iterable[Task]) -> list[tuple[str, str, str, str, str]]:
    """A row per task: seconds, concept, target, what it does, confidence; the table everywhere."""
    return [
        (
            f"{task.start:.1f} - {task.end:.1f} s",
            task.concept,
            str(task.parameters.get("target", "")),
            described(task.concept, task.parameters),
            f"{min(task.confidence, 1.0):.2f}",
        )
        for task in tasks
    ]


def text_table(tasks: Iterable[Task], seen: Sequence[str] | None = None) -> str:
    """One line per task: seconds, concept, target, what it does, confidence.

    Args:
        tasks: In order of time.
        seen: In how many demonstrations each was seen, in words: one column more.

    Returns:
        Lines without a final line break; empty where there are no tasks.
    """
    rows = task_rows(tasks)
    more = [f"  {text:>{max(map(len, seen))}}" for text in seen] if seen else [""] * len(rows)
    if not rows:
        return ""
    widths = [max(len(row[i]) for row in rows) for i in range(4)]
    span = max(widths[3], 30)
    return "\n".join(
        f" {a:>{widths[0]}}  {b:<{widths[1]}}  {c:<{widths[2]}}  {d:<{span}}  {e}{more}"
        for (a, b, c, d, e), more in zip(rows, more, strict=True)
    )


def described(concept: str, parameters: Mapping[str, Any]) -> str:
    """What a task does, in words with numbers and units, without its concept and target."""
    known = concept_of(concept)
    return plain_words(parameters, {}) if known is None else known.describe_task(parameters)
