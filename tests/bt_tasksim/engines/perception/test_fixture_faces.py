"""What reaches through a face that an object's middle is before."""

import numpy as np
import pytest

from bt_tasksim.core.world import Obstacle
from bt_tasksim.engines.perception.fixture_faces import beyond_faces, boxes_near

WALL = Obstacle(np.array([0.5, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0]), (0.01, 0.2, 0.2), "bin")


@pytest.mark.parametrize(
    ("middle", "point", "depth", "normal"),
    [
        ((0.45, 0.0, 0.1), (0.47, 0.0, 0.1), 0.0, None),
        ((0.45, 0.0, 0.1), (0.50, 0.0, 0.1), 0.005, (-1, 0, 0)),
        ((0.45, 0.0, 0.1), (0.52, 0.0, 0.1), 0.025, (-1, 0, 0)),  # right through the wall
        ((0.55, 0.0, 0.1), (0.48, 0.0, 0.1), 0.025, (1, 0, 0)),
        ((0.45, 0.0, 0.1), (0.52, 0.0, 0.21), 0.0, None),  # over the rim
        ((0.50, 0.0, 0.25), (0.50, 0.0, 0.19), 0.01, (0, 0, 1)),  # it lies on the rim
        ((0.50, 0.0, 0.25), (0.53, 0.0, 0.15), 0.0, None),
    ],
)
def test_a_thin_wall(middle, point, depth, normal):
    boxes = boxes_near([WALL], np.array(middle), 0.1)
    found, out = beyond_faces(boxes, np.array([point]), np.array(middle))
    assert found == pytest.approx([depth])
    assert normal is None or out[0] == pytest.approx(np.array(normal, float))


def test_boxes_that_are_far_do_not_count():
    assert boxes_near([WALL], np.array([0.3, 0.0, 0.1]), 0.1) is None
