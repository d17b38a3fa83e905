"""Engines by name, as the command line and `Runner` name them."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

from bt_tasksim.engines.kinematics_pinocchio import PinocchioKinematics
from bt_tasksim.engines.noise import noise_model
from bt_tasksim.engines.pipeline import EnginePipeline, PostProcessEngine, RenderingEngine
from bt_tasksim.engines.remote.address import is_remote, parse_remote
from bt_tasksim.engines.ros.address import is_ros, parse_ros
from bt_tasksim.errors import InputError, MachineError, nearest
from bt_tasksim.pacing import Clock, FreeClock, PacedPhysics, RealTimeClock
from bt_tasksim.robot import RobotDescription
from bt_tasksim.safety.engine import RealEngine
from bt_tasksim.safety.guard import Guard
from bt_tasksim.safety.guarded_robot import GuardedRobot
from bt_tasksim.safety.guarded_simulation import GuardedSimulation

KINEMATICS = ("pinocchio",)
ENGINES = ("sapien", "mujoco")
RENDERERS = ("sapien",)
PERCEPTIONS = ("state", "camera")
PATIENCE = 0.03
"""Seconds for which the inverse kinematics of a real robot looks for another posture."""
ROLES = {
    "kinematics": KINEMATICS,
    "physics": ENGINES,
    "rendering": RENDERERS,
    "postprocess": PERCEPTIONS,
}
"""Names of the engines by role; ``remote:HOST:PORT`` is one in another process, for each role."""


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

    def __post_init__(self) -> None:
        for what, name, known in (
            ("engines", self.engines, ENGINES),
            ("perception", self.perception, PERCEPTIONS),
            ("kinematics", self.kinematics, KINEMATICS),
            ("rendering", self.renderer, RENDERERS),
        ):
            if is_remote(name):
                parse_remote(name)
            elif what == "engines" and is_ros(name):
                parse_ros(name)
            elif name not in known:
                raise InputError(f"unknown {what} '{name}'{nearest(name, known)}")
        noise_model(self.noise)
        for limit in (self.timeout, self.connect_timeout):
            if not 0.0 < limit < 3600.0:
                raise InputError(f"a time-out is a positive number of seconds below 3600, found {limit:g}")

    @property
    def remote(self) -> bool:
        """Some engine is in another process, which serves one client at a time; a robot does, too."""
        return is_ros(self.engines) or any(
            map(is_remote, (self.engines, self.perception, self.kinematics, self.renderer))
        )

    @property
    def label(self) -> str:
        """How results name the perception."""
        if is_ros(self.engines) and self.perception == "state":
            return "tracked"
        return _told(self.perception, self.noise)


def _told(perception: str, noise: str) -> str:
    return f"state, noise {noise}" if perception == "state" else perception


def result_names(options: EngineOptions, pipeline: EnginePipeline) -> tuple[str, str]:
    """How results name physics and perception: an address says nothing of the engine behind it."""
    engines, perception = options.engines, options.label
    if "physics" in pipeline.served:
        engines = f"{engines} ({pipeline.served['physics']})"
    if "postprocess" in pipeline.served:
        perception = f"{perception} ({_told(pipeline.served['postprocess'], options.noise)})"
    return engines, perception


def build_pipeline(robot: RobotDescription, options: EngineOptions) -> EnginePipeline:
    """The pipeline for a robot.

    Raises:
        InputError: An engine in another process is not one for this robot and version, or its key is no good.
        MachineError: An engine cannot start on this machine, or does not answer from another process.
    """
    if is_ros(options.engines):
        return ros_pipeline(robot, options)
    served: dict[str, str] = {}
    with ExitStack() as built:

        def engine(role: str, name: str) -> Any:
            if is_remote(name):
                made = connect(role, name, robot, options)
                served[role] = made.connection.engine
            else:
                made = build_engine(role, name, robot, options.noise)
            if hasattr(made, "close"):
                built.callback(made.close)
            return made

        kinematics = engine("kinematics", options.kinematics)
        physics = engine("physics", options.engines)
        postprocess = engine("postprocess", options.perception)
        rendering = None
        if options.rendering or getattr(postprocess, "perception", "") == "camera":
            rendering = engine("rendering", options.renderer)
        clock: Clock = FreeClock()
        if options.safety:
            physics = GuardedSimulation(physics, Guard(robot, PinocchioKinematics(robot).forward))
        if options.real_time:
            clock = RealTimeClock()
            physics = PacedPhysics(physics, clock)
        built.pop_all()  # all of them are there: they stay
    pipeline = EnginePipeline(kinematics, physics, postprocess, rendering, clock)
    pipeline.served = served
    return pipeline


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


def ros_pipeline(robot: RobotDescription, options: EngineOptions) -> EnginePipeline:
    """The pipeline for a robot behind rosbridge; what perception adds in simulation, reality has already.

    Raises:
        InputError: The robot's files are no good, or an option makes no sense for a robot.
    """
    from bt_tasksim.engines.ros.cameras import RosCameras
    from bt_tasksim.engines.ros.engine import RosRobot
    from bt_tasksim.engines.ros.setting import load_setting

    for what, name in (("kinematics", options.kinematics), ("perception", options.perception)):
        if is_remote(name):
            raise InputError(f"a robot's {what} runs in this process, not at '{name}'")
    if options.rendering:
        raise InputError("the run of a robot cannot be drawn: leave --video away, and film it")
    setting, tracked = load_setting(robot, options.ros), options.perception == "state"
    kinematics = PinocchioKinematics(robot)
    engine = RosRobot(robot, setting, parse_ros(options.engines), kinematics, tracked)
    postprocess: PostProcessEngine
    if tracked:
        from bt_tasksim.engines.postprocess_state import StatePostProcess

        postprocess = StatePostProcess(robot, noise_model("none"))
    else:
        from bt_tasksim.engines.camera_errors import PERFECT
        from bt_tasksim.engines.postprocess_opencv import CameraPostProcess

        postprocess = CameraPostProcess(robot, PERFECT, background=True)
    rendering = RosCameras(engine) if not tracked else None
    return robot_pipeline(robot, engine, postprocess, rendering)


def build_engine(role: str, name: str, robot: RobotDescription, noise: str = "fine") -> Any:
    """One engine in this process.

    Args:
        role: One of `ROLES`.
        name: Its name.
        robot: The robot.
        noise: Name of the noise model, for post-process ``state``.

    Raises:
        InputError: There is no such role or engine.
        MachineError: The engine cannot start on this machine.
    """
    if role not in ROLES:
        raise InputError(f"unknown role of an engine '{role}'{nearest(role, ROLES)}")
    match role, name:
        case "kinematics", "pinocchio":
            return PinocchioKinematics(robot)
        case "physics", "sapien":
            from bt_tasksim.engines.physics_sapien import SapienPhysics

            return SapienPhysics(robot)
        case "physics", "mujoco":
            from bt_tasksim.engines.physics_mujoco import MujocoPhysics

            return MujocoPhysics(robot)
        case "rendering", "sapien":
            from bt_tasksim.engines.rendering_sapien import SapienRendering

            return SapienRendering()
        case "postprocess", "camera":
            from bt_tasksim.engines.postprocess_opencv import CameraPostProcess

            return CameraPostProcess(robot)
        case "postprocess", "state":
            from bt_tasksim.engines.postprocess_state import StatePostProcess

            return StatePostProcess(robot, noise_model(noise))
        case _:
            raise InputError(f"unknown {role} engine '{name}'{nearest(name, ROLES[role])}")


def connect(role: str, name: str, robot: RobotDescription, options: EngineOptions) -> Any:
    """One engine in another process, see `bt_tasksim.engines.remote`.

    Raises:
        InputError: It is not one for this robot and version, or the key is no good.
        MachineError: It does not answer.
    """
    try:
        from bt_tasksim.engines.remote.client import Connection, Limits
        from bt_tasksim.engines.remote.engines import ENGINES as REMOTE
        from bt_tasksim.engines.remote.engines import RemotePostProcess
        from bt_tasksim.engines.remote.keys import CLIENT, load_key
    except ImportError as error:
        raise MachineError(
            f"engines in other processes need the extra 'remote' ({error}): pip install 'bt-tasksim[remote]'"
        ) from error
    key = load_key(options.key, CLIENT) if options.key else None
    limits = Limits(connect=options.connect_timeout, step=options.timeout)
    connection = Connection(parse_remote(name), role, robot, key, limits)
    return RemotePostProcess(connection, options.noise) if role == "postprocess" else REMOTE[role](connection)
