"""Physics by MuJoCo, one fresh model and state an episode.

A world is built in `mujoco_model` and `mujoco_robot` and goes on in `mujoco_stepping`; contacts are chosen in
`mujoco_contacts`, and what is felt is read in `mujoco_sensing`. Here stand the laws of states, for all worlds
of a batch at once.
"""

from __future__ import annotations

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import MachineError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.core.world import Hidden, WorldState
from bt_tasksim.engines.base import EngineSetup
from bt_tasksim.engines.physics.mujoco_sensing import object_velocities, wrist_wrenches
from bt_tasksim.engines.physics.mujoco_stepping import MujocoWorld
from bt_tasksim.engines.physics.threaded import Layout, SimulatedPhysics, ThreadedBatch
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration


class MujocoBatch(ThreadedBatch[MujocoWorld]):
    """Worlds of MuJoCo.

    The same worlds as those of `SapienBatch`, by another method: links carry no weight, drives follow the
    same law, the same bodies can touch, and friction is the mean of two bodies' as there. The forces on
    fingertips have their friction, which PhysX does not report.

    Args:
        robot: The robot.
        worlds: How many there are; at least 1.
        threads: How many threads step them; at least 1.

    Raises:
        MachineError: MuJoCo is not installed.
    """

    library = "MuJoCo"

    def __init__(self, robot: RobotDescription, worlds: int, threads: int) -> None:
        try:
            import mujoco
        except ImportError as error:
            raise MachineError(
                f"MuJoCo physics cannot start: {error}; "
                "install the extra 'mujoco': pip install 'bt-tasksim[mujoco]'"
            ) from error
        super().__init__(robot, worlds, threads)
        self._mujoco = mujoco
        self._tip_points = np.array([tip.point for tip in robot.tips])

    def _build(self, row: int, configuration: ActorConfiguration, start: Array) -> MujocoWorld:
        return MujocoWorld(self._mujoco, self.robot, configuration, start)

    def _read(self, rows: Array, worlds: list[MujocoWorld], layout: Layout) -> tuple[WorldState, Hidden]:
        """See `ThreadedBatch`."""
        readings = [world.reading for world in worlds]
        q, v = np.array([r.position for r in readings]), np.array([r.velocity for r in readings])
        frames = np.concatenate(
            [np.array([r.frame_position for r in readings]), np.array([r.frame_rotation for r in readings])],
            axis=-1,
        )
        tool = poses.multiply(frames[:, 0], self.robot.tool_pose)
        time = np.array([r.time for r in readings])
        rotation = np.concatenate([r.object_rotation for r in readings])
        position = np.concatenate([r.object_position for r in readings])
        objects = layout.padded(np.concatenate([position, rotation], axis=-1), 7)
        moving = object_velocities(
            np.concatenate([r.object_motion for r in readings]),
            rotation,
            np.concatenate([r.object_com for r in readings]),
        )
        velocities = layout.padded(moving, 6)
        state = WorldState(
            time=time,
            joint_position=q,
            joint_velocity=v,
            joint_effort=self._effort(rows, q, v),
            tip_force=np.array([r.tip_force for r in readings]).reshape(len(rows), -1, 3),
            wrench=self._wrench([r.wrist for r in readings]),
            tool_pose=tool,
            tips=poses.transform(frames[:, 1:], self._tip_points),
            objects=objects,
            velocities=velocities,
        )
        hidden = Hidden(
            time=time,
            objects=objects,
            velocities=velocities,
            hand_force=layout.padded([force for r in readings for force in r.hand_force]),
            hand_distance=layout.padded([far for r in readings for far in r.near.hand_distance]),
            support=layout.support([r.near.support for r in readings]),
            penetration=np.array([r.penetration for r in readings]),
            tool_pose=tool,
        )
        return state, hidden

    def _wrench(self, felt: list[list[list[float]]]) -> Array:
        """External wrenches ``(k, 6)``: of each world the mean of the steps in which it was felt."""
        counts = np.array([len(steps) for steps in felt])
        each = wrist_wrenches(np.array([step for steps in felt for step in steps]), self.robot.tool_pose)
        first, total = np.cumsum(counts) - counts, np.zeros((len(felt), 6))
        for step in range(counts.max()):  # one after the other: NumPy's sums have an order of their own
            there = counts > step
            total[there] += each[first[there] + step]
        return total / counts[:, None]


@register("engine/physics", "mujoco")
class MujocoPhysics(SimulatedPhysics[MujocoWorld]):
    """The physics engine on MuJoCo: a `MujocoBatch` of one world.

    Args:
        robot: The robot.

    Raises:
        MachineError: MuJoCo is not installed.
    """

    def __init__(self, robot: RobotDescription) -> None:
        super().__init__(MujocoBatch(robot, worlds=1, threads=1))

    @classmethod
    def batch(cls, robot: RobotDescription, setup: EngineSetup, worlds: int, threads: int) -> MujocoBatch:
        """See `PhysicsEngine.batch`."""
        return MujocoBatch(robot, worlds, threads)
