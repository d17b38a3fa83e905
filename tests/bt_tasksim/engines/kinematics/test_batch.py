"""Many worlds at once: each as if it were alone, bit by bit, in any order, number type and library."""

from __future__ import annotations

import itertools
from functools import cache

import numpy as np
import pytest

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError, UnreachableError
from bt_tasksim.core.poses import Array, host
from bt_tasksim.core.world import Command, WorldState
from bt_tasksim.engines.kinematics.batch import BatchKinematics, Solution
from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics
from bt_tasksim.robot.description import load_robot
from bt_tasksim.robot.kinematics import inverse
from bt_tasksim.robot.kinematics.failures import Reach
from tests.array_libraries import LIBRARIES

STEPS, WORLDS = 12, 65


def batch(name: str, n: int, like: Array | None = None) -> BatchKinematics:
    return BatchKinematics.of(load_robot(name), n, like)


@cache
def story(name: str) -> tuple[Array, Array, Array]:
    """Joints ``(worlds, n)`` to begin at, tool poses ``(steps, worlds, 7)`` and hands, some still unasked.

    Some worlds hold still, some jump (beyond the speed limits), and some ask for what is out of reach.
    """
    robot, rng = load_robot(name), np.random.default_rng(7)
    hands = 1 + len(robot.synergies)
    joints = np.tile(np.concatenate([robot.rest, robot.hand_open]), (WORLDS, 1))
    joints[:, : len(robot.rest)] += rng.normal(scale=0.05, size=(WORLDS, len(robot.rest)))
    begin = batch(name, WORLDS).tool_pose(joints)
    goal = begin.copy()
    goal[:, :3] += rng.uniform(-0.03, 0.03, (WORLDS, 3))
    turn = poses.from_rotation_vector(rng.uniform(-0.15, 0.15, (WORLDS, 3)))
    goal[:, 3:] = poses.quat_multiply(turn, goal[:, 3:])
    goal[5, 0] += 2.0
    share = np.linspace(0.0, 1.0, STEPS)[:, None] * np.ones(WORLDS)
    share[:, ::7] = np.round(share[:, ::7])
    share[:, 1::9] = 0.0
    tool = np.stack([poses.interpolate(begin, goal, f) for f in share])
    tool[:, 5] = np.where(share[:, 5, None] > 0.85, goal[5], begin[5])
    tool[:3, ::5] = np.nan
    hand = rng.uniform(0.0, 1.0, (STEPS, WORLDS, hands))
    hand[:4, ::4] = np.nan
    hand[6:] = hand[6]
    return joints, tool, hand


def follow(name: str, worlds: list[int], like: Array | None = None) -> list[Solution]:
    joints, tool, hand = story(name)
    kinematics = batch(name, len(worlds), like)
    out = []
    for t, h in zip(tool[:, worlds], hand[:, worlds], strict=True):
        asked = [poses.constant(x, like) if like is not None else x for x in (t, h, joints[worlds])]
        out.append(kinematics.track(*asked))
    return out


def numbers(solutions: list[Solution]) -> Array:
    """All that a world gets ``(worlds, ...)``."""
    parts = [
        np.concatenate(
            [
                s.target.position,
                s.target.velocity,
                np.stack([s.failures.code, s.failures.distance, s.failures.angle], axis=1),
            ],
            axis=1,
        )
        for s in solutions
    ]
    return np.stack(parts, axis=1)


@cache
def together(name: str) -> Array:
    return numbers(follow(name, list(range(WORLDS))))


@pytest.mark.parametrize("name", ["panda", "xarm7_ability", "so100"])
def test_a_world_does_not_feel_its_neighbours(name: str) -> None:
    whole = together(name)
    shuffled = np.random.default_rng(0).permutation(WORLDS).tolist()
    np.testing.assert_array_equal(numbers(follow(name, shuffled)), whole[shuffled])
    for worlds in ([0], [5], [7], [14, 5], [3, 60], [21, 1, 5], list(range(64)), shuffled[:64]):
        np.testing.assert_array_equal(numbers(follow(name, worlds)), whole[worlds])


