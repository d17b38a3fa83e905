"""Messages of ROS topics as rosbridge hands them on, and those that the watchdog reads."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from bt_tasksim.core.errors import InputError
from bt_tasksim.hardware.ros import hold, messages
from tests.attacks.mutations import Bait, Rng, damaged_bytes, damaged_data, one_of

HEADER = {"stamp": {"sec": 1_700_000_000, "nanosec": 5}, "frame_id": "base"}
XYZ = {"x": 0.1, "y": -0.2, "z": 0.3}
JOINTS = {"header": HEADER, "name": ["a", "b"], "position": [0.1, 0.2], "velocity": [0.0, 0.1], "effort": []}
SIZE = (4, 4)
PNG = base64.b64encode(cv2.imencode(".png", np.full((4, 4), 900, np.uint16))[1].tobytes()).decode()
SOUND: tuple[tuple[dict[str, Any], Callable[[Any], object]], ...] = (
    (JOINTS, messages.joint_states),
    ({"header": HEADER, "wrench": {"force": XYZ, "torque": XYZ}}, lambda m: messages.wrench(m, "base")),
    (
        {
            "header": HEADER,
            "pose": {"position": XYZ, "orientation": {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0}},
        },
        lambda m: messages.pose(m, "base"),
    ),
    ({"data": True}, messages.flag),
    ({"data": "hold"}, messages.text),
    (
        {"header": HEADER, "width": 4, "height": 4, "k": [5.0, 0, 2, 0, 5, 2, 0, 0, 1], "d": [0.0]},
        messages.camera_info,
    ),
    (
        {"header": HEADER, "format": "png", "data": PNG},
        lambda m: messages.colours(messages.image_content(m, "colour", SIZE)[0]),
    ),
    (
        {"header": HEADER, "format": "16UC1; png compressed", "data": PNG},
        lambda m: messages.metres(messages.image_content(m, "depth", SIZE, messages.MILLIMETRES)[0]),
    ),
)


def begin(folder: Path, bait: Bait) -> Callable[[Rng], Callable[[], object]]:
    """See `tests.attacks.__main__.KINDS`."""

    def make(rng: Rng) -> Callable[[], object]:
        message, read = one_of(rng, SOUND)
        data = damaged_data(message, rng, bait)
        text = json.dumps({"op": "publish", "msg": damaged_data(JOINTS, rng, bait)})
        if rng.random() < 0.3:
            text = damaged_bytes(text.encode(), rng).decode("utf-8", "replace")

        def case() -> None:
            hold._motion(text, ["a", "b"], 1.0, None)
            try:
                read(data)
            except messages.UnusableMessageError as error:
                raise InputError(str(error)) from None

        return case

    return make
