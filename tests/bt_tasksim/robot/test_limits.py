"""The section `safety` of a robot's file: what it says by itself, and what is refused."""

import copy

import numpy as np
import pytest
import yaml

from bt_tasksim.core.document import Document
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.typed_file import validate
from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics
from bt_tasksim.robot.description import load_robot
from bt_tasksim.robot.limits import REACTION, read_limits
from bt_tasksim.robot.schema import ArmEntry, SafetyEntry

ARM = {
    "joints": ["a", "b"], "lower": [-1, -2], "upper": [1, 2], "velocity": [2, 3], "acceleration": [10, 20],
    "rest": [0, 0], "drive": {"stiffness": 1, "damping": 1, "force_limit": 1},
}  # fmt: skip
SECTION = {
    "tool_velocity": {"linear": 1.0, "angular": 2.0},
    "tool_acceleration": {"linear": 10.0, "angular": 20.0},
    "workspace": {"lower": [-1, -1, 0], "upper": [1, 1, 1]},
    "wrench": {"force": 50, "torque": 5},
    "tracking": {"limit": 0.3},
}


def limits_of(data):
    arm = validate(ArmEntry, Document("arm", ARM))
    return read_limits(validate(SafetyEntry, Document("safety", data)), arm)


def section(**changes):
    out = copy.deepcopy(SECTION)
    for path, value in changes.items():
        name, _, key = path.partition("__")
        out[name] = {**out.get(name, {}), key: value} if key else value
    return out


@pytest.mark.parametrize("name", ["panda", "so100", "xarm7_ability"])
def test_every_bundled_robot_has_limits_within_its_own(name):
    robot = load_robot(name)
    limits = robot.safety
    assert np.all(limits.lower >= robot.arm_lower) and np.all(limits.upper <= robot.arm_upper)
    assert np.all(limits.velocity <= robot.arm_velocity)
    assert max(limits.stale, limits.validity, limits.watchdog) < REACTION
    at_rest = PinocchioKinematics(robot).forward(robot.rest)[:3]
    assert np.all(limits.workspace[0] < at_rest) and np.all(at_rest < limits.workspace[1])


def test_what_is_not_said_follows_from_the_arm():
    limits = limits_of(SECTION)
    np.testing.assert_array_equal(limits.lower, [-1, -2])
    np.testing.assert_array_equal(limits.velocity, [2, 3])
    np.testing.assert_allclose(limits.step, [0.2, 0.3])
    assert (limits.stale, limits.validity, limits.watchdog) == (0.1, 0.15, 0.15)
    assert not any(limits.clips(name) for name in limits.policies), "every limit stops unless it says clip"


def test_what_is_said_counts():
    limits = limits_of(
        section(
            joint_velocity__limit=[1, 1], joint_acceleration__policy="clip", joint_position__upper=[0.5, 1],
            step__limit=[0.1, 0.1], timing__stale=0.05,
        )
    )  # fmt: skip
    np.testing.assert_array_equal(limits.velocity, [1, 1])
    np.testing.assert_array_equal(limits.upper, [0.5, 1])
    np.testing.assert_array_equal(limits.lower, [-1, -2])
    np.testing.assert_array_equal(limits.step, [0.1, 0.1])
    assert limits.clips("joint_acceleration") and not limits.clips("joint_velocity")
    assert limits.stale == 0.05


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"wrench": {"force": 50}}, "'wrench.torque' is missing"),
        ({"wrench__forse": 50}, "unknown field 'wrench.forse'; did you mean 'force'"),
        ({"tool_velocity__linear": -1}, "'tool_velocity.linear' should be positive, found -1"),
        ({"tool_velocity__linear": "fast"}, "'tool_velocity.linear' should be a number, found 'fast'"),
        ({"joint_velocity__limit": [1]}, "'safety.joint_velocity.limit' should be 2 numbers"),
        ({"joint_velocity__limit": [1, 4]}, "'safety.joint_velocity.limit' is wider than the arm's own"),
        ({"joint_position__lower": [-1.5, 0]}, "lower' is wider than the arm's own limit for joint 1"),
        ({"joint_position__lower": [0, 0], "joint_position__upper": [0, 1]}, "lower' is not below"),
        ({"step__limit": [0, 1]}, "'step.limit[0]' should be positive"),
        ({"workspace__lower": [2, 0, 0]}, "'safety.workspace.lower' is not below"),
        ({"wrench__policy": "clip"}, "'safety.wrench.policy' can only be 'stop'; joint_position"),
        ({"joint_velocity__policy": "slow"}, "policy' should be 'stop' or 'clip', found 'slow'"),
        ({"timing__validity": 0.5}, "'safety.timing.validity' should be at most 0.2 s, found 0.5"),
        ({"timing__stail": 0.1}, "unknown field 'timing.stail'; did you mean 'stale'"),
    ],
)  # fmt: skip
def test_bad_limits_are_refused(changes, sentence):
    with pytest.raises(InputError) as error:
        limits_of(section(**changes))
    assert sentence in str(error.value)


def test_a_robot_file_names_itself(tmp_path):
    source = load_robot("panda").source
    data = yaml.safe_load(source.read_text())
    data["safety"]["workspace"]["lower"] = [0, 0]
    file = tmp_path / "mine.yaml"
    file.write_text(yaml.safe_dump(data))
    with pytest.raises(InputError, match=r"mine.yaml', line \d+: 'safety.workspace.lower' should be 3"):
        load_robot(str(file))
    del data["safety"]
    file.write_text(yaml.safe_dump(data))
    assert load_robot(str(file)).safety is None, "in simulation nobody needs them"
