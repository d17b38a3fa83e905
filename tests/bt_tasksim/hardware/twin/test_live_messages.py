"""Ten thousand messages that are none, over a real bridge: nothing moves or crashes, and all are counted."""

from __future__ import annotations

import base64
import copy
import random
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np

from benchmarks.faults import Bench
from bt_tasksim.engines.remote.address import Address
from bt_tasksim.hardware.ros import messages
from bt_tasksim.hardware.ros.link import Link
from bt_tasksim.hardware.ros.messages import UnusableMessageError

COMMANDS, READINGS = 6000, 4000
RUN = "run"


# ---- to the twin ------------------------------------------------------------------------------------------


def trajectory(joints: tuple[str, ...], here: list[float]) -> dict[str, Any]:
    """A good one: a little on, and to rest."""
    still = [0.0] * len(here)
    points = [
        {"positions": here, "velocities": still, "time_from_start": {"sec": 0, "nanosec": 50_000_000 * k}}
        for k in (1, 2, 3)
    ]
    return {"header": {"frame_id": RUN}, "joint_names": list(joints), "points": points}


Damage = Callable[[dict[str, Any], random.Random], Any]


def put(key: str, value: Callable[[random.Random], Any]) -> Damage:
    """Damage of one key of one point."""

    def damage(message: dict[str, Any], rng: random.Random) -> Any:
        rng.choice(message["points"])[key] = value(rng)
        return message

    return damage


def wild(n: int) -> Callable[[random.Random], list[Any]]:
    return lambda rng: [rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(1.5, 30.0) for _ in range(n)]


def top(key: str, value: Callable[[random.Random], Any]) -> Damage:
    """Damage of one key of the message."""
    return lambda message, rng: {**message, key: value(rng)}


def noise(rng: random.Random) -> str:
    return rng.randbytes(rng.randint(0, 300)).decode("latin1")


def well_typed(n: int) -> list[Damage]:
    """What a bridge hands on, and no controller may carry out."""
    return [
        put("positions", wild(n)),
        put("velocities", wild(n)),
        put("positions", lambda rng: [0.0] * rng.choice([0, 1, n - 1, n + 1, 500])),
        put("velocities", lambda rng: [0.0] * rng.choice([1, n - 1, n + 1])),
        put("time_from_start", lambda rng: {"sec": -rng.randint(1, 2**31), "nanosec": 0}),
        put("time_from_start", lambda rng: {"sec": rng.randint(1000, 2**31 - 1), "nanosec": 0}),
        put("time_from_start", lambda rng: {"sec": 0, "nanosec": 0}),
        top("joint_names", lambda rng: [noise(rng) for _ in range(rng.choice([0, 1, n, 300]))]),
        top("header", lambda rng: {"frame_id": noise(rng) + "?"}),
        top("points", lambda rng: []),
        lambda message, rng: {**message, "points": message["points"][::-1]},
        lambda message, rng: {**message, "points": message["points"] * rng.randint(200, 400)},
    ]


def ill_typed(n: int) -> list[Damage]:
    """What a bridge already drops."""
    return [
        put("positions", lambda rng: [None] * n),
        put("positions", noise),
        put("velocities", lambda rng: [[0.0]] * n),
        put("time_from_start", lambda rng: rng.random()),
        top("points", noise),
        top("points", lambda rng: [rng.randint(-9, 9)]),
        top("joint_names", lambda rng: rng.random()),
        lambda message, rng: noise(rng),
        lambda message, rng: [message],
    ]


def test_thousands_of_wrong_commands(bench: Bench, stranger: Any) -> None:
    """Each one is refused or dropped, also by topics that stop and begin; none is carried out."""
    bench.restart()
    bench.evaluation.load(bench.configuration)
    setting, rng = bench.setting, random.Random(2026)
    texts = (setting.begin, setting.hold)
    kinds = {
        **dict.fromkeys((setting.arm.command, setting.hand.command), "trajectory_msgs/JointTrajectory"),
        **dict.fromkeys(texts, "std_msgs/String"),
        setting.emergency_stop: "std_msgs/Bool",
    }
    somebody = stranger(kinds)
    end = time.monotonic() + 10.0
    while bench.evaluation.tell()["stopped"] and time.monotonic() < end:  # until they have found each other
        somebody.publish(setting.begin, {"data": RUN})
        time.sleep(0.2)
    before = bench.evaluation.tell()
    assert not before["stopped"] and not before["refused"]
    somebody.sent.clear()
    hand = bench.robot.hand_open.tolist()
    groups = [(setting.arm, before["position"]), (setting.hand, hand)]
    fit = 0
    for k in range(COMMANDS):
        if k % 20 == 19:
            data = rng.choice([3, [1], {"a": 1}, 1.5, [[]]])
            somebody.publish(rng.choice(texts), {"data": data})
        elif k % 20 == 18:
            somebody.publish(setting.emergency_stop, {"data": rng.choice(["x", [1], {"a": 1}, 2**70])})
        else:
            group, here = groups[k % 2]
            n, typed = len(group.joints), rng.random() < 0.8
            damage = rng.choice(well_typed(n) if typed else ill_typed(n))
            fit += typed
            somebody.publish(group.command, damage(trajectory(group.joints, here), rng))
        time.sleep(0.001)
    time.sleep(1.0)
    after = bench.evaluation.tell()
    dropped = somebody.sent[setting.arm.command] + somebody.sent[setting.hand.command] - after["refused"]
    print(f"{sum(somebody.sent.values())} sent, {after['refused']} refused, {dropped} dropped")
    assert sum(somebody.sent.values()) == COMMANDS
    assert after["accepted"] == 0 and after["refused"] > fit / 4 and dropped >= 0
    assert not after["stopped"] and not bench.twin.ended()
    assert np.allclose(before["position"], after["position"], atol=2e-3)
    # What is good is carried out all the same.
    somebody.publish(setting.arm.command, trajectory(setting.arm.joints, after["position"]))
    time.sleep(0.5)
    assert bench.evaluation.tell()["accepted"] == 1


