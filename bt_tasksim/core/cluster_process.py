"""The process in which Ray runs for `bt_tasksim.core.cluster.Cluster`, started by it.

It connects, keeps actors alive, hands them shares of the items, and passes results on, all as bytes that it
does not look into. When the other end of its pipe closes, it ends what it has started, and itself.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import shutil
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from typing import Any

from bt_tasksim.core import cluster_actor
from bt_tasksim.core.errors import BtTasksimError, InputError, MachineError
from bt_tasksim.core.fleet import Shares, TooManyLostError
from bt_tasksim.core.identity import differences

LOCAL = "local"
"""The address for a cluster of this machine alone, which begins and ends with the command."""
OBJECT_STORE = 80 << 20
"""Bytes of shared memory for Ray's objects, the least that it takes; results are small."""
GATHER = 0.5
"""Seconds of results that an actor gives at a time."""
LOOK = 0.25
"""Seconds between two looks at the pipe."""
GROW = 5.0
"""Seconds between two looks for room for more actors."""
ROOM = 60.0
"""Seconds without a living actor, after which the cluster counts as one that has no room."""
MOST_STARTS = 5
"""Actors that may end while they begin, one after the other, where no other one lives."""
LONGEST_REST = 10.0
"""Seconds, at most, before an actor is begun again after one that ended while it began."""
ENDING = 8.0
"""Seconds for ending in order."""


@dataclass(frozen=True)
class Settings:
    """What the process is told first.

    Attributes:
        address: ``local``, or a host and port.
        count: How many actors; None for as many as there is room for.
        memory: Bytes that an actor needs.
        make: Pickled, makes what an actor keeps.
        folder: Where the actors look for files.
        versions: Identity of this program, which the actors' must equal.
        temporary: Ray's folder, for ``local``.
    """

    address: str
    count: int | None
    memory: int
    make: bytes
    folder: str
    versions: Mapping[str, str]
    temporary: str


@dataclass(eq=False)
class _Actor:
    """An actor and what it is doing: ``about``, ``begin``, ``more``, or nothing."""

    handle: Any
    doing: str = "about"
    node: str = "?"
    begun: bool = field(default=False)


class _ClosedError(Exception):
    """Nobody listens any more."""


