"""Every fault of a run on the twin over ROS, injected at random moments, and what became of the arm.

``python -m benchmarks.faults --times 20 --json benchmarks/results/faults.json`` injects each 20 times and
prints a table; ``--faults NAME ...`` only some. Times and ways are the twin's own in real time, read through
its evaluation channel; where the twin itself is killed, the time is the runner's and nobody knows the way.
The exit status is 1 where an arm was not held within 0.25 s, a node had not ended, or no fresh run worked.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import sealed
from benchmarks.sweep import SCENE, Sweep, sweeping
from bt_tasksim import Runner
from bt_tasksim.core.errors import BtTasksimError, MachineError
from bt_tasksim.core.files import write_text
from bt_tasksim.hardware.ros.setting import load_setting
from bt_tasksim.hardware.ros.websocket import WebSocket
from bt_tasksim.hardware.twin.evaluation import EvaluationClient
from bt_tasksim.hardware.twin.launch import Twin
from bt_tasksim.robot.description import load_robot

SENSORS = {
    "joint states stop": "silent",
    "joint states frozen": "frozen",
    "states delayed 300 ms": "delayed",
    "NaN in a state": "nan",
    "wrong joint order": "order",
}
LATEST = 0.25
"""Seconds within which the arm must be held."""
LEAVES: dict[str, Callable[[Any], Any]] = {}
PROCESSES = ("bridge killed", "bridge restarted", "twin killed", "watchdog killed")
SIGNALS = {
    "SIGINT": signal.SIGINT,
    "SIGTERM": signal.SIGTERM,
    "SIGKILL of the runner": signal.SIGKILL,
    "SIGSTOP of the runner": signal.SIGSTOP,
}


def leaf(name: str) -> Callable[[Callable[[Any], Any]], Callable[[Any], Any]]:
    """Enter a fault of a leaf under a name."""

    def enter(act: Callable[[Any], Any]) -> Callable[[Any], Any]:
        LEAVES[name] = act
        return act

    return enter


@leaf("leaf raises")
def _raise(tool: Any) -> Any:
    raise ZeroDivisionError("oh")


@leaf("leaf blocks 2 s")
def _block(tool: Any) -> Any:
    time.sleep(2.0)
    return tool


@leaf("policy gives NaN")
def _nan(tool: Any) -> Any:
    return tool * np.nan


@leaf("no solution of the inverse kinematics")
def _far(tool: Any) -> Any:
    return tool + np.array([3.0, 0, 0, 0, 0, 0, 0])


FAULTS = (*SENSORS, *LEAVES, *PROCESSES, "emergency stop", *SIGNALS)


@dataclass
class Seen:
    """What became of one fault.

    Attributes:
        held: Seconds from the fault until the arm was told to hold, or stood by itself; infinite for never.
        still: Seconds until it stood; likewise.
        far: Farthest that a joint got from where it was at the fault, rad; NaN where nobody knows.
        drift: Motion of the arm in the 0.3 s after it stood, rad; likewise.
        by: What held it.
        said: The message of the run.
        running: Nodes that had not ended.
        again: A fresh run afterwards worked.
        left_out: Seconds of the run in which the twin's physics stood still, since the machine was busy.
        fastest: Greatest speed of the set-points after the fault, as a share of a joint's limit.
        hardest: Greatest acceleration, likewise; within a command it may be four times the limit.
    """

    held: float
    still: float
    far: float
    drift: float
    by: str
    said: str
    running: list[str]
    again: bool
    left_out: float = 0.0
    fastest: float = math.nan
    hardest: float = math.nan

    @property
    def good(self) -> bool:
        """The arm was held in time, every node ended, and a fresh run worked."""
        return self.held <= LATEST and not self.running and self.again


class Bench:
    """A twin to break, and what is needed for it.

    Args:
        domain: ROS domain.
        ros: File with topics and names; by default the robot's bundled one.
        camera: With pictures.
    """

    def __init__(self, domain: int = 43, ros: str = "", camera: bool = False) -> None:
        self.robot, self.ros = load_robot("panda"), ros
        self.setting = load_setting(self.robot, ros)
        self.configuration = SCENE.sample(0)
        quiet: Any = subprocess.DEVNULL
        self.twin = Twin(self.robot, self.configuration, domain=domain, ros=ros, log=quiet, camera=camera)
        try:
            self.evaluation = EvaluationClient(self.twin.evaluation_port, self.twin.secret)
        except BaseException:
            self.twin.close()
            raise

    def sweeping(self) -> tuple[Runner, Sweep]:
        """A runner of a sweep on this twin."""
        return sweeping(self.twin.port, self.ros)

    def press(self, pressed: bool) -> None:
        """The emergency stop's topic, as another machine in the cell would publish it."""
        topic = self.setting.emergency_stop
        button = WebSocket("127.0.0.1", self.twin.port)
        button.send(json.dumps({"op": "advertise", "topic": topic, "type": "std_msgs/Bool"}))
        time.sleep(0.3)
        if pressed:
            self.evaluation.fault("emergency stop")
        button.send(json.dumps({"op": "publish", "topic": topic, "msg": {"data": pressed}}))
        time.sleep(0.2)
        button.close()

    def restart(self) -> None:
        """Have both processes run again, and the evaluation channel answer.

        A node that was killed takes its bridge with it, as where `bt-tasksim twin` is started again.
        """
        bridge, node = self.twin.bridge, self.twin.node
        again = node is None or node.poll() is not None
        if again and bridge is not None and bridge.poll() is None:
            bridge.terminate()
            bridge.wait()
        if bridge is None or bridge.poll() is not None:
            self.twin.start_bridge()
        if again:
            self.twin.start_node()
            self.evaluation.close()
            self.evaluation = EvaluationClient(self.twin.evaluation_port, self.twin.secret)

    def at_rest(self, patience: float = 5.0) -> dict[str, Any]:
        """What the twin says once the arm was held and stands, or after so many seconds."""
        end = time.monotonic() + patience
        while True:
            told = self.evaluation.tell()
            note = told["fault"]
            if note is None:
                raise MachineError("the twin has heard of no fault")
            if time.monotonic() > end or (note["held"] is not None and note["still"] is not None):
                return told
            time.sleep(0.02)

    def close(self) -> None:
        """End everything."""
        self.evaluation.close()
        self.twin.close()


