"""The pipeline of a run: engines by the names that the command line and `Runner` take."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TypeVar

from bt_tasksim.core.errors import InputError, nearest
from bt_tasksim.core.plain import short
from bt_tasksim.core.registry import parts
from bt_tasksim.engines.base import (
    ROLES,
    Engine,
    EngineSetup,
    KinematicsEngine,
    PhysicsEngine,
    PostProcessEngine,
    RenderingEngine,
    engine_class,
)
from bt_tasksim.engines.clock import Clock, FreeClock, RealTimeClock
from bt_tasksim.engines.kinematics.pinocchio import PATIENCE, PinocchioKinematics
from bt_tasksim.engines.pacing import PacedPhysics
from bt_tasksim.engines.perception.noise import noise_model
from bt_tasksim.engines.pipeline import EnginePipeline
from bt_tasksim.hardware.safety.engine import RealEngine
from bt_tasksim.hardware.safety.guard import Guard
from bt_tasksim.hardware.safety.guarded_robot import GuardedRobot
from bt_tasksim.hardware.safety.guarded_simulation import GuardedSimulation
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.scene import WorldSource

_E = TypeVar("_E", bound=Engine)
_TAKEN: dict[type, tuple[type, ...]] = {float: (int, float), str: (str, Path)}
"""What options may be given as."""
LAWS = ("auto", "numpy", "torch")
"""Libraries that a batch of worlds may compute its laws with; ``auto`` goes by the device."""


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
        kinematics: Name of the kinematics engine.
        renderer: Name of the rendering engine, where one is wanted.
        key: The client's key file, for engines on other machines.
        timeout: Seconds that a step of an engine in another process may take.
        connect_timeout: Seconds within which it must be there.
        ros: File with a robot's topics and names; by default the bundled one.
        device: What physics that can choose runs on: ``cpu``, ``cuda`` or ``cuda:N``.
        laws: What a batch of worlds computes concepts, observations and joints with, see
            `bt_tasksim.execution.laws`; a single world and training have NumPy.
    """

    engines: str = "sapien"
    perception: str = "state"
    noise: str = "fine"
    rendering: bool = False
    safety: bool = False
    real_time: bool = False
    kinematics: str = "pinocchio"
    renderer: str = "sapien"
    key: str = ""
    timeout: float = 2.0
    connect_timeout: float = 5.0
    ros: str = ""
    device: str = "cpu"
    laws: str = "auto"

    def __post_init__(self) -> None:
        for item in fields(self):
            kind, found = type(item.default), getattr(self, item.name)
            if not isinstance(found, _TAKEN.get(kind, (kind,))):
                expected = {str: "text", bool: "True or False"}.get(kind, "a number")
                raise InputError(f"the option '{item.name}' should be {expected}, found {short(found)}")
        for role in ROLES:
            engine_class(role, self.name_of(role))
        engine_class("physics", self.engines).check_device(self.device)
        noise_model(self.noise)
        if self.laws not in LAWS:
            raise InputError(f"unknown laws '{self.laws}'{nearest(self.laws, LAWS)}")
        for limit in (self.timeout, self.connect_timeout):
            if not 0.0 < limit < 3600.0:
                raise InputError(f"a time-out is a positive number of seconds below 3600, found {limit:g}")

    def name_of(self, role: str) -> str:
        """Name of the engine of a role."""
        names = {
            "kinematics": self.kinematics,
            "physics": self.engines,
            "rendering": self.renderer,
            "postprocess": self.perception,
        }
        return names[role]

    @property
    def real(self) -> bool:
        """The physics engine is a real robot."""
        return engine_class("physics", self.engines).real

    def own_world(self) -> WorldSource | None:
        """The world that the physics engine brings; None where it builds any scene.

        Raises:
            InputError: There is no such world.
        """
        found = engine_class("physics", self.engines)
        return found.own_world(self.engines) if issubclass(found, PhysicsEngine) else None

    @property
    def remote(self) -> bool:
        """Some engine is outside of this process and serves one client at a time; a robot does, too."""
        return self.real or any(engine_class(role, self.name_of(role)).takes_address for role in ROLES)

    @property
    def label(self) -> str:
        """How results name the perception."""
        return engine_class("postprocess", self.perception).label(self.setup("postprocess"))

    def setup(self, role: str, images: bool = False) -> EngineSetup:
        """What the engine of a role is built from.

        Args:
            role: One of `ROLES`.
            images: Perception works on images.
        """
        return EngineSetup(
            self.name_of(role),
            noise=self.noise,
            images=images,
            real=self.real,
            key=self.key,
            timeout=self.timeout,
            connect_timeout=self.connect_timeout,
            ros=self.ros,
            device=self.device,
        )


