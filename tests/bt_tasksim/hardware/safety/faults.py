"""Every fault of a run on the arm of these tests, injected at a random moment, and what became of it.

``python tests/bt_tasksim/safety/faults.py 20`` injects each 20 times and prints a table; names of faults may
follow.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
from arm import ArmProcess, runner_of

from bt_tasksim.core.errors import BtTasksimError

QUIET = 0.05
"""Longest time in seconds between two steps of the arm's process in a measurement that counts."""


@dataclass
class Seen:
    """What became of a fault.

    Attributes:
        held: Seconds from the fault until the arm was told to hold, or held by itself.
        still: Seconds until it stood.
        far: Farthest that a joint got from where it was at the fault, rad.
        drift: Motion of the arm in the 0.3 s after it stood, rad.
        said: The message.
        running: Nodes that had not ended.
        again: A fresh run afterwards was as it should be.
        fastest: Greatest speed of a joint after the fault, rad/s.
        busy: Longest time between two steps of the arm's process.
    """

    held: float
    still: float
    far: float
    drift: float
    said: str
    running: list[str]
    again: bool
    fastest: float
    busy: float


def later(wait: float, act: Callable[[], None]) -> None:
    """Do something after some time, on a thread."""
    timer = threading.Timer(wait, act)
    timer.daemon = True
    timer.start()


def of_states(name: str) -> Callable[..., None]:
    """A fault of what the arm reports, or of the connection."""

    def inject(arm: ArmProcess, runner: Any, leaf: Any, wait: float) -> None:
        later(wait, lambda: arm.inject(name))

    return inject


def of_leaf(act: Callable[[Any], Any]) -> Callable[..., None]:
    """A fault of a leaf, in the tick that comes next."""

    def inject(arm: ArmProcess, runner: Any, leaf: Any, wait: float) -> None:
        began = time.monotonic() + wait

        def trouble(tool: Any) -> Any:
            if time.monotonic() < began:
                return tool
            leaf.trouble = lambda tool: tool
            arm.inject("leaf")
            return act(tool)

        leaf.trouble = trouble

    return inject


def kill_watchdog(arm: ArmProcess, runner: Any, leaf: Any, wait: float) -> None:
    def act() -> None:
        arm.inject("watchdog")
        os.kill(runner.pipeline.physics.watchdog.pid, signal.SIGKILL)

    later(wait, act)


def raise_error(tool: Any) -> Any:
    raise ZeroDivisionError("oh")


def block(tool: Any) -> Any:
    time.sleep(2.0)
    return tool


IN_PROCESS: dict[str, Callable[..., None]] = {
    "joint states stop": of_states("silent"),
    "joint states frozen": of_states("frozen"),
    "states delayed 300 ms": of_states("delayed"),
    "NaN in a state": of_states("nan"),
    "wrong joint order": of_states("order"),
    "positions of two joints mixed up": of_states("mixed"),
    "emergency stop": of_states("estop"),
    "connection lost": of_states("drop"),
    "leaf raises": of_leaf(raise_error),
    "leaf blocks 2 s": of_leaf(block),
    "policy gives NaN": of_leaf(lambda tool: tool * np.nan),
    "no solution of the inverse kinematics": of_leaf(lambda tool: tool + np.array([3.0, 0, 0, 0, 0, 0, 0])),
    "watchdog killed": kill_watchdog,
}
SIGNALS = {
    "SIGINT": signal.SIGINT,
    "SIGTERM": signal.SIGTERM,
    "SIGKILL of the runner": signal.SIGKILL,
    "SIGSTOP of the runner": signal.SIGSTOP,
}
FAULTS = (*IN_PROCESS, *SIGNALS)


def measure(fault: str, seed: int) -> Seen:
    """Inject a fault once."""
    wait = 0.3 + 0.7 * random.Random(f"{fault} {seed}").random()
    arm = ArmProcess()
    try:
        return _by_signal(arm, fault, wait) if fault in SIGNALS else _in_process(arm, fault, wait)
    finally:
        arm.close()


def _in_process(arm: ArmProcess, fault: str, wait: float) -> Seen:
    runner, leaf = runner_of(arm.port)
    runner.longest = 5.0
    arm.tell()

    def begin(tool: Any) -> Any:
        leaf.trouble = lambda tool: tool
        IN_PROCESS[fault](arm, runner, leaf, wait)
        return leaf.trouble(tool)

    try:
        leaf.trouble = begin
        try:
            result = runner.run(0)
            said = f"{result.status.name}: {result.reason}: {result.why}"
        except BtTasksimError as error:
            said = str(error)
        running = [n.name for n in runner.tree.iterate() if n.status.name == "RUNNING"]
        leaf.trouble, leaf.lasts = lambda tool: tool, 0.3
        return _after(arm, said, running, lambda: runner.run(0).status.name == "SUCCESS")
    finally:
        runner.close()


def _by_signal(arm: ArmProcess, fault: str, wait: float) -> Seen:
    here = Path(__file__).parent
    process = subprocess.Popen(
        [sys.executable, str(here / "arm.py"), str(arm.port)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": str(here.parents[3])},
    )  # fmt: skip
    assert process.stdout.readline().startswith("moving")
    arm.tell()
    time.sleep(wait - 0.3)
    arm.inject("signal")
    process.send_signal(SIGNALS[fault])
    told = arm.at_rest()
    if fault.startswith("SIGSTOP"):
        process.send_signal(signal.SIGCONT)
    out, err = process.communicate(timeout=10.0)

    def again() -> bool:
        runner, leaf = runner_of(arm.port)
        leaf.lasts = 0.3
        try:
            return runner.run(0).status.name == "SUCCESS"
        finally:
            runner.close()

    running = [] if "[]" in out or fault.endswith("runner") else [out]
    return _after(arm, f"{out} {err}", running, again, told)


def _after(
    arm: ArmProcess, said: str, running: list[str], again: Callable[[], bool], told: Any = None
) -> Seen:
    told = told or arm.at_rest()
    time.sleep(0.3)
    last = arm.tell()
    drift = max(abs(a - b) for a, b in zip(told["q"], last["q"], strict=True))
    note = told["fault"]
    return Seen(
        held=note["held"] - note["at"],
        still=note["still"] - note["at"],
        far=note["far"],
        drift=drift,
        said=" ".join(said.split()),
        running=running,
        again=again(),
        fastest=last["fault"]["fastest"],
        busy=told["busy"],
    )


def main(times: int, faults: Sequence[str] = FAULTS) -> None:
    """Print the table."""
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
    print("| fault | held after, median and longest | stands after | farthest joint | again | said |")
    print("|---|---|---|---|---|---|")
    for fault in faults:
        seen = [measure(fault, seed) for seed in range(times)]
        held = [1000 * s.held for s in seen]
        still = 1000 * max(s.still for s in seen)
        print(
            f"| {fault} | {np.median(held):.0f}, {max(held):.0f} ms | {still:.0f} ms "
            f"| {max(s.far for s in seen):.3f} rad | {sum(s.again for s in seen)} of {times} "
            f"| {seen[0].said} |",
            flush=True,
        )


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2:] or FAULTS)
