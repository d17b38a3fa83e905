"""Running a recorded run again, and comparing it state by state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from py_trees.behaviour import Behaviour

from bt_tasksim.core.errors import InputError
from bt_tasksim.demos_decomp.log import Demonstration
from bt_tasksim.demos_decomp.log_file import read_log
from bt_tasksim.execution.recorded import Given, Recorded, recorded_run, take_policies
from bt_tasksim.execution.recorded_arrays import Arrays, arrays_of, gaps, sizes
from bt_tasksim.execution.result import Result
from bt_tasksim.execution.run_log import RunRecorder, versions
from bt_tasksim.execution.runner import Runner
from bt_tasksim.execution.told import told_otherwise
from bt_tasksim.scene.scene import Scene
from bt_tasksim.trees.load import Leaves


@dataclass(frozen=True)
class ReplayResult:
    """How a run and its repetition compare.

    Attributes:
        identical: Every compared number is the same, bit for bit, and so is what was said of the run.
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


def replay(
    run: str | Path,
    tree: Behaviour | None = None,
    *,
    robot: str | None = None,
    policies: Sequence[tuple[str, str]] = (),
    objects: str | Path | None = None,
    nodes: Leaves | None = None,
    until: float | None = None,
) -> ReplayResult:
    """Run a recorded run again with everything as it was, and compare.

    A log is believed in numbers and names only (see `bt_tasksim.execution.recorded`): it runs in this
    machine's own simulation, with bundled robots, meshes and policies, and with what is named here.

    Args:
        run: A run's folder, or its log.
        tree: Its tree, where it has leaves that XML cannot hold or that are not found by name.
        robot: Its robot, where that is not a bundled one.
        policies: Concepts and their policies, where those are not bundled ones.
        objects: Folder of its mesh files, where those are not bundled ones.
        nodes: Concepts and conditions of one's own by name, for a tree from the log.
        until: Seconds from the beginning that are run again and compared; None for all.

    Raises:
        InputError: There is no such log, it is none of a run in simulation, its tree cannot be built, or it
            wants a file or robot that has to be named here.
        MachineError: An engine cannot start.
    """
    path = Path(run) / "run.h5" if Path(run).is_dir() else Path(run)
    where, given = f"'{path}'", Given(robot, policies, objects, nodes or {})
    if until is not None and not until > 0:
        raise InputError(f"a replay of the first {until:g} s has nothing to compare: give a positive number")
    log = read_log(path)
    if log.source != "simulation" and "run/about" in log.demonstrations[0].extra:
        raise InputError(f"{where} was recorded on a robot; only runs in simulation can be replayed")
    recorded = recorded_run(log, given, where)
    compared = arrays_of(recorded.demonstration, where)
    root = tree if tree is not None else _tree(recorded.tree, given, where)
    take_policies(root, recorded, given, where, trusted=tree is not None)
    own, robot = recorded.options.own_world(), recorded.configuration.robot
    scene = Scene(robot) if own is None else own.with_robot(robot)
    longest = recorded.longest if until is None else min(until, recorded.longest)
    runner = Runner(root, scene, recorded.options, longest=longest)
    recorder = RunRecorder(runner, recorded.scenario)
    try:
        world = runner.reset(recorded.configuration)
        result = runner.finish(recorded.configuration, world, record=recorder)
    finally:
        runner.close()
    repeated = recorder.demonstration(result)
    before, now = recorded.versions, versions(runner.robot)
    now |= {f"policy of '{leaf}'": name for leaf, name in result.policies.items()}
    changed = {
        name: (before.get(name, "none"), now.get(name, "none"))
        for name in sorted({*before, *now})
        if before.get(name) != now.get(name)
    }
    return _compared(recorded, compared, repeated, result, changed, until)


def _tree(text: str, given: Given, where: str) -> Behaviour:
    from bt_tasksim.trees.xml_reader import tree_from_xml

    if not text:
        raise InputError(f"{where} does not hold its tree, which XML could not; name it: --tree FILE")
    return tree_from_xml(text, given.nodes, source=f"{where}: run/tree")


def _compared(
    run: Recorded,
    compared: Arrays,
    repeated: Demonstration,
    result: Result,
    changed: dict[str, tuple[str, str]],
    until: float | None,
) -> ReplayResult:
    recorded = run.demonstration
    lengths = [len(one.time) for one in (recorded, repeated)]
    if until is not None:  # what comes after it, and how it is judged there, is the shorter run's own
        lengths = [int(np.searchsorted(one.time, until)) for one in (recorded, repeated)]
    count = min(lengths)
    apart = gaps(compared, arrays_of(repeated, "the repetition"), count)
    first = min((int(np.argmax(gap > 0)) for gap in apart.values()), default=count)
    differences = {name: float(gap.max()) for name, gap in apart.items()}
    same_length = lengths[0] == lengths[1]
    said = ", ".join(f"{name} {old}, now {new}" for name, (old, new) in changed.items())
    if not differences and same_length and until is None and (told := told_otherwise(run, repeated, result)):
        why = f"the same states over {count} ticks, and yet {told}{f'; recorded with {said}' if said else ''}"
        return ReplayResult(False, why, float(recorded.time[-1]), {}, changed, result)
    if not differences and same_length:
        what = result.why if until is None else f"the first {until:g} s"
        why = f"identical bit for bit over {count} ticks: {what}{f'; recorded with {said}' if said else ''}"
        return ReplayResult(True, why, None, {}, changed, result)
    time = float(recorded.time[min(first, count - 1)])
    if differences:
        what = f"different from {time:.2f} s on, at most by: {sizes(differences)}"
    else:
        longer = "recorded" if lengths[0] > lengths[1] else "repeated"
        what = f"the same up to {time:.2f} s, where the {longer} run goes on and the other ends"
    return ReplayResult(
        False,
        f"{what}; {f'recorded with {said}' if said else 'versions are the same'}",
        time,
        differences,
        changed,
        result,
    )
