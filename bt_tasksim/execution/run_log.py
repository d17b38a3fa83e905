"""The log of a run, in the format of demonstrations: it can be replayed, looked at, and decomposed again.

Besides what every demonstration holds, a run's log has, one row a tick:

- ``observations/*``: the fields of `Observation`;
- ``commands/tool``, ``commands/posture`` and ``commands/hand``: what the tree wrote, NaN where it wrote
  nothing;
- ``state/*``: joint positions, velocities and efforts, and in simulation object poses and velocities, exactly
  as the engine gave them;
- ``tree/status`` ``(T, nodes)``: 0 not active, 1 running, 2 success, 3 failure;
- ``tree/necessary_cost`` ``(T, nodes)``: of the active concepts, else NaN;

and once: ``messages/time``, ``messages/node``, ``messages/text`` (what nodes said), and as JSON or XML
``run/nodes``, ``run/configuration``, ``run/tree``, ``run/about``, ``run/policies``.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import platform
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.concept.leaf import ONE, ConceptNode
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.identity import package_versions
from bt_tasksim.core.outcomes import CANNOT_START
from bt_tasksim.core.world import Observation, WorldModel
from bt_tasksim.demos_decomp.log import Demonstration, Log, Surface, Track, Video
from bt_tasksim.demos_decomp.log_file import write_log
from bt_tasksim.execution.pipelines import result_names
from bt_tasksim.execution.result import Result
from bt_tasksim.execution.runner import Runner, Step
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.trees.walk import nodes_of

STATUSES = {Status.INVALID: 0, Status.RUNNING: 1, Status.SUCCESS: 2, Status.FAILURE: 3}
"""Numbers in ``tree/status``."""
ABOUT = frozenset((
    "status", "success", "judged", "reason", "why", "leaf", "outcome", "scenario", "seed", "stream", "robot",
    "engines", "perception", "options", "longest", "policies", "control_steps", "control_frequency",
    "sim_time", "wall_time", "timing", "verdict", "versions",
))  # fmt: skip
"""What a log says about a run, see `about`."""
STATE = ("joint_position", "joint_velocity", "joint_effort", "objects", "velocities")
"""Fields of `WorldState` that are kept as they are."""

_OBSERVED = tuple(f.name for f in dataclasses.fields(Observation) if f.name != "time")
_DIGITS = re.compile(r"[-+]?\d+(\.\d+)?")


class RunRecorder:
    """Keeps what happens in a run; give it to `Runner.run` as ``record``.

    Args:
        runner: The runner whose run is recorded.
        scenario: What was run: a scenario's name or the tree's file; by default the scene's name.
    """

    def __init__(self, runner: Runner, scenario: str = "") -> None:
        self.runner = runner
        self.scenario = scenario or runner.scene.name
        self.nodes = nodes_of(runner.tree)
        self._concepts = [(i, n) for i, n in enumerate(self.nodes) if isinstance(n, ConceptNode)]
        self._tree = tree_text(runner.tree)
        self.clear()

    def clear(self) -> None:
        """Forget the run, to record another one."""
        self._times: list[float] = []
        self._rows: dict[str, list[Any]] = {}
        self._status: list[list[int]] = []
        self._costs: list[list[float]] = []
        self._said: list[tuple[float, int, str]] = []
        self._last: list[tuple[str, int]] = [("", 0)] * len(self.nodes)

    def __call__(self, step: Step) -> None:
        """Keep one tick."""
        observation, state = step.observation, step.pipeline.state
        time = float(observation.time)
        if self._times and time <= self._times[-1]:
            self.clear()  # a new episode
        self._times.append(time)
        for name in _OBSERVED:
            self._keep(f"observations/{name}", getattr(observation, name))
        self._keep("commands/tool", np.full(7, np.nan) if step.command.tool is None else step.command.tool)
        arm = step.command.posture
        self._keep("commands/posture", np.full_like(observation.arm_position, np.nan) if arm is None else arm)
        hand = step.command.hand
        self._keep("commands/hand", [math.nan] if hand is None else hand)
        if state is not None:
            for name in STATE:
                value = getattr(state, name)
                if value is not None:
                    self._keep(f"state/{name}", value)
        self._keep_tree(time)

    def __len__(self) -> int:
        """Ticks that were recorded."""
        return len(self._times)

    def _keep(self, name: str, value: Any) -> None:
        self._rows.setdefault(name, []).append(np.array(value))

    def _keep_tree(self, time: float) -> None:
        now = [STATUSES[node.status] for node in self.nodes]
        if not self._status:  # what nodes that were not ticked yet say is left from an earlier run
            self._last = [
                (n.feedback_message, 0) if s == 0 else ("", 0) for n, s in zip(self.nodes, now, strict=True)
            ]
        before = self._status[-1] if self._status else [0] * len(self.nodes)
        self._status.append(now)
        costs = [math.nan] * len(self.nodes)
        for i, leaf in self._concepts:
            if (now[i] == 1 or (before[i] == 1 and now[i] != 0)) and _began(leaf):
                costs[i] = _necessary_cost(leaf)
        self._costs.append(costs)
        for i, node in enumerate(self.nodes):
            text = node.feedback_message
            if (text, now[i]) == self._last[i]:
                continue
            said, status = self._last[i]
            # Numbers that change from tick to tick make no new message.
            if text and (status != now[i] or _DIGITS.sub("", said) != _DIGITS.sub("", text)):
                self._said.append((time, i, text))
            self._last[i] = (text, now[i])

    def last_statuses(self) -> dict[str, str]:
        """Statuses at the end of the run, by the ids that nodes have in pictures (`node_ids`)."""
        names = {number: status.name for status, number in STATUSES.items()}
        last = self._status[-1] if self._status else [0] * len(self.nodes)
        return {f"node-{i}": names[status] for i, status in enumerate(last)}

    def demonstration(self, result: Result, video: Video | None = None) -> Demonstration:
        """All that was recorded.

        Args:
            result: What the run gave.
            video: The video of it.
        """
        runner, configuration = self.runner, result.configuration
        world = configuration.world_model([tip.name for tip in runner.robot.tips], runner.robot.opening)
        extra = {name: _stacked(rows) for name, rows in self._rows.items()}
        said = list(self._said)
        if result.status == Status.INVALID and self._times:  # stopped from outside the tree
            time = min(result.sim_time, self._times[-1])
            said.append((time, 0, f"stopped: {result.why}"))
            said.sort(key=lambda message: message[0])
        true = "state/objects" in extra
        poses = extra["state/objects" if true else "observations/objects"]
        told = about(result, runner, self.scenario)
        extra |= {
            "tree/status": np.array(self._status, np.int8).reshape(len(self), len(self.nodes)),
            "tree/necessary_cost": np.array(self._costs, np.float64).reshape(len(self), len(self.nodes)),
            "messages/time": np.array([time for time, _, _ in said], np.float64),
            "messages/node": np.array([node for _, node, _ in said], np.int32),
            "messages/text": _texts([text for _, _, text in said]),
            "run/nodes": _text(json.dumps(describe_nodes(self.nodes))),
            "run/configuration": _text(configuration.to_json()),
            "run/tree": _text(self._tree),
            "run/about": _text(json.dumps(told)),
            "run/policies": _text(json.dumps(policies_of(self.nodes))),
        }
        return Demonstration(
            name="000",
            time=np.array(self._times),
            hand_pose=extra["observations/tool_pose"],
            hand_opening=hand_opening(extra["observations/tips"], runner.robot),
            objects={
                model.name: Track(poses[:, i], model.kind, np.array(model.extent))
                for i, model in enumerate(world.objects)
            },
            places=_places(world),
            task=self.scenario,
            seed=result.seed,
            video=video,
            extra=extra,
            notes={
                "robot": configuration.robot,
                "engines": told["engines"],
                "perception": told["perception"],
                "status": result.status.name,
                "success": "yes" if result.success else "no",
                "why": result.why,
                "objects_are": "true poses" if true else "estimated poses",
            },
        )

    def write(self, path: str | Path, result: Result, video: Video | None = None) -> None:
        """Write the log.

        Args:
            path: Where to.
            result: What the run gave.
            video: The video of it, its path relative to the log.

        Raises:
            InputError: The folder does not exist, or the run is none that the format holds: it has no object,
                or fewer than two ticks.
            MachineError: The disk is full or not writable.
        """
        source = "robot" if self.runner.pipeline.real else "simulation"
        write_log(path, Log(source, (self.demonstration(result, video),), result.why))


def describe_nodes(nodes: list[Behaviour]) -> list[dict[str, Any]]:
    """Name, type and parent (index, -1 for the root) of each node, as plain data."""
    from bt_tasksim.trees.vocabulary import kind_of

    index = {id(node): i for i, node in enumerate(nodes)}
    out = []
    for i, node in enumerate(nodes):
        kind = kind_of(node)
        parent = index.get(id(node.parent), -1) if node.parent is not None and i else -1
        out.append(
            {
                "id": i,
                "name": node.name,
                "type": kind.tag if kind is not None else type(node).__name__,
                "category": "leaf" if not node.children else kind.category.lower() if kind else "control",
                "concept": isinstance(node, ConceptNode),
                "parent": parent,
            }
        )
    return out


def policies_of(nodes: list[Behaviour]) -> list[dict[str, Any]]:
    """Which policy each concept uses: its node's number, its name, and what a leaf names to get it again."""
    return [
        {"node": i, "name": leaf.policy_in_use.name, "source": leaf.policy_in_use.source}
        for i, leaf in enumerate(nodes)
        if isinstance(leaf, ConceptNode)
    ]


