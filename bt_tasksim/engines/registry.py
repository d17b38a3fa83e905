"""Engines by name, as the command line and `Runner` name them."""

from __future__ import annotations

from dataclasses import dataclass

from bt_tasksim.engines.kinematics_pinocchio import PinocchioKinematics
from bt_tasksim.engines.noise import noise_model
from bt_tasksim.engines.pipeline import EnginePipeline, PhysicsEngine, PostProcessEngine, RenderingEngine
from bt_tasksim.errors import InputError, nearest
from bt_tasksim.pacing import Clock, FreeClock, PacedPhysics, RealTimeClock
from bt_tasksim.robot import RobotDescription
from bt_tasksim.safety.engine import RealEngine
from bt_tasksim.safety.guard import Guard
from bt_tasksim.safety.guarded_robot import GuardedRobot
from bt_tasksim.safety.guarded_simulation import GuardedSimulation

ENGINES = ("sapien",)
PERCEPTIONS = ("state", "camera")
PATIENCE = 0.03
"""Seconds for which the inverse kinematics of a real robot looks for another posture."""


@dataclass(frozen=True)
class EngineOptions:
    """Which engines a pipeline is made of.

    Attributes:
        engines: Name of the physics engine, or of the robot's connection.
        perception: ``state`` (a stated noise model) or ``camera`` (images).
        noise: Name of the noise model, for perception ``state``.
        rendering: A rendering engine is wanted, for a recording.
        safety: A simulation, too, runs behind the guard; a real robot always does.
        real_time: A simulation, too, runs in real time; a real robot always does.
    """

    engines: str = "sapien"
    perception: str = "state"
    noise: str = "fine"
    rendering: bool = False
    safety: bool = False
    real_time: bool = False

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
    from bt_tasksim.engines.physics_sapien import SapienPhysics

    kinematics = PinocchioKinematics(robot)
    physics: PhysicsEngine = SapienPhysics(robot)
    clock: Clock = FreeClock()
    if options.safety:
        physics = GuardedSimulation(physics, Guard(robot, kinematics.forward))
    if options.real_time:
        clock = RealTimeClock()
        physics = PacedPhysics(physics, clock)
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
    return EnginePipeline(kinematics, physics, postprocess, rendering, clock)


def robot_pipeline(
    robot: RobotDescription,
    engine: RealEngine,
    postprocess: PostProcessEngine,
    rendering: RenderingEngine | None = None,
) -> EnginePipeline:
    """The pipeline for a real robot: behind the guard, in real time, with a watchdog.

    Raises:
        InputError: The robot's file does not say its safety limits.
    """
    kinematics, clock = PinocchioKinematics(robot, patience=PATIENCE), RealTimeClock()
    physics = GuardedRobot(engine, Guard(robot, kinematics.forward), clock)
    return EnginePipeline(kinematics, physics, postprocess, rendering, clock)
