"""A loop in real time changes settings of the whole process, and gives them back."""

import gc
import sys
import weakref

import pytest

from bt_tasksim.core.real_time import TURNS, RealTime


class Loop:
    """An object that refers to itself."""

    def __init__(self):
        self.me = self


@pytest.fixture(autouse=True)
def usual():
    before = sys.getswitchinterval()
    yield before
    assert sys.getswitchinterval() == before and gc.get_freeze_count() == 0


def test_what_is_set_aside_is_passed_over():
    with RealTime() as loop:
        loop.set_aside()
        assert gc.get_freeze_count() > 10_000
        assert len(gc.get_objects()) < 5_000, "what collections to come look at"


def test_what_has_become_garbage_goes_the_next_time():
    with RealTime() as loop:
        kept = Loop()
        gone = weakref.ref(kept)
        loop.set_aside()
        del kept
        gc.collect()
        assert gone() is not None
        loop.set_aside()
        assert gone() is None


def test_the_last_of_several_loops_gives_back_what_the_first_one_found(usual):
    first, second = RealTime(), RealTime()
    first.set_aside()
    first.close()
    first.close()
    assert sys.getswitchinterval() <= TURNS < usual and gc.get_freeze_count() > 0, "the second one goes on"
    second.close()
    assert sys.getswitchinterval() == usual and gc.get_freeze_count() == 0
    second.close()
    second.set_aside()
    assert gc.get_freeze_count() == 0, "who is closed freezes nothing"


def test_what_an_application_has_frozen_stays_so():
    gc.freeze()
    try:
        before = gc.get_freeze_count()
        later = [Loop() for _ in range(1000)]
        with RealTime() as loop:
            loop.set_aside()
            within = gc.get_freeze_count()
        after = gc.get_freeze_count()
        assert all(abs(count - before) < len(later) / 2 for count in (within, after)), (
            "what has come since is not frozen, and what was, is, but for the few that have gone"
        )
    finally:
        gc.unfreeze()