def test_one_world_is_the_case_of_one() -> None:
    joints, tool, hand = story("panda")
    engine, whole = PinocchioKinematics(load_robot("panda")), together("panda")
    n = joints.shape[1]
    zero = np.zeros(n)
    for world in (1, 2, 5, 7):
        engine.batch.restart(np.array([0]), np.array([20.0]))
        for step in range(STEPS):
            parts = [None if np.isnan(x[0]) else x for x in (tool[step, world], hand[step, world])]
            state = WorldState(0.0, joints[world], zero, zero, None, None, None, None)
            if whole[world, step, 2 * n]:
                with pytest.raises(UnreachableError) as error:
                    engine.solve(Command(*parts), state)
                assert error.value.distance == whole[world, step, 2 * n + 1]
                continue
            target = engine.solve(Command(*parts), state)
            np.testing.assert_array_equal(target.position, whole[world, step, :n])
            np.testing.assert_array_equal(target.velocity, whole[world, step, n : 2 * n])


def test_worlds_begin_anew_and_are_asked_apart() -> None:
    """The rows of a call are those that it names; a reset of some leaves the others where they are."""
    joints, tool, hand = story("panda")
    whole, n = together("panda"), joints.shape[1]
    kinematics = batch("panda", 4)
    worlds, age = np.array([2, 3, 7, 10]), np.zeros(4, int)
    rng = np.random.default_rng(3)
    for _ in range(40):
        anew = np.flatnonzero((rng.random(4) < 0.1) | (age == STEPS))
        kinematics.restart(anew, np.full(len(anew), 20.0))
        age[anew] = 0
        rows = rng.permutation(4)[: rng.integers(1, 5)]
        named = worlds[rows]
        target, _ = kinematics.track(tool[age[rows], named], hand[age[rows], named], joints[named], rows)
        np.testing.assert_array_equal(target.position, whole[named, age[rows], :n])
        age[rows] += 1
        age[age == STEPS] = STEPS
        done = np.flatnonzero(age == STEPS)
        kinematics.restart(done, np.full(len(done), 20.0))
        age[done] = 0


def test_a_world_out_of_reach_stays_and_the_others_go_on() -> None:
    solutions, n = follow("panda", [4, 5, 6]), len(load_robot("panda").joints)
    fails = [s.failures for s in solutions if s.failures]
    assert fails and all(f.mask.tolist() == [False, True, False] for f in fails)
    before = next(s for s, after in itertools.pairwise(solutions) if after.failures)
    for s in solutions:
        if s.failures:
            np.testing.assert_array_equal(s.target.position[1], before.target.position[1])
            assert not s.target.velocity[1].any() and s.target.velocity[0].any()
            assert 1.0 < s.failures.distance[1] < 2.5
            error = s.failures.error(1)
            assert isinstance(error, UnreachableError) and "panda cannot bring its tool" in str(error)
            assert s.failures.error(0) is None
    assert solutions[0].target.position.shape == (3, n)


def test_a_pose_without_a_rotation_fails_alone() -> None:
    joints, tool, hand = story("panda")
    kinematics, asked = batch("panda", 3), tool[5, 1:4].copy()
    asked[1, 3:] = 0.0
    target, failures = kinematics.track(asked, hand[5, 1:4], joints[1:4])
    assert failures.code.tolist() == [Reach.REACHED, Reach.NO_ROTATION, Reach.REACHED]
    assert isinstance(failures.error(1), InputError)
    np.testing.assert_array_equal(target.position[1, :7], joints[2, :7])
    assert target.velocity[[0, 2]].any(axis=1).all()


def test_each_world_has_its_own_rate() -> None:
    joints, tool, _ = story("panda")
    kinematics = batch("panda", 2)
    kinematics.restart(np.array([1]), np.array([50.0]))
    far = np.tile(tool[-1, 7] + np.array([0.1, 0, 0, 0, 0, 0, 0]), (2, 1))
    target, _ = kinematics.track(far, None, joints[[7, 7]])
    ratio = np.abs(target.velocity[:, :7]).max(axis=1) / np.abs(target.position - joints[[7, 7]]).max(axis=1)
    np.testing.assert_allclose(ratio, [20.0, 50.0], rtol=1e-9)