def tree_text(tree: Behaviour) -> str:
    """A tree as XML; empty where it holds nodes that XML cannot."""
    from bt_tasksim.trees.xml_writer import tree_to_xml

    try:
        return tree_to_xml(tree)
    except InputError:
        return ""


def about(result: Result, runner: Runner, scenario: str) -> dict[str, Any]:
    """A run in plain data: what was run with what, and what became of it; this is ``result.json``."""
    options, verdict = runner.options, result.verdict
    engines, perception = result_names(options, runner.pipeline)
    return {
        "status": result.status.name,
        "success": result.success,
        "judged": result.judged,
        "reason": result.reason,
        "why": result.why,
        "leaf": result.leaf,
        "outcome": result.outcome.to_data(),
        "scenario": scenario,
        "seed": result.seed,
        "stream": result.configuration.stream,
        "robot": result.configuration.robot,
        "engines": engines,
        "perception": perception,
        "options": dataclasses.asdict(options),
        "longest": runner.longest,
        "policies": result.policies,
        "control_steps": result.control_steps,
        "control_frequency": result.configuration.control_frequency,
        "sim_time": result.sim_time,
        "wall_time": result.wall_time,
        "timing": None
        if result.timing is None
        else {**dataclasses.asdict(result.timing), "summary": str(result.timing)},
        "verdict": None if verdict is None else verdict.to_data(),
        "versions": versions(runner.robot),
    }


