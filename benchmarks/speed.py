"""How fast: `make bench`, or ``bt-tasksim bench``. Ratios within one run, medians over rounds.

1. Control steps per second of ``pick_and_place`` against ManiSkill's ``PickCube-v1`` (one process, state
   observations, ``pd_joint_delta_pos``, random actions), both with 100 Hz physics and 20 Hz control: once
   whole episodes with their resets, once without the resets.
2. Time outside physics for one control step, by part.
3. A tick without the concepts' own functions, over a tick of a plain py_trees tree of the same shape.
4. ``bt-tasksim --help``.
"""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import py_trees
from py_trees.common import Status

from benchmarks.peer_maniskill import environment, rates
from bt_tasksim.concept.leaf import ONE, ConceptNode
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.core.files import write_text
from bt_tasksim.core.world import Command
from bt_tasksim.engines.vulkan import use_software_driver
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import Runner
from bt_tasksim.policy.policy import Action
from bt_tasksim.trees.load import load_source

PURE = ("initial_state", "begin", "violated", "maintained", "carry_out", "explain")
"""The concepts' own functions that a tick calls, besides the policy's."""
BARS = {"steps_ratio": 3.0, "outside_us": 250.0, "tick_ratio": 1.5, "help_s": 0.5}


def main(quick: bool = False, json_path: Path | None = None) -> int:
    """Measure, print the tables, and write the numbers as JSON if asked."""
    rounds = 3 if quick else 7
    found: dict[str, Any] = {}
    found |= throughput(rounds, episodes=3 if quick else 6)
    found |= outside_physics(episodes=5 if quick else 20)
    found |= tick_overhead(2000 if quick else 10000)
    found |= help_time(rounds)
    _print(found)
    if json_path is not None:
        write_text(json_path, json.dumps(found, indent=2) + "\n")
        print(f"wrote {json_path}")
    return 0


def throughput(rounds: int, episodes: int) -> dict[str, Any]:
    """Control steps per second of both, in turns; the ratio is the median over the rounds."""
    runner = _runner("pick_and_place")
    peer, why = _maniskill()
    runner.run(0)
    # Every control step counts, also those in which things come to rest before the outcome is judged.
    counted: list[None] = []
    engine: Any = runner.pipeline.physics
    step = engine.step
    engine.step = lambda target: (counted.append(None), step(target))[1]
    begins: list[float] = []
    begin = runner.begin

    def timed_begin(*arguments: Any) -> Any:
        started = time.perf_counter()
        out = begin(*arguments)
        begins.append(time.perf_counter() - started)
        return out

    runner.begin = timed_begin  # type: ignore[method-assign]
    ours: list[tuple[float, float]] = []
    theirs: list[tuple[float, float]] = []
    for k in range(rounds):
        counted.clear()
        begins.clear()
        started = time.perf_counter()
        for seed in range(episodes):
            runner.run(1 + k * episodes + seed)
        total = time.perf_counter() - started
        ours.append((len(counted) / total, len(counted) / (total - sum(begins))))
        if peer is not None:
            theirs.append(rates(peer, 150))
    out: dict[str, Any] = {
        "steps_per_s": statistics.median(a for a, _ in ours),
        "steps_alone_per_s": statistics.median(a for _, a in ours),
    }
    if theirs:
        out["maniskill_steps_per_s"] = statistics.median(a for a, _ in theirs)
        out["maniskill_steps_alone_per_s"] = statistics.median(a for _, a in theirs)
        pairs = list(zip(ours, theirs, strict=True))
        out["steps_ratio"] = statistics.median(a[0] / b[0] for a, b in pairs)
        out["steps_alone_ratio"] = statistics.median(a[1] / b[1] for a, b in pairs)
    else:
        out["maniskill_missing"] = why
    return out


def _maniskill() -> tuple[Any, str]:
    try:
        env = environment()
        env.reset(seed=0)
    except Exception as error:  # any reason it does not start here
        return None, f"{type(error).__name__}: {error}"
    return env, ""


