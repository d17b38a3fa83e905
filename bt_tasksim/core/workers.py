"""Worker processes that each keep something of their own, and do tasks with it."""

from __future__ import annotations

import contextlib
import copy
import multiprocessing
import os
import signal
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, Generic, Literal, Protocol, Self, TypeVar

from bt_tasksim.core import child
from bt_tasksim.core.culprit import users_place
from bt_tasksim.core.errors import BtTasksimError, InputError, MachineError
from bt_tasksim.core.interrupts import held_back

StateT = TypeVar("StateT")
StateT_contra = TypeVar("StateT_contra", contravariant=True)
ResultT = TypeVar("ResultT")
ResultT_co = TypeVar("ResultT_co", covariant=True)


class Task(Protocol[StateT_contra, ResultT_co]):
    """What a worker is to do; it is pickled, and so is its result."""

    def run(self, state: StateT_contra, /) -> ResultT_co:
        """Do it with what the worker keeps."""


class Workers(Generic[StateT]):
    """Worker processes; a context manager, which ends them.

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

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self.close(0.0 if kind is not None else 2.0)

    @property
    def pids(self) -> tuple[int | None, ...]:
        """The workers' process ids."""
        return tuple(process.pid for process in self._processes)

    def each(self, tasks: Sequence[Task[StateT, ResultT]]) -> Iterator[tuple[int, ResultT]]:
        """The tasks' numbers and results, in the order in which they are done.

        Raises:
            BtTasksimError: A worker found an error; then they are good for nothing any more.
            InputError: A user's own code raised in a worker; says where.
            MachineError: A worker ended, or something else was raised in it.
        """
        waiting = list(enumerate(tasks))[::-1]
        busy: dict[Connection, int] = {}
        idle = list(self._pipes)
        try:
            while waiting or busy:
                while waiting and idle:
                    pipe = idle.pop()
                    number, task = waiting.pop()
                    pipe.send(task)
                    busy[pipe] = number
                for ready in wait(list(busy)):
                    assert isinstance(ready, Connection)
                    kind, result = ready.recv()
                    if kind == "error":
                        raise result
                    idle.append(ready)
                    yield busy.pop(ready), result
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
    os.environ["OMP_NUM_THREADS"] = "1"
    for other in others:
        other.close()
    parent = os.getppid()
    made: list[StateT] = []
    while os.getppid() == parent:
        try:
            if not pipe.poll(1.0):
                continue
            task: Task[StateT, object] = pipe.recv()
        except (EOFError, OSError):
            break
        try:
            if not made:
                made.append(make())
            pipe.send(("done", task.run(made[0])))
        except BrokenPipeError:
            break
        except Exception as error:
            pipe.send(("error", _sendable(error)))
    os._exit(0)


def _sendable(error: Exception) -> Exception:
    """An error that comes through a pipe: itself where it can, else one with the same sentence."""
    if not isinstance(error, BtTasksimError) and (place := users_place(error)):
        return InputError(f"{place}: {type(error).__name__}: {error}")
    if not isinstance(error, BtTasksimError):
        return MachineError(f"{error!r}: {traceback.format_exc(limit=-3)}")
    try:
        return copy.copy(error)  # as it is put together again on the other side
    except Exception:  # whatever its constructor asks for
        return InputError(str(error)) if isinstance(error, InputError) else MachineError(str(error))


@contextlib.contextmanager
def begun_anew() -> Iterator[None]:
    """Python processes that begin in this block find modules where this one does, and nowhere else.

    They take one thread for linear algebra: they are the parallelism.
    """
    variables = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    variables |= child.VARIABLES
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
