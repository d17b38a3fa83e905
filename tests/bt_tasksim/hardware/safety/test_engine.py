"""The emergency stop and the robot's clock."""

import pytest

from bt_tasksim.hardware.safety.engine import EmergencyStop, RobotClock


def test_an_emergency_stop_stays_pressed_and_calls_its_listeners_once():
    stop, heard = EmergencyStop(), []
    stop.listen(heard.append)
    assert stop.why == "" and not stop.held_down()
    stop.press("topic /estop")
    stop.press("again")
    assert stop.why == "topic /estop" and heard == ["topic /estop"]
    stop.release()
    assert stop.why == ""
    stop.press("again")
    assert heard == ["topic /estop", "again"]


def test_what_a_message_is_late_by_is_its_age_whatever_the_clocks_say():
    clock = RobotClock()
    assert clock.convert(1000.0, 5.004) == pytest.approx(5.004)
    assert clock.convert(1000.1, 5.102) == pytest.approx(5.102), (
        "the fastest message so far defines the offset"
    )
    assert clock.convert(1000.2, 5.502) == pytest.approx(5.202), "300 ms late"
