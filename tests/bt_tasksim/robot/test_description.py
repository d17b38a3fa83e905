"""Robot files: the bundled ones agree with ManiSkill's agents and the URDFs; a bad one is said plainly."""

from __future__ import annotations

import importlib
import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.resources import asset
from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics
from bt_tasksim.robot.description import RobotDescription, load_robot
from bt_tasksim.scene import Scene

ROBOTS = ["panda", "panda_wristcam", "xarm7_ability", "so100"]
AGENTS = {
    "panda": ("mani_skill.agents.robots.panda.panda", "Panda"),
    "panda_wristcam": ("mani_skill.agents.robots.panda.panda_wristcam", "PandaWristCam"),
    "xarm7_ability": ("mani_skill.agents.robots.xarm.xarm7_ability", "XArm7Ability"),
    "so100": ("mani_skill.agents.robots.so100.so_100", "SO100"),
}


def joints_of(robot: RobotDescription) -> dict[str, ET.Element]:
    return {j.get("name", ""): j for j in ET.parse(robot.urdf).getroot().findall("joint")}


def all_open(robot: RobotDescription) -> np.ndarray:
    return np.concatenate([robot.rest, robot.hand_open])


@pytest.mark.parametrize("name", ROBOTS)
def test_limits_are_those_of_the_urdf(name: str) -> None:
    robot = load_robot(name)
    joints = joints_of(robot)
    for i, joint in enumerate(robot.arm_joints):
        limit = joints[joint].find("limit")
        assert limit is not None
        assert robot.arm_lower[i] == pytest.approx(float(limit.get("lower", "nan")), abs=1e-4)
        assert robot.arm_upper[i] == pytest.approx(float(limit.get("upper", "nan")), abs=1e-4)
        if float(limit.get("velocity", "0")) > 0.0:
            assert robot.arm_velocity[i] <= float(limit.get("velocity", "nan")) + 1e-6


@pytest.mark.parametrize("name", ROBOTS)
def test_hand_stays_within_the_urdfs_limits_and_mimics(name: str) -> None:
    robot = load_robot(name)
    joints = joints_of(robot)
    commands = [np.zeros(1 + len(robot.synergies)), np.eye(1 + len(robot.synergies))[0]]
    commands += [
        np.array([c, *row]) for c in (0.0, 0.4, 1.0) for row in np.eye(len(robot.synergies)).tolist()
    ]
    for command in commands:
        position = dict(zip(robot.hand_joints, robot.hand_position(command).tolist(), strict=True))
        for joint, value in position.items():
            limit, mimic = joints[joint].find("limit"), joints[joint].find("mimic")
            assert limit is not None
            assert float(limit.get("lower", "0")) - 1e-6 <= value <= float(limit.get("upper", "0")) + 1e-6
            if mimic is not None:
                led = position[mimic.get("joint", "")] * float(mimic.get("multiplier", "1"))
                assert value == pytest.approx(led + float(mimic.get("offset", "0")), abs=1e-6)


@pytest.mark.parametrize("name", ROBOTS)
def test_agrees_with_maniskills_agent(name: str) -> None:
    module, cls = AGENTS[name]
    try:
        agent: Any = getattr(importlib.import_module(module), cls)
    except ImportError as error:
        pytest.skip(f"mani_skill does not load here: {error}")
    robot = load_robot(name)
    assert Path(agent.urdf_path).resolve() == robot.urdf.resolve()
    assert agent.uid == robot.name
    if name.startswith("panda"):
        assert tuple(agent.arm_joint_names) == robot.arm_joints
        assert tuple(agent.gripper_joint_names) == robot.hand_joints
        assert agent.ee_link_name == robot.tool_link
        assert (robot.arm_drive.stiffness, robot.arm_drive.damping) == (
            agent.arm_stiffness,
            agent.arm_damping,
        )
        assert robot.arm_drive.force_limit == agent.arm_force_limit
        assert robot.hand_drive.stiffness == agent.gripper_stiffness
        assert robot.hand_drive.damping == agent.gripper_damping
        # On purpose: the real hand presses with 30 to 70 N, ManiSkill's with up to 100 N.
        assert 30.0 <= robot.hand_drive.force_limit <= 70.0 < agent.gripper_force_limit
    if name == "so100":
        assert tuple(agent.arm_joint_names) == robot.arm_joints
        assert tuple(agent.gripper_joint_names) == robot.hand_joints