def local_engines(role: str) -> tuple[str, ...]:
    """Names of the engines of a role that are simulated in this process: no address, and no robot."""
    found: dict[str, type[Engine]] = parts(f"engine/{role}")
    return tuple(name for name, engine in found.items() if not engine.takes_address and not engine.real)


def result_names(options: EngineOptions, pipeline: EnginePipeline) -> tuple[str, str]:
    """How results name physics and perception: an address says nothing of the engine behind it."""
    engines, perception = options.engines, options.label
    if served := pipeline.served.get("physics"):
        engines = f"{engines} ({served})"
    if served := pipeline.served.get("postprocess"):
        known, setup = (
            served in parts("engine/postprocess"),
            replace(options.setup("postprocess"), name=served),
        )
        behind = engine_class("postprocess", served).label(setup) if known else served
        perception = f"{perception} ({behind})"
    return engines, perception


def build_pipeline(robot: RobotDescription, options: EngineOptions) -> EnginePipeline:
    """The pipeline for a robot.

    Raises:
        InputError: An engine is not one for this robot, or an option makes no sense for it.
        MachineError: An engine cannot start on this machine, or does not answer from another process.
    """
    if options.real:
        _check_real(options)
    with ExitStack() as built:

        def keep(engine: _E) -> _E:
            built.callback(engine.close)
            return engine

        kinematics = keep(KinematicsEngine.named(robot, options.setup("kinematics")))
        postprocess = keep(PostProcessEngine.named(robot, options.setup("postprocess")))
        images = postprocess.wants_images
        if options.real:
            real = keep(RealEngine.named(robot, options.setup("physics", images)))
            pictures = real.rendering() if images else None
            if images and pictures is None:
                raise InputError(
                    f"'{options.engines}' has no cameras, and perception '{options.perception}' needs some"
                )
            pipeline = robot_pipeline(robot, real, postprocess, pictures, kinematics)
        else:
            physics = keep(PhysicsEngine.named(robot, options.setup("physics", images)))
            rendering = None
            if options.rendering or images:
                rendering = physics.rendering()
                if rendering is None:
                    rendering = RenderingEngine.named(robot, options.setup("rendering"))
                keep(rendering)
            clock: Clock = FreeClock()
            if options.safety:
                physics = GuardedSimulation(physics, _guard(robot))
            if options.real_time:
                clock = RealTimeClock()
                physics = PacedPhysics(physics, clock)
            pipeline = EnginePipeline(kinematics, physics, postprocess, rendering, clock)
        built.pop_all()  # all of them are there: they stay
    return pipeline


def robot_pipeline(
    robot: RobotDescription,
    engine: RealEngine,
    postprocess: PostProcessEngine,
    rendering: RenderingEngine | None = None,
    kinematics: KinematicsEngine | None = None,
) -> EnginePipeline:
    """The pipeline for a real robot: behind the guard, in real time, with a watchdog.

    Raises:
        InputError: The robot's file does not say its safety limits.
    """
    clock = RealTimeClock()
    physics = GuardedRobot(engine, _guard(robot), clock)
    kinematics = kinematics or PinocchioKinematics(robot, patience=PATIENCE)
    return EnginePipeline(kinematics, physics, postprocess, rendering, clock)


def build_engine(role: str, name: str, robot: RobotDescription, noise: str = "fine") -> Engine:
    """One engine.

    Args:
        role: One of `ROLES`.
        name: Its name.
        robot: The robot.
        noise: Name of the noise model of estimated poses.

    Raises:
        InputError: There is no such role or engine.
        MachineError: The engine cannot start on this machine.
    """
    return engine_class(role, name).create(robot, EngineSetup(name, noise=noise))


def _guard(robot: RobotDescription) -> Guard:
    return Guard(robot, PinocchioKinematics(robot).forward)


def _check_real(options: EngineOptions) -> None:
    """What perception adds in simulation, reality has already; and nobody waits for other processes."""
    for role, what in (("kinematics", "kinematics"), ("postprocess", "perception")):
        name = options.name_of(role)
        if engine_class(role, name).takes_address:
            raise InputError(f"a robot's {what} runs in this process, not at '{name}'")
    if options.rendering:
        raise InputError("the run of a robot cannot be drawn: leave --video away, and film it")
