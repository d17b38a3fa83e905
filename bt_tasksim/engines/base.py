"""The four roles of an engine, as abstract base classes.

An engine is one class in one file, which announces itself under the name that users give it::

    @register("engine/physics", "bullet")
    class BulletPhysics(PhysicsEngine):
        def reset(self, configuration): ...
        def step(self, target): ...

Methods that are not abstract have a default, which its docstring states. `Engine.create` is how every engine
is built by name; an engine whose constructor takes more than the robot overrides it. A library that is heavy
or that not everybody has is imported in the constructor: the file itself is imported to find its parts.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Self

from bt_tasksim.core.errors import InputError, MachineError, nearest
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import part
from bt_tasksim.core.world import Command, Hidden, JointTarget, Observation, WorldModel, WorldState
from bt_tasksim.engines.body_contacts import BodyContacts
from bt_tasksim.engines.images import Image
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.scene import WorldSource
from bt_tasksim.scene.success import Verdict

if TYPE_CHECKING:
    from bt_tasksim.engines.batch import PhysicsBatch

ROLES = ("kinematics", "physics", "rendering", "postprocess")
"""In the order in which the pipeline calls them; the kinds of part are ``engine/`` and these."""


@dataclass(frozen=True)
class EngineSetup:
    """What an engine is built from besides the robot; each takes what concerns it.

    Attributes:
        name: The name by which it was asked for, with the address where it takes one.
        noise: Name of the noise model of estimated poses.
        images: Perception works on images, so a real robot needs nothing else that tracks objects.
        real: The physics role is a real robot: nothing is added to what is measured, and time does not wait.
        key: A client's key file; empty for none.
        timeout: Seconds that a step of an engine in another process may take.
        connect_timeout: Seconds within which it must be there.
        ros: File with a robot's topics and names; empty for the bundled one.
        device: What physics that can choose runs on, see `Engine.check_device`.
    """

    name: str
    noise: str = "fine"
    images: bool = False
    real: bool = False
    key: str = ""
    timeout: float = 2.0
    connect_timeout: float = 5.0
    ros: str = ""
    device: str = "cpu"


def engine_class(role: str, name: str) -> type[Engine]:
    """The class of an engine.

    Args:
        role: One of `ROLES`.
        name: Its name, with an address behind a colon where it takes one.

    Raises:
        InputError: There is no such role or engine, or the address is no good.
        MachineError: It needs a library that is not installed.
    """
    if role not in ROLES:
        raise InputError(f"unknown role of an engine '{role}'{nearest(role, ROLES)}")
    found: type[Engine] = part(f"engine/{role}", name.partition(":")[0])
    found.check_name(name)
    return found


class Engine(ABC):
    """What engines of all roles have in common.

    Attributes:
        role: One of `ROLES`.
        takes_address: It is named ``NAME:HOST:PORT``, as it stands for something outside of this process.
        real: What it moves is a real robot.
    """

    role: ClassVar[str]
    takes_address: ClassVar[bool] = False
    real: ClassVar[bool] = False

    @classmethod
    def create(cls, robot: RobotDescription, setup: EngineSetup) -> Self:
        """The engine for a robot; by default ``cls(robot)``.

        Raises:
            InputError: It cannot serve this robot, or something in the setup is no good.
            MachineError: It cannot start on this machine.
        """
        return cls(robot)  # type: ignore[call-arg]  # whose constructor takes something else overrides this

    @classmethod
    def named(cls, robot: RobotDescription, setup: EngineSetup) -> Self:
        """An engine of this role by its name, whichever class that is.

        Raises:
            InputError: There is no such engine, it is none of this role, or see `create`.
            MachineError: See `create`.
        """
        found = engine_class(cls.role, setup.name)
        if not issubclass(found, cls):
            raise InputError(f"'{setup.name}' is registered as a {cls.role} engine, but is no {cls.__name__}")
        return found.create(robot, setup)

    @classmethod
    def check_name(cls, name: str) -> None:
        """Refuse a name with a bad address; by default any address at all.

        Args:
            name: The engine's name, and what follows it after a colon.

        Raises:
            InputError: The address is no good, or there should be none.
        """
        if ":" in name:
            raise InputError(f"the {cls.role} engine '{name.partition(':')[0]}' takes no address: '{name}'")

    @classmethod
    def check_device(cls, name: str) -> None:
        """Refuse a device that an engine of this kind cannot run on; by default all but ``cpu``.

        Args:
            name: ``cpu``, ``cuda`` or ``cuda:N``. Whether the GPU is there, `create` says.

        Raises:
            InputError: There is no such device, or this engine cannot use it.
        """
        if name != "cpu":
            raise InputError(f"the {cls.role} engine {cls.__name__} runs on the CPU alone, not on '{name}'")

    @classmethod
    def in_logs(cls, name: str) -> bool:
        """Whether a log that anybody may have written can name it so; by default with nothing behind a colon.

        Args:
            name: The engine's name, and what follows it after a colon.
        """
        return ":" not in name

    @classmethod
    def label(cls, setup: EngineSetup) -> str:
        """How results name an engine with this setup; by default as it was asked for."""
        return setup.name

    @property
    def served_name(self) -> str:
        """Name of the engine that answers behind a connection; empty, the default, where it is this one."""
        return ""

    def close(self) -> None:  # noqa: B027  # a default, and not a method that was forgotten
        """Let go of what the engine holds; by default nothing. May be called more than once."""


class KinematicsEngine(Engine):
    """Turns commands into joint targets; the only engine that knows arm joints."""

    role = "kinematics"

    def reset(self, configuration: ActorConfiguration) -> None:
        """Prepare for an episode, and forget the last one; by default there is nothing to forget."""

    @abstractmethod
    def solve(self, command: Command, state: WorldState) -> JointTarget:
        """Joint target that brings the tool to ``command.tool`` in one control period.

        Args:
            command: The tool's pose and the hand's closure as they were asked for last: the pipeline keeps
                what nobody wrote anew. A part is None where nothing was asked of it since the reset.
            state: The present state.

        Raises:
            UnreachableError: The arm cannot be there; says by how much it misses. The last target stays.
        """

    def tool_pose(self, state: WorldState) -> Array | None:
        """Tool pose ``(7,)`` of a state's joints by this engine's own model of the robot.

        Returns:
            The pose; None, the default, where the engine cannot tell.
        """
        return None

    def joints_of_hand_start(self, start: tuple[float, ...]) -> tuple[float, ...]:
        """All joints ``(n_joints,)`` with the hand open where an `ActorConfiguration` lets it begin.

        Args:
            start: Position (m) and turn (rad) ``(4,)`` of a tool that points down.

        Raises:
            UnreachableError: No posture brings the tool there.
            MachineError: This engine cannot tell; the default.
        """
        raise MachineError(f"{type(self).__name__} cannot tell with which joints the hand is at its start")


class PhysicsEngine(Engine):
    """Moves the world on by one control period: a simulator, or a real robot behind its guard."""

    role = "physics"

    @classmethod
    def own_world(cls, name: str) -> WorldSource | None:
        """The world that an engine of this name brings; None, the default, where it builds any scene.

        What decides it and may change, such as a file's content, it gives in plain data by a method
        ``content()``: only with the same does an evaluation or a training go on.

        Args:
            name: The engine's name, and what follows it after a colon.

        Raises:
            InputError: There is no such world.
        """
        return None

    def worlds(self, scene: WorldSource) -> WorldSource:
        """Where the worlds of runs in a scene come from; by default the scene draws them itself.

        Raises:
            InputError: This engine cannot build this scene.
        """
        return scene

    def rendering(self) -> RenderingEngine | None:
        """What draws the world of this engine; None, the default, where any rendering engine does."""
        return None

    def verdict(self) -> Verdict | None:
        """What became of the run, now that the tree has ended, where the engine itself says what success is.

        Returns:
            The verdict; None, the default, where the scene's goal says it.
        """
        return None

    @classmethod
    def has_batches(cls) -> bool:
        """It has worlds in batches, see `batch`."""
        return any("batch" in vars(base) for base in cls.__mro__[: cls.__mro__.index(PhysicsEngine)])

    @classmethod
    def batch(cls, robot: RobotDescription, setup: EngineSetup, worlds: int, threads: int) -> PhysicsBatch:
        """Many worlds of a robot at once.

        Args:
            robot: The robot.
            setup: See `create`.
            worlds: How many; at least 1.
            threads: How many threads may step them; at least 1.

        Raises:
            InputError: This engine has no worlds in batches, the default; or see `create`.
            MachineError: See `create`.
        """
        raise InputError(f"the physics engine '{setup.name}' has no worlds in batches: run them one by one")

    @abstractmethod
    def reset(self, configuration: ActorConfiguration) -> WorldState:
        """A fresh world, at rest, and its state."""

    def begin(self) -> WorldState | None:
        """The run begins now, after `reset`, pictures and the first look.

        Returns:
            The state of this instant where time has gone on meanwhile; None, the default, where it has not.
        """
        return None

    @abstractmethod
    def step(self, target: JointTarget) -> WorldState:
        """The state one control period later."""

    def hidden(self) -> Hidden | None:
        """What only a simulator knows; None, the default, where nobody knows the truth."""
        return None

    def contact_points(self) -> BodyContacts | None:
        """Where bodies touch at this instant; None, the default, where the engine does not say it."""
        return None

    @property
    def deepest_pair(self) -> tuple[str, str, float, float] | None:
        """Names of the bodies that overlapped most, metres, and seconds since the episode began.

        None before any overlap, and, the default, where the engine does not say it.
        """
        return None

    def hold(self, why: str) -> None:
        """The run is over, or has to be: a robot stands still until `reset`; by default nothing to do."""

    @property
    def hold_delivered(self) -> bool:
        """The last hold reached what it was meant for; True by default, where nothing has to be stopped."""
        return True


class RenderingEngine(Engine):
    """Draws the world, or fetches the pictures of real cameras."""

    role = "rendering"

    def reset(self, configuration: ActorConfiguration) -> None:
        """Prepare for an episode; by default nothing to do."""

    @abstractmethod
    def render(
        self, state: WorldState, camera: str, *, depth: bool = False, size: tuple[int, int] | None = None
    ) -> Image:
        """What the named camera sees now.

        Args:
            state: Unbatched.
            camera: Its name.
            depth: Fetch the depth image, too.
            size: Width and height in pixels, with the same opening angle from top to bottom; None for the
                camera's own.

        Raises:
            InputError: There is no such camera, or it has no pictures of this size.
        """


class PostProcessEngine(Engine):
    """Turns states and images into observations."""

    role = "postprocess"

    @property
    def wants_images(self) -> bool:
        """It works on images, so the pipeline needs a rendering engine; by default it does not."""
        return False

    @abstractmethod
    def reset(self, configuration: ActorConfiguration, model: WorldModel) -> None:
        """Prepare for an episode, and forget the last one."""

    def cameras(self, first: bool) -> tuple[str, ...]:
        """Cameras whose images `observe` wants at this instant; by default none.

        Args:
            first: It is the first observation of an episode.
        """
        return ()

    @abstractmethod
    def observe(self, state: WorldState, images: Mapping[str, Image]) -> Observation:
        """The observation of this instant."""

    def unseen(self) -> dict[str, str]:
        """Why an object was never seen, one sentence each, by the object's name; by default none."""
        return {}


