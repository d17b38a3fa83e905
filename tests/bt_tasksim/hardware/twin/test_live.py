"""Trees on the twin over real ROS processes: runs, faults, and messages that are none."""

from __future__ import annotations

import base64
import gc
import json
import logging
import random
import re
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from benchmarks.any_tree.episodes import Conditions, player_of
from benchmarks.faults import Bench, Seen, bench_of, measure
from benchmarks.sweep import sweeping
from bt_tasksim import Goal, Runner, Scene
from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.core.real_time import TURNS
from bt_tasksim.core.world import Hidden
from bt_tasksim.execution.pipelines import EngineOptions, build_pipeline
from bt_tasksim.hardware.ros.websocket import WebSocket
from bt_tasksim.robot.description import load_robot
from bt_tasksim.robot.limits import REACTION
from bt_tasksim.scene.success import at_rest, evaluate_success
from bt_tasksim.trees.load import load_source

ROOT = Path(__file__).parents[4]
LATEST = REACTION
"""Seconds until a hold."""


def on_the_command_line(*words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "bt_tasksim.cli", *words]
    return subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=60)


def test_a_scenario_on_the_command_line_judged_by_the_twin(bench: Bench, tmp_path: Path) -> None:
    scene, robot = load_source("pick_and_throw").scene, load_robot("panda")
    done = []
    for seed in (0, 1, 2):
        configuration = scene.sample(seed)
        bench.evaluation.load(configuration, seed)
        before, _ = bench.evaluation.truth()
        assert not evaluate_success(configuration, world_of(configuration, robot), before).success
        port, out = bench.twin.port, str(tmp_path / str(seed))
        ran = on_the_command_line(
            "run", "pick_and_throw", "--seed", str(seed), "--engines", f"ros:127.0.0.1:{port}", "--out", out
        )
        assert ran.returncode in (0, 1), ran.stderr
        assert "Traceback" not in ran.stderr and "20 Hz" in ran.stdout
        truth = settled(bench)
        verdict = evaluate_success(configuration, world_of(configuration, robot), truth)
        assert at_rest(truth.velocities) or not verdict.success
        done.append(ran.returncode == 0 and verdict.success)
        assert bench.evaluation.tell()["stopped"]
        result = json.loads((tmp_path / str(seed) / "result.json").read_text())
        assert (result["status"] == "SUCCESS") == (ran.returncode == 0)
        if any(done):
            break
    assert any(done)


def settled(bench: Bench, patience: float = 5.0) -> Hidden:
    """The physics state once everything rests, or after so many seconds."""
    end = time.monotonic() + patience
    while not at_rest((truth := bench.evaluation.truth()[0]).velocities) and time.monotonic() < end:
        time.sleep(0.1)
    return truth


def world_of(configuration: Any, robot: Any) -> Any:
    return configuration.world_model([tip.name for tip in robot.tips], robot.opening)


def undisturbed(bench: Bench, fault: str) -> Seen:
    """A fault of a run in which the twin's physics kept up; on a busy machine perhaps only the third one."""
    seen = measure(bench, fault, seed=0)
    for seed in (1, 2):
        if seen.left_out > 0.0:
            seen = measure(bench, fault, seed)
    return seen


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("joint states frozen", "have not changed"),
        ("bridge restarted", "connection to rosbridge at .* is lost"),
        ("emergency stop", "emergency stop: /emergency_stop"),
        ("leaf blocks 2 s", "no sign of life"),
        ("SIGKILL of the runner", "the runner is gone"),
    ],
)
def test_a_fault_ends_in_a_hold_and_a_fresh_run_works(bench: Bench, fault: str, said: str) -> None:
    seen = undisturbed(bench, fault)
    assert seen.held < LATEST and seen.far < 0.15 and seen.drift < 5e-3
    assert seen.fastest < 1.0 and seen.hardest < 4.2, "no faster and no harder than a command may be"
    assert re.search(said, seen.said + seen.by), seen
    assert not seen.running and seen.again