class ClusterDriver:
    """Actors of a cluster, and the shares that they have.

    Args:
        ray: The module, connected.
        settings: What was told.
        pipe: To the other process.
        messages: What comes from there; None when it has closed.
    """

    def __init__(self, ray: Any, settings: Settings, pipe: Connection, messages: queue.Queue[Any]) -> None:
        ray.cloudpickle.register_pickle_by_value(cluster_actor)
        remote = ray.remote(num_cpus=1, memory=settings.memory, max_restarts=0, max_task_retries=0)
        self._ray, self._settings, self._pipe, self._messages = ray, settings, pipe, messages
        self._member = remote(cluster_actor.Member)
        self._actors: list[_Actor] = []
        self._calls: dict[Any, _Actor] = {}
        self._failed_starts = 0
        self._alone_since = self._looked = self._rest_until = -float("inf")

    def spread(self, work: bytes, items: Sequence[bytes], share: int) -> None:
        """Do work on items with all actors, and pass the results on.

        Raises:
            BtTasksimError: It cannot be done.
            _ClosedError: Nobody wants the results any more.
        """
        shares = Shares(len(items), share)
        self._alone_since = time.monotonic()
        while shares.left:
            if not self._messages.empty():
                raise _ClosedError
            self._recruit(shares)
            for actor in self._actors:
                if actor.begun and not actor.doing and (taken := shares.take(actor, self._living)):
                    self._call(actor, "more", (work, [items[number] for number in taken]), GATHER)
            self._check_room()
            if not self._calls:
                time.sleep(LOOK)
                continue
            ready, _ = self._ray.wait(list(self._calls), timeout=LOOK)
            for call in ready:
                self._answered(call, shares)

    @property
    def _living(self) -> int:
        return sum(actor.begun for actor in self._actors)

    def _call(self, actor: _Actor, method: str, *arguments: Any) -> None:
        actor.doing = method
        self._calls[getattr(actor.handle, method).remote(*arguments)] = actor

    def _recruit(self, shares: Shares) -> None:
        """Have as many actors as were asked for, or as there is room for; one, at least, waits for room."""
        if time.monotonic() < self._rest_until:
            return
        wanted = self._settings.count
        if wanted is None:
            wanted = max(1, len(self._actors))
            pending = any(not actor.begun for actor in self._actors)
            if not pending and shares.waiting and time.monotonic() - self._looked > GROW:
                self._looked = time.monotonic()
                wanted = max(1, len(self._actors) + min(self._room(), shares.waiting))
        for _ in range(wanted - len(self._actors)):
            actor = _Actor(self._member.remote())
            self._actors.append(actor)
            self._call(actor, "about")

    def _room(self) -> int:
        free = self._ray.available_resources()
        return int(min(free.get("CPU", 0.0), free.get("memory", 0.0) // self._settings.memory))

    def _check_room(self) -> None:
        now = time.monotonic()
        if self._living:
            self._alone_since = now
        elif now - self._alone_since > ROOM:
            raise MachineError(
                f"the Ray cluster has had no room for an actor (one processor and "
                f"{self._settings.memory / 1e9:.1f} GB) for {ROOM:.0f} s, and its largest node has "
                f"{self._largest() / 1e9:.1f} GB: 'ray status' shows what uses them, and a smaller batch "
                "needs less"
            )

    def _largest(self) -> float:
        """Bytes that the largest node lends to actors."""
        living = (node["Resources"] for node in self._ray.nodes() if node["Alive"])
        return max((node.get("memory", 0.0) for node in living), default=0.0)

    def _answered(self, call: Any, shares: Shares) -> None:
        actor = self._calls.pop(call)
        try:
            value = self._ray.get(call)
        except self._ray.exceptions.RayTaskError as error:  # not a fault of the node
            raise MachineError(f"an actor on {actor.node} failed: {_last_line(error)}") from error
        except self._ray.exceptions.RayError:
            self._lost(actor, shares)
            return
        doing, actor.doing = actor.doing, ""
        if doing == "about":
            self._check_version(actor, *value)
            self._call(actor, "begin", self._settings.folder, self._settings.make)
        elif doing == "begin":
            if value:
                raise self._of_node(actor, pickle.loads(value))  # noqa: S301  # of our own actor
            actor.begun = True
            self._failed_starts = 0
        else:
            self._passed_on(actor, value, shares)

    def _passed_on(self, actor: _Actor, answers: Sequence[tuple[str, int, bytes]], shares: Shares) -> None:
        for kind, index, content in answers:
            if kind == "error":
                raise pickle.loads(content)  # noqa: S301  # of our own actor
            self._pipe.send(("part", (shares.done(actor, index), content)))
        if actor in shares.members:
            self._call(actor, "more", None, GATHER)

    def _check_version(self, actor: _Actor, node: str, versions: Mapping[str, str], problem: str) -> None:
        actor.node = node
        if problem:
            raise InputError(
                f"the node {node} of the cluster has no bt-tasksim, or an older version ({problem}): install "
                "there what is here"
            )
        if differ := differences(versions, self._settings.versions):
            raise InputError(
                f"the node {node} of the cluster has another version ({differ}): install the same everywhere"
            )

    def _of_node(self, actor: _Actor, error: BtTasksimError) -> BtTasksimError:
        if self._settings.address == LOCAL:
            return error
        kind = InputError if isinstance(error, InputError) else MachineError
        return kind(f"on the node {actor.node} of the cluster: {error}")

    def _lost(self, actor: _Actor, shares: Shares) -> None:
        """Others make up for an actor that has ended, or cannot be reached."""
        self._actors.remove(actor)
        with contextlib.suppress(Exception):
            self._ray.kill(actor.handle)
        if not actor.begun:
            self._failed_starts += 1
            self._rest_until = time.monotonic() + min(0.5 * 2.0**self._failed_starts, LONGEST_REST)
            if self._failed_starts >= MOST_STARTS and not self._living:
                raise MachineError(
                    f"actors of the Ray cluster end while they begin, such as on {actor.node}; is there "
                    "enough memory?"
                )
        try:
            again = shares.lost(actor)
        except TooManyLostError as error:
            self._pipe.send(("culprit", error.number))
            raise _ClosedError from error
        self._looked = time.monotonic() - GROW + 1.0  # there may be room soon
        if again:
            self._pipe.send(("lost", (actor.node, len(again))))


def connect(settings: Settings) -> Any:
    """Ray, connected.

    Raises:
        InputError: The cluster is of another version, or wants a token.
        MachineError: It cannot be reached, or cannot be started.
    """
    import ray

    where = f"the Ray cluster at {settings.address}"
    try:
        if settings.address == LOCAL:
            ray.init(
                address="local",
                num_cpus=max(len(os.sched_getaffinity(0)), settings.count or 1),
                num_gpus=0,
                object_store_memory=OBJECT_STORE,
                include_dashboard=False,
                log_to_driver=False,
                _temp_dir=settings.temporary,
            )
        else:
            ray.init(address=settings.address, log_to_driver=False)
    except ray.exceptions.AuthenticationError as error:
        raise InputError(
            f"{where} asks for its token: set RAY_AUTH_MODE=token, and RAY_AUTH_TOKEN or ~/.ray/auth_token "
            "as on its head node"
        ) from error
    except Exception as error:
        said = " ".join(str(error).split())
        if "ersion mismatch" in said:
            raise InputError(f"{where} has another version of Ray or Python: {said}") from error
        kind = "cannot be started" if settings.address == LOCAL else "cannot be joined"
        raise MachineError(f"{where} {kind}: {said or type(error).__name__}") from error
    return ray


def main() -> None:
    """The process: the number of the pipe's file is its last argument."""
    pipe = Connection(int(sys.argv[-1]))
    settings: Settings = pipe.recv()
    messages: queue.Queue[Any] = queue.Queue()
    threading.Thread(target=_listen, args=(pipe, messages, settings), daemon=True).start()
    try:
        ray = connect(settings)
        pipe.send(("ready", None))
        driver = ClusterDriver(ray, settings, pipe, messages)
        while (message := messages.get()) is not None:
            driver.spread(*message)
    except BtTasksimError as error:
        with contextlib.suppress(OSError):
            pipe.send(("error", pickle.dumps(error)))
            messages.get()  # until the other side has read it
    except (_ClosedError, BrokenPipeError, ConnectionError):
        messages.get()
    finally:
        _end(settings)


def _listen(pipe: Connection, messages: queue.Queue[Any], settings: Settings) -> None:
    while True:
        try:
            messages.put(pipe.recv())
        except (EOFError, OSError):
            break
    messages.put(None)
    time.sleep(ENDING)  # the main thread hangs
    os._exit(1)


def _end(settings: Settings) -> None:
    import ray

    with contextlib.suppress(Exception):
        ray.shutdown()
    if settings.temporary:
        shutil.rmtree(settings.temporary, ignore_errors=True)
    sys.stderr.flush()
    os._exit(0)


def _last_line(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[-1]