def test_pandas_tool_lies_midway_between_its_fingertips() -> None:
    robot = load_robot("panda")
    kinematics = PinocchioKinematics(robot)
    for hand in (robot.hand_open, robot.hand_closed, np.array([0.02, 0.02])):
        joints = np.concatenate([robot.rest, hand])
        tips = kinematics.tips(joints)
        tool = kinematics.forward(robot.rest)
        np.testing.assert_allclose(tips.mean(axis=0), tool[:3], atol=1e-4)
        across = poses.rotate(tool[3:], np.array([0.0, 1.0, 0.0]))
        np.testing.assert_allclose(abs((tips[1] - tips[0]) @ across), 2 * hand[0], atol=1e-6)


def test_ability_hands_thumb_opposes_its_fingers() -> None:
    robot = load_robot("xarm7_ability")
    kinematics = PinocchioKinematics(robot)
    tool = poses.inverse(kinematics.forward(robot.rest))
    gaps = []
    for closure in np.linspace(0.0, 1.0, 11):
        hand = robot.hand_position(np.array([closure]))
        tips = poses.transform(tool, kinematics.tips(np.concatenate([robot.rest, hand])))
        thumb, fingers = tips[0], tips[1:3].mean(axis=0)
        gaps.append(float(np.linalg.norm(fingers - thumb)))
        if 0.035 < gaps[-1] < 0.085:  # where it holds things: about the tool's origin, along its y
            assert (fingers - thumb)[1] / gaps[-1] > 0.95
            assert np.linalg.norm((fingers + thumb)[1:] / 2) < 0.005
        assert np.all(np.abs(tips[:, 0]) < 0.045)
        assert np.all(tips[:, 2] < 0.01)
    assert gaps[0] >= robot.opening
    assert gaps[-1] < 0.02
    assert np.all(np.diff(gaps) < 0.0)


def test_closure_is_read_back_from_joint_positions() -> None:
    for name in ROBOTS:
        robot = load_robot(name)
        for closure in (0.0, 0.3, 1.0):
            assert robot.closure(robot.hand_position(np.array([closure]))) == pytest.approx(closure)


def test_hand_commands_are_batched() -> None:
    robot = load_robot("xarm7_ability")
    commands = np.random.default_rng(0).uniform(0, 1, (4, 2, 3))
    batch = robot.hand_position(commands)
    assert batch.shape == (4, 2, 10)
    np.testing.assert_allclose(batch[2, 1], robot.hand_position(commands[2, 1]))


def test_drive_arrays_are_in_joint_order() -> None:
    robot = load_robot("xarm7_ability")
    limits = robot.drive_array("force_limit")
    assert limits.shape == (len(robot.joints),)
    by_name = dict(zip(robot.joints, limits, strict=True))
    assert by_name["joint1"] == 500.0
    assert by_name["thumb_q2"] == 2.5 * by_name["index_q1"]


