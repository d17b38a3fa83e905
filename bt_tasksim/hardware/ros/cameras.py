"""Pictures of a robot's real cameras, in the rendering role."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from bt_tasksim.core.errors import InputError, MachineError, nearest
from bt_tasksim.core.world import WorldState
from bt_tasksim.engines.base import RenderingEngine
from bt_tasksim.engines.images import CameraModel, Image
from bt_tasksim.hardware.ros import messages
from bt_tasksim.hardware.ros.joints import JointFeed
from bt_tasksim.hardware.ros.link import PATIENCE, Link
from bt_tasksim.hardware.ros.messages import Calibration, UnusableMessageError
from bt_tasksim.hardware.ros.setting import CameraTopics, RosSetting
from bt_tasksim.scene.configuration import ActorConfiguration

STALE = 1.0
"""Seconds after which a picture shows what was, not what is."""
TOGETHER = 0.05
"""Seconds by which colour and depth of one instant may differ."""
EVERY = 40
"""Milliseconds at least between two pictures that a bridge hands on. It thins out colour and depth each for
itself; where this is less than `TOGETHER`, what it leaves belongs together, whatever the camera's rate."""
KEPT = 4


@dataclass
class Pictures:
    """What has come from one camera: messages with the time at which they were taken, newest last."""

    topics: CameraTopics
    calibration: Calibration | None = None
    colour: deque[tuple[float, Any]] = field(default_factory=lambda: deque(maxlen=KEPT))
    depth: deque[tuple[float, Any]] = field(default_factory=lambda: deque(maxlen=KEPT))
    unpacked: tuple[Any, Image] | None = None

    def forget(self) -> None:
        """Only what arrives from now on counts."""
        self.colour.clear()
        self.depth.clear()

    def since(self, begin: float) -> bool:
        """There are pictures of colour and depth, of one instant that was not before a moment."""
        return self.calibration is not None and any(min(a, b) >= begin for (a, _), (b, _) in self.pairs())

    def pairs(self) -> Iterator[tuple[tuple[float, Any], tuple[float, Any]]]:
        """Colour and depth of one instant, newest first."""
        depth = tuple(self.depth)
        for colour in reversed(tuple(self.colour)):
            for metres in sorted(depth, key=lambda d: abs(d[0] - colour[0])):
                if abs(metres[0] - colour[0]) <= TOGETHER:
                    yield colour, metres


class ConnectedRobot(Protocol):
    """What the cameras need of the robot's engine: its connection and its clock.

    Attributes:
        setting: Topics and names.
        link: The connection, where there is one.
        joints: Converts stamps of the robot's clock.
        began: When the run began, seconds of `time.monotonic`.
    """

    setting: RosSetting
    link: Link | None
    joints: JointFeed
    began: float


class RosCameras(RenderingEngine):
    """A rendering engine that draws nothing: it hands on the newest pictures.

    Args:
        robot: The robot's engine, whose connection it uses.
    """

    def __init__(self, robot: ConnectedRobot) -> None:
        if not robot.setting.cameras:
            raise InputError(f"'{robot.setting.source}' names no cameras; perception 'camera' needs some")
        self._robot = robot
        self._link: Link | None = None
        self._cameras: Mapping[str, Pictures] = {}

    def reset(self, configuration: ActorConfiguration) -> None:
        """See `RenderingEngine.reset`: wait until every camera has shown what is now.

        Raises:
            MachineError: One has not.
        """
        link = self._robot.link
        if link is None or link.lost:
            raise MachineError("there is no connection to the robot")
        if link is not self._link:
            self._link = link
            self._cameras = {k: Pictures(v) for k, v in self._robot.setting.cameras.items()}
            for pictures in self._cameras.values():
                self._subscribe(link, pictures)
        for pictures in self._cameras.values():
            pictures.forget()
        begin = time.monotonic()
        end = begin + PATIENCE
        for name, pictures in self._cameras.items():
            while not pictures.since(begin):  # a bridge hands on old ones to whoever is new
                if link.lost or time.monotonic() > end:
                    topics = pictures.topics
                    raise MachineError(
                        link.lost
                        or f"no usable picture of camera '{name}' has come for {PATIENCE:g} s on "
                        f"{topics.colour}, {topics.depth} and {topics.info}"
                    )
                time.sleep(0.01)

    def _subscribe(self, link: Link, pictures: Pictures) -> None:
        def info(message: Any, arrived: float) -> None:
            pictures.calibration = messages.camera_info(message)

        def keep(into: deque[tuple[float, Any]], what: str, encodings: tuple[str, ...] = ()) -> Any:
            def handle(message: Any, arrived: float) -> None:
                if pictures.calibration is None:
                    return
                size = (pictures.calibration.width, pictures.calibration.height)
                content, stamp = messages.image_content(message, what, size, encodings)
                into.append((self._robot.joints.convert(stamp, arrived), content))

            return handle

        topics, kind = pictures.topics, "sensor_msgs/CompressedImage"
        link.subscribe(topics.info, "sensor_msgs/CameraInfo", info, EVERY)
        link.subscribe(topics.colour, kind, keep(pictures.colour, "colour image"), EVERY)
        depth = keep(pictures.depth, "depth image", messages.MILLIMETRES)
        link.subscribe(topics.depth, kind, depth, EVERY)

    def render(
        self, state: WorldState, camera: str, *, depth: bool = False, size: tuple[int, int] | None = None
    ) -> Image:
        """See `RenderingEngine.render`: the newest pair of pictures, and when it was taken.

        Raises:
            InputError: There is no such camera, or its pictures have another size.
            MachineError: What has come is too old or cannot be read.
        """
        pictures = self._cameras.get(camera)
        if pictures is None:
            raise InputError(
                f"no camera '{camera}' in '{self._robot.setting.source}'{nearest(camera, self._cameras)}"
            )
        assert pictures.calibration is not None
        known, now = pictures.calibration, time.monotonic()
        if size not in (None, (known.width, known.height)):
            raise InputError(f"the pictures of camera '{camera}' have {known.width}x{known.height} pixels")
        model = CameraModel(camera, known.width, known.height, known.matrix, pictures.topics.pose)
        why = f"no colour and depth within {TOGETHER} s of each other have come"
        for (taken, colour), (other, metres) in pictures.pairs():
            if now - taken > STALE:
                why = f"the newest picture is {now - taken:.1f} s old"
                break
            which = (taken, other, depth)
            if pictures.unpacked is not None and pictures.unpacked[0] == which:
                return pictures.unpacked[1]
            try:
                pixels, far = messages.colours(colour), messages.metres(metres) if depth else None
                image = Image(model, pixels, far, min(taken, other) - self._robot.began)
                pictures.unpacked = (which, image)
                return image
            except UnusableMessageError as error:
                why = str(error)
        raise MachineError(f"camera '{camera}': {why}")
