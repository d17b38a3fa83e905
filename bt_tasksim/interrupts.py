"""Ctrl-C and SIGTERM: whom they reach, and what they must not break off."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from typing import Any

from bt_tasksim.errors import Terminated


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
    """SIGTERM raises `Terminated` in the block, unless it is handled already; on the main thread only."""
    main = threading.current_thread() is threading.main_thread()
    if not main or signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        yield
        return

    def terminate(number: int, frame: Any) -> None:
        raise Terminated

    signal.signal(signal.SIGTERM, terminate)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


@contextmanager
def ending() -> Iterator[None]:
    """What ends things in order is not broken off by a second Ctrl-C or SIGTERM, which count for nothing."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number, handler in before.items():
        if callable(handler):
            signal.signal(number, lambda number, frame: None)
    try:
        yield
    finally:
        for number, handler in before.items():
            if callable(handler):
                signal.signal(number, handler)
