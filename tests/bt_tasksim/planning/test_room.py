"""Room among outlines: the same distances as those of outlines, and points with a given gap."""

import numpy as np
import pytest

from bt_tasksim.planning.room import Room, outside
from bt_tasksim.scene.outlines import distance, hull


def outlines(seed):
    rng = np.random.default_rng(seed)
    return [hull(rng.normal(size=(8, 2))) for _ in range(3)]


@pytest.mark.parametrize("seed", range(5))
def test_gaps_are_the_distances_of_outlines(seed):
    mine, *others = outlines(seed)
    points = np.random.default_rng(seed).uniform(-6.0, 6.0, (40, 2))
    expected = [min(distance(mine + point, other) for other in others) for point in points]
    assert np.allclose(Room(mine, others).gaps(points), expected, atol=1e-9)


def test_there_is_room_where_nothing_is():
    assert np.isinf(Room(outlines(0)[0], []).gaps(np.zeros((3, 2)))).all()


def test_beside_keeps_the_gap_in_every_direction():
    mine, other, _ = outlines(1)
    angles = np.linspace(0.0, 2 * np.pi, 12, endpoint=False)
    room = Room(mine, [other])
    points = room.beside(np.stack([np.cos(angles), np.sin(angles)], axis=-1), 0.3)
    assert np.allclose(room.gaps(points), 0.3, atol=1e-4)


def test_within_an_outline_the_distance_is_negative():
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    points = np.array([[0.5, 0.5], [2.0, 0.5], [2.0, 2.0]])
    assert np.allclose(outside(points, square), [-0.5, 1.0, np.sqrt(2.0)])
