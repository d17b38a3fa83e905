"""Convex pieces in space as coal has them."""

import numpy as np
import pytest

from bt_tasksim.core import poses
from bt_tasksim.core.narrow_phase import coal
from bt_tasksim.scene.hulls import placed
from bt_tasksim.scene.shapes import BoxPiece, ConvexPiece

CUBE = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], float) - 0.5


def test_a_box_and_its_hull_are_at_the_same_distance_from_another_one():
    at = poses.pose([0.1, -0.2, 0.3], poses.yaw(0.4))
    box = BoxPiece(poses.pose([0.0, 0.0, 0.0]), np.full(3, 0.5))
    other, there = placed(box, poses.pose([2.0, 0.3, 0.0]))
    found = []
    for piece in (box, ConvexPiece(CUBE)):
        form, here = placed(piece, at)
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        found.append(coal.distance(form, here, other, there, request, result))
    assert found[0] == pytest.approx(found[1], abs=1e-6) and found[0] > 0.5
