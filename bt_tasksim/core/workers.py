"""Worker processes that each keep something of their own, and do tasks with it."""

from __future__ import annotations

import contextlib
import functools
import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, Literal

from bt_tasksim.core import child
from bt_tasksim.core.errors import MachineError
from bt_tasksim.core.fleet import Fleet, ItemT, ResultT, Shares, StateT, Work, results_of, sendable
from bt_tasksim.core.interrupts import held_back


class Workers(Fleet[StateT]):
    """Worker processes as a fleet.

    A worker ends when its parent is gone. Ctrl-C does not reach it: the parent ends it.

    Args:
        make: Makes what a worker keeps, in the worker, before its first task.
        count: How many.
        method: ``fork``: they begin as copies of this process, so ``make`` may hold anything; ``spawn``: they
            begin anew with one thread each for linear algebra, and ``make`` is pickled.
    """

    def __init__(
        self, make: Callable[[], StateT], count: int, method: Literal["fork", "spawn"] = "fork"
    ) -> None:
        context: Any = multiprocessing.get_context(method)  # the two have no base with Process to mypy
        spawning = method == "spawn"
        self._pipes: list[Connection] = []
        self._processes: list[BaseProcess] = []
        with begun_anew() if spawning else contextlib.nullcontext(), held_back(spawning):
            for _ in range(count):
                mine, theirs = context.Pipe()
                others = [] if spawning else [*self._pipes, mine]
                process = context.Process(target=_serve, args=(make, theirs, others), daemon=True)
                process.start()
                theirs.close()
                self._pipes.append(mine)
                self._processes.append(process)

    @property
    def pids(self) -> tuple[int | None, ...]:
        """The workers' process ids."""
        return tuple(process.pid for process in self._processes)

    def spread(
        self, work: Work[StateT, ItemT, ResultT], items: Sequence[ItemT], share: int = 1
    ) -> Iterator[tuple[int, ResultT]]:
        """See `Fleet.spread`.

        Raises:
            MachineError: A worker ended: nobody makes up for it.
        """
        shares = Shares(len(items), share)
        idle = list(self._pipes)
        try:
            while shares.left:
                while idle and (taken := shares.take(idle[-1], len(self._pipes))):
                    idle.pop().send((work, [items[number] for number in taken]))
                for ready in wait(shares.members):
                    assert isinstance(ready, Connection)
                    kind, what = ready.recv()
                    if kind == "error":
                        raise what
                    index, result = what
                    number = shares.done(ready, index)
                    if ready not in shares.members:
                        idle.append(ready)
                    yield number, result
        except (EOFError, ConnectionError) as error:
            raise MachineError("a worker process ended; is there enough memory?") from error

    def close(self, patience: float = 2.0) -> None:
        """End the workers.

        Args:
            patience: Seconds for what they are doing, before they are killed.
        """
        for pipe in self._pipes:
            with contextlib.suppress(OSError):
                pipe.close()
        until = time.monotonic() + patience
        for process in self._processes:
            process.join(timeout=max(0.0, until - time.monotonic()))
            if process.is_alive():
                process.kill()
                process.join()


def _serve(make: Callable[[], StateT], pipe: Connection, others: list[Connection]) -> None:
    """A worker process: what it keeps is a variable of this function."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)  # how the parent ends in order is not how a copy of it ends
    os.environ.update(child.ONE_THREAD)
    for other in others:
        other.close()
    parent = os.getppid()
    kept = functools.cache(make)
    while os.getppid() == parent:
        try:
            if not pipe.poll(1.0):
                continue
            work, items = pipe.recv()
        except (EOFError, OSError):
            break
        try:
            for answer in results_of(kept, work, items):
                pipe.send(answer)
        except BrokenPipeError:
            break
        except Exception as error:  # a result that cannot be pickled
            pipe.send(("error", sendable(error)))
    os._exit(0)


@contextlib.contextmanager
def begun_anew() -> Iterator[None]:
    """Python processes that begin in this block find modules where this one does, and nowhere else.

    They take one thread for linear algebra: they are the parallelism.
    """
    variables = child.ONE_THREAD | child.VARIABLES
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