def test_planning_for_longer_than_the_watchdog_waits_stops_nothing(bench: Bench) -> None:
    bench.restart()
    bench.evaluation.load(bench.configuration)
    runner, sweep = sweeping(bench.twin.port)
    begin, took, sweep.lasts = type(sweep).begin, 5 * runner.robot.safety.watchdog, 1.0

    def slowly(model: Any, seen: Any) -> Any:
        time.sleep(took)
        return begin(model, seen)

    try:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(type(sweep), "begin", slowly)
            result = runner.run(0)
    finally:
        runner.close()
    assert result.status.name == "SUCCESS", result.why
    assert result.sim_time > sweep.lasts + took


def test_meshes_among_other_things_on_the_twin(tmp_path: Path) -> None:
    """Tasks of the benchmark, with planned grasps and ways; one of six runs is enough on a busy machine."""
    asked = Conditions("panda", "obvious", None, EngineOptions(), tmp_path, twin=True)
    player, found = player_of(asked), []
    try:
        for seed in (988041, 988027, 988049) * 2:
            found.append(player.play(seed))
            if found[-1]["success"]:
                break
    finally:
        player.close()
    assert found[-1]["success"], [(episode["seed"], episode["why"]) for episode in found]
    assert list(tmp_path.glob("*.obj"))


@pytest.mark.parametrize("fault", ["SIGKILL of the runner", "emergency stop"])
def test_a_cell_of_ros2_control_alone(bench: Bench, tmp_path: Path, fault: str) -> None:
    """Nobody announces runs or takes a word to hold: what stops the arm is the watchdog's own trajectory."""
    data = yaml.safe_load(bench.setting.source.read_text())
    del data["begin"], data["hold"]
    data["emergency_stop"]["every"] = 1.0
    (tmp_path / "cell.yaml").write_text(yaml.safe_dump(data))
    with bench_of(bench.twin.domain - 1 or 101, str(tmp_path / "cell.yaml")) as plain:
        seen = undisturbed(plain, fault)
        assert (
            plain.evaluation.tell()["unfit"] == 0
        )  # what was under way at an emergency stop comes to nothing
    assert seen.held < LATEST and seen.far < 0.15 and seen.drift < 5e-3
    assert seen.fastest < 1.0 and seen.hardest < 4.2, "no faster and no harder than a command may be"
    assert not seen.running and seen.again, seen


def test_no_bridge_and_silent_topics_are_said(bench: Bench, tmp_path: Path) -> None:
    ran = on_the_command_line("run", "pick_and_throw", "--engines", "ros:127.0.0.1:1", "--out", str(tmp_path))
    assert ran.returncode == 1 and "cannot reach the robot" in ran.stderr and "Traceback" not in ran.stderr
    text = bench.setting.source.read_text().replace("/wrist/wrench", "/nobody/publishes/here")
    (tmp_path / "cell.yaml").write_text(text)
    words = ("run", "pick_and_throw", "--engines", f"ros:127.0.0.1:{bench.twin.port}")
    ran = on_the_command_line(*words, "--ros", str(tmp_path / "cell.yaml"), "--out", str(tmp_path / "run"))
    assert ran.returncode == 1, ran.stderr
    assert "nothing usable has come for 5 s on /nobody/publishes/here" in ran.stderr
    assert "Traceback" not in ran.stderr


# ---- messages that are none -------------------------------------------------------------------------------


