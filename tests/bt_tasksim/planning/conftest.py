"""Robots among things, for tests of planning."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from bt_tasksim.core import poses
from bt_tasksim.planning.arm import arm_of
from bt_tasksim.planning.things import Held, Thing, box_corners
from bt_tasksim.robot.description import load_robot


class Bench:
    """A robot with its tool as at rest, and things before it.

    Args:
        name: The robot's name.
    """

    def __init__(self, name: str = "panda") -> None:
        self.robot = load_robot(name)
        self.arm = arm_of(self.robot)
        self.hand = self.robot.hand_open
        self.down = self.arm.tool(self.robot.rest)[3:]

    def pose(self, *position: float):
        """A tool pose ``(7,)`` turned as at rest."""
        return poses.pose(position, self.down)

    def posture(self, *position: float):
        """Joints that bring the tool there."""
        joints = self.arm.joints(self.pose(*position), self.robot.rest)
        assert joints is not None
        return joints

    @staticmethod
    def box(position, size, margin=0.0, name="box"):
        """A box to keep clear of."""
        return Thing(name, poses.pose(position), tuple(size), margin=margin)

    @staticmethod
    def held(size=(0.04, 0.04, 0.2), name="held"):
        """A box in the hand."""
        return Held(name, poses.pose([0.0, 0.0, 0.0]), (box_corners(size),))


@pytest.fixture(scope="session")
def panda():
    """The Panda."""
    return Bench()


@pytest.fixture(scope="session", params=["panda", "xarm7_ability", "so100"])
def each(request):
    """Each of the shipped robots."""
    return Bench(request.param)


WALL = ((0.45, 0.0, 0.2), (0.4, 0.04, 0.4))
"""Position and size of a wall between the right and the left of a robot."""


@pytest.fixture(scope="session")
def wall():
    """A wall between right and left, 10 mm of room kept before it."""
    return Bench.box(*WALL, margin=0.01, name="wall")


def finely(joints, step=0.01):
    """Postures between postures ``(n, n_arm)``, ever ``step`` radians."""
    out = [joints[:1]]
    for a, b in itertools.pairwise(joints):
        n = max(2, int(np.ceil(np.abs(b - a).max() / step)) + 1)
        out.append((a + np.linspace(0, 1, n)[:, None] * (b - a))[1:])
    return np.concatenate(out)


@pytest.fixture(scope="session")
def fine():
    """See `finely`."""
    return finely
