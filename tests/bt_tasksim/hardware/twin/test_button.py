"""The twin's own word on the emergency stop's topic."""

from __future__ import annotations

import math

from bt_tasksim.hardware.twin.button import FORGOTTEN, ReleaseAnnouncer


def test_it_speaks_as_often_as_it_should_and_not_while_pressed() -> None:
    button = ReleaseAnnouncer(0.3)
    said = [0.01 * k for k in range(100) if button.speaks(False, 0.01 * k)]
    assert 9 <= len(said) <= 10 and not button.speaks(True, 5.0)
    assert not ReleaseAnnouncer(math.inf).speaks(False, 5.0)


def test_its_own_word_undoes_nothing() -> None:
    button = ReleaseAnnouncer(0.3)
    assert button.speaks(False, 0.0)
    assert not button.is_own(True, 0.001)  # somebody presses
    assert button.is_own(False, 0.002)  # what it had said before
    assert not button.is_own(False, 0.5)  # somebody releases


def test_a_word_that_never_came_back_is_forgotten() -> None:
    button = ReleaseAnnouncer(0.3)
    assert button.speaks(False, 0.0)
    assert not button.is_own(False, FORGOTTEN + 0.1)