def bad_trajectories(joints: tuple[str, ...], run: str, rng: random.Random) -> list[dict[str, Any]]:
    """Well typed, and wrong."""
    n = len(joints)

    def point(positions: list[float], velocities: list[float], sec: int, nanosec: int) -> dict[str, Any]:
        return {
            "positions": positions, "velocities": velocities,
            "time_from_start": {"sec": sec, "nanosec": nanosec},
        }  # fmt: skip

    def message(names: list[str], *points: dict[str, Any]) -> dict[str, Any]:
        return {"header": {"frame_id": run}, "joint_names": names, "points": list(points)}

    good = [0.1] * n
    wild = [rng.uniform(-1e6, 1e6) for _ in range(n)]
    return [
        message([], point(good, [], 0, 50_000_000)),
        message(list(joints)),
        message([*joints, "another"], point([*good, 0.0], [], 0, 50_000_000)),
        message(list(joints[1:]), point(good[1:], [], 0, 50_000_000)),
        message(list(joints), point(wild, [], 0, 50_000_000)),
        message(list(joints), point([0.0] * (n - 1), [], 0, 50_000_000)),
        message(list(joints), point(good, [0.0] * 3, 0, 50_000_000)),
        message(list(joints), point(good, [1e3] * n, 0, 50_000_000)),
        message(list(joints), point(good, [0.5] * n, 1, 0)),
        message(list(joints), point(good, [], 0, 0)),
        message(list(joints), point(good, [], -5, 0)),
        message(list(joints), point(good, [], 2**31 - 1, 0)),
        message(list(joints), point([0.0] * 20_000, [], 1, 0)),
        message(["x" * 5000] * n, point(good, [], 1, 0)),
        message(list(joints), *[point(good, [], 0, 1000 * (k + 1)) for k in range(800)]),
        {"joint_names": "no list", "points": 3},
        {"points": [{"positions": ["a"]}]},
    ]


def test_wrong_commands_move_nothing(bench: Bench, stranger: Any) -> None:
    bench.restart()
    bench.evaluation.load(bench.configuration)
    setting, rng = bench.setting, random.Random(1)
    commands = dict.fromkeys((setting.arm.command, setting.hand.command), "trajectory_msgs/JointTrajectory")
    somebody = stranger({**commands, setting.begin: "std_msgs/String"})
    time.sleep(0.5)
    somebody.publish(setting.begin, {"data": "run"})
    time.sleep(0.2)
    before = bench.evaluation.tell()
    assert not before["stopped"]
    for _ in range(12):
        for group in (setting.arm, setting.hand):
            for message in bad_trajectories(group.joints, "run", rng):
                somebody.publish(group.command, message)
                time.sleep(0.005)
    time.sleep(0.5)
    after = bench.evaluation.tell()
    assert after["accepted"] == 0 and after["refused"] > 100
    assert np.allclose(before["position"], after["position"], atol=2e-3)


def test_wrong_states_are_refused_and_the_run_goes_on(bench: Bench, stranger: Any, caplog: Any) -> None:
    """Another publisher writes nonsense on every topic that the engine reads, hundreds of times."""
    bench.restart()
    bench.evaluation.load(bench.configuration)
    setting = bench.setting
    kinds = {
        setting.joint_states: "sensor_msgs/JointState",
        setting.wrench.topic: "geometry_msgs/WrenchStamped",
        setting.tips.topics[0]: "geometry_msgs/WrenchStamped",
        setting.object_topic("cup"): "geometry_msgs/PoseStamped",
    }
    wrong: dict[str, list[Any]] = {
        "sensor_msgs/JointState": [
            {}, {"name": ["a"]}, {"name": ["a", "a"], "position": [0.0, 0.0]},
            {"name": list(setting.wire), "position": [0.0]},
            {"name": [str(i) for i in range(3000)], "position": [0.0] * 3000},
            {"name": list(setting.wire), "position": [1e30] * len(setting.wire)},
        ],
        "geometry_msgs/WrenchStamped": [{}, {"header": {"frame_id": "elsewhere"}}],
        "geometry_msgs/PoseStamped": [{}, {"header": {"frame_id": setting.objects.frame}}],
    }  # fmt: skip
    somebody = stranger(kinds)
    stop = threading.Event()
    sent = []

    def pester() -> None:
        while not stop.wait(0.01):
            for topic, kind in kinds.items():
                somebody.publish(topic, wrong[kind][len(sent) % len(wrong[kind])])
            sent.append(4)

    thread = threading.Thread(target=pester)
    runner, sweep = sweeping(bench.twin.port)
    sweep.lasts = 2.0
    thread.start()
    try:
        with caplog.at_level(logging.WARNING, logger="bt_tasksim.ros"):
            result = runner.run(0)
    finally:
        stop.set()
        thread.join()
        runner.close()
    assert result.status.name == "SUCCESS", result.why
    assert sum(sent) > 300
    said = [r.message for r in caplog.records]
    for topic in kinds:
        assert any(line.startswith(f"{topic}: ") for line in said), said
    assert len(said) < 60  # once a second and topic


