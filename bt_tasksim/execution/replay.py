"""Running a recorded run again, and comparing it state by state."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from py_trees.behaviour import Behaviour

from bt_tasksim.concept import ConceptModel
from bt_tasksim.engines.registry import EngineOptions
from bt_tasksim.errors import InputError
from bt_tasksim.report.run_log import RunRecorder, nodes_of, read_text, versions
from bt_tasksim.runner import Result, Runner
from bt_tasksim.scene import ActorConfiguration, Scene
from demos_decomp.log import Demonstration
from demos_decomp.log_file import read_log

COMPARED = {
    "state/joint_position": ("joint positions", "rad or m"),
    "state/joint_velocity": ("joint velocities", "rad/s or m/s"),
    "state/objects": ("object poses", "m"),
    "state/velocities": ("object velocities", "m/s or rad/s"),
    "observations/objects": ("estimated object poses", "m"),
    "observations/wrench": ("the wrist's wrench", "N or Nm"),
    "observations/contact_force": ("contact forces", "N"),
    "commands/tool": ("the tool's command", "m"),
    "commands/hand": ("the hand's command", ""),
    "tree/status": ("statuses", ""),
}
"""What is compared bit for bit: how a sentence names it, and its unit."""


@dataclass(frozen=True)
class ReplayResult:
    """How a run and its repetition compare.

    Attributes:
        identical: Every compared number is the same, bit for bit.
        why: One sentence.
        time: Seconds at which the first difference was seen; None where there is none.
        differences: Largest difference by compared array, where there is one; infinity where one has a number
            and the other has none.
        changed: What differs in versions, machine and policies: recorded and present one, by name.
        result: What the repetition gave.
    """

    identical: bool
    why: str
    time: float | None
    differences: dict[str, float]
    changed: dict[str, tuple[str, str]]
    result: Result


def replay(run: str | Path, tree: Behaviour | None = None) -> ReplayResult:
    """Run a recorded run again with everything as it was, and compare.

    Args:
        run: A run's folder, or its log.
        tree: Its tree, where it has leaves that XML cannot hold or that are not found by name.

    Raises:
        InputError: There is no such log, it is none of a run in simulation, or its tree cannot be built.
        MachineError: An engine cannot start.
    """
    path = Path(run) / "run.h5" if Path(run).is_dir() else Path(run)
    log = read_log(path)
    recorded = log.demonstrations[0]
    parts = _parts(recorded, path)
    if log.source != "simulation":
        raise InputError(f"'{path}' was recorded on a robot; only runs in simulation can be replayed")
    about = json.loads(parts["run/about"])
    configuration = ActorConfiguration.from_json(parts["run/configuration"])
    root = tree if tree is not None else _tree(parts["run/tree"], path)
    _take_policies(root, recorded, path)
    runner = Runner(
        root,
        Scene(configuration.robot),
        _options(about, path),
        longest=float(about["longest"]),
    )
    assert runner.pipeline is not None
    recorder = RunRecorder(runner, str(about["scenario"]))
    try:
        result = runner.finish(configuration, runner.reset(configuration), record=recorder)
    finally:
        runner.pipeline.close()
    repeated = recorder.demonstration(result)
    before, now = about["versions"], versions(runner.robot)
    before |= _policies(about["policies"])
    now |= _policies(result.policies)
    changed = {
        name: (before.get(name, "none"), now.get(name, "none"))
        for name in sorted({*before, *now})
        if before.get(name) != now.get(name)
    }
    return _compared(recorded, repeated, result, changed)


def _parts(recorded: Demonstration, path: Path) -> dict[str, str]:
    names = ("run/about", "run/configuration", "run/tree")
    if any(name not in recorded.extra for name in (*names, "tree/status")):
        raise InputError(f"'{path}' is a demonstration, not the log of a run; only a run can be replayed")
    return {name: read_text(recorded.extra[name]) for name in names}


def _options(about: Mapping[str, Any], path: Path) -> EngineOptions:
    known = {field.name for field in fields(EngineOptions)}
    unknown = set(about["options"]) - known
    if unknown:
        raise InputError(
            f"'{path}' was run with the option '{min(unknown)}', which this version does not have"
        )
    return EngineOptions(**{**about["options"], "rendering": False, "real_time": False})


def _tree(text: str, path: Path) -> Behaviour:
    from trees.xml_reader import tree_from_xml

    if not text:
        raise InputError(f"'{path}' does not hold its tree, which XML could not; replay it from Python")
    return tree_from_xml(text, source=f"{path}: run/tree")


def _take_policies(root: Behaviour, recorded: Demonstration, path: Path) -> None:
    """Have each leaf take the policy that it had, whatever is pinned by now."""
    if "run/policies" not in recorded.extra:  # an older log: all were programmed
        return
    nodes = nodes_of(root)
    for entry in json.loads(read_text(recorded.extra["run/policies"])):
        leaf = nodes[entry["node"]] if entry["node"] < len(nodes) else None
        if not isinstance(leaf, ConceptModel):
            raise InputError(f"'{path}' was recorded with another tree; give that one")
        if entry["source"]:
            leaf.policy = entry["source"]


def _policies(names: Mapping[str, str]) -> dict[str, str]:
    return {f"policy of '{leaf}'": name for leaf, name in names.items()}


def _compared(
    recorded: Demonstration, repeated: Demonstration, result: Result, changed: dict[str, tuple[str, str]]
) -> ReplayResult:
    count = min(len(recorded.time), len(repeated.time))
    first, differences = count, {}
    for name in COMPARED:
        if name not in recorded.extra and name not in repeated.extra:
            continue
        if name not in recorded.extra or name not in repeated.extra:
            first, differences[name] = 0, float("inf")
            continue
        gap = _gap(recorded.extra[name], repeated.extra[name], count)
        if (gap > 0).any():
            first = min(first, int(np.argmax(gap > 0)))
            differences[name] = float(gap.max())
    same_length = len(recorded.time) == len(repeated.time)
    if not differences and same_length:
        why = f"identical bit for bit over {count} ticks: {result.why}"
        return ReplayResult(True, why, None, {}, changed, result)
    time = float(recorded.time[min(first, count - 1)])
    if differences:
        sizes = ", ".join(_size(name, size) for name, size in differences.items())
        what = f"different from {time:.2f} s on, at most by: {sizes}"
    else:
        longer = "recorded" if len(recorded.time) > len(repeated.time) else "repeated"
        what = f"the same up to {time:.2f} s, where the {longer} run goes on and the other ends"
    said = ", ".join(f"{name} {old}, now {new}" for name, (old, new) in changed.items())
    return ReplayResult(
        False,
        f"{what}; {f'recorded with {said}' if said else 'versions are the same'}",
        time,
        differences,
        changed,
        result,
    )


def _gap(a: NDArray[Any], b: NDArray[Any], count: int) -> NDArray[np.float64]:
    """Largest difference ``(count,)`` in each tick; infinite where only one is a number."""
    if a.shape[1:] != b.shape[1:]:
        return np.full(count, np.inf)
    rows_a = a[:count].reshape(count, -1).astype(np.float64)
    rows_b = b[:count].reshape(count, -1).astype(np.float64)
    missing = np.isnan(rows_a) != np.isnan(rows_b)
    gap: NDArray[np.float64] = np.where(missing, np.inf, np.nan_to_num(np.abs(rows_a - rows_b)))
    return np.asarray(gap.max(axis=1, initial=0.0))


def _size(name: str, size: float) -> str:
    title, unit = COMPARED[name]
    if name == "tree/status":
        return title
    return f"{title} {size:.2g} {unit}".strip() if np.isfinite(size) else f"{title} (one has none)"
