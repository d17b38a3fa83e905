"""What many tests share: a toy world without physics, and real runs recorded decision by decision."""

from __future__ import annotations

import dataclasses
import os
import signal
import sys
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.concept.context import one_world
from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.seen import Seen
from bt_tasksim.core import plugins, poses, real_time
from bt_tasksim.core.bundles import parts, taken
from bt_tasksim.core.world import Command, Hidden, Observation
from bt_tasksim.execution.runner import Runner
from bt_tasksim.planning.arm import arm_of
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import Goal, ObjectSpec, SpotSpec

sys.path.insert(0, str(Path(__file__).parent / "perturbation"))
import perturbation


def pytest_addoption(parser: pytest.Parser) -> None:
    """Perturbations of physics (see `perturbation`)."""
    group = parser.getgroup("perturbations")
    group.addoption("--nudge", type=float, default=0.0, metavar="RAD", help="add RAD to all drive targets")
    group.addoption("--shift-seeds", type=int, default=0, metavar="N", help="draw worlds with seed + N")
    group.addoption("--part", default="0/1", metavar="K/N", help="only the K-th of N parts, from 0 on")


def pytest_configure(config: pytest.Config) -> None:
    """Perturb physics here, and in all processes that tests start."""
    perturbation.install(config.getoption("--nudge"), config.getoption("--shift-seeds"), os.environ)


LONG = tuple(f"tests/{name}" for name in (
    "trees/test_shipped.py", "concept_nodes/test_array_api.py", "doc_commands/", "trees/test_from_goals.py",
    "bt_tasksim/training/test_cluster_evaluation.py", "bt_tasksim/training/test_evaluation.py",
    "bt_tasksim/engines/maniskill/test_environments.py", "bt_tasksim/execution/test_batch_runner.py",
    "test_wheel.py",
))  # fmt: skip
"""Files of a minute and more: first, so that no process is still at one when the others have ended.

Not bt_tasksim/core/test_cluster.py: it looks at what is left of Ray, which other files here start.
"""


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Long files first. Keep one part of the tests; which one a test is in depends on its name alone."""
    items.sort(key=lambda item: not item.nodeid.startswith(LONG))
    part, parts = (int(number) for number in config.getoption("--part").split("/"))
    if parts > 1:
        wanted = [zlib.crc32(item.nodeid.encode()) % parts == part for item in items]
        config.hook.pytest_deselected(items=[i for i, keep in zip(items, wanted, strict=True) if not keep])
        items[:] = [item for item, keep in zip(items, wanted, strict=True) if keep]


@pytest.fixture(scope="session", autouse=True)
def ctrl_c_arrives() -> Iterator[None]:
    """A shell's background jobs ignore SIGINT, and so would all that the tests start."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(autouse=True)
def parts_are_forgotten() -> Iterator[None]:
    """What a test announces or loads as a plugin is not there for the next one."""
    with plugins.scratch():
        yield