def outside_physics(episodes: int, robot: str = "panda") -> dict[str, Any]:
    """Median microseconds a control step spends in each part; physics is PhysX's own steps."""
    runner = _runner("pick_and_place", robot)
    runner.run(0)
    clock = _Clock()
    physics: Any = runner.pipeline.physics
    clock.wrap(runner, "tick", "tick")
    for leaf in runner.tree.iterate():
        if isinstance(leaf, ConceptNode):
            for name in PURE:
                clock.wrap(leaf.model, name, "concepts")
            clock.wrap(leaf.policy_in_use, "act", "concepts")
    clock.wrap(runner.pipeline.kinematics, "solve", "kinematics")
    clock.wrap(runner.pipeline.postprocess, "observe", "observation")
    clock.wrap(physics, "step", "physics engine")
    clock.wrap(runner.pipeline, "step", "pipeline")
    use_software_driver()
    from sapien import physx

    stepping = clock.timed(physx.PhysxCpuSystem.step, "stepping")
    with mock.patch.object(physx.PhysxCpuSystem, "step", stepping):
        for seed in range(1, 1 + episodes):
            runner.run(seed, record=lambda step: clock.next())
    parts = clock.table()
    parts["state"] = parts["physics engine"] - parts["stepping"]
    tick, concepts = parts["tick"] - parts["concepts"], parts["concepts"]
    rest = parts["pipeline"] - parts["kinematics"] - parts["physics engine"] - parts["observation"]
    table = {
        "tick": np.median(tick),
        "concept functions": np.median(concepts),
        "kinematics": np.median(parts["kinematics"]),
        "observation": np.median(parts["observation"] + parts["state"]),
        "pipeline": np.median(rest),
    }
    outside = tick + concepts + parts["kinematics"] + parts["observation"] + parts["state"] + rest
    return {
        "parts_us": {k: float(1e6 * v) for k, v in table.items()},
        "outside_us": float(1e6 * np.median(outside)),
        "outside_mean_us": float(1e6 * np.mean(outside)),
        "physics_us": float(1e6 * np.median(parts["stepping"])),
    }


class _Clock:
    """Adds up the time of calls within each control step."""

    def __init__(self) -> None:
        self.now: dict[str, float] = {}
        self.rows: list[dict[str, float]] = []
        self.depth = 0

    def wrap(self, owner: Any, name: str, part: str) -> None:
        object.__setattr__(owner, name, self.timed(getattr(owner, name), part))

    def timed(self, call: Callable[..., Any], part: str) -> Callable[..., Any]:
        def inner(*args: Any, **kwargs: Any) -> Any:
            nested = part == "concepts" and self.depth > 0
            self.depth += part == "concepts"
            started = time.perf_counter()
            try:
                return call(*args, **kwargs)
            finally:
                spent = time.perf_counter() - started
                self.depth -= part == "concepts"
                if not nested:
                    self.now[part] = self.now.get(part, 0.0) + spent

        return inner

    def next(self) -> None:
        self.rows.append(self.now)
        self.now = {}

    def table(self) -> dict[str, Any]:
        names = {name for row in self.rows for name in row}
        # Settling after the tree's end has no tick; those steps are not control steps of the tree.
        rows = [row for row in self.rows if "tick" in row and "physics engine" in row]
        return {name: np.array([row.get(name, 0.0) for row in rows]) for name in names}


class _Idle(ConceptModel):
    """A concept whose own functions cost next to nothing."""

    def command(self, action: Any, seen: Any, memory: Any) -> Command:
        """A command made beforehand."""
        return _COMMAND

    def done(self, seen: Any, memory: Any) -> Any:
        """Never."""
        return _ACTION.terminate


class _Decided:
    name = "decided"

    def act(self, model: Any, seen: Any, memory: Any) -> Action:
        return _ACTION


_COMMAND = Command(np.array([[0.4, 0.0, 0.3, 0.0, 1.0, 0.0, 0.0]]), np.array([[0.0]]))
_ACTION = Action(np.zeros((1, 0)), np.array([False]))


class _Noop(py_trees.behaviour.Behaviour):  # type: ignore[misc]
    def update(self) -> Status:
        return Status.RUNNING


