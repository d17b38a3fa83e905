"""Pictures of a real camera: which pair is handed on, when it was taken, and what is forgotten."""

from __future__ import annotations

import base64
import threading
import time
from typing import Any

import cv2
import numpy as np
import pytest

from bt_tasksim.core.errors import MachineError
from bt_tasksim.hardware.ros.cameras import EVERY, TOGETHER, RosCameras
from bt_tasksim.hardware.ros.setting import load_setting
from bt_tasksim.robot.description import load_robot

SETTING = load_setting(load_robot("panda"))
TOPICS = SETTING.cameras["scene"]


class Robot:
    """The engine, as far as cameras know it: one clock, and a link that hands on what is published."""

    def __init__(self) -> None:
        self.setting, self.joints, self.link, self.lost = SETTING, self, self, ""
        self.began = time.monotonic()
        self._handles: dict[str, Any] = {}

    def convert(self, stamp: float, arrived: float) -> float:
        return stamp

    def subscribe(self, topic: str, kind: str, handle: Any, throttle: int = 0) -> None:
        self._handles[topic] = handle

    def picture(self, taken: float, shade: int = 0, damaged: bool = False, later: float = 0.0) -> None:
        """Colour and depth, of one instant but for so many seconds, or files that break off."""
        header, after = (
            {"stamp": {"sec": int(t), "nanosec": int(t % 1 * 1e9)}, "frame_id": "camera"}
            for t in (taken, taken + later)
        )
        info = {"header": header, "width": 8, "height": 6, "k": [6.0, 0, 4, 0, 6.0, 3, 0, 0, 1], "d": []}
        self._handles[TOPICS.info](info, taken)
        colour, depth = np.full((6, 8, 3), shade, np.uint8), np.full((6, 8), 1000, np.uint16)
        for topic, pixels, head in ((TOPICS.colour, colour, header), (TOPICS.depth, depth, after)):
            content = cv2.imencode(".png", pixels)[1].tobytes()
            data = base64.b64encode(content[:40] if damaged else content).decode()
            self._handles[topic]({"header": head, "format": "png", "data": data}, taken)


def test_a_picture_says_when_it_was_taken() -> None:
    robot = Robot()
    cameras = RosCameras(robot)  # type: ignore[arg-type]
    threading.Timer(0.1, lambda: robot.picture(time.monotonic(), shade=7)).start()
    cameras.reset(None)  # type: ignore[arg-type]
    image = cameras.render(None, "scene", depth=True)  # type: ignore[arg-type]
    assert image.taken == pytest.approx(0.1, abs=0.09) and image.colour[0, 0, 0] == 7
    assert cameras.render(None, "scene", depth=True) is image  # type: ignore[arg-type]
    robot.picture(time.monotonic(), shade=9)
    newer = cameras.render(None, "scene", depth=True)  # type: ignore[arg-type]
    assert newer.taken is not None and newer.taken > image.taken and newer.colour[0, 0, 0] == 9


def test_colour_and_depth_are_of_one_instant() -> None:
    robot = Robot()
    cameras = RosCameras(robot)  # type: ignore[arg-type]
    threading.Timer(0.05, lambda: robot.picture(time.monotonic(), shade=7, later=0.08)).start()
    threading.Timer(0.3, lambda: robot.picture(time.monotonic(), shade=9, later=0.02)).start()
    cameras.reset(None)  # type: ignore[arg-type]  # the first ones do not belong together
    image = cameras.render(None, "scene", depth=True)  # type: ignore[arg-type]
    assert image.colour[0, 0, 0] == 9 and image.taken == pytest.approx(0.3, abs=0.09)


@pytest.mark.parametrize("period", [0.01, 0.033, 0.039, 0.041, 0.05, 0.067, 0.1, 0.2])
def test_what_a_bridge_leaves_of_colour_and_depth_belongs_together(period: float) -> None:
    """Pictures of any rate, of which a bridge hands on one each 40 ms at most, colour from another one on."""

    def left(first: int) -> list[float]:
        kept: list[float] = []
        for taken in np.arange(first, 400) * period:
            if not kept or taken - kept[-1] >= EVERY / 1000.0:
                kept.append(float(taken))
        return kept

    for first in range(5):
        colour, depth = np.array(left(0)), np.array(left(first))
        apart = np.abs(colour[5:50, None] - depth[None, :]).min(axis=1)
        assert apart.max() <= TOGETHER


def test_a_new_run_has_pictures_of_its_own() -> None:
    robot = Robot()
    cameras = RosCameras(robot)  # type: ignore[arg-type]
    threading.Timer(0.05, lambda: robot.picture(time.monotonic(), shade=7)).start()
    cameras.reset(None)  # type: ignore[arg-type]
    threading.Timer(0.2, lambda: robot.picture(time.monotonic(), shade=9)).start()
    cameras.reset(None)  # type: ignore[arg-type]  # the first run's picture is not a second old
    assert cameras.render(None, "scene").colour[0, 0, 0] == 9  # type: ignore[arg-type]


def test_a_picture_of_the_last_run_does_not_stand_in_for_a_damaged_one() -> None:
    robot = Robot()
    cameras = RosCameras(robot)  # type: ignore[arg-type]
    threading.Timer(0.05, lambda: robot.picture(time.monotonic(), shade=7)).start()
    cameras.reset(None)  # type: ignore[arg-type]
    threading.Timer(0.05, lambda: robot.picture(time.monotonic(), damaged=True)).start()
    cameras.reset(None)  # type: ignore[arg-type]
    with pytest.raises(MachineError, match="camera 'scene': colour image: cannot be read"):
        cameras.render(None, "scene")  # type: ignore[arg-type]


def test_an_old_picture_that_a_bridge_hands_on_does_not_count() -> None:
    robot = Robot()
    cameras = RosCameras(robot)  # type: ignore[arg-type]
    old = time.monotonic() - 0.9
    threading.Timer(0.05, lambda: robot.picture(old, shade=7)).start()
    threading.Timer(0.2, lambda: robot.picture(time.monotonic(), shade=9)).start()
    cameras.reset(None)  # type: ignore[arg-type]
    assert cameras.render(None, "scene").colour[0, 0, 0] == 9  # type: ignore[arg-type]


def test_inverse_depth_is_refused() -> None:
    robot = Robot()
    cameras = RosCameras(robot)  # type: ignore[arg-type]
    threading.Timer(0.05, lambda: robot.picture(time.monotonic())).start()
    cameras.reset(None)  # type: ignore[arg-type]
    header = {"stamp": {"sec": 1, "nanosec": 0}, "frame_id": "camera"}
    message = {"header": header, "format": "32FC1; compressedDepth png", "data": ""}
    with pytest.raises(ValueError, match="publish 16UC1"):
        robot._handles[TOPICS.depth](message, 1.0)
    robot.lost = "the connection is lost"
    with pytest.raises(MachineError, match="no connection"):
        cameras.reset(None)  # type: ignore[arg-type]
