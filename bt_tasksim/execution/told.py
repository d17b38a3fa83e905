"""What a log says of its run in words, and whether as much can be said of the run's repetition."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from bt_tasksim.core.json_text import parse_json, parse_json_object
from bt_tasksim.core.plain import shown, where_text
from bt_tasksim.demos_decomp.log import Demonstration
from bt_tasksim.execution.recorded import Recorded
from bt_tasksim.execution.recorded_arrays import ROUNDED, as_read
from bt_tasksim.execution.result import Result
from bt_tasksim.execution.run_log import read_text

NOT_THE_RUNS = frozenset({"options", "longest", "wall_time", "timing", "versions", "policies"})
"""What ``run/about`` says that no repetition gives again: what was asked for, and clocks; and versions and
policies, which are named where they changed."""
_JUDGED = frozenset({"reason", "why", "outcome"})
"""What the success evaluator said, where a tree succeeded."""


def told_otherwise(run: Recorded, repeated: Demonstration, result: Result) -> str:
    """In words, the first thing that a log says otherwise of its run than its repetition does; else nothing.

    What a log lacks is not compared, nor what a goal decides that is a function: a log holds its name alone.

    Args:
        run: What the log says.
        repeated: The log of the repetition.
        result: What the repetition gave.
    """
    about = parse_json_object(read_text(repeated.extra["run/about"]), "run/about")
    left_out = NOT_THE_RUNS | _not_known(run, result) | ({"robot"} if run.robot_named else frozenset())
    if judged := _judged_otherwise(run, result, left_out):
        return judged
    for where, said, now in _both(run, repeated, about, result):
        if where[-1] not in left_out and (found := _difference(said, now)) is not None:
            at, said, now = found
            name = where_text((*where, *at))
            return f"the log says of its {name} {_quoted(said)}, and now it is {_quoted(now)}"
    return ""


def _not_known(run: Recorded, result: Result) -> frozenset[str]:
    """Names of what is said of the run that its functions have a say in."""
    if not run.configuration.functions:
        return frozenset()
    found = {"judged", "verdict"}
    if result.success:  # a failure is one whatever functions say
        found.add("success")
    if result.status.name == "SUCCESS":
        found |= _JUDGED
    return frozenset(found)


def _judged_otherwise(run: Recorded, result: Result, left_out: frozenset[str]) -> str:
    said = ("fails" if run.success is False else "succeeds") + (f" ({run.reason})" if run.reason else "")
    same = run.success in (None, result.success) or "success" in left_out
    same = same and (run.reason in ("", result.reason) or "reason" in left_out)
    return "" if same else f"the log says that it {said}, and it is judged now: {result.why}"


def _both(
    run: Recorded, repeated: Demonstration, about: Mapping[str, Any], result: Result
) -> Iterator[tuple[tuple[str, ...], Any, Any]]:
    """Where something stands, what the log says there, and what the repetition's would."""
    log = run.demonstration
    for name in about:
        if name in run.about:
            yield (name,), run.about[name], about[name]
    for name, now in repeated.notes.items():
        if name in log.notes:
            yield ("attribute", name), log.notes[name], now
    if log.task:
        yield ("attribute", "task"), log.task, repeated.task
    if log.seed is not None:
        yield ("attribute", "seed"), log.seed, repeated.seed
    if run.description:
        yield ("description", "why"), run.description, result.why
    yield ("objects",), _things(log), _things(repeated)
    yield ("places",), _surfaces(log), _surfaces(repeated)
    if "run/nodes" in log.extra:
        yield ("nodes",), _nodes(log), _nodes(repeated)
    for name in ("text", "time", "node"):
        if f"messages/{name}" in log.extra:
            yield ("messages", name), _listed(log, name), _listed(repeated, name)


def _things(log: Demonstration) -> dict[str, Any]:
    return {
        name: {"kind": track.kind, "size": np.asarray(track.size).tolist()}
        for name, track in log.objects.items()
    }


def _surfaces(log: Demonstration) -> dict[str, Any]:
    """Places as a log that was read has them: a place of no fixture names none."""
    read = {
        name: replace(place, pose=as_read(place.pose), fixture=place.fixture or None)
        for name, place in log.places.items()
    }
    return {name: {k: np.asarray(v).tolist() for k, v in vars(place).items()} for name, place in read.items()}


def _nodes(log: Demonstration) -> Any:
    """Names and parents of the tree's nodes: what a type is called may change."""
    nodes = parse_json(read_text(log.extra["run/nodes"]), "run/nodes")
    if not isinstance(nodes, list):
        return nodes
    return [
        {k: v for k, v in n.items() if k in ("name", "parent")} if isinstance(n, dict) else n for n in nodes
    ]


def _listed(log: Demonstration, name: str) -> list[Any]:
    values = np.ravel(log.extra[f"messages/{name}"])
    return [read_text(value) for value in values] if values.dtype.kind in "SO" else list(values.tolist())


def _difference(said: Any, now: Any) -> tuple[tuple[str | int, ...], Any, Any] | None:
    """The first difference of plain data: the path to it, and both; what ``said`` lacks is none."""
    if isinstance(said, dict) and isinstance(now, dict):
        pairs = [(key, said[key], value) for key, value in now.items() if key in said]
    elif isinstance(said, list) and isinstance(now, list) and len(said) == len(now):
        pairs = list(zip(range(len(now)), said, now, strict=True))
    else:
        return None if _same(said, now) else ((), said, now)
    for key, one, other in pairs:
        if (found := _difference(one, other)) is not None:
            return (key, *found[0]), found[1], found[2]
    return None


def _same(said: Any, now: Any) -> bool:
    if isinstance(said, bool) or isinstance(now, bool):
        return said is now
    if isinstance(said, float) and isinstance(now, float):
        return bool(abs(said - now) <= ROUNDED)
    if isinstance(said, int | float) and isinstance(now, int | float):
        return said == now
    return type(said) is type(now) and bool(said == now)


def _quoted(value: Any) -> str:
    if isinstance(value, list):
        return f"a list of {len(value)}"
    return "a mapping" if isinstance(value, dict) else shown(repr(value), 160)