BAD: list[tuple[str, Any, str]] = [
    ("arm.lower", [0, 1], "'arm.lower' should be 7 numbers"),
    ("arm.lower", [0, 0, 0, 0, 0, 0, float("nan")], "'arm.lower[6]'"),
    ("arm.upper", [-3.0] * 7, "not below"),
    ("arm.rest", [9.0] * 7, "'arm.rest' is not within"),
    ("arm.velocity", [0.0] * 7, "should be positive"),
    ("arm.joints", "panda_joint1", "'arm.joints' should be a list"),
    ("arm.drive", {"stifness": 1, "damping": 1, "force_limit": 1}, "did you mean 'stiffness'"),
    ("arm.drive", {"stiffness": 1, "damping": 1}, "'arm.drive.force_limit' is missing"),
    ("hand.speed", "fast", "'hand.speed' should be a number"),
    ("hand.closed", [0.04, 0.04], "are the same"),
    ("hand.press", -1, "'hand.press' should not be negative"),
    ("hand.press", 1e9, "'hand.press' should be at most"),
    ("hand.press", "hard", "'hand.press' should be a number"),
    ("hand.open", [0.04, 0.3], "'hand.open' puts joint 'panda_finger_joint2' at 0.3"),
    ("hand.closed", [-0.02, 0.0], "from 0 to 0.04"),
    ("hand.synergies", {"spread": [1]}, "'hand.synergies.spread' should be 2 numbers"),
    ("hand.drive_scale", {"thumb": 2}, "'hand.drive_scale' names 'thumb'"),
    ("tool.pose", [0, 0, 0, 1, 1, 0, 0], "unit quaternion"),
    ("tool.lnk", "x", "unknown field 'tool.lnk'; did you mean 'link'"),
    ("opposition", [[0], [5]], "'opposition' names tip 5 of 2"),
    ("opposition", [[0, 1]], "'opposition' should have at least 2"),
    ("task_mask", [0, 0, 0, 0, 0, 0], "task_mask"),
    ("urdf", "nowhere.urdf", "no URDF at"),
    ("urdf", "no_such_package:a.urdf", "not installed"),
    ("pads", 3, "'pads' should be a mapping"),
    ("arm.drive", {"stiffness": -1, "damping": 1, "force_limit": 1}, "'arm.drive.stiffness'"),
    ("hand.drive", {"stiffness": 1, "damping": 1, "force_limit": float("inf")}, "'hand.drive.force_limit'"),
    ("pads.surface.friction", -1.2, "'pads.surface.friction' should not be negative"),
    ("arm.velocity", [-1.0] * 7, "'arm.velocity[0]' should be positive"),
    ("tips", [{"name": "a", "links": ["b"], "point": [0, 0, 1e12]}], "'tips[0].point[2]'"),
    ("tool.closing", [0, 0, 0], "'tool.closing' should be a direction"),
    ("tool.closing", [0, 0, 1], "'tool.closing' is parallel to the approach"),
    ("tool.closing", [0.001, 0, -2], "'tool.closing' is parallel to the approach"),
    ("arm.lower", [-166, *[-1.7] * 2, -3, -2, 0, -2], "'arm.lower' puts joint 'panda_joint1' at -166"),
    ("arm.upper", [2.8, 1.7, 2.8, 0.5, 2.8, 3.7, 2.8], "at 0.5, and its URDF lets it go from -3.0718"),
    ("arm.velocity", [2, 2, 2, 60, 2, 2, 2], "'arm.velocity' lets joint 'panda_joint4' move at 60"),
    ("arm.joints", [f"panda_joint{i}" for i in (2, 1, 3, 4, 5, 6, 7)], "from the base on: panda_joint1"),
    ("solver_iterations", 10**9, "'solver_iterations' should be at most"),
    ("name", "pan/da", "'name' should hold no '/'"),
    ("urdf", "/etc/passwd", "should lie in the folder"),
    ("urdf", "../a.urdf", "should lie in the folder"),
    ("urdf", "mani_skill:../../a.urdf", "should lie in the folder"),
    ("urdf", "os.path:a.urdf", "not installed"),
    ("cameras", {"a": {"position": [0, 0, 0]}}, "'cameras.a.look_at' is missing"),
    ("envelope", [{"position": [0, 0, 0]}], "'envelope[0].size' is missing"),
]


@pytest.mark.parametrize(("key", "value", "says"), BAD, ids=[f"{k}-{s[:20]}" for k, _, s in BAD])
def test_bad_robot_file(tmp_path: Path, key: str, value: Any, says: str) -> None:
    data = yaml.safe_load(asset("robots", "panda.yaml").read_text())
    *groups, last = key.split(".")
    target = data
    for group in groups:
        target = target[group]
    target[last] = value
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(InputError) as error:
        load_robot(str(path))
    assert says in str(error.value)
    assert re.search(r"mine\.yaml', line \d+: ", str(error.value)) and "\n" not in str(error.value)


def test_a_faster_motor_than_the_urdfs_is_taken(tmp_path: Path) -> None:
    data = yaml.safe_load(asset("robots", "panda.yaml").read_text())
    data["arm"]["velocity"] = [9.0] * 7
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(data))
    assert load_robot(str(path)).arm_velocity.tolist() == [9.0] * 7