def test_joints_for_poses_are_found_together_as_alone() -> None:
    _, tool, _ = story("panda")
    kinematics, one = batch("panda", 1), PinocchioKinematics(load_robot("panda"))
    asked = tool[-1, [1, 5, 9]]
    found, failures = kinematics.joints_at(asked)
    assert failures.mask.tolist() == [False, True, False]
    for i in (0, 2):
        np.testing.assert_array_equal(found[i], one.inverse(asked[i]))
        assert poses.angle_between(one.forward(found[i])[3:], asked[i, 3:]) < 1e-4


def test_single_precision_is_as_good_as_it_can_be() -> None:
    worlds = [i for i in range(WORLDS) if i != 5]
    single = follow("panda", worlds, np.empty(0, np.float32))
    assert single[-1].target.position.dtype == np.float32
    apart = np.abs(
        single[-1].target.position - together("panda")[worlds, -1, : single[-1].target.position.shape[1]]
    )
    assert apart.max() < 2e-3


@pytest.mark.parametrize(
    ("name", "library"),
    [
        *(("panda", library) for library in LIBRARIES),
        *((n, "another device") for n in ("xarm7_ability", "so100")),
    ],
)
def test_every_library_and_device_gives_the_same_joints(name: str, library: str) -> None:
    like, worlds = LIBRARIES[library](np.zeros(1)), [0, 1, 2, 7, 9]
    found, expected = follow(name, worlds, like), together(name)[worlds]
    for i, solution in enumerate(found):
        position, velocity = solution.target.position, solution.target.velocity
        assert type(position) is type(velocity) is type(like)
        assert position.device == velocity.device == like.device
        n = position.shape[1]
        np.testing.assert_allclose(host(position), expected[:, i, :n], atol=1e-7)
        np.testing.assert_allclose(host(velocity), expected[:, i, n : 2 * n], atol=1e-6)
        np.testing.assert_array_equal(solution.failures.code, expected[:, i, 2 * n])
        np.testing.assert_allclose(solution.failures.distance, expected[:, i, 2 * n + 1], atol=1e-7)


@pytest.mark.parametrize("library", LIBRARIES)
def test_every_library_and_device_misses_by_the_same(library: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(inverse, "_HARDER", 20)  # it is for the way there, not for how far it goes
    put, (joints, tool, hand) = LIBRARIES[library], story("panda")
    usual, other = batch("panda", 2), batch("panda", 2, put(np.zeros(1)))
    rows, far = [4, 5], tool[-1, [4, 5]]
    for asked in (tool[4, rows], far):
        wanted = usual.track(asked, hand[6, rows], joints[rows])
        found = other.track(put(asked), put(hand[6, rows]), put(joints[rows]))
        assert found.failures.code.tolist() == wanted.failures.code.tolist()
        np.testing.assert_allclose(host(found.target.position), wanted.target.position, atol=1e-7)
    assert found.failures.mask.tolist() == [False, True]
    np.testing.assert_allclose(found.failures.distance, wanted.failures.distance, atol=1e-4)


@pytest.mark.parametrize("library", LIBRARIES)
def test_every_library_and_device_is_asked_apart_and_finds_joints_for_poses(library: str) -> None:
    """Rows of their own, worlds that begin anew, a pose without a rotation, and postures from nowhere."""
    put, (joints, tool, hand) = LIBRARIES[library], story("panda")
    usual, other = batch("panda", 3), batch("panda", 3, put(np.zeros(1)))
    asked = tool[-1, :3].copy()
    asked[1, 3:] = 0.0
    for rows, at in (([0, 1, 2], 5), ([2, 0], 7), ([1], 7)):
        wanted = usual.track(tool[at, rows], hand[at, rows], joints[rows], np.array(rows))
        found = other.track(put(tool[at, rows]), put(hand[at, rows]), put(joints[rows]), np.array(rows))
        np.testing.assert_allclose(host(found.target.position), wanted.target.position, atol=1e-9)
        for kinematics in (usual, other):
            kinematics.restart(np.array([1]), np.array([50.0]))
    found, failures = other.joints_at(put(asked), put(joints[:3, :7]), put(joints[3:6, :7]))
    wanted, expected = usual.joints_at(asked, joints[:3, :7], joints[3:6, :7])
    assert failures.code.tolist() == expected.code.tolist() == [0, Reach.NO_ROTATION, 0]
    np.testing.assert_allclose(host(found), wanted, atol=1e-6)
    np.testing.assert_allclose(host(other.tool_pose(put(joints))), usual.tool_pose(joints), atol=1e-12)
