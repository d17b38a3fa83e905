"""What is set aside is not looked at by later collections, and garbage among it is not kept for ever."""

import gc
import weakref

from bt_tasksim.core import pauses


class Loop:
    """An object that refers to itself."""

    def __init__(self):
        self.me = self


def test_what_is_set_aside_is_passed_over():
    try:
        pauses.set_aside()
        assert gc.get_freeze_count() > 10_000
        assert len(gc.get_objects()) < 5_000, "what collections to come look at"
    finally:
        pauses.take_back()
    assert gc.get_freeze_count() == 0


def test_what_has_become_garbage_goes_the_next_time():
    try:
        kept = Loop()
        gone = weakref.ref(kept)
        pauses.set_aside()
        del kept
        gc.collect()
        assert gone() is not None
        pauses.set_aside()
        assert gone() is None
    finally:
        pauses.take_back()