def tick_overhead(n: int) -> dict[str, Any]:
    """A tick of five concepts in a sequence, less their own functions, over one of five no-op leaves."""
    from bt_tasksim.trees import sequence

    runner = _runner("pick_and_place")
    runner.begin(0)
    context = runner.context
    plain = py_trees.composites.Sequence("plain", memory=True, children=[_Noop(str(i)) for i in range(5)])
    leaves = [_Idle(name=str(i)) for i in range(5)]
    tree = sequence("ours", *leaves)
    for node in tree.iterate():
        node.setup(context=context)
    policy = _Decided()
    for leaf in leaves:
        leaf.use(policy)
    observation, first = context.observation, leaves[0]

    def tick(root: Any) -> None:
        for _ in root.tick():
            pass

    def ours() -> None:
        context.advance(observation)
        tick(tree)

    ours()
    seen, motion = context.seen(ONE, np.zeros(1)), _ACTION.motion

    def functions() -> None:
        first.model.violated(seen, None)
        policy.act(first.model, seen, None)
        first.model.carry_out(motion, seen, None)

    def turn() -> tuple[float, ...]:
        return tuple(
            _best(call, n // 10)
            for call in (ours, lambda: context.advance(observation), functions, lambda: tick(plain))
        )

    turns = np.array([turn() for _ in range(10)])
    own = turns[:, 0] - turns[:, 1] - turns[:, 2]
    return {
        "tick_us": float(1e6 * np.median(own)),
        "py_trees_tick_us": float(1e6 * np.median(turns[:, 3])),
        "tick_ratio": float(np.median(own / turns[:, 3])),
    }


def _best(call: Callable[[], None], n: int) -> float:
    times = []
    for _ in range(n):
        started = time.perf_counter()
        call()
        times.append(time.perf_counter() - started)
    return statistics.median(times)


def help_time(rounds: int) -> dict[str, Any]:
    """Seconds of ``bt-tasksim --help`` in a process of its own, and what it must not import."""
    command = [sys.executable, "-m", "bt_tasksim.cli", "--help"]
    times = []
    for _ in range(rounds):
        started = time.perf_counter()
        subprocess.run(command, check=True, capture_output=True)
        times.append(time.perf_counter() - started)
    check = (
        "import sys, bt_tasksim, bt_tasksim.cli.main; "
        "print(*sorted({'torch', 'sapien', 'mani_skill'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", check], check=True, capture_output=True, text=True)
    heavy = done.stdout.split()
    return {"help_s": statistics.median(times), "help_imports": heavy}


def _runner(scenario: str, robot: str = "panda") -> Runner:
    source = load_source(scenario, robot)
    return Runner(source.build(), source.scene, EngineOptions())


def _print(found: dict[str, Any]) -> None:
    def row(label: str, value: float, unit: str, digits: int = 0, bar: str = "") -> None:
        print(f"{label:40}{value:10.{digits}f} {unit:18}{f'(bar: {bar})' if bar else ''}".rstrip())

    row("pick_and_place, episodes with resets", found["steps_per_s"], "control steps/s")
    if "steps_ratio" in found:
        row("ManiSkill PickCube-v1, the same", found["maniskill_steps_per_s"], "control steps/s")
        row("ratio", found["steps_ratio"], "", 2, f"at least {BARS['steps_ratio']:g}")
        row("pick_and_place, without resets", found["steps_alone_per_s"], "control steps/s")
        row("ManiSkill PickCube-v1, the same", found["maniskill_steps_alone_per_s"], "control steps/s")
        row("ratio", found["steps_alone_ratio"], "", 2)
    else:
        print(f"ManiSkill PickCube-v1 did not start: {found['maniskill_missing']}")
    print()
    for part, value in found["parts_us"].items():
        row(f"outside physics: {part}", value, "us")
    row("outside physics, together", found["outside_us"], "us", 0, f"at most {BARS['outside_us']:g}")
    row("physics", found["physics_us"], "us")
    print()
    row("tick without concept functions", found["tick_us"], "us", 2)
    row("tick of plain py_trees", found["py_trees_tick_us"], "us", 2)
    row("ratio", found["tick_ratio"], "", 2, f"at most {BARS['tick_ratio']:g}")
    print()
    row("bt-tasksim --help", found["help_s"], "s", 3, f"under {BARS['help_s']:g}")
    print(f"it imports {', '.join(found['help_imports']) or 'none of torch, sapien, mani_skill'}")


if __name__ == "__main__":
    sys.exit(main("--quick" in sys.argv))
