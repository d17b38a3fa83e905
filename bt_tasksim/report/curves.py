"""What the report draws, as plain data: curves, spans of statuses, messages."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bt_tasksim.demos_decomp.log import Demonstration
from bt_tasksim.execution.run_log import read_text, read_texts
from bt_tasksim.robot.description import RobotDescription, load_robot

Curve = dict[str, Any]
Panel = dict[str, Any]

_STATUSES = ("", "RUNNING", "SUCCESS", "FAILURE")


def report_data(run: Demonstration) -> dict[str, Any]:
    """Everything that the report shows of a run, as plain data for JSON.

    Args:
        run: A recorded run, of `RunRecorder.demonstration` or read from its log.

    Returns:
        ``time``, ``end`` (when the tree ended), ``nodes``, ``spans`` (by node: first and last tick and
        status), ``messages``, ``panels`` (curves that share an axis), ``about``, ``configuration``.
    """
    about = json.loads(read_text(run.extra["run/about"]))
    nodes = json.loads(read_text(run.extra["run/nodes"]))
    messages = zip(
        run.extra["messages/time"].tolist(),
        run.extra["messages/node"].tolist(),
        read_texts(run.extra["messages/text"]),
        strict=True,
    )
    return {
        "time": _rounded(run.time, 4),
        "end": min(float(about["sim_time"]), float(run.time[-1])),
        "nodes": nodes,
        "spans": status_spans(run.extra["tree/status"]),
        "messages": [[round(time, 4), node, text] for time, node, text in messages],
        "panels": panels(run, nodes, load_robot(about["robot"])),
        "about": about,
        "objectsAre": run.notes.get("objects_are", ""),
    }


def status_spans(status: NDArray[np.int8]) -> list[list[list[Any]]]:
    """By node, the spans ``[first tick, tick after the last, status]`` in which it has a status.

    Args:
        status: ``(T, nodes)``, numbers as in a run's log.
    """
    out = []
    for column in status.T:
        edges = [0, *(np.flatnonzero(np.diff(column)) + 1).tolist(), len(column)]
        out.append([[a, b, _STATUSES[column[a]]] for a, b in pairwise(edges) if a < b and column[a]])
    return out


def panels(run: Demonstration, nodes: list[dict[str, Any]], robot: RobotDescription) -> list[Panel]:
    """The curves, by panel; a panel without any number is left out."""
    seen = run.extra
    tips = [tip.name for tip in robot.tips]
    cost = seen["tree/necessary_cost"]
    concepts = [node for node in nodes if node["concept"]]
    force = np.linalg.norm(seen["observations/contact_force"], axis=-1)
    wrench = seen["observations/wrench"]
    tool, hand = _kept(seen["commands/tool"][:, 2]), _kept(seen["commands/hand"][:, 0])
    heights = [(name, track.pose[:, 2]) for name, track in run.objects.items()]
    heights = [("tool", run.hand_pose[:, 2]), ("tool, commanded", tool), *heights]
    closure = [("measured", seen["observations/closure"]), ("commanded", hand)]
    joints = zip(_short(robot.arm_joints), seen["observations/arm_position"].T, strict=True)
    costs = [(node["name"], cost[:, node["id"]]) for node in concepts]
    found = [
        _panel("Height of tool and objects", "m", heights, dashed="tool, commanded"),
        _panel("Hand opening", "mm", [("between the fingertips", 1000 * run.hand_opening)]),
        _panel("Hand closure (0 open, 1 shut)", "", closure, dashed="commanded"),
        _panel("Contact force at the fingertips", "N", zip(tips, force.T, strict=True)),
        _panel("Force at the wrist, tool frame", "N", zip("xyz", wrench[:, :3].T, strict=True)),
        _panel("Torque at the wrist, tool frame", "Nm", zip("xyz", wrench[:, 3:].T, strict=True)),
        _panel("Joint positions", "rad", joints),
        _panel("Necessary cost, of each concept in its own unit", "", costs),
    ]
    if "state/objects" in seen:
        gap = seen["state/objects"][..., :3] - seen["observations/objects"][..., :3]
        error = 1000 * np.linalg.norm(gap, axis=-1)
        found.append(_panel("Error of the estimated position", "mm", zip(run.objects, error.T, strict=True)))
    return [panel for panel in found if panel["curves"]]


def _panel(title: str, unit: str, values: Iterable[tuple[str, Any]], dashed: str = "") -> Panel:
    curves = [
        {"name": name, "values": _rounded(column), "dashed": name == dashed}
        for name, column in values
        if np.isfinite(column).any()
    ]
    return {"title": title, "unit": unit, "curves": curves}


def _kept(commanded: NDArray[np.float64]) -> NDArray[np.float64]:
    """A command ``(T,)`` as the robot follows it: where nothing was written, the last one."""
    at = np.where(np.isfinite(commanded), np.arange(len(commanded)), 0)
    return commanded[np.maximum.accumulate(at)]


def _short(names: tuple[str, ...]) -> list[str]:
    """Joint names without what they all begin with, or numbers where nothing is left."""
    start = 0
    while len(names) > 1 and all(len(n) > start for n in names) and len({n[start] for n in names}) == 1:
        start += 1
    short = [name[start:] for name in names]
    if all(name.isdigit() for name in short):
        return [f"joint {name}" for name in short]
    return short if all(short) else list(names)


def _rounded(values: Any, digits: int = 5) -> list[float | None]:
    """Numbers for JSON: five significant digits, None for NaN."""
    return [
        float(f"{v:.{digits}g}") if math.isfinite(v) else None for v in np.asarray(values, float).tolist()
    ]