def test_pictures_of_a_camera_in_the_cell(bench: Bench, stranger: Any, caplog: Any) -> None:
    """A driver publishes; the newest pair is handed on, a damaged one is not, an old one is an error."""
    bench.restart()
    bench.evaluation.load(bench.configuration)
    topics = bench.setting.cameras["scene"]
    pictures = dict.fromkeys((topics.colour, topics.depth), "sensor_msgs/CompressedImage")
    driver, stop = stranger({topics.info: "sensor_msgs/CameraInfo", **pictures}), threading.Event()
    colour = np.zeros((48, 64, 3), np.uint8)
    colour[10:20, 30:40] = (10, 200, 60)
    depth = np.full((48, 64), 1234, np.uint16)
    damaged: list[str] = []

    def publish() -> None:
        while not stop.wait(0.1):
            now = time.time()
            header = {"stamp": {"sec": int(now), "nanosec": int(now % 1 * 1e9)}, "frame_id": "camera"}
            info = {"header": header, "width": 64, "height": 48, "d": [0.0] * 5}
            driver.publish(topics.info, {**info, "k": [60.0, 0, 32, 0, 60.0, 24, 0, 0, 1]})
            for topic, pixels in ((topics.colour, colour[:, :, ::-1]), (topics.depth, depth)):
                content = cv2.imencode(".png", np.ascontiguousarray(pixels))[1].tobytes()
                data = base64.b64encode(content).decode()
                driver.publish(
                    topic, {"header": header, "format": "png", "data": damaged[0] if damaged else data}
                )

    thread = threading.Thread(target=publish)
    thread.start()
    robot = load_robot("panda")
    options = EngineOptions(engines=f"ros:127.0.0.1:{bench.twin.port}", perception="camera")
    pipeline = build_pipeline(robot, options)
    try:
        engine, cameras = pipeline.physics.engine, pipeline.rendering
        engine.reset(bench.configuration, lambda: None)
        state = engine.state(engine.latest())
        assert state.objects is None  # nothing is tracked where there are pictures
        cameras.reset(bench.configuration)
        image = cameras.render(state, "scene", depth=True)
        assert np.array_equal(image.colour, colour) and np.allclose(image.depth, 1.234)
        assert image.camera.matrix[0, 0] == 60.0 and np.allclose(image.camera.pose, topics.pose)
        with pytest.raises(InputError, match="no camera 'ceiling'"):
            cameras.render(state, "ceiling")
        with caplog.at_level(logging.WARNING, logger="bt_tasksim.ros"):
            damaged.append(base64.b64encode(b"no picture at all").decode())
            time.sleep(0.5)
            assert np.array_equal(cameras.render(state, "scene").colour, colour)
            time.sleep(1.2)
        with pytest.raises(MachineError, match="camera 'scene': the newest picture is"):
            cameras.render(state, "scene")
        assert any("neither PNG nor JPEG" in r.message for r in caplog.records)
    finally:
        stop.set()
        thread.join()
        pipeline.close()


