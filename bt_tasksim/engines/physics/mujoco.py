"""Physics by MuJoCo, one fresh model and state an episode.

A world is built in `mujoco_model` and `mujoco_robot` and goes on in `mujoco_stepping`; contacts are chosen in
`mujoco_contacts`, and what is felt is read in `mujoco_sensing`; the laws of states, for all worlds of a batch
at once, stand in `mujoco_state`.
"""

from __future__ import annotations

import numpy as np

from bt_tasksim.core.errors import MachineError
from bt_tasksim.core.mujoco_log import write_none
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.core.world import Hidden, WorldState
from bt_tasksim.engines.base import EngineSetup
from bt_tasksim.engines.physics.layout import Layout
from bt_tasksim.engines.physics.mujoco_sensing import mean_wrenches
from bt_tasksim.engines.physics.mujoco_state import StateArrays, states
from bt_tasksim.engines.physics.mujoco_stepping import MujocoWorld
from bt_tasksim.engines.physics.single import SimulatedPhysics
from bt_tasksim.engines.physics.threaded import ThreadedBatch
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
        write_none(mujoco)

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
        position = np.concatenate([r.object_position for r in readings])
        rotation = np.concatenate([r.object_rotation for r in readings])
        read = StateArrays(
            time=np.array([r.time for r in readings]),
            position=q,
            velocity=v,
            effort=self._effort(rows, q, v),
            frames=frames,
            objects=np.concatenate([position, rotation], axis=-1),
            motion=np.concatenate([r.object_motion for r in readings]),
            com=np.concatenate([r.object_com for r in readings]),
            wrench=mean_wrenches(
                np.array([step for r in readings for step in r.wrist]),
                np.array([len(r.wrist) for r in readings]),
                self.robot.tool_pose,
            ),
            tip_force=np.array([r.tip_force for r in readings]).reshape(len(rows), -1, 3),
            hand_force=np.array([force for r in readings for force in r.hand_force]),
            hand_distance=np.array([far for r in readings for far in r.near.hand_distance]),
            support=layout.support([r.near.support for r in readings]),
            penetration=np.array([r.penetration for r in readings]),
        )
        return states(self.robot, layout, read)


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
