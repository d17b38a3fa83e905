"""A push waits until something is held, and ends when it is out of the hand or the time is over."""

import numpy as np
import pytest

from bt_tasksim.engines.physics.disturbance import DisturbanceForce
from bt_tasksim.scene.configuration import Disturbance

PUSH = Disturbance("cup", delay=0.5, force=(0.0, 0.0, -10.0), speed=0.2, limit=0.3)
STILL = np.zeros(3)


def pushing(at=1.0):
    force = DisturbanceForce(PUSH)
    force.watch(at - 0.5, True)
    force.watch(at, True)
    assert force.pushing and not force.over
    return force


def test_nothing_happens_without_a_disturbance():
    force = DisturbanceForce(None)
    force.watch(1.0, True)
    assert force.over and not force.pushing


def test_it_waits_from_when_the_object_was_first_held():
    force = DisturbanceForce(PUSH)
    for time, held in ((0.0, False), (5.0, False), (6.0, True), (6.4, False)):
        force.watch(time, held)
        assert not force.pushing and not force.over
    force.watch(6.5, False)
    assert force.pushing


def test_it_pushes_no_faster_than_it_says():
    force = pushing()
    assert np.array_equal(force.force(1.0, True, STILL), PUSH.force)
    assert not force.force(1.1, True, np.array([0.0, 0.0, -0.3])).any() and force.pushing
    assert np.array_equal(force.force(1.1, True, np.array([0.9, 0.0, -0.1])), PUSH.force)


@pytest.mark.parametrize(("time", "touched"), [(1.1, False), (1.31, True)])
def test_it_ends(time, touched):
    force = pushing()
    assert not force.force(time, touched, STILL).any()
    assert force.over
    force.watch(9.0, True)
    assert force.over, "it comes once"
