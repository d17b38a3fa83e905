"""The twin's camera: pictures drawn from the twin's true state, published through rosbridge like a driver's.

A process of its own in this project's environment, since the twin's has no renderer:
``python -m bt_tasksim.hardware.twin.camera --robot R --ros FILE --port P --evaluation-port P --rate HZ``. It
draws what SAPIEN draws, with the errors of depth that perception has in simulation.
"""

from __future__ import annotations

import argparse
import base64
import json
import math
import os
import sys
import time
from collections.abc import Mapping
from typing import Any

import cv2
import numpy as np

from bt_tasksim.core.errors import BtTasksimError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import WorldState
from bt_tasksim.engines.images import Image
from bt_tasksim.engines.perception.camera_errors import CameraErrors
from bt_tasksim.engines.rendering.sapien import SapienRendering
from bt_tasksim.hardware.ros.setting import CameraTopics, RosSetting, load_setting
from bt_tasksim.hardware.ros.websocket import WebSocket
from bt_tasksim.hardware.twin.evaluation import SECRET, EvaluationClient
from bt_tasksim.robot.description import RobotDescription, load_robot
from bt_tasksim.scene.configuration import ActorConfiguration

TYPES = {
    "colour": "sensor_msgs/CompressedImage",
    "depth": "sensor_msgs/CompressedImage",
    "info": "sensor_msgs/CameraInfo",
}


class TwinCamera:
    """Draws and publishes.

    Args:
        robot: The robot.
        setting: The topics of its cameras.
        port: Of rosbridge, on this machine.
        twin: The twin's evaluation channel.
    """

    def __init__(
        self, robot: RobotDescription, setting: RosSetting, port: int, twin: EvaluationClient
    ) -> None:
        self._robot, self._setting = robot, setting
        self._twin = twin
        self._bridge = WebSocket("127.0.0.1", port, patience=5.0)
        self._renderer, self._errors = SapienRendering(), CameraErrors()
        self._rng = np.random.default_rng(0)
        self._world = -1
        for camera in setting.cameras.values():
            for key, kind in TYPES.items():
                self._say("advertise", getattr(camera, key), type=kind)

    def publish(self) -> None:
        """One picture of each camera, of now."""
        seen = self._twin.ask(do="picture", known=self._world)
        if seen["configuration"] is not None:
            self._renderer.reset(ActorConfiguration.from_json(seen["configuration"]))
            self._world = seen["world"]
        state = drawn_state(seen, len(self._robot.tips))
        for name, topics in self._setting.cameras.items():
            image = self._renderer.render(state, name, depth=True)
            self._publish(image, topics, float(seen["stamp"]))
        while self._bridge.receive(1e-3) is not None:  # a bridge lets go of who never answers its pings
            pass

    def _publish(self, image: Image, topics: CameraTopics, stamp: float) -> None:
        header = {
            "stamp": {"sec": math.floor(stamp), "nanosec": int(stamp % 1.0 * 1e9)},
            "frame_id": "camera",
        }
        model = image.camera
        matrix = model.matrix.ravel().tolist()
        info = {"header": header, "width": model.width, "height": model.height, "k": matrix, "d": [0.0] * 5}
        self._say("publish", topics.info, msg=info)
        assert image.depth is not None
        millimetres = np.round(1000.0 * self._errors.depth(image.depth, self._rng)).clip(0, 65535)
        colour = np.ascontiguousarray(image.colour[:, :, ::-1])
        for topic, kind, pixels in (
            (topics.colour, "jpeg", colour),
            (topics.depth, "png", millimetres.astype(np.uint16)),
        ):
            message = {"header": header, "format": kind, "data": _file(kind, pixels)}
            self._say("publish", topic, msg=message)

    def _say(self, op: str, topic: str, **more: Any) -> None:
        self._bridge.send(json.dumps({"op": op, "topic": topic, **more}))


def drawn_state(seen: Mapping[str, Any], n_tips: int) -> WorldState:
    """What a renderer needs to know of an answer to ``picture``: joints and objects."""
    joints = np.array(seen["joint_position"], float)
    return WorldState(
        time=np.float64(seen["time"]),
        joint_position=joints,
        joint_velocity=np.zeros_like(joints),
        joint_effort=np.zeros_like(joints),
        tip_force=np.zeros((n_tips, 3)),
        wrench=np.zeros(6),
        tool_pose=np.array(seen["tool_pose"], float),
        tips=np.zeros((n_tips, 3)),
        objects=np.array(seen["objects"], float).reshape(-1, 7),
    )


def _file(kind: str, pixels: Array) -> str:
    """A PNG or JPEG in base64, such as a camera's driver writes; small enough for rosbridge."""
    how = [cv2.IMWRITE_PNG_COMPRESSION, 3] if kind == "png" else [cv2.IMWRITE_JPEG_QUALITY, 95]
    return base64.b64encode(cv2.imencode(f".{kind}", pixels, how)[1].tobytes()).decode()


def main() -> int:
    """Publish until the bridge or the twin is gone; returns the exit status."""
    parser = argparse.ArgumentParser(description="The twin's camera.")
    parser.add_argument("--robot", required=True)
    parser.add_argument("--ros", required=True)
    parser.add_argument("--port", type=int, required=True)
    parser.add_argument("--evaluation-port", type=int, required=True)
    parser.add_argument("--rate", type=float, required=True)
    options = parser.parse_args()
    try:
        robot = load_robot(options.robot)
        setting = load_setting(robot, options.ros)
        twin = EvaluationClient(options.evaluation_port, os.environ.pop(SECRET, ""))
        camera = TwinCamera(robot, setting, options.port, twin)
        camera.publish()
        print("ready", flush=True)
        due = time.monotonic()
        while True:
            due = max(due + 1.0 / options.rate, time.monotonic())
            time.sleep(max(due - time.monotonic(), 0.0))
            camera.publish()
    except KeyboardInterrupt:
        return 0
    except (BtTasksimError, OSError) as error:
        print(f"twin's camera: {error}", file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())
