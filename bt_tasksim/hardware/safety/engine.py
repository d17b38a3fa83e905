"""What an engine of a real robot implements, in place of the methods of a `PhysicsEngine`.

An engine that is real is never stepped by the pipeline itself: the guard sends, waits for the period to end,
and reads (`bt_tasksim.hardware.safety.guard`).
"""

from __future__ import annotations

import threading
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar, Protocol

from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import JointTarget, WorldState
from bt_tasksim.engines.base import Engine, RenderingEngine
from bt_tasksim.scene.configuration import ActorConfiguration


@dataclass(frozen=True, slots=True)
class JointReading:
    """The newest joint states as they came, before anything is made of them.

    Attributes:
        names: Names in the order of the arrays.
        position: ``(n,)`` rad or m.
        velocity: ``(n,)`` rad/s or m/s.
        stamp: When they were measured, seconds of this machine's `time.monotonic`; `RobotClock` converts.
        effort: ``(n,)`` Nm or N, NaN where the robot does not say; None where it never does.
    """

    names: tuple[str, ...]
    position: Array
    velocity: Array
    stamp: float
    effort: Array | None = None


@dataclass(frozen=True)
class ChannelSpec:
    """How a process that has nothing but this builds a `HoldChannel`.

    Attributes:
        factory: ``module:name`` of a class or function; the module should import little.
        arguments: Its keyword arguments, plain data for JSON: a host, a port.
    """

    factory: str
    arguments: dict[str, Any] = field(default_factory=dict)


class HoldChannel(Protocol):
    """A way of its own to stop the robot, used by the watchdog when the runner can no longer do it."""

    def open(self) -> None:
        """Connect, so that a hold takes no time for that.

        Raises:
            OSError: There is nothing to connect to.
        """

    def hold(self, why: str) -> None:
        """Stop the robot and have it refuse every further command of the run.

        Raises:
            OSError: The connection is lost.
        """

    def close(self) -> None:
        """Disconnect."""


class EmergencyStop:
    """An emergency stop that an engine feeds, from a topic or a button, on any thread.

    It stays pressed until a new run releases it, and is refused then while whatever feeds it says it is
    still pressed (`held_down`).
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._why = ""
        self._listeners: list[Callable[[str], None]] = []
        self.held_down: Callable[[], bool] = lambda: False
        """Says whether the button is pressed at this moment."""

    @property
    def why(self) -> str:
        """Who pressed it; empty where nobody has."""
        return self._why

    def press(self, why: str) -> None:
        """Stop; listeners are called at once, on the thread that presses."""
        with self._lock:
            first, self._why = not self._why, self._why or why
            listeners = list(self._listeners)
        if first:
            for listener in listeners:
                listener(why)

    def release(self) -> None:
        """Forget it, for a new run."""
        with self._lock:
            self._why = ""

    def listen(self, listener: Callable[[str], None]) -> None:
        """Have a function called when it is pressed."""
        with self._lock:
            self._listeners.append(listener)


class RealEngine(Engine):
    """The physics role, played by a real robot; registered as ``engine/physics``, like any other.

    Attributes:
        emergency: Its emergency stop.
    """

    role: ClassVar[str] = "physics"
    real: ClassVar[bool] = True
    emergency: EmergencyStop

    @abstractmethod
    def reset(self, configuration: ActorConfiguration, heartbeat: Callable[[], None]) -> None:
        """Begin a run: connect, end a hold, bring the arm to where an episode starts, wait until it is still.

        The guard does not see this motion; `bt_tasksim.hardware.safety.motion.approach` keeps to limits.

        Args:
            configuration: The world.
            heartbeat: To be called all the time that the arm moves, as often as a command follows another:
                the watchdog holds the arm when it is called no more.

        Raises:
            MachineError: There is no robot, it does not come to rest, or `heartbeat` says to stop.
        """

    @abstractmethod
    def send(self, target: JointTarget) -> None:
        """Send one command, which the robot gives up ``target.validity`` seconds after it was sent.

        Returns at once, and never queues: an older command that has not been sent is dropped. Between a
        `hold` and the next `reset` nothing may be carried out, whatever is sent.

        Raises:
            MachineError: The connection is lost.
        """

    @abstractmethod
    def latest(self) -> JointReading:
        """The newest joint states, without waiting.

        Raises:
            MachineError: There are none, or the connection is lost.
        """

    @abstractmethod
    def state(self, reading: JointReading) -> WorldState:
        """The state of this instant: these joint states, which were checked, and the newest of all else.

        Raises:
            MachineError: Something has not been heard of for too long, or the connection is lost.
        """

    @abstractmethod
    def hold(self, why: str, here: bool) -> None:
        """Stop, and carry out nothing more until `reset`; on any thread, and more than once.

        Args:
            why: The reason, for the robot's own log.
            here: Stop where the arm is; else as the last command would end, slowing down within limits.

        Raises:
            MachineError: The connection is lost.
        """

    def hold_channel(self) -> ChannelSpec | None:
        """How the watchdog stops this robot; None, the default, where there is no second way to it."""
        return None

    def rendering(self) -> RenderingEngine | None:
        """The pictures of the robot's cameras; None, the default, where it has none."""
        return None


class RobotClock:
    """Converts stamps of a robot's clock to seconds of this machine's `time.monotonic`.

    The smallest difference between arrival and stamp that was ever seen is taken for the clocks' offset, so
    that what a message was late by counts as its age (one-way delays as in RFC 5905's clock filter). Delays
    that have always been there cannot be seen so.
    """

    def __init__(self) -> None:
        self._offset = float("inf")

    def convert(self, stamp: float, arrived: float) -> float:
        """When it was measured, in seconds of `time.monotonic`.

        Args:
            stamp: Seconds of the robot's clock.
            arrived: Seconds of `time.monotonic`.
        """
        self._offset = min(self._offset, arrived - stamp)
        return stamp + self._offset
