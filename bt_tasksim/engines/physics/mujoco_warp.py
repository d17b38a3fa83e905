"""Physics by MuJoCo Warp: many worlds at once, on a GPU, or slowly on the CPU.

The worlds are MuJoCo's, built by the same code (`mujoco_model`, `mujoco_robot`, `mujoco_contacts`), in single
precision. Those whose models have one structure are stepped together, see
`bt_tasksim.engines.physics.warp_batch`. Warp and its library are imported when an engine is made.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bt_tasksim.core.errors import InputError, MachineError, nearest
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.core.world import Hidden, WorldState
from bt_tasksim.engines.base import EngineSetup
from bt_tasksim.engines.body_contacts import BodyContacts
from bt_tasksim.engines.physics.layout import Layout, put, rows_for, wider_support
from bt_tasksim.engines.physics.mujoco_model import BodyNumbers, build_world
from bt_tasksim.engines.physics.mujoco_sensing import mean_wrenches
from bt_tasksim.engines.physics.mujoco_state import StateArrays, states
from bt_tasksim.engines.physics.mujoco_timing import StepPlan
from bt_tasksim.engines.physics.single import SimulatedPhysics
from bt_tasksim.engines.physics.threaded import ThreadedBatch
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration

if TYPE_CHECKING:
    from bt_tasksim.engines.physics.warp_batch.group import WarpGroup
    from bt_tasksim.engines.physics.warp_batch.structure import Prepared

DEVICES = ("cpu", "cuda")
FULL = (
    "MuJoCo Warp has too little room for the contacts of this world: too many things touch; "
    "take --engines mujoco, or a scene in which fewer do"
)


class WarpWorld:
    """One world of a batch, see `bt_tasksim.engines.physics.threaded.SimulatedWorld`.

    Args:
        prepared: What goes to the device.
        configuration: What was drawn.
        gains: Stiffness and damping of the drives ``(2, n_joints)``.

    Attributes:
        prepared: What goes to the device.
        group: The worlds of its structure, once it has entered.
        slot: Where it is in its group.
        control: What the drives are told next ``(n_joints,)``.
        falling: It goes on in fine steps.
        full: It had more contacts than there is room for, and cannot go on.
        periods: Control periods so far.
        report: What was read last.
    """

    group: WarpGroup
    slot: int
    report: Array

    def __init__(self, prepared: Prepared, configuration: ActorConfiguration, gains: Array) -> None:
        self.prepared, self.falling, self.full, self.periods = prepared, False, False, 0
        self.n_objects, self.n_fixtures = len(configuration.objects), len(configuration.fixtures)
        self.control: Array = np.zeros(0)
        self._gains = gains

    @property
    def deepest_pair(self) -> tuple[str, str, float, float] | None:
        """See `bt_tasksim.engines.physics.threaded.SimulatedWorld`; the time is that of the reading."""
        columns = self.group.columns
        deep = float(columns.floats(self.report[None], "deepest")[0, 0])
        a, b = columns.integers(self.report[None], "deepest_pair")[0].tolist()
        bodies = self.prepared.world.bodies
        time = self.periods * self.prepared.timing.period
        return (bodies[a].name, bodies[b].name, deep, time) if deep > 0.0 else None

    def drive_to(self, position: list[float], velocity: list[float]) -> None:
        """See `bt_tasksim.engines.physics.threaded.SimulatedWorld`."""
        stiffness, damping = self._gains
        self.control = stiffness * np.array(position) + damping * np.array(velocity)

    def advance(self) -> None:
        """Nothing: the worlds of a group go on together, see `MujocoWarpBatch`."""

    def read(self) -> None:
        """Nothing: they are read together, too."""

    def contact_points(self) -> BodyContacts | None:
        """None: contacts stay on the device."""
        return None

    def note_motion(self, falling: bool, spin: float) -> None:
        """See `bt_tasksim.engines.physics.threaded.SimulatedWorld`."""
        self.falling = falling


class MujocoWarpBatch(ThreadedBatch[WarpWorld]):
    """Worlds of MuJoCo Warp. Threads build their models; the device steps them.

    A disturbance, which looks at contacts at every step, is not simulated: such a world cannot be built.

    Args:
        robot: The robot.
        worlds: How many there are; at least 1.
        threads: How many threads build them; at least 1.
        device: ``cpu``, ``cuda`` or ``cuda:N``.

    Raises:
        MachineError: MuJoCo Warp is not installed, or the device is not there.
    """

    library = "MuJoCo Warp"

    def __init__(self, robot: RobotDescription, worlds: int, threads: int, device: str) -> None:
        try:
            import mujoco

            from bt_tasksim.engines.physics.warp_batch import device as devices
            from bt_tasksim.engines.physics.warp_batch import group, meshes, structure

            self.device = devices.start(device)
            self._warp = devices.mujoco_warp_library()
        except ImportError as error:
            raise MachineError(
                f"MuJoCo Warp physics cannot start: {error}; "
                "install the extra 'warp': pip install 'bt-tasksim[warp]'"
            ) from error
        super().__init__(robot, worlds, threads)
        self._mujoco, self._structure = mujoco, structure
        self._group_class = group.WarpGroup
        self._hulls = meshes.HullStore(self.device)
        self.groups: dict[bytes, WarpGroup] = {}
        self._gains = np.array([self._stiffness, self._damping])

    # ---- worlds come and go -----------------------------------------------------------------------------

    def reset(self, rows: Array, configurations: Sequence[ActorConfiguration]) -> None:
        """See `PhysicsBatch.reset`."""
        for row in np.asarray(rows, int).tolist():
            self._leave(row)
        super().reset(rows, configurations)

    def _leave(self, row: int) -> None:
        world = self.simulated[row]
        if world is not None:
            world.group.leave(world.slot)
            self.simulated[row] = None

    def _build(self, row: int, configuration: ActorConfiguration, start: Array) -> WarpWorld:
        if configuration.disturbance is not None:
            raise InputError(
                "MuJoCo Warp does not simulate disturbances: take --engines mujoco, or a scene without them"
            )
        mujoco = self._mujoco
        world = build_world(mujoco, self.robot, configuration)
        if world.latched:
            name = configuration.objects[world.latched[0][0]].name
            raise InputError(
                f"MuJoCo Warp does not simulate latches, and '{name}' has one: take --engines mujoco, or a "
                f"fixture without"
            )
        model = world.model
        model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)  # which Warp never does
        data = mujoco.MjData(model)
        data.qpos[world.joint_qpos] = start
        for address, value in world.opened:
            data.qpos[address] = value
        data.xfrc_applied[world.object_body, 2] = -world.weight
        mujoco.mj_kinematics(model, data)
        control = self._gains[0] * start
        state = {"qpos": data.qpos, "xfrc_applied": data.xfrc_applied, "ctrl": control}
        state |= {"geom_xpos": data.geom_xpos, "geom_xmat": data.geom_xmat}
        return WarpWorld(
            self._structure.prepare(self._warp, world, StepPlan.of(configuration), state),
            configuration,
            self._gains,
        )

    def _begin(self, rows: Array) -> None:
        """Worlds that were built enter their groups, and are looked at."""
        fresh = [(row, world) for row in rows.tolist() if (world := self.simulated[row]) is not None]
        row_of = {id(world): row for row, world in fresh}
        for worlds in _by_structure([world for _, world in fresh]).values():
            try:
                self._enter(worlds)
            except InputError as error:
                for world in worlds:
                    row = row_of[id(world)]
                    self.errors[row], self.simulated[row] = error, None
        self._refuse_full(fresh)

    def _enter(self, worlds: list[WarpWorld]) -> None:
        """Worlds of one structure enter their group.

        Raises:
            InputError: MuJoCo Warp does not take them.
        """
        first = worlds[0]
        group = self.groups.get(first.prepared.key)
        if group is None:
            bodies = BodyNumbers.of(self.robot, first.prepared.world, first.n_fixtures)
            group = self._group_class(self._warp, self.device, first.prepared, bodies, self._hulls)
        slots = group.enter([world.prepared for world in worlds])
        self.groups[first.prepared.key] = group
        reports = group.look(np.array(slots))
        full = group.full(reports).tolist()
        for world, slot, report, over in zip(worlds, slots, reports, full, strict=True):
            world.group, world.slot, world.report, world.full = group, slot, report, over

    # ---- running ----------------------------------------------------------------------------------------

    def _go_on(self, worlds: Sequence[tuple[int, WarpWorld, list[float], list[float]]]) -> None:
        """See `ThreadedBatch`; all worlds of one structure at once."""
        for _, world, position, velocity in worlds:
            world.drive_to(position, velocity)
        for some in _by_structure([world for _, world, _, _ in worlds if not world.full]).values():
            group, slots = some[0].group, np.array([world.slot for world in some])
            group.write(slots, "ctrl", np.array([world.control for world in some]))
            reports = group.period(slots, np.array([world.falling for world in some]))
            for world, report, over in zip(some, reports, group.full(reports).tolist(), strict=True):
                world.report, world.full = report, over
                world.periods += 1
        self._refuse_full([(row, world) for row, world, _, _ in worlds])

    def _refuse_full(self, worlds: Sequence[tuple[int, WarpWorld]]) -> None:
        for row, world in worlds:
            if world.full:
                self.errors[row] = MachineError(FULL)

    def _read(self, rows: Array, worlds: list[WarpWorld], layout: Layout) -> tuple[WorldState, Hidden]:
        """See `ThreadedBatch`."""
        state: WorldState | None = None
        hidden: Hidden | None = None
        where = {id(world): k for k, world in enumerate(worlds)}
        for some in _by_structure(worlds).values():
            at = np.array([where[id(world)] for world in some])
            mine = self._states(rows[at], some, Layout(layout.counts[at], layout.objects, layout.fixtures))
            if state is None or hidden is None:
                state, hidden = rows_for(mine[0], len(worlds)), rows_for(mine[1], len(worlds))
            put(state, at, mine[0])
            put(hidden, at, mine[1])
        assert state is not None
        assert hidden is not None
        return state, hidden

    def _states(self, rows: Array, worlds: list[WarpWorld], layout: Layout) -> tuple[WorldState, Hidden]:
        """States of worlds of one structure."""
        first, group = worlds[0], worlds[0].group
        world, columns, k = first.prepared.world, group.columns, len(worlds)
        report = np.array([w.report for w in worlds])
        q, v = columns.floats(report, "qpos"), columns.floats(report, "qvel")
        n, tips, fixed = first.n_objects, len(self.robot.tips), first.n_fixtures
        positions = columns.floats(report, "poses").reshape(k, -1, 7)
        joints, speeds = q[:, world.joint_qpos], v[:, world.joint_dof]
        periods = np.array([w.periods for w in worlds])
        felt = np.where(periods == 0, 1, group.timing.sensed)[:, None]  # a look feels once
        each = columns.floats(report, "felt").reshape(k, -1, 16)
        touched = columns.floats(report, "support").reshape(k, max(n, 1), -1)[:, :n, : n + fixed] > 0.0
        com = [w.prepared.world.model.body_ipos[w.prepared.world.object_body] for w in worlds]
        read = StateArrays(
            time=periods * group.timing.period,
            position=joints,
            velocity=speeds,
            effort=self._effort(rows, joints, speeds),
            frames=np.ascontiguousarray(positions[:, : 1 + tips]),
            objects=positions[:, 1 + tips :].reshape(-1, 7),
            motion=world.object_motion(v, positions[:, 1 + tips :, 3:]).reshape(-1, 6),
            com=np.concatenate(com),
            wrench=mean_wrenches(each[np.arange(each.shape[1]) < felt], felt[:, 0], self.robot.tool_pose),
            tip_force=columns.floats(report, "tips").reshape(k, -1, 3)[:, :tips] / felt[..., None],
            hand_force=(columns.floats(report, "hand")[:, :n] / felt).ravel(),
            hand_distance=columns.floats(report, "distance")[:, :n].ravel(),
            support=wider_support(touched, n, layout.objects, layout.fixtures),
            penetration=columns.floats(report, "deepest")[:, 0],
        )
        return states(self.robot, layout, read)


@register("engine/physics", "mujoco_warp")
class MujocoWarpPhysics(SimulatedPhysics[WarpWorld]):
    """The physics engine on MuJoCo Warp: a `MujocoWarpBatch` of one world.

    Args:
        robot: The robot.
        device: ``cpu``, ``cuda`` or ``cuda:N``.

    Raises:
        MachineError: MuJoCo Warp is not installed, or the device is not there.
    """

    def __init__(self, robot: RobotDescription, device: str = "cpu") -> None:
        super().__init__(MujocoWarpBatch(robot, worlds=1, threads=1, device=device))

    @classmethod
    def create(cls, robot: RobotDescription, setup: EngineSetup) -> MujocoWarpPhysics:
        """See `Engine.create`."""
        return cls(robot, setup.device)

    @classmethod
    def check_device(cls, name: str) -> None:
        """See `Engine.check_device`."""
        kind, colon, number = name.partition(":")
        if kind not in DEVICES or (colon and (kind == "cpu" or not number.isdecimal())):
            raise InputError(
                f"unknown device '{name}'{nearest(name, DEVICES)}: it is cpu, cuda or cuda:N, such as cuda:1"
            )

    @classmethod
    def batch(cls, robot: RobotDescription, setup: EngineSetup, worlds: int, threads: int) -> MujocoWarpBatch:
        """See `PhysicsEngine.batch`."""
        return MujocoWarpBatch(robot, worlds, threads, setup.device)


def _by_structure(worlds: Sequence[WarpWorld]) -> dict[bytes, list[WarpWorld]]:
    found: dict[bytes, list[WarpWorld]] = {}
    for world in worlds:
        found.setdefault(world.prepared.key, []).append(world)
    return found
