"""What `benchmarks.compare` runs in a process of its own, with one code or the other.

A script, run by its path with ``PYTHONPATH`` set to a checkout and never imported. Of the packages it uses
names that the documentation of both codes gives, and from ``benchmarks.grasp`` the untrained grasp.

    python compare_worker.py where
    python compare_worker.py untrained ROBOT FOLDER
    python compare_worker.py logs FOLDER SCENARIO FIRST COUNT FACTOR
    python compare_worker.py tasks          # reads a JSON list of [label, file, episode]
"""

from __future__ import annotations

import json
import sys
from pathlib import Path


def where() -> object:
    """The checkout that this process imports from."""
    import bt_tasksim

    return str(Path(bt_tasksim.__file__).resolve().parents[1])


def untrained(robot: str, folder: str) -> object:
    """Save the untrained grasp of `benchmarks.grasp`."""
    from benchmarks import grasp

    layout = tuple(grasp.Grasp.layout(grasp.load_robot(robot)).items())
    card = grasp.PolicyCard("grasp", robot, layout, grasp.Grasp.actions, "none")
    grasp.save_policy(folder, grasp.untrained(robot), card)
    return folder


def logs(folder: str, scenario: str, first: str, count: str, factor: str) -> object:
    """Write a synthetic log for each seed; what is there stays."""
    from demos_decomp import Log, write_log
    from demos_decomp.synthetic import make
    from demos_decomp.synthetic_motion import Sensing

    Path(folder).mkdir(parents=True, exist_ok=True)
    for seed in range(int(first), int(first) + int(count)):
        path = Path(folder) / f"{seed}.h5"
        if not path.exists():
            shown = make(scenario, seed, Sensing().worse(float(factor)))[0]
            write_log(path, Log("synthetic", (shown,)))
    return folder


def tasks() -> object:
    """The recognised task sequence of each log, by label; the error's class where a log is refused."""
    from demos_decomp import decompose_log, open_log

    found: dict[str, list[str]] = {}
    for label, file, episode in json.load(sys.stdin):
        try:
            found[label] = [task.concept for task in decompose_log(open_log(file), episode).tasks]
        except Exception as error:  # whatever it is: the log was not recognised
            found[label] = [type(error).__name__]
    return found


ACTIONS = {"where": where, "untrained": untrained, "logs": logs, "tasks": tasks}

if __name__ == "__main__":
    print(json.dumps(ACTIONS[sys.argv[1]](*sys.argv[2:])))
