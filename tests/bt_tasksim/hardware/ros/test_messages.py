"""What arrives is used or refused with a sentence, whatever it is."""

from __future__ import annotations

import base64
import copy
import json
import math
import random
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bt_tasksim.hardware.ros import messages
from bt_tasksim.hardware.ros.messages import UnusableMessageError

STAMP = {"sec": 12, "nanosec": 500_000_000}
HEADER = {"stamp": STAMP, "frame_id": "base"}
VECTOR = {"x": 1.0, "y": 2.0, "z": 3.0}


def png(array: np.ndarray) -> str:
    return base64.b64encode(cv2.imencode(".png", array)[1].tobytes()).decode()


COLOUR = np.dstack([np.full((6, 8), v, np.uint8) for v in (10, 20, 30)])
DEPTH = np.arange(48, dtype=np.uint16).reshape(6, 8) * 100
GOOD: dict[str, Any] = {
    "joints": {
        "header": HEADER,
        "name": ["a", "b"],
        "position": [0.1, 0.2],
        "velocity": [],
        "effort": [1.0, None],
    },
    "wrench": {"header": HEADER, "wrench": {"force": VECTOR, "torque": VECTOR}},
    "pose": {
        "header": HEADER,
        "pose": {"position": VECTOR, "orientation": {"x": 0.0, "y": 0.0, "z": 1.0, "w": 0.0}},
    },
    "flag": {"data": True},
    "text": {"data": "hold"},
    "info": {"width": 8, "height": 6, "k": [5.0, 0, 4.0, 0, 5.0, 3.0, 0, 0, 1.0], "d": [0.0] * 5},
    "colour": {"header": HEADER, "format": "png", "data": png(COLOUR)},
    "depth": {"header": HEADER, "format": "png", "data": png(DEPTH)},
}
READ = {
    "joints": messages.joint_states,
    "wrench": lambda m: messages.wrench(m, "base"),
    "pose": lambda m: messages.pose(m, "base"),
    "flag": messages.flag,
    "text": messages.text,
    "info": messages.camera_info,
    "colour": lambda m: messages.colours(messages.image_content(m, "colour image", (8, 6))[0]),
    "depth": lambda m: messages.metres(messages.image_content(m, "depth image", (8, 6))[0]),
}


def test_good_messages_are_read() -> None:
    joints = READ["joints"](GOOD["joints"])
    assert joints.names == ("a", "b") and joints.stamp == 12.5
    assert joints.position.tolist() == [0.1, 0.2]
    assert np.isnan(joints.velocity).all() and math.isnan(joints.effort[1])
    assert READ["wrench"](GOOD["wrench"])[0].tolist() == [1, 2, 3, 1, 2, 3]
    assert READ["pose"](GOOD["pose"])[0].tolist() == [1, 2, 3, 0, 0, 0, 1]  # w x y z
    assert READ["flag"](GOOD["flag"]) is True
    assert READ["info"](GOOD["info"]).matrix[0, 2] == 4.0
    assert np.array_equal(READ["colour"](GOOD["colour"]), COLOUR[:, :, ::-1])
    assert np.allclose(READ["depth"](GOOD["depth"]), DEPTH / 1000.0)


def test_a_depth_image_as_image_transport_writes_it() -> None:
    content = bytes(12) + base64.b64decode(GOOD["depth"]["data"])
    message = {**GOOD["depth"], "data": base64.b64encode(content).decode()}
    assert np.allclose(READ["depth"](message), DEPTH / 1000.0)


@pytest.mark.parametrize(
    ("kind", "sentence"),
    [
        ("32FC1; compressedDepth png", "in format '32FC1; compressedDepth png'; publish 16UC1"),
        ("bgr8; png compressed bgr8", "publish 16UC1"),
        (3, "'format' should be a text"),
    ],
)
def test_a_depth_image_of_another_encoding(kind: Any, sentence: str) -> None:
    """Inverse depth comes as a PNG of 16 bits, too, and would be read as millimetres."""

    def read(kind: Any) -> Any:
        message = {**GOOD["depth"], "format": kind}
        return messages.image_content(message, "depth image", (8, 6), messages.MILLIMETRES)

    with pytest.raises(UnusableMessageError, match=sentence):
        read(kind)
    for good in ("16UC1; compressedDepth png", "mono16; png compressed", "png", ""):
        assert np.allclose(messages.metres(read(good)[0]), DEPTH / 1000.0)


def test_the_size_of_a_jpeg_is_read_before_it_is_unpacked() -> None:
    jpeg = cv2.imencode(".jpg", COLOUR)[1].tobytes()
    message = {**GOOD["colour"], "data": base64.b64encode(jpeg).decode()}
    assert READ["colour"](message).shape == (6, 8, 3)
    with pytest.raises(UnusableMessageError, match="8 x 6 pixels, and the camera has 640 x 480"):
        messages.image_content(message, "colour image", (640, 480))


