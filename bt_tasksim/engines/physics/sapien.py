"""Physics by SAPIEN (PhysX 5), one fresh scene an episode, without any rendering.

A world is built in `sapien_world` and `sapien_robot` and goes on in `sapien_stepping`; contacts are read in
`sapien_contacts`. Here stand the laws of states, for all worlds of a batch at once.
"""

from __future__ import annotations

import threading

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import MachineError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.core.world import Hidden, WorldState
from bt_tasksim.engines.base import EngineSetup
from bt_tasksim.engines.physics.layout import Layout
from bt_tasksim.engines.physics.sapien_readings import SapienReadings
from bt_tasksim.engines.physics.sapien_robot import RobotBuilder
from bt_tasksim.engines.physics.sapien_stepping import SapienWorld
from bt_tasksim.engines.physics.sapien_world import build_world
from bt_tasksim.engines.physics.sapien_wrist import external_wrench
from bt_tasksim.engines.physics.single import SimulatedPhysics
from bt_tasksim.engines.physics.threaded import ThreadedBatch
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
        self._readings = SapienReadings(worlds, len(robot.tips))
        self._lever, self._to_tool = np.zeros((worlds, 3)), np.zeros((worlds, 1, 4))

    def _build(self, row: int, configuration: ActorConfiguration, start: Array) -> SapienWorld:
        with _BUILDING:
            world = build_world(configuration, self.robot.solver_iterations)
            robot = self._builder.build(world, start)
        self._lever[row], self._to_tool[row] = robot.lever, robot.to_tool
        return SapienWorld(world, robot, configuration, len(self.robot.tips), self._readings, row)

    def _widen(self, objects: int, fixtures: int) -> None:
        """See `ThreadedBatch`."""
        super()._widen(objects, fixtures)
        for world in self.simulated:
            if world is not None:
                articulation = world.robot.articulation
                self._readings.fit(articulation.dof, len(articulation.get_links()), *self._most)
                return

    def _read(self, rows: Array, worlds: list[SapienWorld], layout: Layout) -> tuple[WorldState, Hidden]:
        """See `ThreadedBatch`."""
        read, robot = self._readings, worlds[0].robot

        def of(values: Array) -> Array:
            return values.take(rows, axis=0)

        q, v = of(read.position)[:, robot.index], of(read.velocity)[:, robot.index]
        frames = of(read.frames)
        time, tool = of(read.time), poses.multiply(frames[:, 0], robot.tool_pose)
        objects = of(read.objects)
        velocities = np.concatenate([of(read.linear), of(read.angular)], axis=-1)
        state = WorldState(
            time=time,
            joint_position=q,
            joint_velocity=v,
            joint_effort=self._effort(rows, q, v),
            tip_force=of(read.tip_force),
            wrench=external_wrench(read.incoming[rows, robot.wrist], of(self._lever), of(self._to_tool)),
            tool_pose=tool,
            tips=poses.transform(frames[:, 1:], self._tip_points),
            objects=objects,
            velocities=velocities,
        )
        hidden = Hidden(
            time=time,
            objects=objects,
            velocities=velocities,
            hand_force=of(read.hand_force),
            hand_distance=of(read.hand_distance),
            support=of(read.support),
            penetration=of(read.penetration),
            tool_pose=tool,
        )
        return state, hidden


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
