"""Engines of the pipeline that are in another process: each is the role's methods over a connection.

They are named ``remote:HOST:PORT``; the libraries of the extra 'remote' are imported when one is built.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar, Self

from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.core.registry import register
from bt_tasksim.core.world import Command, Hidden, JointTarget, Observation, WorldModel, WorldState
from bt_tasksim.engines.base import (
    Engine,
    EngineSetup,
    KinematicsEngine,
    PhysicsEngine,
    PostProcessEngine,
    RenderingEngine,
)
from bt_tasksim.engines.images import Image
from bt_tasksim.engines.remote.address import parse_remote
from bt_tasksim.engines.remote.bundles import arrays_of, bundle_of
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration

if TYPE_CHECKING:
    from bt_tasksim.engines.remote.client import Connection
    from bt_tasksim.engines.remote.messages import Message


class RemoteEngine(Engine):
    """What the roles have in common.

    Args:
        connection: To a server of this role.
    """

    takes_address: ClassVar[bool] = True

    def __init__(self, connection: Connection) -> None:
        self.connection = connection

    @classmethod
    def create(cls, robot: RobotDescription, setup: EngineSetup) -> Self:
        """See `Engine.create`.

        Raises:
            InputError: It is not one for this robot and version, or the key is no good.
            MachineError: It does not answer, or the extra 'remote' is not installed.
        """
        return cls(connect(cls.role, robot, setup))

    @classmethod
    def check_name(cls, name: str) -> None:
        """See `Engine.check_name`."""
        parse_remote(name)

    @property
    def served_name(self) -> str:
        """See `Engine.served_name`."""
        return self.connection.engine

    def close(self) -> None:
        """Let go of the served engine."""
        self.connection.close()

    def _begin(self, configuration: ActorConfiguration, reply: str) -> Message:
        from bt_tasksim.engines.remote.configurations import for_sending

        connection = self.connection
        if connection.broken:  # an episode begins anew, and so may a connection
            connection.open()
        sent = {"configuration": for_sending(configuration, connection.robot)}
        connection.begin(configuration)
        return connection.request("reset", reply, connection.limits.slow, sent)

    def _ask(self, kind: str, *replies: str, slow: bool = False, **content: Any) -> Message:
        limits = self.connection.limits
        return self.connection.request(kind, replies, limits.slow if slow else limits.step, **content)


def connect(role: str, robot: RobotDescription, setup: EngineSetup) -> Connection:
    """A connection to a served engine.

    Raises:
        InputError: It is not one for this robot and version, or the key is no good.
        MachineError: It does not answer, or the extra 'remote' is not installed.
    """
    try:
        from bt_tasksim.engines.remote.client import Connection, Limits
        from bt_tasksim.engines.remote.keys import CLIENT, load_key
    except ImportError as error:
        raise MachineError(
            f"engines in other processes need the extra 'remote' ({error}): pip install 'bt-tasksim[remote]'"
        ) from error
    key = load_key(setup.key, CLIENT) if setup.key else None
    limits = Limits(connect=setup.connect_timeout, step=setup.timeout)
    return Connection(parse_remote(setup.name), role, robot, key, limits)


@register("engine/physics", "remote")
class RemotePhysics(RemoteEngine, PhysicsEngine):
    """A `PhysicsEngine` in another process."""

    def reset(self, configuration: ActorConfiguration) -> WorldState:
        """See `PhysicsEngine.reset`."""
        return bundle_of(WorldState, self._begin(configuration, "state").arrays)

    def step(self, target: JointTarget) -> WorldState:
        """See `PhysicsEngine.step`.

        Raises:
            MachineError: The engine raised it.
            LostEngine: The server has gone, is too slow or answers nonsense.
        """
        return bundle_of(WorldState, self._ask("step", "state", arrays=arrays_of(target)).arrays)

    def hidden(self) -> Hidden | None:
        """See `PhysicsEngine.hidden`."""
        reply = self._ask("hidden", "truth", "no truth")
        return bundle_of(Hidden, reply.arrays) if reply.kind == "truth" else None


@register("engine/kinematics", "remote")
class RemoteKinematics(RemoteEngine, KinematicsEngine):
    """A `KinematicsEngine` in another process."""

    def reset(self, configuration: ActorConfiguration) -> None:
        """See `KinematicsEngine.reset`."""
        self._begin(configuration, "done")

    def solve(self, command: Command, state: WorldState) -> JointTarget:
        """See `KinematicsEngine.solve`.

        Raises:
            UnreachableError: The arm cannot be there; nothing has moved.
            MachineError: The engine raised it.
            LostEngine: The server has gone, is too slow or answers nonsense.
        """
        arrays = {**arrays_of(state), **arrays_of(command)}
        return bundle_of(JointTarget, self._ask("solve", "target", arrays=arrays).arrays)

    def joints_of_hand_start(self, start: tuple[float, ...]) -> tuple[float, ...]:
        """See `KinematicsEngine.joints_of_hand_start`."""
        reply = self._ask("hand_start", "joints", arrays={"start": start})
        return tuple(reply.arrays["position"].tolist())


@register("engine/rendering", "remote")
class RemoteRendering(RemoteEngine, RenderingEngine):
    """A `RenderingEngine` in another process."""

    def reset(self, configuration: ActorConfiguration) -> None:
        """See `RenderingEngine.reset`."""
        self._begin(configuration, "done")

    def render(
        self, state: WorldState, camera: str, *, depth: bool = False, size: tuple[int, int] | None = None
    ) -> Image:
        """See `RenderingEngine.render`.

        Raises:
            InputError: There is no such camera.
            MachineError: The engine raised it.
            LostEngine: The server has gone, is too slow or answers nonsense.
        """
        width, height = size or (0, 0)
        fields = {"camera": camera, "depth": depth, "width": width, "height": height}
        reply = self._ask("render", "image", slow=True, fields=fields, arrays=arrays_of(state))
        image: Image = reply.images[0]
        return image


@register("engine/postprocess", "remote")
class RemotePostProcess(RemoteEngine, PostProcessEngine):
    """A `PostProcessEngine` in another process.

    Args:
        connection: To a server of this role.
        noise: Name of the noise model of `StatePostProcess`, where the world as drawn names none;
            empty for the server's own.
    """

    def __init__(self, connection: Connection, noise: str = "") -> None:
        super().__init__(connection)
        self.noise = noise
        self._unseen: dict[str, str] = {}

    @classmethod
    def create(cls, robot: RobotDescription, setup: EngineSetup) -> Self:
        """See `RemoteEngine.create`."""
        return cls(connect(cls.role, robot, setup), setup.noise)

    @property
    def wants_images(self) -> bool:
        """See `PostProcessEngine.wants_images`: as the served engine says."""
        return self.connection.wants_images

    def reset(self, configuration: ActorConfiguration, model: WorldModel) -> None:
        """See `PostProcessEngine.reset`; the other side makes the model from the configuration.

        Raises:
            InputError: The model is another one than that.
        """
        robot = self.connection.robot
        own = configuration.world_model([tip.name for tip in robot.tips], robot.opening)
        if (own.objects, own.tips, own.control_period) != (model.objects, model.tips, model.control_period):
            raise InputError("a served post-process engine takes the world's own model, and no other one")
        self._unseen = {}
        self._begin(replace(configuration, noise=configuration.noise or self.noise), "done")

    def cameras(self, first: bool) -> tuple[str, ...]:
        """See `PostProcessEngine.cameras`."""
        names: tuple[str, ...] = self._ask("cameras", "names", fields={"first": bool(first)}).fields["names"]
        return names

    def observe(self, state: WorldState, images: Mapping[str, Image]) -> Observation:
        """See `PostProcessEngine.observe`.

        Raises:
            MachineError: The engine raised it.
            LostEngine: The server has gone, is too slow or answers nonsense.
        """
        reply = self._ask(
            "observe",
            "observation",
            slow=bool(images),
            arrays=arrays_of(state),
            images=tuple(images.values()),
        )
        self._unseen = reply.fields["unseen"]
        return bundle_of(Observation, reply.arrays)

    def unseen(self) -> dict[str, str]:
        """See `PostProcessEngine.unseen`."""
        return self._unseen
