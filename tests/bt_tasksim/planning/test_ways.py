"""Ways around obstacles, checked at fine steps by a collision check of the test's own."""

from itertools import pairwise

import coal
import numpy as np
import pytest

from bt_tasksim.core import poses
from bt_tasksim.core.errors import BtTasksimError, NoWayError
from bt_tasksim.core.world import Obstacle
from bt_tasksim.planning.ways import MARGIN, Carried, _Checker, clear_path
from bt_tasksim.robot.description import load_robot

DOWN = poses.frame_from_axes(np.array([0.0, 0, -1]), np.array([0.0, 1, 0]))
HAND = ((poses.pose([0, 0, -0.05]), (0.07, 0.21, 0.13)),)
CARRIED = Carried(HAND, (0.05, 0.05, 0.10), poses.pose([0, 0, 0.02]))
START, GOAL = poses.pose([0.45, -0.3, 0.25], DOWN), poses.pose([0.45, 0.3, 0.25], DOWN)


def box(position, size, name="wall"):
    return Obstacle(poses.pose(position), size, name)


def transform(pose):
    return coal.Transform3s(poses.to_matrix(pose[3:]), pose[:3])


def clearance(way, carried, obstacles, step=0.004):
    """Least distance in metres of anything that moves to any obstacle, along the way."""
    least = np.inf
    moving = [*carried.hand, (carried.grip, carried.extent)]
    for a, b in pairwise(way):
        n = int(np.linalg.norm(b[:3] - a[:3]) / step) + 2
        for f in np.linspace(0, 1, n):
            tool = poses.interpolate(a, b, f)
            for local, size in moving:
                at = transform(poses.multiply(tool, local))
                for o in obstacles:
                    d = coal.distance(
                        coal.Box(*size), at, coal.Box(*o.size), transform(o.pose),
                        coal.DistanceRequest(), coal.DistanceResult(),
                    )  # fmt: skip
                    least = min(least, d)
    return least


def test_a_free_straight_line_is_taken():
    far = [box([0.9, 0.0, 0.2], (0.1, 0.4, 0.4))]
    way = clear_path(START, GOAL, CARRIED, far)
    assert len(way) == 2 and np.array_equal(way[0], START) and np.array_equal(way[1], GOAL)


WALLS = {
    "a wall to go over": [box([0.45, 0.0, 0.15], (0.4, 0.04, 0.3))],
    "a post to go round": [box([0.45, 0.0, 0.5], (0.06, 0.06, 1.0))],
    "a gate to go through": [
        box([-0.24, 0.0, 0.5], (1.52, 0.04, 1.4)),
        box([1.28, 0.0, 0.5], (1.0, 0.04, 1.4)),
    ],
}


@pytest.mark.parametrize("name", WALLS)
def test_a_way_round_is_clear_all_along(name):
    obstacles = WALLS[name]
    assert clearance([START, GOAL], CARRIED, obstacles) < MARGIN, "the straight line should not be free"
    way = clear_path(START, GOAL, CARRIED, obstacles)
    assert np.array_equal(way[0], START) and np.array_equal(way[-1], GOAL)
    assert clearance(way, CARRIED, obstacles) > 0.004


def test_the_same_question_has_the_same_answer():
    ways = [clear_path(START, GOAL, CARRIED, WALLS["a wall to go over"]) for _ in range(2)]
    assert np.array_equal(np.array(ways[0]), np.array(ways[1]))


def test_the_held_object_counts():
    beam = [box([0.45, 0.0, 0.0], (2.0, 0.04, 0.34))]  # low enough for the hand, too high for what it holds
    short = Carried(HAND, (0.03, 0.03, 0.03), poses.pose([0, 0, 0.0]))
    long = Carried(HAND, (0.03, 0.03, 0.2), poses.pose([0, 0, 0.08]))
    assert len(clear_path(START, GOAL, short, beam)) == 2
    way = clear_path(START, GOAL, long, beam)
    assert len(way) > 2 and clearance(way, long, beam) > 0.004


def test_a_way_out_of_a_shelf_follows_its_exit():
    boards = [box([0.6, -0.3, z], (0.3, 0.5, 0.02), "shelf") for z in (0.0, 0.6)]
    sides = [box([0.6, y, 0.3], (0.3, 0.02, 0.6), "shelf") for y in (-0.56, -0.04)]
    start = poses.pose([0.6, -0.3, 0.25], poses.frame_from_axes(np.array([1.0, 0, 0]), np.array([0, 1.0, 0])))
    goal = start.copy()
    goal[1] = 0.3
    exits = (np.array([-0.35, 0, 0]), np.array([-0.35, 0, 0]))
    way = clear_path(start, goal, CARRIED, [*boards, *sides], exits)
    assert np.allclose([p[:3] for p in way[1:-1]], [[0.25, -0.3, 0.25], [0.25, 0.3, 0.25]])
    assert clearance(way, CARRIED, [*boards, *sides]) > 0.004


def test_no_way_is_one_sentence_with_both_ends():
    shut = [
        box([0.45, 0.3, 0.25 + s * 0.3], (0.7, 0.7, 0.02)) for s in (-1, 1)
    ] + [box([0.45 + s * 0.3, 0.3, 0.25], (0.02, 0.7, 0.7)) for s in (-1, 1)] + [
        box([0.45, 0.3 + s * 0.3, 0.25], (0.7, 0.02, 0.7)) for s in (-1, 1)
    ]  # fmt: skip
    with pytest.raises(NoWayError) as error:
        clear_path(START, GOAL, CARRIED, shut)
    assert isinstance(error.value, BtTasksimError)
    sentence = str(error.value)
    assert "no way for the hand from [0.45, -0.3, 0.25] to [0.45, 0.3, 0.25] m" in sentence
    assert "12 mm clear" in sentence and "via-points" in sentence and "\n" not in sentence


def touches(tool, obstacles):
    """coal about each box and each obstacle, without looking first how far away they are."""
    request, result = coal.CollisionRequest(), coal.CollisionResult()
    return any(
        coal.collide(
            coal.Box(*size), transform(poses.multiply(tool, local)),
            coal.Box(*(np.array(o.size) + 2 * MARGIN)), transform(o.pose), request, result,
        )
        for local, size in (*HAND, (CARRIED.grip, CARRIED.extent))
        for o in obstacles
    )  # fmt: skip


@pytest.mark.parametrize("name", WALLS)
def test_many_tool_poses_are_checked_at_once_as_one_by_one(rows_alike, name):
    rng = np.random.default_rng(5)
    turned = poses.pose([0.1, 0.2, 0.3], poses.normalise(np.array([0.9, 0.1, -0.3, 0.2])))
    obstacles = [*WALLS[name], Obstacle(turned, (0.1, 0.3, 0.2), "slanted")]
    tools = np.concatenate(
        [rng.uniform([0.0, -0.4, 0.0], [0.9, 0.4, 0.8], (400, 3)), rng.normal(size=(400, 4))], 1
    )
    tools[:, 3:] = poses.normalise(tools[:, 3:])
    checker = _Checker(CARRIED, obstacles)
    free = rows_alike(lambda rows: checker.free(tools[rows]), len(tools))
    assert free.any() and not free.all()
    assert free.tolist() == [not touches(tool, obstacles) for tool in tools]


def test_where_there_are_no_obstacles_everything_is_free():
    assert _Checker(CARRIED, []).free(np.stack([START, GOAL])).all()


def test_the_bundled_hands_have_an_envelope():
    for name in ("panda", "xarm7_ability"):
        assert load_robot(name).envelope