# ---- from the cell ----------------------------------------------------------------------------------------

HEADER = {"stamp": {"sec": 12, "nanosec": 5}, "frame_id": "base"}
VECTOR = {"x": 1.0, "y": 2.0, "z": 3.0}
TURN = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
MATRIX = [5.0, 0.0, 4.0, 0.0, 5.0, 3.0, 0.0, 0.0, 1.0]


def png(pixels: np.ndarray) -> str:
    return base64.b64encode(cv2.imencode(".png", pixels)[1].tobytes()).decode()


GOOD: dict[str, tuple[str, Any]] = {
    "/fuzz/joints": (
        "sensor_msgs/JointState", {"header": HEADER, "name": ["a", "b"], "position": [0.1, 0.2]}
    ),
    "/fuzz/wrench": (
        "geometry_msgs/WrenchStamped", {"header": HEADER, "wrench": {"force": VECTOR, "torque": VECTOR}}
    ),
    "/fuzz/pose": (
        "geometry_msgs/PoseStamped",
        {"header": HEADER, "pose": {"position": VECTOR, "orientation": TURN}},
    ),
    "/fuzz/stop": ("std_msgs/Bool", {"data": True}),
    "/fuzz/info": (
        "sensor_msgs/CameraInfo", {"header": HEADER, "width": 8, "height": 6, "k": MATRIX}
    ),
    "/fuzz/colour": (
        "sensor_msgs/CompressedImage",
        {"header": HEADER, "format": "png", "data": png(np.zeros((6, 8, 3), np.uint8))},
    ),
    "/fuzz/depth": (
        "sensor_msgs/CompressedImage",
        {"header": HEADER, "format": "16UC1; png", "data": png(np.ones((6, 8), np.uint16))},
    ),
}  # fmt: skip


def _picture(message: Any, what: str, unpack: Callable[[bytes], Any], encodings: Any = ()) -> Any:
    return unpack(messages.image_content(message, what, (8, 6), encodings)[0])


READ: dict[str, Callable[[Any], Any]] = {
    "/fuzz/joints": messages.joint_states,
    "/fuzz/wrench": lambda m: messages.wrench(m, "base")[0],
    "/fuzz/pose": lambda m: messages.pose(m, "base")[0],
    "/fuzz/stop": messages.flag,
    "/fuzz/info": lambda m: messages.camera_info(m).matrix,
    "/fuzz/colour": lambda m: _picture(m, "colour image", messages.colours),
    "/fuzz/depth": lambda m: _picture(m, "depth image", messages.metres, messages.MILLIMETRES),
}


def damaged(message: Any, rng: random.Random) -> Any:
    """The message, with one thing in it that does not belong there."""
    message = copy.deepcopy(message)
    place, key = message, rng.choice(list(message))
    while isinstance(place[key], dict | list) and place[key] and rng.random() < 0.8:
        place = place[key]
        key = rng.choice(list(place) if isinstance(place, dict) else range(len(place)))
    if rng.random() < 0.2 and isinstance(place, dict):
        del place[key]
    else:
        values = [None, -1, 2**40, 1e200, "", noise(rng), [], {}, [0.0] * rng.randint(1, 3000), True, "AAAA"]
        place[key] = rng.choice(values)
    return message


def test_thousands_of_wrong_readings(bench: Bench, stranger: Any) -> None:
    """What the bridge hands on is refused with a sentence, or still a message of finite numbers."""
    bench.restart()
    rng, refused, used = random.Random(7), Counter[str](), Counter[str]()
    link = Link(Address("127.0.0.1", bench.twin.port), complain=lambda line: None)

    def handler(topic: str) -> Callable[[Any, float], None]:
        def handle(message: Any, arrived: float) -> None:
            try:
                value = READ[topic](message)
            except UnusableMessageError:
                refused[topic] += 1
                raise
            used[topic] += 1
            if isinstance(value, np.ndarray):
                assert np.isfinite(value).all()

        return handle

    unexpected: list[str] = []
    link._complaints.about = lambda topic, why: unexpected.append(why) if "Error" in why else None  # type: ignore[method-assign]
    try:
        for topic, (kind, _) in GOOD.items():
            link.subscribe(topic, kind, handler(topic))
        somebody = stranger({topic: kind for topic, (kind, _) in GOOD.items()})
        end = time.monotonic() + 10.0
        while len(used) < len(GOOD) and time.monotonic() < end:  # until they have found each other
            for topic, (_, good) in GOOD.items():
                somebody.publish(topic, good)
            time.sleep(0.2)
        assert len(used) == len(GOOD), used
        time.sleep(0.5)
        for counter in (somebody.sent, used, refused):
            counter.clear()
        topics = list(GOOD)
        for k in range(READINGS):
            topic = topics[k % len(topics)]
            somebody.publish(topic, damaged(GOOD[topic][1], rng))
            time.sleep(0.0005)
        time.sleep(1.0)
    finally:
        link.close()
    dropped = somebody.sent.total() - refused.total() - used.total()
    print(f"{READINGS} sent, {refused.total()} refused, {dropped} dropped, {used.total()} still good")
    assert somebody.sent.total() == READINGS and dropped >= 0
    assert not unexpected, unexpected[:3]
    assert refused.total() > READINGS / 20
    assert not bench.twin.ended()
