"""The ROS side of a robot's cell, and sentences on what is wrong in its file."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import pytest
import yaml

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.resources import asset
from bt_tasksim.hardware.ros.address import parse_ros
from bt_tasksim.hardware.ros.setting import load_setting
from bt_tasksim.robot.description import load_robot

PANDA = load_robot("panda")
GOOD = yaml.safe_load(asset("robots", "ros", "panda.yaml").read_text())


def written(folder: Path, **changes: Any) -> str:
    data = copy.deepcopy(GOOD)
    for path, value in changes.items():
        *keys, last = path.split("__")
        inner = data
        for key in keys:
            inner = inner[key]
        if value is None:
            del inner[last]
        else:
            inner[last] = value
    file = folder / "cell.yaml"
    file.write_text(yaml.safe_dump(data))
    return str(file)


@pytest.mark.parametrize("path", sorted(asset("robots", "ros").glob("*.yaml")), ids=lambda p: p.stem)
def test_bundled_files_are_good(path: Path) -> None:
    robot = load_robot(path.stem)
    setting = load_setting(robot)
    assert len(setting.order) == len(robot.joints)
    assert setting.object_topic("cup") == "/objects/cup/pose"


def test_the_order_on_the_wire_is_of_its_own(tmp_path: Path) -> None:
    wire = [*reversed(GOOD["joint_states"]["joints"]), "head"]
    setting = load_setting(PANDA, written(tmp_path, joint_states__joints=wire))
    assert [setting.wire[i] for i in setting.order] == list(PANDA.joints)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"robot": "so100"}, "for robot 'so100', and the robot is 'panda'"),
        ({"wrench": None}, "'wrench' is missing"),
        ({"emergency_stop": {"topic": "/stop"}}, "'emergency_stop.every' is missing"),
        ({"emergency_stop": {"topic": "/stop", "every": 0}}, "emergency_stop.every"),
        ({"begin": None}, "'hold' needs 'begin' beside it"),
        ({"wrenhc": 1}, "unknown field 'wrenhc'; did you mean 'wrench'"),
        ({"arm__joints": ["panda_joint1"]}, "7 joints of the robot's arm"),
        ({"joint_states__joints": ["panda_joint1"] * 2}, "names a joint twice"),
        ({"arm__joints": [f"panda_joint{i}" for i in (1, 2, 3, 4, 5, 6, 8)]}, "'panda_joint8'.*lacks"),
        (
            {"arm__joints": [f"panda_joint{i}" for i in (2, 1, 3, 4, 5, 6, 7)]},
            "the robot's joints in another order, 'panda_joint2' where 'panda_joint1' should be",
        ),
        ({"hand__joints": ["panda_finger_joint2", "panda_finger_joint1"]}, "'hand.joints' has the robot's"),
        ({"arm__command": "arm controller"}, "line 3: 'arm.command' should be a topic"),
        ({"hold": "/begin"}, "the topic '/begin' is named twice"),
        ({"approach": 3}, "'approach' should be at most 1"),
        ({"approach": "fast"}, "'approach' should be a number"),
        ({"tips__topics__left": None}, "'tips.topics.left' is missing"),
        ({"tips": {"effort": -1}}, "'tips.effort' should be positive"),
        ({"objects__topic": "/objects"}, r"should hold .\{name\}. once"),
        ({"cameras__scene__pose": [0, 0, 0, 1, 1, 0, 0]}, "unit quaternion"),
        ({"wrench__frame": 3}, "'wrench.frame' should be text"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, changes: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        load_setting(PANDA, written(tmp_path, **changes))


def test_files_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no file .nowhere\.yaml."):
        load_setting(PANDA, "nowhere.yaml")
    (tmp_path / "list.yaml").write_text("- a\n")
    with pytest.raises(InputError, match="should be a mapping"):
        load_setting(PANDA, str(tmp_path / "list.yaml"))
    (tmp_path / "no.yaml").write_text("a: [")
    with pytest.raises(InputError, match="line 2: not YAML"):
        load_setting(PANDA, str(tmp_path / "no.yaml"))
    with pytest.raises(InputError, match=r"no file says how 'so100' speaks ROS.*docs/connect_a_robot.md"):
        load_setting(load_robot("so100"))


def test_a_cell_without_tracking(tmp_path: Path) -> None:
    setting = load_setting(PANDA, written(tmp_path, objects=None, begin=None, hold=None, cameras=None))
    assert setting.begin == setting.hold == "" and not setting.cameras
    with pytest.raises(InputError, match="use --perception camera"):
        setting.object_topic("cup")


def test_addresses() -> None:
    assert str(parse_ros("ros:192.0.2.10:9090")) == "192.0.2.10:9090"
    for bad in ("ros:", "ros:9090", "ros:host", "ros:host:0", "ros:ho st:1", "ros:host:99999"):
        with pytest.raises(InputError, match="ros:"):
            parse_ros(bad)
