"""Worlds that begin, go on and fail one by one, and the pipeline of a batch of them.

A batch has kinematics, physics and post-process of many simulated worlds at once. What has only worlds of one
is in `bt_tasksim.execution.pipeline_worlds`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from bt_tasksim.concept.context import widened
from bt_tasksim.core.available_memory import available_memory
from bt_tasksim.core.columns import with_rows
from bt_tasksim.core.errors import BtTasksimError, InputError
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.core.transfer import Index, fetched, sent
from bt_tasksim.core.world import Hidden, Observation, WorldState
from bt_tasksim.engines.base import PhysicsEngine, engine_class
from bt_tasksim.engines.kinematics.batch import BatchKinematics
from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics
from bt_tasksim.engines.perception.noise import noise_model
from bt_tasksim.engines.perception.state import BatchState
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.scene import WorldSource

WORLD_MEMORY = 3_000_000
"""Bytes that a world takes, of which 1.6 to 2.4 million were measured with one object."""
PROCESS_MEMORY = 350_000_000
"""Bytes that a process takes besides its worlds, of which 241 to 347 million were measured."""
PICTURE_MEMORY = 350_000_000
"""What it takes besides where it draws pictures."""
ROOM = 0.8
"""Share of the free memory that worlds may take."""
FIELDS = tuple(field.name for field in fields(Observation))
STATE = tuple(field.name for field in fields(WorldState))


def why_alone(options: EngineOptions) -> str:
    """Why worlds with these engines run one by one, as the end of a sentence; empty where they need not."""
    if options.remote or options.safety or options.real_time:
        return "a robot, a guard, real time and engines in other processes are of one world"
    if options.perception != "state":
        return f"perception '{options.perception}' works on pictures, one world at a time"
    if options.kinematics != "pinocchio":
        return f"the kinematics engine '{options.kinematics}' has no worlds in batches"
    physics = engine_class("physics", options.engines)
    if not issubclass(physics, PhysicsEngine) or not physics.has_batches():
        return f"the physics engine '{options.engines}' has no worlds in batches"
    return "a film is of one world" if options.rendering else ""


def check_memory(worlds: int, processes: int = 0, pictures: bool = False) -> None:
    """Refuse more worlds than this machine has room for.

    Args:
        worlds: How many, all processes together.
        processes: Processes that are begun for them; none where this one has them.
        pictures: They draw pictures.

    Raises:
        InputError: There is no room; says how many fit.
    """
    most = most_processes(1, pictures)
    if processes > most:
        raise InputError(
            f"{processes} processes do not fit into this machine's memory, of which each takes some "
            f"{_process_memory(pictures) / 1e6:.0f} MB; {most} do"
        )
    room = most_worlds(processes, pictures)
    if worlds > room:
        among = f" in {processes} processes" if processes else ""
        raise InputError(
            f"a batch of {worlds} worlds{among} does not fit into this machine's memory; {room} do"
        )


def most_worlds(processes: int = 0, pictures: bool = False) -> int:
    """How many worlds this machine has room for, one at least.

    Args:
        processes: Processes that are begun for them; none where this one has them.
        pictures: They draw pictures.
    """
    left = ROOM * available_memory() - processes * _process_memory(pictures)
    return max(1, int(left / WORLD_MEMORY))


def most_processes(worlds: int, pictures: bool = False) -> int:
    """How many processes with so many worlds each this machine has room for, one at least."""
    return max(1, int(ROOM * available_memory() / (_process_memory(pictures) + worlds * WORLD_MEMORY)))


def _process_memory(pictures: bool) -> int:
    return PROCESS_MEMORY + (PICTURE_MEMORY if pictures else 0)


@dataclass(frozen=True)
class Unreached:
    """A command that could not be carried out, in one world.

    Attributes:
        row: The world.
        error: Why.
    """

    row: int
    error: BtTasksimError


class Worlds(ABC):
    """Worlds of one robot, which begin, go on and fail one by one.

    Attributes:
        count: How many, N.
        observation: What was last seen of all of them ``(N, ...)``, the objects of each in its own order;
            None before the first look.
        real: It is a real robot's one world.
    """

    count: int
    real: bool = False
    observation: Observation | None = None

    def source(self, scene: WorldSource) -> WorldSource:
        """Where the worlds of episodes in a scene come from; by default the scene draws them itself.

        Raises:
            InputError: There are no such worlds of this scene.
        """
        return scene

    @abstractmethod
    def reset(self, rows: Array, configurations: Sequence[ActorConfiguration]) -> None:
        """Fresh worlds at these rows ``(k,)``; `observe` comes next, where `errors` has none."""

    @abstractmethod
    def errors(self, rows: Array) -> dict[int, BtTasksimError]:
        """Why worlds among ``rows (k,)`` could not begin, or have failed since they began, by row."""

    @abstractmethod
    def observe(self, rows: Array) -> Observation:
        """What is seen now ``(N, ...)``: of worlds ``rows (k,)`` anew, of the others as it was.

        The objects of each world are in its own order, with NaN behind them where others have more. Of worlds
        that nobody has looked at so far, numbers are NaN.
        """

    @abstractmethod
    def step(self, tool: Array | None, hand: Array | None, rows: Array) -> list[Unreached]:
        """One control period in worlds ``rows (k,)``.

        Args:
            tool: Tool targets ``(k, 7)``; rows of NaN, or None, keep their last ones.
            hand: Hand targets ``(k, 1 + n_synergies)``, likewise; synergies that are lacking are 0.
            rows: Which worlds.

        Returns:
            The worlds whose targets are out of reach: there the last ones were followed.
        """

    @abstractmethod
    def hidden(self, rows: Array | None = None) -> Hidden | None:
        """What only a simulator knows of worlds ``rows (k,)``, by default of all; None: nobody knows it.

        The objects of each world are in its own order.
        """

    def picture(self, camera: str) -> Array:
        """A picture ``(height, width, 3)`` of the first world, uint8.

        Raises:
            RuntimeError: Nothing is drawn here, the default.
        """
        raise RuntimeError("nothing can be drawn: these worlds have no rendering engine")

    @abstractmethod
    def close(self) -> None:
        """Let go of worlds, engines and threads."""


class BatchWorlds(Worlds):
    """Worlds in one batch of physics, see `PhysicsBatch`.

    Args:
        robot: The robot.
        options: The engines; see `why_alone` for those that have no batches.
        count: How many worlds.
        threads: How many threads step them.
        like: An array of the library, type and device of observations and commands, and in which joints are
            computed; by default NumPy. States of physics come from the host and go there, each in one
            transfer for a control period.

    Raises:
        InputError: An engine has no worlds in batches, or is none for this robot.
        MachineError: An engine cannot start.
    """

    def __init__(
        self,
        robot: RobotDescription,
        options: EngineOptions,
        count: int,
        threads: int,
        like: Array | None = None,
    ) -> None:
        alone = why_alone(options)
        if alone:
            raise InputError(f"these worlds cannot be run in a batch: {alone}")
        check_memory(count)
        self.count, self._robot = count, robot
        engine = engine_class("physics", options.engines)
        assert issubclass(engine, PhysicsEngine), "why_alone has seen to it"
        self.physics = engine.batch(robot, options.setup("physics"), count, threads)
        self._like: Array = np.empty(0) if like is None else like
        self.kinematics = BatchKinematics.of(robot, count, self._like)
        self._arm = PinocchioKinematics(robot)
        self._perception = BatchState(robot, count, noise_model(options.noise))
        self._unplaced: dict[int, BtTasksimError] = {}
        self._tool = self._nobody(7 + len(robot.arm_joints))
        self._hand = self._nobody(1 + len(robot.synergies))

    def _nobody(self, width: int) -> Array:
        """Targets ``(N, width)`` before any was written."""
        like = self._like
        shape = (self.count, width)
        return array_namespace(like).full(shape, np.nan, dtype=like.dtype, device=like.device)

    def reset(self, rows: Array, configurations: Sequence[ActorConfiguration]) -> None:
        """See `Worlds.reset`."""
        placed, failed = self._placed(rows, configurations)
        for row in rows.tolist():
            self._unplaced.pop(row, None)
        self._unplaced |= failed
        self.physics.reset(rows, placed)
        self.kinematics.reset(rows, placed)
        self._perception.reset(rows, placed)
        index = Index(np.asarray(rows))
        index.put(self._tool, np.nan)
        index.put(self._hand, np.nan)

    def _placed(
        self, rows: Array, configurations: Sequence[ActorConfiguration]
    ) -> tuple[list[ActorConfiguration], dict[int, BtTasksimError]]:
        """Worlds with the joints that bring the hand to where it is to begin; why some have none, by row."""
        placed = list(configurations)
        asked = [k for k, configuration in enumerate(placed) if configuration.hand_start]
        if not asked:
            return placed, {}
        robot = self._robot
        failed: dict[int, BtTasksimError] = {}
        starts = np.array([placed[k].hand_start for k in asked])
        poses = np.stack([robot.pointing_down(start[:3], start[3]) for start in starts])
        arms, failures = self._arm.batch.joints_at(poses)
        for i, k in enumerate(asked):
            joints: tuple[float, ...] = ()
            if (error := failures.error(i)) is not None:
                failed[int(rows[k])] = error
            else:
                joints = tuple(np.concatenate([arms[i], robot.hand_open]).tolist())
            placed[k] = replace(placed[k], joint_position=joints)
        return placed, failed

    def errors(self, rows: Array) -> dict[int, BtTasksimError]:
        """See `Worlds.errors`."""
        if not self._unplaced and not any(self.physics.errors):
            return {}
        numbers = rows.tolist()
        found = {row: error for row in numbers if (error := self.physics.errors[row]) is not None}
        if self._unplaced:
            found = {row: error for row in numbers if (error := self._unplaced.get(row)) is not None} | found
        return found

    def observe(self, rows: Array) -> Observation:
        """See `Worlds.observe`."""
        state = _sent(self.physics.state(rows), self._like)
        seen = self._perception.observe(state, rows if len(rows) < self.count else None)
        if len(rows) < self.count:
            seen = _merged(self.observation, rows, seen, self.count)
        self.observation = seen
        return seen

    def step(self, tool: Array | None, hand: Array | None, rows: Array) -> list[Unreached]:
        """See `Worlds.step`."""
        xp, index = array_namespace(self._like), Index(rows)
        asked_tool, asked_hand = index.of(self._tool), index.of(self._hand)
        if tool is not None:
            tool = widened(tool, asked_tool.shape[-1], np.nan)
            asked_tool = xp.where(xp.isnan(tool[:, :1]), asked_tool, tool)
        if hand is not None:
            asked_hand = _hands(asked_hand, hand)
        state = self.physics.state(rows)
        target, failures = self.kinematics.track(asked_tool, asked_hand, state.joint_position, rows)
        unreached: list[Unreached] = []
        if failures:
            failed = np.flatnonzero(failures.mask)
            for k in failed.tolist():
                error = failures.error(k)
                assert error is not None
                unreached.append(Unreached(int(rows[k]), error))
            these, last = Index(failed), Index(rows[failed])
            tool_before, hand_before = last.of(self._tool), last.of(self._hand)
            these.put(asked_tool, tool_before)
            these.put(asked_hand, hand_before)
            joints = self.physics.state(last.rows).joint_position
            again, _ = self.kinematics.track(tool_before, hand_before, joints, last.rows)
            position, velocity = (xp.asarray(x, copy=True) for x in (target.position, target.velocity))
            these.put(position, again.position)
            these.put(velocity, again.velocity)
            target = replace(target, position=position, velocity=velocity)
        index.put(self._tool, asked_tool)
        index.put(self._hand, asked_hand)
        position, velocity = fetched([target.position, target.velocity])
        self.physics.step(replace(target, position=position, velocity=velocity), rows)
        return unreached

    def hidden(self, rows: Array | None = None) -> Hidden:
        """See `Worlds.hidden`."""
        return self.physics.hidden(np.arange(self.count) if rows is None else rows)

    def close(self) -> None:
        """See `Worlds.close`."""
        self.physics.close()


def _hands(last: Array, hand: Array) -> Array:
    """Hand targets ``(k, 1 + n_synergies)`` with those that are asked anew, which may lack synergies."""
    xp = array_namespace(last, hand)
    asked = xp.concat([hand, last[:, hand.shape[1] :]], axis=1)
    asked = xp.where(xp.isnan(asked), xp.zeros_like(asked), asked)
    return xp.where(xp.isnan(hand[:, :1]), last, asked)


def _sent(state: WorldState, like: Array) -> WorldState:
    """A state in the library and on the device of an array."""
    if isinstance(like, np.ndarray):
        return state
    known = {name: value for name in STATE if (value := getattr(state, name)) is not None}
    there = sent(list(known.values()), like)
    return replace(state, **dict(zip(known, there, strict=True)))


def _merged(before: Observation | None, rows: Array, seen: Observation, worlds: int) -> Observation:
    """Observations of all worlds, with some of them seen anew; NaN or False where nothing was seen so far."""
    out, index = {}, Index(rows)
    for name in FIELDS:
        new = getattr(seen, name)
        xp = array_namespace(new)
        nothing = False if new.dtype == xp.bool else np.nan
        shape = (worlds, *new.shape[1:])
        old = (
            xp.full(shape, nothing, dtype=new.dtype, device=new.device)
            if before is None
            else getattr(before, name)
        )
        out[name] = with_rows(old, index, new, nothing)
    return Observation(**out)


def hidden_of(hidden: Hidden, row: int, objects: int, fixtures: int) -> Hidden:
    """The hidden state of one world of a batch, without what other worlds have more.

    Args:
        hidden: Of all worlds ``(N, ...)``.
        row: Which world.
        objects: How many objects it has.
        fixtures: How many fixtures it has.
    """
    most = hidden.objects.shape[1]
    columns = [*range(objects), *range(most, most + fixtures)]
    return Hidden(
        time=hidden.time[row],
        objects=hidden.objects[row, :objects],
        velocities=hidden.velocities[row, :objects],
        hand_force=hidden.hand_force[row, :objects],
        hand_distance=hidden.hand_distance[row, :objects],
        support=hidden.support[row, :objects][:, columns],
        penetration=hidden.penetration[row],
        tool_pose=hidden.tool_pose[row],
    )
