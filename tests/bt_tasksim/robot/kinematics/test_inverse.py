"""Postures that are asked for: come to exactly, taken as they are beside what cannot be reached, or not."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.robot.description import load_robot
from bt_tasksim.robot.kinematics.chain import Chain, poses_of
from bt_tasksim.robot.kinematics.failures import Reach
from bt_tasksim.robot.kinematics.inverse import InverseKinematics, Postures
from bt_tasksim.robot.kinematics.models import arm_model, full_model

PANDA = load_robot("panda")


@cache
def panda() -> InverseKinematics:
    full, _ = full_model(PANDA)
    return InverseKinematics(PANDA, arm_model(PANDA, full), np.zeros(1))


def tools(joints: Array) -> Array:
    """Poses ``(N, 7)`` of the tool at joints ``(N, 7)``."""
    chain: Chain = panda().chain
    found: Array = poses_of(chain.seen(joints.T)[0])
    return found


def placements(pose: Array) -> Array:
    """``(3, 4, N)`` of poses ``(N, 7)``."""
    matrix = np.concatenate([poses.to_matrix(pose[:, 3:]), pose[:, :3, None]], axis=-1)
    return np.moveaxis(matrix, 0, -1)


def near(goal: Array, last: Array, posture: Array | None) -> Postures:
    """For rows ``(N, 7)``."""
    kinematics = panda()
    asked = None if posture is None else posture.T
    return kinematics.near(placements(goal), last.T, kinematics.chain.seen(last.T), asked)


def stretched() -> Array:
    """Joints of an arm that is stretched out: its tool can go no farther from its shoulder."""
    return np.array([0.0, np.pi / 2, 0.0, -0.462, 0.0, 2.9588, np.pi / 4])


def beyond(metres: float) -> Array:
    """A pose ``(7,)`` so far beyond where the stretched arm's tool is, seen from its shoulder."""
    tool = tools(stretched()[None])[0]
    out = tool[:3] - np.array([0.0, 0.0, 0.333])
    return poses.shifted(tool, metres * out / np.linalg.norm(out))


def test_a_pose_that_can_be_reached_is_whatever_posture_is_asked_for() -> None:
    rng = np.random.default_rng(0)
    asked = PANDA.rest + rng.normal(scale=0.2, size=(30, 7))
    goal = tools(asked)
    goal[:, :3] += rng.uniform(-0.007, 0.007, (30, 3))  # no farther than from what is taken as it is
    found = near(goal, np.tile(PANDA.rest, (30, 1)), asked)
    assert not found.code.any()
    there = tools(found.q.T)
    assert np.linalg.norm(there[:, :3] - goal[:, :3], axis=1).max() < 1e-4
    assert poses.angle_between(there[:, 3:], goal[:, 3:]).max() < 1e-4
    assert np.abs(found.q.T - asked).max() < 0.1


@pytest.mark.parametrize("metres", [0.006, 0.012])
def test_a_posture_beside_a_pose_that_cannot_be_reached_is_taken_as_it_is(metres: float) -> None:
    goal, last = beyond(metres)[None], stretched()[None] + 0.02
    alone = near(goal, last, None)
    assert alone.code[0] == Reach.UNREACHABLE and alone.distance[0] > 1e-3
    found = near(goal, last, stretched()[None])
    assert found.code[0] == Reach.REACHED
    np.testing.assert_array_equal(found.q[:, 0], stretched())
    np.testing.assert_array_equal(found.seen, panda().chain.seen(found.q))


def test_farther_off_it_cannot_be_reached() -> None:
    goal, last = beyond(0.04)[None], stretched()[None]
    found = near(goal, last, stretched()[None])
    assert found.code[0] == Reach.UNREACHABLE and 0.03 < found.distance[0] < 0.045


def test_turned_too_far_it_cannot_be_reached_either() -> None:
    goal, last = beyond(0.012)[None], stretched()[None]
    goal[:, 3:] = poses.quat_multiply(goal[:, 3:], poses.from_rotation_vector(np.array([0.0, 0.1, 0.0])))
    assert near(goal, last, stretched()[None]).code[0] != Reach.REACHED


def test_rows_that_ask_for_none_and_rows_that_do_are_solved_as_alone() -> None:
    far, close, easy = beyond(0.3), beyond(0.01), tools(PANDA.rest[None])[0]
    goal = np.array([close, far, easy, close, easy, far])
    last = np.array([stretched(), stretched(), PANDA.rest + 0.02, stretched(), PANDA.rest, stretched()])
    asked = np.array([stretched(), stretched(), PANDA.rest, np.full(7, np.nan), np.full(7, np.nan), last[0]])
    whole = near(goal, last, asked)
    R, U = Reach.REACHED, Reach.UNREACHABLE
    assert whole.code.tolist() == [R, U, R, U, R, U]
    for k in range(len(goal)):
        alone = near(goal[k : k + 1], last[k : k + 1], asked[k : k + 1])
        np.testing.assert_array_equal(alone.q[:, 0], whole.q[:, k])
        assert alone.code[0] == whole.code[k] and alone.distance[0] == whole.distance[k]


class Slow:
    """A chain for which every look at where its joints are takes a millisecond of a clock."""

    def __init__(self, chain: Chain) -> None:
        self._chain, self.now = chain, 0.0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._chain, name)

    def seen(self, joints: Array) -> Array:
        self.now += 0.001
        return self._chain.seen(joints)


def test_the_patience_of_a_call_is_for_all_that_it_tries(monkeypatch: pytest.MonkeyPatch) -> None:
    full, _ = full_model(PANDA)
    kinematics = InverseKinematics(PANDA, arm_model(PANDA, full), np.zeros(1), patience=0.03)
    kinematics.chain = slow = Slow(kinematics.chain)
    monkeypatch.setattr("bt_tasksim.robot.kinematics.inverse.time.monotonic", lambda: slow.now)
    last = stretched()[:, None]
    found = kinematics.near(placements(beyond(2.0)[None]), last, kinematics.chain.seen(last))
    assert found.code[0] == Reach.UNREACHABLE and 1.9 < found.distance[0] < 2.1
    assert slow.now < 0.04
