"""The environment engine pipeline: four roles in a fixed order, each engine replaceable.

An engine is any object with the methods of its role below. The pipeline is all that the runner knows: a
robot, a simulator, or parts of both in other processes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol, runtime_checkable

from bt_tasksim.pacing import Clock, FreeClock, Timing
from bt_tasksim.poses import Array
from bt_tasksim.scene import ActorConfiguration
from bt_tasksim.world import Command, Hidden, JointTarget, Observation, WorldModel, WorldState


@dataclass(frozen=True)
class CameraModel:
    """A calibrated camera.

    Attributes:
        name: Its name.
        width: Pixels.
        height: Pixels.
        matrix: Intrinsic matrix ``(3, 3)``, pixels (OpenCV convention: x right, y down, z forward).
        pose: Pose ``(7,)`` of the camera's optical frame (OpenCV convention) in the robot base frame.
    """

    name: str
    width: int
    height: int
    matrix: Array
    pose: Array


@dataclass(frozen=True)
class Image:
    """What one camera saw.

    Attributes:
        camera: The camera.
        colour: ``(height, width, 3)`` uint8, RGB.
        depth: ``(height, width)`` float32 metres along the optical axis; 0 where nothing was seen.
        taken: When, in seconds of `WorldState.time`; None where it shows the state it came with.
    """

    camera: CameraModel
    colour: Array
    depth: Array | None
    taken: float | None = None


@runtime_checkable
class KinematicsEngine(Protocol):
    """Turns commands into joint targets; the only one that knows arm joints."""

    def reset(self, configuration: ActorConfiguration) -> None:
        """Prepare for an episode."""

    def solve(self, command: Command, state: WorldState) -> JointTarget:
        """Joint target that brings the tool to ``command.tool`` in one control period.

        Raises:
            UnreachableError: The arm cannot be there; says by how much it misses.
        """


@runtime_checkable
class PhysicsEngine(Protocol):
    """Moves the world on by one control period."""

    def reset(self, configuration: ActorConfiguration) -> WorldState:
        """A fresh scene, at rest, and its state."""

    def step(self, target: JointTarget) -> WorldState:
        """The state one control period later."""

    def hidden(self) -> Hidden | None:
        """What only a simulator knows; None on a real robot."""


@runtime_checkable
class RenderingEngine(Protocol):
    """Draws the world, or fetches the pictures of real cameras."""

    def reset(self, configuration: ActorConfiguration) -> None:
        """Prepare for an episode."""

    def render(self, state: WorldState, camera: str, *, depth: bool = False) -> Image:
        """What the named camera sees now."""


@runtime_checkable
class PostProcessEngine(Protocol):
    """Turns states and images into observations."""

    def reset(self, configuration: ActorConfiguration, model: WorldModel) -> None:
        """Prepare for an episode."""

    def cameras(self, needed: bool) -> tuple[str, ...]:
        """Cameras whose images `observe` wants at this instant; ``needed``: a concept asked for a look."""

    def observe(self, state: WorldState, images: Mapping[str, Image]) -> Observation:
        """The observation of this instant."""


class EnginePipeline:
    """Kinematics, physics, rendering and post-process, in that order.

    Args:
        kinematics: See `KinematicsEngine`.
        physics: See `PhysicsEngine`.
        postprocess: See `PostProcessEngine`.
        rendering: See `RenderingEngine`; None where nothing is ever drawn.
        clock: The clock that the physics role waits for; by default none, as fast as possible.

    Attributes:
        served: Names of those engines that are in other processes, as their servers say them, by role.
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
        self.last: Command = Command()
        self.served: dict[str, str] = {}

    def reset(self, configuration: ActorConfiguration, model: WorldModel) -> Observation:
        """Begin an episode; returns its first observation."""
        self.kinematics.reset(configuration)
        if configuration is not None and configuration.hand_start:
            posture: Any = self.kinematics
            joints = posture.joints_of_hand_start(configuration.hand_start)
            configuration = replace(configuration, joint_position=joints)
        self.state = self.physics.reset(configuration)
        if self.rendering is not None:
            self.rendering.reset(configuration)
        self.postprocess.reset(configuration, model)
        self.last = Command()
        observation = self._observe(needed=True)
        begin: Any = getattr(self.physics, "begin", None)
        if begin is None:
            return observation
        self.state = begin()  # pictures and the first look have taken their time
        return self._observe(needed=False)

    def step(self, command: Command, *, look: bool = False) -> Observation:
        """One control period: a part of the command that nobody wrote keeps its last target.

        Args:
            command: What the tree asks for.
            look: A concept wants fresh images for the next observation.

        Raises:
            UnreachableError: The tool target is out of reach; nothing has moved, and the last targets stay.
        """
        if self.state is None:
            raise RuntimeError("the pipeline was stepped before it was reset")
        wanted = command.over(self.last)
        target = self.kinematics.solve(wanted, self.state)
        self.last = wanted
        self.state = self.physics.step(target)
        return self._observe(needed=look)

    def hidden(self) -> Hidden | None:
        """The physics state, in simulation."""
        return self.physics.hidden()

    def unseen(self) -> dict[str, str]:
        """Why perception has never seen an object, one sentence each, by the object's name."""
        say: Any = getattr(self.postprocess, "unseen", dict)
        return dict(say())

    def render(self, camera: str, *, depth: bool = False) -> Image:
        """A picture for a recording.

        Raises:
            RuntimeError: There is no rendering engine or no episode.
        """
        if self.rendering is None or self.state is None:
            raise RuntimeError("nothing can be drawn: the pipeline has no rendering engine or was not reset")
        return self.rendering.render(self.state, camera, depth=depth)

    @property
    def real(self) -> bool:
        """What it moves is a real robot."""
        return bool(getattr(self.physics, "real", False))

    @property
    def told(self) -> bool:
        """A robot that had to hold was told so, in one way or another."""
        return bool(getattr(self.physics, "told", True))

    def stop(self, why: str) -> None:
        """The run is over, or has to be: a robot holds until the next `reset`; a simulation need not."""
        hold: Any = getattr(self.physics, "hold", None)
        if hold is not None:
            hold(why)

    def timing(self) -> Timing | None:
        """How well the rate was kept; None where there is none to keep."""
        return self.clock.timing()

    def close(self) -> None:
        """Let go of what the engines hold."""
        for engine in (self.kinematics, self.physics, self.rendering, self.postprocess):
            close: Any = getattr(engine, "close", None)
            if close is not None:
                close()

    def _observe(self, needed: bool) -> Observation:
        state = self.state
        assert state is not None
        cameras = self.postprocess.cameras(needed)
        images = {name: self.render(name, depth=True) for name in cameras}
        return self.postprocess.observe(state, images)
