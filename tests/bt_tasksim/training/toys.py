"""A world without physics and concepts to train in it, also for programs that tests start."""

from __future__ import annotations

import dataclasses
import importlib.util
from pathlib import Path
from typing import Any

import numpy as np

from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import Flag, Metres, ObjectName, Ratio
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.core.errors import BtTasksimError, InputError, UnreachableError
from bt_tasksim.core.outcomes import Form
from bt_tasksim.core.units import METRES
from bt_tasksim.core.world import Command, Hidden
from bt_tasksim.execution import worlds
from bt_tasksim.execution.pipeline_worlds import PipelineWorlds
from bt_tasksim.policy.network import Network
from bt_tasksim.policy.policy import Action, split_action

_spec = importlib.util.spec_from_file_location("toy_world", Path(__file__).parents[2] / "conftest.py")
_shared = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(_shared)
SCENE = _shared.SCENE


class World(_shared.ToyWorld):
    """The toy world with a hidden state, which may differ from what is seen.

    Attributes:
        truth: The tool is really so many metres higher than it seems.
        error: What a step raises that moves the tool.
        depth: Overlap of two bodies.
    """

    def __init__(self) -> None:
        super().__init__()
        self.truth, self.error, self.depth, self.closed = 0.0, None, 0.0, 0

    def step(self, command: Command):
        if self.error is not None and command.tool is not None:
            raise self.error
        return super().step(command)

    def hidden(self) -> Hidden:
        n = len(self.now.objects)
        tool = self.now.tool_pose.copy()
        tool[2] += self.truth
        return Hidden(
            time=self.now.time,
            objects=self.now.objects,
            velocities=np.zeros((n, 6)),
            hand_force=np.zeros(n),
            hand_distance=np.zeros(n),
            support=np.zeros((n, n), bool),
            penetration=np.float64(self.depth),
            tool_pose=tool,
        )

    def close(self) -> None:
        self.closed += 1


class Worlds(worlds.Worlds):
    """Several toy worlds in place of `bt_tasksim.execution.worlds.BatchWorlds`.

    Attributes:
        each: The worlds.
        sizes: In how many worlds each control period was.
    """

    made: list[Any] = []
    """Those that a test has made."""

    def __init__(self, robot: Any, count: int) -> None:
        self.each, self.count, self.robot = [World() for _ in range(count)], count, robot
        self._seen: list[Any] = [None] * count
        self._failed: dict[int, Any] = {}
        self.sizes: list[int] = []
        Worlds.made.append(self)

    def reset(self, rows: Any, configurations: Any) -> None:
        tips = [tip.name for tip in self.robot.tips]
        for row, drawn in zip(rows.tolist(), configurations, strict=True):
            self._failed.pop(row, None)
            self._seen[row] = self.each[row].reset(drawn, drawn.world_model(tips, self.robot.opening))

    def errors(self, rows: Any) -> dict[int, Any]:
        return {row: self._failed[row] for row in rows.tolist() if row in self._failed}

    def observe(self, rows: Any) -> Any:
        some = next(seen for seen in self._seen if seen is not None)
        self.observation = stacked([some if seen is None else seen for seen in self._seen])
        return self.observation

    def step(self, tool: Any, hand: Any, rows: Any) -> list[worlds.Unreached]:
        unreached = []
        self.sizes.append(len(rows))
        for k, row in enumerate(rows.tolist()):
            parts = [None if p is None or np.isnan(p[k]).any() else p[k] for p in (tool, hand)]
            try:
                self._seen[row] = self.each[row].step(Command(*parts))
            except UnreachableError as error:
                unreached.append(worlds.Unreached(row, error))
                self._seen[row] = self.each[row].step(Command())
            except BtTasksimError as error:
                self._failed[row] = error
        return unreached

    def hidden(self, rows: Any = None) -> Hidden:
        each = self.each if rows is None else [self.each[row] for row in rows.tolist()]
        return stacked([world.hidden() for world in each])

    def close(self) -> None:
        for world in self.each:
            world.close()


