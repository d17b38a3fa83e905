"""Physics by SAPIEN (PhysX 5), one fresh scene an episode, without any rendering.

A world is built in `sapien_world` and `sapien_robot` and goes on in `sapien_stepping`; contacts are read in
`sapien_contacts`. Here stand the laws of states, for all worlds of a batch at once.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable
from itertools import chain

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import MachineError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.core.world import Hidden, WorldState
from bt_tasksim.engines.base import EngineSetup
from bt_tasksim.engines.physics.sapien_robot import RobotBuilder
from bt_tasksim.engines.physics.sapien_stepping import SapienWorld
from bt_tasksim.engines.physics.sapien_world import build_world
from bt_tasksim.engines.physics.sapien_wrist import external_wrench
from bt_tasksim.engines.physics.threaded import Layout, SimulatedPhysics, ThreadedBatch
from bt_tasksim.engines.vulkan import use_software_driver
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration

_BUILDING = threading.Lock()
"""SAPIEN's defaults for new bodies are global for the process: one thread at a time sets them and builds."""


class SapienBatch(ThreadedBatch[SapienWorld]):
    """Worlds of SAPIEN.

    The arm's links do not collide with one another; hands, fingers, objects and fixtures do. Links carry no
    weight, as the controllers of real arms compensate it, so the wrist's wrench needs no correction.

    Args:
        robot: The robot.
        worlds: How many there are; at least 1.
        threads: How many threads step them; at least 1.

    Raises:
        MachineError: SAPIEN is not installed.
    """

    library = "SAPIEN"

    def __init__(self, robot: RobotDescription, worlds: int, threads: int) -> None:
        use_software_driver()
        try:
            import sapien  # noqa: F401  # here, so that an engine that cannot start says so at once
        except ImportError as error:
            raise MachineError(
                f"SAPIEN physics cannot start: {error}; "
                "install the simulation extra: pip install 'bt-tasksim[sim]'"
            ) from error
        super().__init__(robot, worlds, threads)
        self._builder = RobotBuilder(robot)
        self._tip_points = np.array([tip.point for tip in robot.tips])
        self._lever, self._to_tool = np.zeros((worlds, 3)), np.zeros((worlds, 1, 4))

    def _build(self, row: int, configuration: ActorConfiguration, start: Array) -> SapienWorld:
        with _BUILDING:
            world = build_world(configuration, self.robot.solver_iterations)
            robot = self._builder.build(world, start)
        self._lever[row], self._to_tool[row] = robot.lever, robot.to_tool
        return SapienWorld(world, robot, configuration, len(self.robot.tips))

    def _read(self, rows: Array, worlds: list[SapienWorld], layout: Layout) -> tuple[WorldState, Hidden]:
        """See `ThreadedBatch`."""
        k, readings, robot = len(rows), [world.reading for world in worlds], worlds[0].robot
        q = np.concatenate([r.position for r in readings]).reshape(k, -1)[:, robot.index].astype(float)
        v = np.concatenate([r.velocity for r in readings]).reshape(k, -1)[:, robot.index].astype(float)
        frames = _poses(pose for r in readings for pose in r.frames).reshape(k, -1, 7)
        tool = poses.multiply(frames[:, 0], robot.tool_pose)
        incoming = np.concatenate([r.incoming for r in readings]).reshape(k, -1, 6)[:, robot.wrist]
        time = np.array([r.time for r in readings])
        objects = layout.padded(_poses(pose for r in readings for pose in r.objects), 7)
        velocities = layout.padded(np.array([v for r in readings for v in r.velocities], np.float32), 6)
        touches = [r.touch for r in readings]
        state = WorldState(
            time=time,
            joint_position=q,
            joint_velocity=v,
            joint_effort=self._effort(rows, q, v),
            tip_force=np.array([touch.tip_force for touch in touches]).reshape(k, -1, 3),
            wrench=external_wrench(incoming.astype(float), self._lever[rows], self._to_tool[rows]),
            tool_pose=tool,
            tips=poses.transform(frames[:, 1:], self._tip_points),
            objects=objects,
            velocities=velocities,
        )
        hidden = Hidden(
            time=time,
            objects=objects,
            velocities=velocities,
            hand_force=layout.padded([force for touch in touches for force in touch.hand_force]),
            hand_distance=layout.padded([far for touch in touches for far in touch.hand_distance]),
            support=layout.support([touch.support for touch in touches]),
            penetration=np.array([r.penetration for r in readings]),
            tool_pose=tool,
        )
        return state, hidden


def _poses(found: Iterable[tuple[float, ...]]) -> Array:
    """Poses ``(n, 7)`` of tuples of numbers, quicker than NumPy itself makes them of nested ones."""
    return np.fromiter(chain.from_iterable(found), float).reshape(-1, 7)


@register("engine/physics", "sapien")
class SapienPhysics(SimulatedPhysics[SapienWorld]):
    """The physics engine on SAPIEN: a `SapienBatch` of one world.

    Args:
        robot: The robot.

    Raises:
        MachineError: SAPIEN is not installed.
    """

    def __init__(self, robot: RobotDescription) -> None:
        super().__init__(SapienBatch(robot, worlds=1, threads=1))

    @classmethod
    def batch(cls, robot: RobotDescription, setup: EngineSetup, worlds: int, threads: int) -> SapienBatch:
        """See `PhysicsEngine.batch`."""
        return SapienBatch(robot, worlds, threads)
