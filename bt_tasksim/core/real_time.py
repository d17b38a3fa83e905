"""What the interpreter does differently while a loop runs in real time, as a robot's does.

Its garbage collector now and then looks at every object that there is, and nothing else goes on meanwhile:
80 to 120 ms with the 130,000 objects of a runner that has planned a few tasks, as long as a robot's command
lasts. Of objects that are set aside it looks at none. And a thread that computes lets another one go on
after 5 ms: each message of a robot waits so long for a plan that is being made, and hundreds a second
cannot.

Both are settings of the whole process, so they are counted: the first loop that opens changes them, and the
last one that closes gives back what was there.
"""

from __future__ import annotations

import gc
import sys
import threading

from bt_tasksim.core.closing import Closing

TURNS = 2e-4
"""Seconds after which a thread that computes lets another one go on, while a loop runs in real time."""


class _Interpreter:
    """The process's settings, and how many loops need them changed."""

    def __init__(self) -> None:
        self._lock, self._loops = threading.Lock(), 0
        self._turns, self._frozen_by_others = 0.0, False

    def open(self) -> None:
        with self._lock:
            if not self._loops:
                self._turns, self._frozen_by_others = sys.getswitchinterval(), gc.get_freeze_count() > 0
                sys.setswitchinterval(min(TURNS, self._turns))
            self._loops += 1

    def set_aside(self) -> None:
        with self._lock:
            if not self._frozen_by_others:
                gc.unfreeze()
                gc.collect()
                gc.freeze()

    def close(self) -> None:
        with self._lock:
            self._loops -= 1
            if self._loops:
                return
            sys.setswitchinterval(self._turns)
            if not self._frozen_by_others:
                gc.unfreeze()

    def loops(self) -> int:
        with self._lock:
            return self._loops


_INTERPRETER = _Interpreter()


def loops_open() -> int:
    """How many loops of this process are open."""
    return _INTERPRETER.loops()


class RealTime(Closing):
    """A loop in real time, from its making until it is closed.

    An application that has frozen objects itself before takes care of its collector, and nothing is done
    about that.
    """

    def __init__(self) -> None:
        self._open = True
        _INTERPRETER.open()

    def set_aside(self) -> None:
        """Collect garbage now, which takes a moment, and have later collections pass over what is left.

        Closed, it does nothing.
        """
        if self._open:
            _INTERPRETER.set_aside()

    def close(self) -> None:
        """Give back what was there before, if no other loop is open; a second call does nothing."""
        if self._open:
            self._open = False
            _INTERPRETER.close()
