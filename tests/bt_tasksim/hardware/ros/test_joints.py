"""Joint states as they come: their order, their age, and the clock that they alone tell."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from bt_tasksim.hardware.ros.joints import JointFeed
from bt_tasksim.hardware.ros.messages import UnusableMessageError
from bt_tasksim.hardware.ros.setting import load_setting
from bt_tasksim.robot.description import load_robot

ROBOT = load_robot("panda")
SETTING = load_setting(ROBOT)
HOUR = 3600.0
"""By which the cell's clock is behind."""


def states(stamp: float, first: float = 0.0) -> dict[str, Any]:
    nanoseconds = round(stamp * 1e9)
    header = {"stamp": {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}, "frame_id": ""}
    return {"header": header, "name": list(SETTING.wire), "position": [first] + [0.0] * 8}


@pytest.fixture
def feed() -> JointFeed:
    made = JointFeed(ROBOT, SETTING)
    made.take(states(10.0), HOUR + 10.005)
    return made


def test_an_older_state_does_not_take_the_place_of_a_newer_one(feed: JointFeed) -> None:
    feed.take(states(10.1, first=0.5), HOUR + 10.105)
    for stamp in (10.1, 10.05):
        with pytest.raises(UnusableMessageError, match="before the last ones, not after them"):
            feed.take(states(stamp, first=0.2), HOUR + 10.12)
    assert feed.newest is not None and feed.newest.position[0] == 0.5
    feed.forget()
    feed.take(states(9.0), HOUR + 10.2)  # a new run may find a clock that was set back
    assert feed.newest is not None


def test_other_topics_do_not_set_the_clock(feed: JointFeed) -> None:
    assert feed.offset == pytest.approx(HOUR + 0.005)
    assert feed.convert(10.05, HOUR + 10.1) == pytest.approx(HOUR + 10.055)
    assert feed.convert(99.0, HOUR + 10.1) == HOUR + 10.1  # not from the future
    feed.take(states(10.1), HOUR + 10.105)
    assert feed.newest is not None and feed.newest.stamp == pytest.approx(HOUR + 10.105)


def test_before_the_first_states_a_message_is_as_old_as_its_arrival() -> None:
    feed = JointFeed(ROBOT, SETTING)
    assert math.isinf(feed.offset) and feed.convert(5.0, 100.0) == 100.0


def test_speeds_follow_from_the_way_where_none_are_said(feed: JointFeed) -> None:
    feed.take(states(10.1, first=0.02), HOUR + 10.105)
    assert feed.newest is not None and np.allclose(feed.newest.velocity[0], 0.2)