@pytest.mark.parametrize(
    ("kind", "change", "sentence"),
    [
        ("joints", {"position": [0.1]}, "should be 2 numbers, found 1"),
        ("joints", {"position": [0.1, "x"]}, "should be a number"),
        ("joints", {"position": [0.1, True]}, "should be a number"),
        ("joints", {"position": [0.1, 1e300]}, "should be a number"),
        ("joints", {"name": ["a", "a"]}, "named twice"),
        ("joints", {"name": [str(i) for i in range(5000)]}, "5000 joints, more than 256"),
        ("joints", {"header": {}}, "'stamp' is missing"),
        ("wrench", {"header": {**HEADER, "frame_id": "camera"}}, "in frame 'camera', expected 'base'"),
        ("wrench", {"wrench": {"force": VECTOR}}, "'torque' is missing"),
        ("wrench", {"wrench": {"force": {**VECTOR, "y": None}, "torque": VECTOR}}, "force y"),
        ("pose", {"pose": {"position": VECTOR, "orientation": {**VECTOR, "w": 1.0}}}, "has length"),
        ("flag", {"data": 1}, "true or false"),
        ("text", {"data": "x" * 10_000}, "at most 500"),
        ("info", {"width": 10**9}, "a size of"),
        ("info", {"k": [0.0] * 9}, "no intrinsic matrix"),
        ("info", {"d": [0.1, 0, 0, 0, 0]}, "distorted"),
        ("colour", {"data": "not base64!"}, "not base64"),
        ("colour", {"data": base64.b64encode(b"hello").decode()}, "neither PNG nor JPEG"),
        ("colour", {"data": "A" * 20_000_000}, "too many"),
        ("depth", {"data": GOOD["colour"]["data"]}, "one channel of 16 bits"),
        ("colour", {"data": GOOD["colour"]["data"][:80]}, "cannot be read|not base64"),
    ],
)
def test_what_is_wrong_is_said(kind: str, change: dict[str, Any], sentence: str) -> None:
    with pytest.raises(UnusableMessageError, match=sentence) as refused:
        READ[kind]({**GOOD[kind], **change})
    assert len(str(refused.value)) < 200


anything = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.text(max_size=8), inner, max_size=5),
    max_leaves=10,
)


@given(anything)
@settings(max_examples=200, deadline=None)
def test_nothing_but_a_refusal(value: Any) -> None:
    for read in READ.values():
        with pytest.raises(UnusableMessageError):
            read(value)


def changed(message: Any, rng: random.Random) -> Any:
    """The message, with something in it that does not belong there."""
    bad = [
        None, True, -1, 2**70, 1e308, math.nan, math.inf, "", "x" * 1000, [], {}, [[]], [None] * 500,
        list(range(1000)), {"sec": "a"}, "/w==", base64.b64encode(rng.randbytes(60)).decode(),
    ]  # fmt: skip
    message = copy.deepcopy(message)
    place = message
    while True:
        keys = list(place) if isinstance(place, dict) else list(range(len(place)))
        if not keys:
            return message
        key = rng.choice(keys)
        inner = place[key]
        if isinstance(inner, dict | list) and inner and rng.random() < 0.7:
            place = inner
            continue
        if isinstance(place, dict) and rng.random() < 0.2:
            del place[key]
        elif isinstance(inner, str) and inner and rng.random() < 0.5:
            at = rng.randrange(len(inner))
            place[key] = inner[:at] + rng.choice("A/z0= \0") + inner[at + 1 :]
        else:
            place[key] = rng.choice(bad)
        return message


@pytest.mark.parametrize("kind", sorted(GOOD))
def test_thousands_of_damaged_messages(kind: str) -> None:
    """Each is read to finite numbers of the right shape, or refused; nothing else ever happens."""
    rng = random.Random(kind)
    refused = 0
    for _ in range(2500):
        message = GOOD[kind]
        for _ in range(rng.randint(1, 3)):
            message = changed(message, rng)
        try:
            value = READ[kind](message)
        except UnusableMessageError as error:
            refused += 1
            assert "\n" not in str(error) and len(str(error)) < 250
            continue
        if kind in ("wrench", "pose"):
            assert value[0].shape == (6 if kind == "wrench" else 7,) and np.isfinite(value[0]).all()
        if kind == "joints":
            assert len(value.names) == len(value.position) == len(value.velocity) == len(value.effort)
    assert refused > (300 if kind == "text" else 900)


def test_a_command_ends_at_rest_within_limits() -> None:
    rng = np.random.default_rng(0)
    lower, upper, acceleration = -np.ones(3), np.ones(3), np.array([5.0, 10.0, 20.0])
    for _ in range(300):
        position, velocity = rng.uniform(-0.9, 0.9, 3), rng.uniform(-2.0, 2.0, 3)
        points = messages.ending_at_rest(position, velocity, 0.05, acceleration, lower, upper, 0.15)
        assert points[0].time == 0.05 and np.array_equal(points[0].position, position)
        assert not np.any(points[-1].velocity)
        assert np.all(points[-1].position <= upper) and np.all(points[-1].position >= lower)
        assert points[-1].time <= max(0.15, 0.05 + float(np.max(np.abs(velocity) / acceleration))) + 1e-9
    (only,) = messages.ending_at_rest(position, np.zeros(3), 0.05, acceleration, lower, upper, 0.15)
    assert only.time == 0.05


def test_a_trajectory_is_a_message() -> None:
    points = (
        messages.Point(np.array([1.0]), np.array([0.5]), 0.05),
        messages.Point(np.array([1.1]), None, 1.5),
    )
    message = json.loads(json.dumps(messages.trajectory(["a"], points, "run")))
    assert message["header"]["frame_id"] == "run" and message["joint_names"] == ["a"]
    assert message["points"][0]["time_from_start"] == {"sec": 0, "nanosec": 50_000_000}
    assert message["points"][1]["time_from_start"] == {"sec": 1, "nanosec": 500_000_000}
    assert message["points"][0]["velocities"] == [0.5] and message["points"][1]["velocities"] == []


def test_a_wrench_of_a_sensor_elsewhere() -> None:
    sensor = np.array([0.0, 0.0, -0.1, 1.0, 0.0, 0.0, 0.0])  # 10 cm behind the tool
    felt = messages.in_tool_frame(np.array([1.0, 0, 0, 0, -0.1, 0]), sensor)
    assert np.allclose(felt, [1.0, 0, 0, 0, -0.2, 0])