def test_the_line_is_that_of_the_field(tmp_path: Path) -> None:
    text = asset("robots", "panda.yaml").read_text()
    path = tmp_path / "mine.yaml"
    path.write_text(text.replace("speed: 2.5", "speeed: 2.5"))
    line = 1 + text[: text.index("speed: 2.5")].count("\n")
    with pytest.raises(InputError, match=f"mine.yaml', line {line}: unknown field 'hand.speeed'.*'speed'"):
        load_robot(str(path))


def test_a_relative_path_serves_from_every_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "robots").mkdir()
    (tmp_path / "robots" / "mine.yaml").write_text(asset("robots", "panda.yaml").read_text())
    monkeypatch.chdir(tmp_path)
    drawn = Scene("robots/mine.yaml").sample(0)
    monkeypatch.chdir("/")
    assert load_robot(drawn.robot).source == tmp_path / "robots" / "mine.yaml"


def test_a_changed_file_is_read_anew(tmp_path: Path) -> None:
    path, text = tmp_path / "mine.yaml", asset("robots", "panda.yaml").read_text()
    path.write_text(text)
    assert load_robot(str(path)).hand_speed == 2.5
    path.write_text(text.replace("speed: 2.5", "speed: 1.25"))
    assert load_robot(str(path)).hand_speed == 1.25


def test_a_hand_presses_where_its_file_says_so(tmp_path: Path) -> None:
    assert {name: load_robot(name).hand_press for name in ROBOTS} == {
        "panda": 30.0,
        "panda_wristcam": 30.0,
        "xarm7_ability": 0.0,
        "so100": 0.0,
    }
    for name in ROBOTS:
        robot = load_robot(name)
        assert robot.hand_press <= robot.drive_array("force_limit")[len(robot.arm_joints) :].min()
    path, text = tmp_path / "mine.yaml", asset("robots", "panda.yaml").read_text()
    path.write_text(text.replace("press: 30", "press: 12.5"))
    assert load_robot(str(path)).hand_press == 12.5
    path.write_text(text.replace("press: 30", ""))
    assert load_robot(str(path)).hand_press == 0.0


def test_five_joints_need_a_mask(tmp_path: Path) -> None:
    data = yaml.safe_load(asset("robots", "so100.yaml").read_text())
    del data["task_mask"]
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(InputError, match="set some of 'task_mask' to 0"):
        load_robot(str(path))


@pytest.mark.parametrize(
    "text", ["", "- a", "name: [", "name: x", "a: &a [*a]", "[" * 3000, "name: x\nname: x", "{<<: 3}"]
)
def test_not_a_robot_file(tmp_path: Path, text: str) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=r"mine\.yaml"):
        load_robot(str(path))


def test_unknown_robot() -> None:
    with pytest.raises(InputError, match="did you mean 'panda'"):
        load_robot("pnada")
    with pytest.raises(InputError, match="no robot file"):
        load_robot("mine.yaml")


WRONG_FOR_URDF: list[tuple[str, Any, str]] = [
    ("base_link", "panda_link00", "no link 'panda_link00'; did you mean 'panda_link0'"),
    ("base_link", "panda_hand", "moves with a joint"),
    ("wrist_link", "wrist", "no link 'wrist'"),
    ("hand.joints", ["panda_finger_joint1", "panda_finger_joint3"], "no joint 'panda_finger_joint3'"),
]


@pytest.mark.parametrize(("key", "value", "says"), WRONG_FOR_URDF)
def test_file_that_does_not_fit_its_urdf(tmp_path: Path, key: str, value: Any, says: str) -> None:
    data = yaml.safe_load(asset("robots", "panda.yaml").read_text())
    *groups, last = key.split(".")
    target = data[groups[0]] if groups else data
    target[last] = value
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(InputError) as error:
        PinocchioKinematics(load_robot(str(path)))
    assert says in str(error.value)


def test_unreadable_urdf_is_one_sentence(tmp_path: Path) -> None:
    data = yaml.safe_load(asset("robots", "panda.yaml").read_text())
    (tmp_path / "broken.urdf").write_text("<robot")
    data["urdf"] = "broken.urdf"
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(data))
    with pytest.raises(InputError, match="URDF"):
        PinocchioKinematics(load_robot(str(path)))