class PhysicsWrapper(PhysicsEngine):
    """A physics engine around another one, which does all that is not overridden.

    Args:
        inner: The engine inside.
    """

    def __init__(self, inner: PhysicsEngine) -> None:
        self.inner = inner

    @property
    def served_name(self) -> str:
        """See `Engine.served_name`."""
        return self.inner.served_name

    def worlds(self, scene: WorldSource) -> WorldSource:
        """See `PhysicsEngine.worlds`."""
        return self.inner.worlds(scene)

    def rendering(self) -> RenderingEngine | None:
        """See `PhysicsEngine.rendering`."""
        return self.inner.rendering()

    def verdict(self) -> Verdict | None:
        """See `PhysicsEngine.verdict`."""
        return self.inner.verdict()

    def reset(self, configuration: ActorConfiguration) -> WorldState:
        """See `PhysicsEngine.reset`."""
        return self.inner.reset(configuration)

    def begin(self) -> WorldState | None:
        """See `PhysicsEngine.begin`."""
        return self.inner.begin()

    def step(self, target: JointTarget) -> WorldState:
        """See `PhysicsEngine.step`."""
        return self.inner.step(target)

    def hidden(self) -> Hidden | None:
        """See `PhysicsEngine.hidden`."""
        return self.inner.hidden()

    def contact_points(self) -> BodyContacts | None:
        """See `PhysicsEngine.contact_points`."""
        return self.inner.contact_points()

    @property
    def deepest_pair(self) -> tuple[str, str, float, float] | None:
        """See `PhysicsEngine.deepest_pair`."""
        return self.inner.deepest_pair

    def hold(self, why: str) -> None:
        """See `PhysicsEngine.hold`."""
        self.inner.hold(why)

    @property
    def hold_delivered(self) -> bool:
        """See `PhysicsEngine.hold_delivered`."""
        return self.inner.hold_delivered

    def close(self) -> None:
        """See `Engine.close`."""
        self.inner.close()
