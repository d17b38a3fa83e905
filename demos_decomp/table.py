"""Recognised tasks as lines of text."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from bt_tasksim.concept.demonstrated import plain_words
from bt_tasksim.concept.task import Task
from bt_tasksim.demos_decomp.concepts import concept_of


def text_table(tasks: Iterable[Task]) -> str:
    """One line per task: seconds, concept, target, what it does, confidence.

    Args:
        tasks: In order of time.

    Returns:
        Lines without a final line break; empty where there are no tasks.
    """
    rows = [
        (
            f"{task.start:.1f} - {task.end:.1f} s",
            task.concept,
            str(task.parameters.get("target", "")),
            described(task.concept, task.parameters),
            f"{min(task.confidence, 1.0):.2f}",
        )
        for task in tasks
    ]
    if not rows:
        return ""
    widths = [max(len(row[i]) for row in rows) for i in range(4)]
    span = max(widths[3], 30)
    return "\n".join(
        f" {a:>{widths[0]}}  {b:<{widths[1]}}  {c:<{widths[2]}}  {d:<{span}}  {e}" for a, b, c, d, e in rows
    )


def described(concept: str, parameters: Mapping[str, Any]) -> str:
    """What a task does, in words with numbers and units, without its concept and target."""
    known = concept_of(concept)
    return plain_words(parameters, {}) if known is None else known.describe_task(parameters)