@pytest.fixture(autouse=True)
def modules_are_forgotten(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """What a test imports from its own folder is not there for the next one."""
    path, known, folder = list(sys.path), set(sys.modules), str(tmp_path_factory.getbasetemp())
    yield
    sys.path[:] = path
    for name in set(sys.modules) - known:
        if (getattr(sys.modules[name], "__file__", None) or "").startswith(folder):
            del sys.modules[name]


@pytest.fixture(autouse=True)
def loops_in_real_time_are_closed() -> Iterator[None]:
    """A loop left open holds settings of the whole process, and the objects of all tests before it."""
    before = real_time.loops_open()  # a whole module's simulated cell has one
    yield
    assert real_time.loops_open() == before, "a loop in real time was left open"


SCENE = Scene(
    objects={
        "cup": ObjectSpec(kinds=("cup",), on="table", centre=(0.0, -0.14), area=(0.01, 0.01)),
        "box": ObjectSpec(kinds=("box",), on="table", centre=(0.0, 0.05), area=(0.01, 0.01)),
    },
    spots=[SpotSpec("goal", on="table", centre=(0.0, 0.25), area=(0.01, 0.01))],
    goal=Goal("cup", "goal"),
    name="toy",
)


class ToyWorld:
    """Stands in for an engine pipeline: tool and hand are at once where they are told to be.

    The arm's joints are those that bring the tool there, where it can go there.

    Attributes:
        now: The present observation; tests change it by `put`.
        steps: The commands it was stepped with.
        grip: The hand feels something when it is half closed, and its objects follow the tool.
    """

    state = None

    def __init__(self) -> None:
        self.steps: list[Command] = []
        self.held: str | None = None
        self.resets = 0

    def unseen(self) -> dict[str, str]:
        return {}

    def reset(self, configuration: Any, model: Any) -> Observation:
        self.robot, self.model = load_robot(configuration.robot), model
        self.steps.clear()
        self.resets += 1
        n_hand, n_tips = len(self.robot.hand_joints), len(self.robot.tips)
        down = poses.frame_from_axes(np.array([0.0, 0, -1]), np.array([0.0, -1, 0]))
        self.now = Observation(
            time=np.float64(0.0),
            arm_position=self.robot.rest.copy(),
            arm_velocity=np.zeros(len(self.robot.arm_joints)),
            hand_position=np.zeros(n_hand),
            hand_effort=np.zeros(n_hand),
            closure=np.float64(0.0),
            tool_pose=poses.pose([0.45, 0.0, 0.35], down),
            tips=np.zeros((n_tips, 3)),
            contacts=np.zeros(n_tips, bool),
            contact_force=np.zeros((n_tips, 3)),
            wrench=np.zeros(6),
            objects=np.array([a.pose for a in configuration.objects]),
            contact_points=np.zeros((n_tips, 3)),
            motion=np.zeros(6),
        )
        self.bend()
        return self.now

    def put(self, **changes: Any) -> None:
        """Change what is observed from the next step on."""
        self.now = dataclasses.replace(self.now, **changes)

    def hold(self, name: str) -> None:
        """Have an object in the hand."""
        objects = self.now.objects.copy()
        objects[self.model.object_index(name), :3] = self.now.tool_pose[:3]
        self.put(objects=objects, contacts=np.ones(len(self.robot.tips), bool), closure=np.float64(0.5))

    def stand(self, name: str, place: str) -> None:
        """Have an object stand on the middle of a place."""
        k, objects = self.model.object_index(name), self.now.objects.copy()
        objects[k] = self.model.place(place).pose
        objects[k, 2] += self.model.object(name).extent[2] / 2
        self.put(objects=objects)

    def step(self, command: Command) -> Observation:
        self.steps.append(command)
        before = self.now
        closure = before.closure if command.hand is None else np.float64(command.hand[0])
        self.put(
            time=before.time + 0.05,
            tool_pose=before.tool_pose if command.tool is None else command.tool,
            closure=closure,
        )
        self.bend(command.posture)
        return self.now

    def bend(self, posture: Any = None) -> None:
        """Have the arm where its tool is; ``posture (n_arm,)`` is the one that was asked for, if any."""
        start = self.now.arm_position if posture is None or np.isnan(posture).any() else posture
        joints = arm_of(self.robot).joints(self.now.tool_pose, start)
        if joints is not None:
            self.put(arm_position=joints)

    def hidden(self) -> Hidden | None:
        return None

    def verdict(self) -> None:
        return None

    def worlds(self, scene: Scene) -> Scene:
        return scene

    real = False

    def stop(self, why: str) -> None:
        pass

    def timing(self) -> None:
        return None


class Toy:
    """A tree in a toy world, ticked by the real runner."""

    def __init__(self, tree: Behaviour, scene: Scene = SCENE, seed: int = 0) -> None:
        self.world = ToyWorld()
        self.tree = tree
        self.runner = Runner(tree, scene, pipeline=self.world)
        self.context = self.runner.context
        self.runner.begin(seed)

    def look(self) -> None:
        """Have the leaves see the world as it now is, without a step."""
        self.context.advance(one_world(self.world.now))

    def tick(self, n: int = 1) -> Status:
        """Tick and step, n times or until the tree ends."""
        for _ in range(n):
            self.runner.tick()
            if self.tree.status != Status.RUNNING:
                break
            self.context.advance(one_world(self.world.step(self.context.command)))
        return self.tree.status


@pytest.fixture
def toy() -> type[Toy]:
    """Builds a tree in a toy world: ``toy(tree)``."""
    return Toy


class ActLeaf(ConceptNode):
    """A leaf for tests, which keeps how it ended."""

    def __init__(self, name, parts="tool", ticks=3, height=0.4, **settings):
        super().__init__(name=name, **settings)
        self.model.parts, self.model.ticks, self.model.height = parts.split(), ticks, height
        self.ended: list[Status] = []

    def terminate(self, new_status: Status) -> None:
        self.ended.append(new_status)
        super().terminate(new_status)


class Act(ConceptModel):
    """A concept for tests: commands the parts it is told to, and is done after some time."""

    leaf_base = ActLeaf

    def begin(self, seen: Seen) -> Any:
        return np.zeros(len(seen.tool), int)

    def advance(self, action: Any, seen: Seen, memory: Any) -> Any:
        return memory + 1

    def command(self, action: Any, seen: Seen, memory: Any) -> Command:
        tool = seen.tool.copy()
        tool[:, 2] = self.height
        return Command(
            tool=tool if "tool" in self.parts else None,
            hand=np.full((len(tool), 1), 0.5) if "hand" in self.parts else None,
        )

    def done(self, seen: Seen, memory: Any) -> Any:
        return memory >= self.ticks


@pytest.fixture
def act() -> type[Act]:
    """A concept for tests: ``act(name, parts="tool hand", ticks=3, height=0.4)``."""
    return Act


def same_bits(first: Any, second: Any) -> bool:
    """Two bundles hold the same arrays, to the last bit; NaN is like NaN."""
    inner = parts(first)
    if inner is not None:
        others = parts(second) or {}
        return inner.keys() == others.keys() and all(same_bits(inner[k], others[k]) for k in inner)
    if first is None or isinstance(first, str):
        return bool(first == second)
    a, b = np.asarray(first), np.asarray(second)
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()


@pytest.fixture(scope="session")
def rows_alike():
    """``rows_alike(function, n)``: what a function of rows ``(k,)`` of a batch gives for a row is the same
    bits in all of ``n`` rows, alone, in any order and in any company; gives what it says of all."""

    def check(function: Callable[[Any], Any], n: int) -> Any:
        whole = function(np.arange(n))
        mixed = np.random.default_rng(n).permutation(n)
        some = (mixed[:2], mixed[: n // 2], mixed[n // 3 :], mixed[:64])
        for rows in (*np.arange(n)[:, None], mixed, np.arange(n)[::-1], *some):
            if len(rows):
                assert same_bits(function(rows), taken(whole, rows)), f"rows {rows} differ in company"
        return whole

    return check


@pytest.fixture(scope="session")
def recorded_run():
    """Every decision of every concept in a real run: ``recorded_run(scenario, seed)``."""
    from bt_tasksim.checking.recording import record
    from bt_tasksim.trees.load import load_source

    kept: dict[tuple[str, int], list[Any]] = {}

    def run(scenario: str, seed: int = 1) -> list[Any]:
        if (scenario, seed) not in kept:
            source = load_source(scenario)
            found = record(source.build(), source.scene, seeds=[seed])
            assert not found.errors, found.errors
            kept[scenario, seed] = [d for notes in found.decisions.values() for d in notes]
        return kept[scenario, seed]

    return run