def toy_worlds(robot: Any, options: Any, count: int, threads: int) -> worlds.Worlds:
    """Toy worlds in place of those of `bt_tasksim.execution.pipeline_worlds.worlds_for`."""
    return PipelineWorlds(robot, World()) if count == 1 else Worlds(robot, count)


def instead_of_engines(put: Any) -> None:
    """Every world is a toy from now on; ``put(path, value)`` puts a value in the place of another."""
    put("bt_tasksim.execution.runner.build_pipeline", lambda robot, options: World())
    put("bt_tasksim.training.episode_batch.worlds_for", toy_worlds)
    put("toys.Worlds.made", [])


def stacked(bundles: list[Any]) -> Any:
    """Observations or hidden states of single worlds as one of several."""
    names = [field.name for field in dataclasses.fields(bundles[0])]
    return type(bundles[0])(**{n: np.stack([np.asarray(getattr(b, n)) for b in bundles]) for n in names})


HIGH = Form("the tool is {height:.0f} high", {"height": METRES})
STEP = 0.02
"""Metres that a toy leaf moves the tool at a decision, at most."""


class RaiseLeaf(ConceptNode):
    """Keeps what became of it in its `log`."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.log: list[str] = []
        self.model.log = self.log


class Raise(ConceptModel):
    """Bring the tool to a height: what is learned is where to, and when it is there."""

    height: Metres = 0.45
    limit: Metres = 2.0
    is_task_model = False
    actions = 1
    default_timeout = 1.5
    leaf_base = RaiseLeaf

    def begin(self, seen: Seen) -> Any:
        self.log.append("begin")
        return np.zeros(len(seen.tool), int)

    def advance(self, action, seen: Seen, memory: Any) -> Any:
        return memory + 1

    @classmethod
    def layout(cls, robot):
        return {"missing": 1, "cup": 2}

    def features(self, seen: Seen, memory: Any):
        missing = (self.height - seen.tool[:, 2:3]) / 0.1
        return np.concatenate([missing, seen.object("cup")[:, :2] / 0.01], axis=-1)

    def command(self, action, seen: Seen, memory: Any) -> Command:
        self.log.append(f"command {float(action[0, 0]):g}")
        tool = seen.tool.copy()
        tool[:, 2] += STEP * action[:, 0]
        return Command(tool=tool)

    def programmed_motion(self, seen: Seen, memory: Any):
        return np.clip((self.height - seen.tool[:, 2:3]) / STEP, -1.0, 1.0)

    def done(self, seen: Seen, memory: Any):
        return np.abs(self.height - seen.tool[:, 2]) < 0.005

    def violated(self, seen: Seen, memory: Any):
        return seen.tool[:, 2] > self.limit

    def necessary_cost(self, seen: Seen, memory: Any):
        return np.abs(self.height - seen.tool[:, 2]) / 0.1

    def sufficient_cost(self, known: Known, memory: Any):
        return np.abs(self.height - known.hidden.tool_pose[:, 2]) / 0.01

    def explain(self, seen: Seen, memory: Any) -> Any:
        return HIGH(height=seen.tool[:, 2])


class Unprogrammed(Raise):
    """As `Raise`, without a programmed policy."""

    is_programmed = False


class Turn(Raise):
    """Sees other things than `Raise`."""

    @classmethod
    def layout(cls, robot):
        return {"missing": 1}

    def features(self, seen: Seen, memory: Any):
        return super().features(seen, memory)[:, :1]


class Check(ConceptModel):
    """Follows a `Raise`: holds still for some ticks; it seems well, and truly is where the tool is up."""

    height: Metres = 0.45
    ticks: Ratio = 0.2
    blind: Flag = False
    """It does not see that the tool is at the wrong height."""

    def begin(self, seen: Seen) -> Any:
        return np.zeros(len(seen.tool), int)

    def advance(self, action, seen: Seen, memory: Any) -> Any:
        return memory + 1

    def command(self, action, seen: Seen, memory: Any) -> Command:
        return Command(tool=seen.tool)

    def violated(self, seen: Seen, memory: Any):
        return (abs(self.height - seen.tool[:, 2]) > 0.01) & (not self.blind)

    def done(self, seen: Seen, memory: Any):
        return memory >= round(10 * self.ticks)

    def sufficient_cost(self, known: Known, memory: Any):
        return np.abs(self.height - known.hidden.tool_pose[:, 2]) / 0.01

    def explain(self, seen: Seen, memory: Any) -> Any:
        return HIGH(height=seen.tool[:, 2])


class Move(ConceptModel):
    """A programmed concept that says nothing of what must be true: brings the tool to a height at once."""

    height: Metres = 0.3

    def begin(self, seen: Seen) -> Any:
        return np.zeros(len(seen.tool), int)

    def advance(self, action, seen: Seen, memory: Any) -> Any:
        return memory + 1

    def command(self, action, seen: Seen, memory: Any) -> Command:
        tool = seen.tool.copy()
        tool[:, 2] = self.height
        return Command(tool=tool)

    def done(self, seen: Seen, memory: Any):
        return memory >= 2


class Below(Condition):
    """The tool is below a height."""

    height: Metres = 0.5

    def holds(self, seen: Seen):
        return seen.tool[:, 2] < self.height

    def explain(self, seen: Seen) -> Any:
        return HIGH(height=seen.tool[:, 2])


class Even(Condition):
    """Some worlds are so, and some are not."""

    target: ObjectName = "cup"

    def holds(self, seen: Seen):
        return seen.object(self.target)[:, 0] > 0.5


UP, DOWN, STILL, DONE = ([1.0, 0.0], [-1.0, 0.0], [0.0, 0.0], [0.0, 1.0])
"""Actions of a `Raise`."""


def honest(features: Any) -> list[float]:
    """What brings the tool up, and says so."""
    missing = 0.1 * float(features[0])
    return DONE if abs(missing) < 0.005 else [float(np.clip(missing / STEP, -1.0, 1.0)), 0.0]


def play(env: Any, decide: Any, seed: int | None = 0) -> tuple[list[float], bool, bool, dict[str, Any]]:
    """One episode: rewards, how it ended, and what is said of it."""
    features, info = env.reset(seed=seed)
    rewards = []
    for _ in range(2000):
        features, reward, terminated, truncated, info = env.step(np.array(decide(features)))
        rewards.append(reward)
        if terminated or truncated:
            return rewards, terminated, truncated, info
    raise AssertionError("the episode does not end")


def alone(env: Any, task: Any) -> Any:
    """The result of a task of `bt_tasksim.training.collectors`, in an environment of its own."""
    collector = task.collector(Network.from_arrays(task.network))
    while not collector.done:
        episode = collector.next()
        wanted = episode.begin()
        env.stream, env.stage = wanted.stream, wanted.stage
        draw = {} if wanted.draw is None else {"draw": wanted.draw}
        try:
            features, info = env.reset(seed=wanted.seed, options=draw)
        except InputError as error:
            episode.failed(error)
            continue
        episode.began(info["redrawn"])
        over = False
        while not over:
            action = episode.action(features, collector.network(features))
            motion, done = split_action(np.asarray(action)[None], collector.network.signal_std)
            features, reward, terminated, truncated, _ = env.act(Action(np.asarray(motion, float), done))
            ended = terminated or truncated
            episode.paid(features, reward, env.ending if ended else None)
            over = ended or collector.done
    return collector.result()


def activations(env: Any, leaf: Any) -> Any:
    """How often a leaf has begun in each world ``(N,)`` of an environment."""
    tree = env.batch.batch
    (number,) = (n for n, node in enumerate(tree.nodes) if node is leaf)
    return tree.compiled[number].activation.activations
