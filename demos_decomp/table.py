"""Recognised tasks as lines of text."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from demos_decomp.tasks import Task

_WAYS = {
    "up": (0, 0, 1),
    "down": (0, 0, -1),
    "forward": (1, 0, 0),
    "back": (-1, 0, 0),
    "left": (0, 1, 0),
    "right": (0, -1, 0),
}
_FROM = {
    "up": "below",
    "down": "above",
    "forward": "the front",
    "back": "behind",
    "left": "the right",
    "right": "the left",
}


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


def described(concept: str, parameters: Any) -> str:
    """What a task does, in words with numbers and units, without its concept and target."""
    parts: list[str] = []
    if "approach" in parameters:
        parts.append(f"from {_FROM[nearest_way(parameters['approach'])]}")
    if "distance" in parameters and concept != "place":
        parts.append(f"{nearest_way(parameters['direction'])} {float(parameters['distance']):.2f} m")
    if "off" in parameters:
        parts.append(f"off {parameters['off']}")
    if "on" in parameters:
        parts.append(f"onto {parameters['on']}")
    if "to" in parameters:
        parts.append(f"to {parameters['to']}")
    if "position" in parameters:
        parts.append("to ({:.2f}, {:.2f}, {:.2f}) m".format(*(np.round(parameters["position"], 2) + 0.0)))
    if "into" in parameters:
        parts.append(f"into {parameters['into']}")
    if "via" in parameters:
        count = len(parameters["via"])
        parts.append(f"{count} via-point{'' if count == 1 else 's'}" if count else "straight")
    if concept == "place" and "distance" in parameters:
        parts.append(f"{nearest_way(parameters['direction'])} {float(parameters['distance']):.2f} m")
    return ", ".join(parts)


def nearest_way(direction: Any) -> str:
    """The word for the axis of the robot base frame that a direction ``(3,)`` is nearest to."""
    vector = np.asarray(direction, dtype=float)
    return max(_WAYS, key=lambda name: float(vector @ np.array(_WAYS[name])))