def test_bytes_that_are_no_protocol(bench: Bench) -> None:
    bench.restart()
    rng = random.Random(5)
    for port in (bench.twin.port, bench.twin.evaluation_port):
        for _ in range(40):
            with socket.create_connection(("127.0.0.1", port), 5.0) as line:
                line.sendall(rng.randbytes(rng.randint(1, 3000)) + b"\n")
    questions = [
        b"[]\n",
        b"3\n",
        b'{"do": "fly"}\n',
        b'{"do": "load"}\n',
        b"[" * 100_000 + b"\n",
        b'{"do": 1}\n',
    ]
    questions += [
        json.dumps({"do": "load", "configuration": text}).encode() + b"\n" for text in ("", "{}", "[]")
    ]
    with socket.create_connection(("127.0.0.1", bench.twin.evaluation_port), 5.0) as line:
        line.sendall(questions[0])
        assert not line.makefile("rb").readline(), "who does not know the secret is told nothing"
    for question in questions:
        with socket.create_connection(("127.0.0.1", bench.twin.evaluation_port), 5.0) as line:
            line.sendall(bench.twin.secret.encode() + b"\n" + question)
            assert b"error" in line.makefile("rb").readline(), question
    junk = WebSocket("127.0.0.1", bench.twin.port)
    for text in ("", "{", "[]", "3", '{"op": "fly"}', '{"op": "publish"}', '{"op": "subscribe", "topic": 3}'):
        junk.send(text)
    for _ in range(100):
        junk.send(rng.randbytes(200).decode("latin1"))
    junk.close()
    assert not bench.twin.ended()
    runner, sweep = sweeping(bench.twin.port)
    sweep.lasts = 0.3
    try:
        bench.evaluation.load(bench.configuration)
        assert runner.run(0).status.name == "SUCCESS"
    finally:
        runner.close()


def test_topics_of_objects_end_with_their_world(bench: Bench) -> None:
    def topics(of: list[str]) -> list[str]:
        return [bench.setting.object_topic(name) for name in of]

    for name in ("pick_and_throw", "shelf_to_shelf"):
        configuration = load_source(name).scene.sample(0)
        names = sorted(actor.name for actor in configuration.objects)
        bench.evaluation.load(configuration, 0)
        end = time.monotonic() + 5.0
        while (told := bench.evaluation.tell()["object_topics"]) != topics(names):
            assert time.monotonic() < end, (told, names)
            time.sleep(0.05)


def test_an_object_whose_name_makes_no_topic_is_refused_and_the_world_stays(bench: Bench) -> None:
    there = load_source("pick_and_throw").scene.sample(0)
    bench.evaluation.load(there, 0)
    odd = Scene("panda", objects={"my-cup": "cube on table"}, goal=Goal("my-cup", "table")).sample(0)
    with pytest.raises(MachineError, match="my-cup"):
        bench.evaluation.load(odd, 0)
    truth, _ = bench.evaluation.truth()
    assert truth.objects.shape == (len(there.objects), 7)


def test_a_runner_of_a_robot_is_in_real_time_until_it_is_closed(bench: Bench) -> None:
    usual, frozen = (
        sys.getswitchinterval(),
        gc.get_freeze_count(),
    )  # of a runner that an error keeps open, perhaps
    runner, _ = bench.sweeping()
    try:
        assert sys.getswitchinterval() <= TURNS
        bench.evaluation.load(bench.configuration)
        runner.begin(0)
        assert gc.get_freeze_count() > 0 and runner.context.planner is not None
    finally:
        runner.close()
    assert sys.getswitchinterval() == usual and (frozen > 0 or gc.get_freeze_count() == 0)


def test_a_runner_that_cannot_be_made_leaves_nothing_changed(bench: Bench) -> None:
    usual, scene = sys.getswitchinterval(), load_source("pick_and_throw").scene
    options = EngineOptions(engines=f"ros:127.0.0.1:{bench.twin.port}")
    with pytest.raises(InputError):
        Runner(lambda: "no tree", scene, options)
    assert sys.getswitchinterval() == usual