def attempt(bench: Bench, fault: str, seed: int) -> Seen:
    """As `measure`; what makes that impossible is a bad result, and the next one is measured all the same."""
    try:
        return measure(bench, fault, seed)
    except (BtTasksimError, RuntimeError, OSError, subprocess.SubprocessError) as error:
        said = " ".join(f"not measured: {type(error).__name__}: {error}".split())
        return Seen(math.inf, math.inf, math.nan, math.nan, "", said, [], False)


def measure(bench: Bench, fault: str, seed: int) -> Seen:
    """Inject a fault once, at a moment that follows from the seed.

    Raises:
        BtTasksimError, RuntimeError, OSError, SubprocessError: There was no run to break.
    """
    bench.restart()
    bench.evaluation.load(bench.configuration)
    wait = 0.5 + 1.5 * random.Random(f"{fault} {seed}").random()
    return _by_signal(bench, fault, wait) if fault in SIGNALS else _in_process(bench, fault, wait)


def _in_process(bench: Bench, fault: str, wait: float) -> Seen:
    runner, model = bench.sweeping()
    model.lasts = 6.0
    broke: list[float] = []
    _prepare(bench, runner, model, fault, wait, broke)
    try:
        try:
            result = runner.run(0)
            said = f"{result.status.name}: {result.reason}: {result.why}"
        except BtTasksimError as error:
            said = str(error)
        ended = time.monotonic()
        running = _running(runner)
        if fault not in LEAVES and not broke:
            raise RuntimeError(f"the run ended before the fault: {said}")
        if fault == "twin killed":
            bench.restart()
            seconds, gone = ended - broke[0], "the arm is gone with the twin"
            again = works(runner, model)
            return Seen(seconds, seconds, math.nan, math.nan, gone, " ".join(said.split()), running, again)

        def again_after() -> bool:
            bench.restart()
            bench.evaluation.fault("")  # the sensors work again
            if fault == "emergency stop":
                bench.press(False)
            return works(runner, model)

        return _after(bench, said, running, again_after)
    finally:
        runner.close()


def works(runner: Runner, model: Sweep) -> bool:
    """A short run without trouble succeeds; it is repeated where a busy machine let the robot fall silent."""
    model.trouble, model.lasts = lambda tool: tool, 0.3
    for _ in range(3):
        try:
            return runner.run(0).status.name == "SUCCESS"
        except BtTasksimError as error:
            print(f"a fresh run: {error}", file=sys.stderr)
            if "is silent for" not in str(error):
                return False
    return False


def _prepare(bench: Bench, runner: Any, model: Any, fault: str, wait: float, broke: list[float]) -> None:
    """Have the fault happen so many seconds after the first tick."""

    def act() -> None:
        broke.append(time.monotonic())
        if fault in SENSORS:
            bench.evaluation.fault(SENSORS[fault])
        elif fault == "emergency stop":
            bench.press(True)
        elif fault == "watchdog killed":
            bench.evaluation.fault(fault)
            os.kill(runner.pipeline.physics.watchdog.pid, signal.SIGKILL)
        elif fault == "twin killed":
            assert bench.twin.node is not None
            bench.twin.node.kill()
        else:
            bench.evaluation.fault(fault)
            assert bench.twin.bridge is not None
            bench.twin.bridge.kill()
            if fault == "bridge restarted":
                bench.twin.bridge.wait()
                bench.twin.start_bridge()

    began: list[float] = []

    def trouble(tool: Any) -> Any:
        if not began:
            began.append(time.monotonic())
            if fault not in LEAVES:
                timer = threading.Timer(wait, act)
                timer.daemon = True
                timer.start()
        if fault in LEAVES and time.monotonic() > began[0] + wait:
            model.trouble = lambda tool: tool
            bench.evaluation.fault(fault)
            return LEAVES[fault](tool)
        return tool

    model.trouble = trouble