def versions(robot: RobotDescription) -> dict[str, str]:
    """Versions of everything that a run's numbers may depend on."""
    found = {"python": platform.python_version(), "machine": f"{platform.system()} {platform.machine()}"}
    found |= package_versions()
    found["robot file"] = hashlib.sha256(robot.source.read_bytes()).hexdigest()[:16]
    return found


def hand_opening(tips: NDArray[np.float64], robot: RobotDescription) -> NDArray[np.float64]:
    """Smallest distance ``(T,)`` in metres between fingertips ``(T, n_tips, 3)`` that face each other."""
    groups = robot.opposition
    pairs = [(i, j) for a in range(len(groups)) for b in range(a) for i in groups[a] for j in groups[b]]
    if not pairs:
        return np.zeros(len(tips))
    distances = np.array([np.linalg.norm(tips[:, i] - tips[:, j], axis=-1) for i, j in pairs])
    smallest: NDArray[np.float64] = distances.min(axis=0)
    return smallest


def _began(leaf: ConceptNode) -> bool:
    """It remembers something of this time: on a robot it plans first, and may find that it cannot start."""
    return not leaf.plans and (leaf.outcome is None or not leaf.outcome.is_a(CANNOT_START))


def _necessary_cost(leaf: ConceptNode) -> float:
    return float(leaf.model.necessary_cost(leaf.activation.seen(ONE), leaf.memory)[0])


def _places(world: WorldModel) -> dict[str, Surface]:
    return {
        name: Surface(
            np.asarray(place.pose, float),
            np.array(place.extent),
            place.kind,
            place.fixture,
            np.array(place.centre),
            place.height,
        )
        for name, place in world.places.items()
    }


def _stacked(rows: list[Any]) -> NDArray[Any]:
    """Rows of one shape; a shorter one (a hand command without synergies) is filled up with NaN."""
    longest = max(rows, key=np.size).shape
    if any(row.shape != longest for row in rows):
        rows = [
            np.concatenate([r, np.full(longest[0] - len(r), np.nan)]) if len(r) < longest[0] else r
            for r in rows
        ]
    return np.stack(rows)


def _text(text: str) -> NDArray[np.bytes_]:
    return np.array(text.encode() or b" ")


def _texts(texts: list[str]) -> NDArray[np.bytes_]:
    return np.array([text.encode() for text in texts], dtype=np.bytes_ if texts else "S1")


def read_text(values: NDArray[Any]) -> str:
    """A text of `Demonstration.extra`, such as ``run/tree``."""
    value: Any = values.item() if isinstance(values, np.ndarray) else values
    return (value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)).strip()


def read_texts(values: NDArray[Any]) -> list[str]:
    """Several texts of `Demonstration.extra`, such as ``messages/text``."""
    return [v.decode("utf-8", "replace") if isinstance(v, bytes) else str(v) for v in values.tolist()]
