"""The environment engine pipeline: four roles in a fixed order, each engine replaceable.

The pipeline is all that the runner knows: a robot, a simulator, or parts of both in other processes. What an
engine is stands in `bt_tasksim.engines.base`.

What was asked last has one owner at each level: `EnginePipeline.commanded` is what leaves have asked of tool
and hand; the kinematics engine has the joints that this comes to, and how far they are on their way; the
guard has what it let through; a simulator has what its drives are told. Nobody reads another one's.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.world import Command, Hidden, Observation, WorldModel, WorldState
from bt_tasksim.engines.base import (
    Engine,
    KinematicsEngine,
    PhysicsEngine,
    PostProcessEngine,
    RenderingEngine,
)
from bt_tasksim.engines.clock import Clock, FreeClock, Timing
from bt_tasksim.engines.images import Image
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.scene import WorldSource
from bt_tasksim.scene.success import Verdict

SAME_PLACE = (2e-3, 2e-2)
"""m and rad by which the tool's poses of kinematics and physics may differ at a reset."""


class EnginePipeline:
    """Kinematics, physics, rendering and post-process, in that order.

    Args:
        kinematics: See `KinematicsEngine`.
        physics: See `PhysicsEngine`.
        postprocess: See `PostProcessEngine`.
        rendering: See `RenderingEngine`; None where nothing is ever drawn.
        clock: The clock that the physics role waits for; by default none, as fast as possible.
    """

    def __init__(
        self,
        kinematics: KinematicsEngine,
        physics: PhysicsEngine,
        postprocess: PostProcessEngine,
        rendering: RenderingEngine | None = None,
        clock: Clock | None = None,
    ) -> None:
        self.kinematics = kinematics
        self.physics = physics
        self.postprocess = postprocess
        self.rendering = rendering
        self.clock = clock or FreeClock()
        self.state: WorldState | None = None
        self.commanded: Command = Command()

    def worlds(self, scene: WorldSource) -> WorldSource:
        """Where the worlds of runs in a scene come from, see `PhysicsEngine.worlds`."""
        return self.physics.worlds(scene)

    def reset(self, configuration: ActorConfiguration, model: WorldModel) -> Observation:
        """Begin an episode; returns its first observation."""
        self.kinematics.reset(configuration)
        if configuration is not None and configuration.hand_start:
            joints = self.kinematics.joints_of_hand_start(configuration.hand_start)
            configuration = replace(configuration, joint_position=joints)
        self.state = self.physics.reset(configuration)
        self._check_tool(self.state)
        if self.rendering is not None:
            self.rendering.reset(configuration)
        self.postprocess.reset(configuration, model)
        self.commanded = Command()
        observation = self._observe(first=True)
        now = self.physics.begin()
        if now is None:
            return observation
        self.state = now  # pictures and the first look have taken their time
        return self._observe(first=False)

    def step(self, command: Command) -> Observation:
        """One control period: a part of the command that nobody wrote keeps its last target.

        Raises:
            UnreachableError: The tool target is out of reach; nothing has moved, and the last targets stay.
        """
        if self.state is None:
            raise RuntimeError("the pipeline was stepped before it was reset")
        wanted = command.over(self.commanded)
        target = self.kinematics.solve(wanted, self.state)
        self.commanded = wanted
        self.state = self.physics.step(target)
        return self._observe(first=False)

    def hidden(self) -> Hidden | None:
        """The physics state, in simulation."""
        return self.physics.hidden()

    def verdict(self) -> Verdict | None:
        """What became of the run, where the physics engine itself says it."""
        return self.physics.verdict()

    def unseen(self) -> dict[str, str]:
        """Why perception has never seen an object, one sentence each, by the object's name."""
        return dict(self.postprocess.unseen())

    def render(self, camera: str, *, depth: bool = False, size: tuple[int, int] | None = None) -> Image:
        """A picture for a recording, see `RenderingEngine.render`.

        Raises:
            InputError: There is no such camera, or it has no pictures of this size.
            RuntimeError: There is no rendering engine or no episode.
        """
        if self.rendering is None or self.state is None:
            raise RuntimeError("nothing can be drawn: the pipeline has no rendering engine or was not reset")
        if size is None:  # engines that know no sizes are engines, too
            return self.rendering.render(self.state, camera, depth=depth)
        return self.rendering.render(self.state, camera, depth=depth, size=size)

    @property
    def real(self) -> bool:
        """What it moves is a real robot."""
        return self.physics.real

    @property
    def hold_delivered(self) -> bool:
        """A robot that had to hold was told so, in one way or another."""
        return self.physics.hold_delivered

    @property
    def served(self) -> dict[str, str]:
        """Names of those engines that are in other processes, as their servers say them, by role."""
        return {engine.role: engine.served_name for engine in self.engines if engine.served_name}

    @property
    def engines(self) -> tuple[Engine, ...]:
        """Its engines, in their order."""
        found = (self.kinematics, self.physics, self.rendering, self.postprocess)
        return tuple(engine for engine in found if engine is not None)

    def stop(self, why: str) -> None:
        """The run is over, or has to be: a robot holds until the next `reset`; a simulation need not."""
        self.physics.hold(why)

    def timing(self) -> Timing | None:
        """How well the rate was kept; None where there is none to keep."""
        return self.clock.timing()

    def close(self) -> None:
        """Let go of what the engines hold."""
        for engine in self.engines:
            engine.close()

    def _check_tool(self, state: WorldState) -> None:
        """Kinematics and physics have the same robot: with the same joints the tool is at the same place."""
        expected = self.kinematics.tool_pose(state)
        if expected is None:
            return
        apart = float(np.linalg.norm(expected[:3] - state.tool_pose[:3]))
        turned = float(poses.angle_between(expected[3:], state.tool_pose[3:]))
        if apart > SAME_PLACE[0] or turned > SAME_PLACE[1]:
            raise InputError(
                f"kinematics and physics do not have the same robot: for the same joints their tool poses "
                f"are {1000 * apart:.1f} mm and {math.degrees(turned):.1f} degrees apart; do both read the "
                f"same URDF, with the same base_link and tool?"
            )

    def _observe(self, first: bool) -> Observation:
        state = self.state
        assert state is not None
        cameras = self.postprocess.cameras(first)
        images = {name: self.render(name, depth=True) for name in cameras}
        return self.postprocess.observe(state, images)
