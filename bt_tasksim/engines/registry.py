"""Engines by name, as the command line and `Runner` name them."""

from __future__ import annotations

from dataclasses import dataclass

from bt_tasksim.engines.kinematics_pinocchio import PinocchioKinematics
from bt_tasksim.engines.noise import noise_model
from bt_tasksim.engines.pipeline import EnginePipeline, PhysicsEngine, PostProcessEngine, RenderingEngine
from bt_tasksim.errors import InputError, nearest
from bt_tasksim.robot import RobotDescription

ENGINES = ("sapien", "mujoco")
PERCEPTIONS = ("state", "camera")


@dataclass(frozen=True)
class EngineOptions:
    """Which engines a pipeline is made of.

    Attributes:
        engines: Name of the physics engine, or of the robot's connection.
        perception: ``state`` (a stated noise model) or ``camera`` (images).
        noise: Name of the noise model, for perception ``state``.
        rendering: A rendering engine is wanted, for a recording.
    """

    engines: str = "sapien"
    perception: str = "state"
    noise: str = "fine"
    rendering: bool = False

    def __post_init__(self) -> None:
        if self.engines not in ENGINES:
            raise InputError(f"unknown engines '{self.engines}'{nearest(self.engines, ENGINES)}")
        if self.perception not in PERCEPTIONS:
            raise InputError(f"unknown perception '{self.perception}'{nearest(self.perception, PERCEPTIONS)}")
        noise_model(self.noise)

    @property
    def label(self) -> str:
        """How results name the perception."""
        return "camera" if self.perception == "camera" else f"state, noise {self.noise}"


def build_pipeline(robot: RobotDescription, options: EngineOptions) -> EnginePipeline:
    """The pipeline for a robot.

    Raises:
        MachineError: An engine cannot start on this machine.
    """
    physics: PhysicsEngine
    if options.engines == "mujoco":
        from bt_tasksim.engines.physics_mujoco import MujocoPhysics

        physics = MujocoPhysics(robot)
    else:
        from bt_tasksim.engines.physics_sapien import SapienPhysics

        physics = SapienPhysics(robot)
    rendering: RenderingEngine | None = None
    if options.rendering or options.perception == "camera":
        from bt_tasksim.engines.rendering_sapien import SapienRendering

        rendering = SapienRendering()
    postprocess: PostProcessEngine
    if options.perception == "camera":
        from bt_tasksim.engines.postprocess_opencv import CameraPostProcess

        postprocess = CameraPostProcess(robot)
    else:
        from bt_tasksim.engines.postprocess_state import StatePostProcess

        postprocess = StatePostProcess(robot, noise_model(options.noise))
    return EnginePipeline(PinocchioKinematics(robot), physics, postprocess, rendering)
