"""Ctrl-C, SIGTERM and SIGHUP: whom they reach, and what they must not break off."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from typing import Any

from bt_tasksim.core.errors import Terminated


@contextmanager
def held_back(spawning: bool = False) -> Iterator[None]:
    """SIGINT to this thread waits until the end of the block; processes started in it never receive one.

    A terminal sends SIGINT to all processes in front. A worker that it ends between two lines may leave a
    lock taken, for which its parent then waits for ever; the parent ends the workers instead.

    Args:
        spawning: Processes are spawned in the block, not forked.
    """
    if spawning:
        resource_tracker.ensure_running()  # would start in the block otherwise, and lets SIGINT through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def terminable() -> Iterator[None]:
    """SIGTERM and SIGHUP, of a terminal that goes away, raise `Terminated` in the block.

    Not those that are handled or ignored already (nohup), and on the main thread only.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def terminate(number: int, frame: Any) -> None:
        raise Terminated

    unhandled = [n for n in (signal.SIGTERM, signal.SIGHUP) if signal.getsignal(n) is signal.SIG_DFL]
    for number in unhandled:
        signal.signal(number, terminate)
    try:
        yield
    finally:
        for number in unhandled:
            signal.signal(number, signal.SIG_DFL)


@contextmanager
def ending() -> Iterator[None]:
    """What ends things in order is not broken off by a second signal of these, which counts for nothing."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    for number, handler in before.items():
        if callable(handler):
            signal.signal(number, lambda number, frame: None)
    try:
        yield
    finally:
        for number, handler in before.items():
            if callable(handler):
                signal.signal(number, handler)
