"""A push waits until something is held, and ends when it is out of the hand or the time is over."""

import numpy as np
import pytest

from bt_tasksim.engines.disturbance import Knock
from bt_tasksim.scene import Disturbance

PUSH = Disturbance("cup", delay=0.5, force=(0.0, 0.0, -10.0), speed=0.2, limit=0.3)
STILL = np.zeros(3)


def pushing(at=1.0):
    knock = Knock(PUSH)
    knock.watch(at - 0.5, True)
    knock.watch(at, True)
    assert knock.pushing and not knock.over
    return knock


def test_nothing_happens_without_a_disturbance():
    knock = Knock(None)
    knock.watch(1.0, True)
    assert knock.over and not knock.pushing


def test_it_waits_from_when_the_object_was_first_held():
    knock = Knock(PUSH)
    for time, held in ((0.0, False), (5.0, False), (6.0, True), (6.4, False)):
        knock.watch(time, held)
        assert not knock.pushing and not knock.over
    knock.watch(6.5, False)
    assert knock.pushing


def test_it_pushes_no_faster_than_it_says():
    knock = pushing()
    assert np.array_equal(knock.force(1.0, True, STILL), PUSH.force)
    assert not knock.force(1.1, True, np.array([0.0, 0.0, -0.3])).any() and knock.pushing
    assert np.array_equal(knock.force(1.1, True, np.array([0.9, 0.0, -0.1])), PUSH.force)


@pytest.mark.parametrize(("time", "touched"), [(1.1, False), (1.31, True)])
def test_it_ends(time, touched):
    knock = pushing()
    assert not knock.force(time, touched, STILL).any()
    assert knock.over
    knock.watch(9.0, True)
    assert knock.over, "it comes once"