def _by_signal(bench: Bench, fault: str, wait: float) -> Seen:
    process = subprocess.Popen(
        [sys.executable, "-m", "benchmarks.faults", "--run", str(bench.twin.port), "--ros", bench.ros],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=Path(__file__).parents[1],
    )  # fmt: skip
    try:
        assert process.stdout is not None
        if not process.stdout.readline().startswith("moving"):
            raise MachineError(f"the run did not begin: {process.communicate(timeout=15.0)[1]}")
        time.sleep(wait)
        bench.evaluation.fault(fault)
        process.send_signal(SIGNALS[fault])
        told = bench.at_rest()
        if fault.startswith("SIGSTOP"):
            process.send_signal(signal.SIGCONT)
        out, err = process.communicate(timeout=15.0)
    finally:
        process.kill()
        process.wait()

    def again() -> bool:
        runner, model = bench.sweeping()
        try:
            return works(runner, model)
        finally:
            runner.close()

    running = [] if "[]" in out or fault == "SIGKILL of the runner" else [out]
    return _after(bench, f"{out} {err}", running, again, told)


def _after(
    bench: Bench, said: str, running: list[str], again: Callable[[], bool], told: dict[str, Any] | None = None
) -> Seen:
    told = told or bench.at_rest()
    time.sleep(0.3)
    last = bench.evaluation.tell()
    drift = max(abs(a - b) for a, b in zip(told["position"], last["position"], strict=True))
    note = last["fault"]
    held, still = (math.inf if note[key] is None else note[key] for key in ("held", "still"))
    left_out = last["left_out"]
    said = " ".join(said.split())
    peaks = note["fastest"], note["hardest"]
    return Seen(held, still, note["far"], drift, note["why"], said, running, again(), left_out, *peaks)


def _running(runner: Any) -> list[str]:
    """Names of the nodes that have not ended."""
    return [node.name for node in runner.tree.iterate() if node.status.name == "RUNNING"]


def run_child(port: int, ros: str) -> None:
    """A run in a process of its own: a word when the arm moves."""
    runner, _ = sweeping(port, ros)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
    told = []

    def moving(step: Any) -> None:
        if not told and float(step.observation.time) > 0.3:
            told.append(True)
            print("moving", flush=True)

    try:
        result = runner.run(0, record=moving)
        print("result", result.status.name, result.why, _running(runner), flush=True)
    except KeyboardInterrupt as stop:
        print("stopped", type(stop).__name__, str(stop), _running(runner), flush=True)
    except BtTasksimError as error:
        print("error", error, flush=True)
    finally:
        runner.close()


@contextlib.contextmanager
def bench_of(domain: int, ros: str = "", camera: bool = False) -> Iterator[Bench]:
    """A bench, closed at the end."""
    bench = Bench(domain, ros, camera)
    try:
        yield bench
    finally:
        bench.close()


HEAD = (
    "| fault | held after: median, longest | stands after | farthest joint | again | busy | by | said |\n"
    "|---|---|---|---|---|---|---|---|"
)


def row(fault: str, seen: Sequence[Seen]) -> str:
    """A line of the table; *busy* counts runs in which the twin's physics stood still for a while."""
    held, ways = [1000 * s.held for s in seen], [s.far for s in seen if not math.isnan(s.far)]
    first = next((s for s in seen if not s.good), seen[0])
    return (
        f"| {fault} | {np.median(held):.0f}, {max(held):.0f} ms | {1000 * max(s.still for s in seen):.0f} ms "
        f"| {f'{max(ways):.3f} rad' if ways else 'not known'} | {sum(s.again for s in seen)} of {len(seen)} "
        f"| {sum(s.left_out > 0.0 for s in seen)} | {first.by} | {first.said} |"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=int, default=2)
    parser.add_argument("--faults", nargs="*", default=list(FAULTS), metavar="NAME")
    parser.add_argument("--domain", type=int, default=43)
    parser.add_argument("--ros", default="", metavar="FILE", help="topics, by default the bundled ones")
    parser.add_argument("--json", type=Path)
    sealed.add_arguments(parser, first=0)
    parser.add_argument("--run", type=int, metavar="PORT", help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.run is not None:
        run_child(options.run, options.ros)
        return 0
    try:
        seeds = sealed.choose(options.block, options.seed, "faults/faults", options.times)
    except BtTasksimError as error:
        print(f"faults: {error}", file=sys.stderr)
        return 2
    found: dict[str, list[dict[str, Any]]] = {}
    good = True
    print(HEAD)
    with bench_of(options.domain, options.ros) as bench:
        for fault in options.faults:
            seen = [attempt(bench, fault, seed) for seed in seeds]
            good = good and all(s.good for s in seen)
            found[fault] = [asdict(s) for s in seen]
            print(row(fault, seen), flush=True)
            if options.json:
                write_text(options.json, json.dumps(found, indent=1) + "\n")
    if options.block is not None:
        sealed.keep(options.block, "faults/faults", found)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
