"""Actors of a Ray cluster as a fleet.

Ray runs in a process of its own (`bt_tasksim.core.cluster_process`): it takes over a process's signals and
streams, waits without limit for what does not answer, and ends the process when it has lost its cluster.
"""

from __future__ import annotations

import contextlib
import importlib.util
import os
import pickle
import re
import secrets
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator, Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, BinaryIO

from bt_tasksim.core import child
from bt_tasksim.core.cluster_process import ENDING, LOCAL, Settings
from bt_tasksim.core.errors import BtTasksimWarning, InputError, MachineError
from bt_tasksim.core.fleet import Fleet, ItemT, ResultT, StateT, Work
from bt_tasksim.core.identity import identity
from bt_tasksim.core.interrupts import ending
from bt_tasksim.core.resources import HOME

REACH = 5.0
"""Seconds within which a cluster's address must answer."""
GREET = 10.0
"""Seconds within which what is there must begin to speak."""
SETTINGS_FRAME = 4
"""Kind of the frame with which every end of an HTTP/2 connection begins (RFC 9113, 3.4)."""
START = 60.0
"""Seconds within which Ray must have started, or joined the cluster."""
LONGEST_PLACE = 24
"""Characters of the path of a folder for temporary files, which is part of the names of Ray's sockets."""

_ADDRESS = re.compile(r"(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9_.-]+):([0-9]{1,5})")
_PREFIX = re.compile(r"^\[[^]]*\] (\([^)]*\) )?\S+:[0-9]+: ")
"""Time, process and place in the source, in lines of Ray's log."""
_BEGIN = "from bt_tasksim.core.cluster_process import main; main()"
_ALONE = {
    "RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0",  # Ray's name for "on the loopback device alone"
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_AUTH_MODE": "token",
    "RAY_worker_niceness": "0",  # as other processes of the user, and not behind them all
}


def check_address(address: str) -> str:
    """An address of a cluster.

    Args:
        address: ``local``, or a host and port such as ``10.0.0.1:6379``.

    Raises:
        InputError: It is none, or Ray is not installed.
    """
    found = _ADDRESS.fullmatch(address)
    if address != LOCAL and (found is None or not 0 < int(found[2]) < 65536):
        hint = "; for ray:// give the head's own port, and run this on a node" if "://" in address else ""
        raise InputError(f"a cluster is 'local' or HOST:PORT, such as 10.0.0.1:6379, found '{address}'{hint}")
    if importlib.util.find_spec("ray") is None:
        raise InputError("a cluster needs the extra 'cluster': pip install 'bt-tasksim[cluster]'")
    return address


class Cluster(Fleet[StateT]):
    """Actors of a Ray cluster as a fleet. One that is lost, with its node or alone, is made up for.

    Args:
        make: Makes what an actor keeps, in the actor; it is pickled.
        address: See `check_address`.
        count: How many actors; None for as many as the cluster has processors and memory for.
        memory: Bytes that an actor needs.

    Raises:
        InputError: The address is none, Ray is not installed, or the cluster is of another version.
        MachineError: The cluster does not answer, or Ray cannot start.
    """

    def __init__(
        self, make: Callable[[], StateT], address: str, count: int | None = None, memory: int = 500_000_000
    ) -> None:
        self.address = check_address(address)
        self._where = "Ray" if address == LOCAL else f"the Ray cluster at {address}"
        if address != LOCAL:
            _check_reachable(address)
        self._process: subprocess.Popen[bytes] | None = None
        self._pipe: Connection | None = None
        self._patience = 1.0  # nothing has begun that must end in order
        self._temporary = tempfile.mkdtemp(prefix="bt-ray-", dir=_short_place()) if address == LOCAL else ""
        self._log: BinaryIO = tempfile.TemporaryFile()  # noqa: SIM115  # until `close`
        try:
            self._start()
            self._send(
                Settings(address, count, memory, pickle.dumps(make), os.getcwd(), identity(), self._temporary)
            )
            if not self._connection.poll(START):
                raise MachineError(f"{self._where} did not answer within {START:.0f} s")
            self._receive("ready")
            self._patience = ENDING + 2.0
        except BaseException:
            self.close(0.0)
            raise

    def spread(
        self, work: Work[StateT, ItemT, ResultT], items: Sequence[ItemT], share: int = 1
    ) -> Iterator[tuple[int, ResultT]]:
        """See `Fleet.spread`.

        Warns:
            BtTasksimWarning: An actor was lost.
        """
        self._send((pickle.dumps(work), [pickle.dumps(item) for item in items], share))
        left = len(items)
        while left:
            kind, what = self._receive("part", "lost", "culprit")
            if kind == "part":
                left -= 1
                number, content = what
                yield number, pickle.loads(content)  # noqa: S301  # of our own actor
            elif kind == "lost":
                node, count = what
                warnings.warn(
                    f"an actor on {node} ended; others do what it had not finished ({count})",
                    BtTasksimWarning,
                    stacklevel=2,
                )
            else:
                raise MachineError(
                    f"{items[what]} has ended one actor after the other; is there enough memory?"
                )

    def close(self, patience: float = 2.0) -> None:
        """End the actors, and Ray where it was started here: some seconds, whatever the patience."""
        with ending():
            if self._pipe is not None:
                self._pipe.close()
                self._pipe = None
            if self._process is not None:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    self._process.wait(self._patience)
                _kill_session(self._process.pid)
                self._process.wait()
                self._process = None
            if self._temporary:
                shutil.rmtree(self._temporary, ignore_errors=True)
            self._log.close()

    @property
    def _connection(self) -> Connection:
        assert self._pipe is not None, "it is closed"
        return self._pipe

    def _start(self) -> None:
        mine, theirs = socket.socketpair()
        with mine, theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-c", _BEGIN, str(theirs.fileno())],
                stdin=subprocess.DEVNULL,
                stdout=self._log,
                stderr=self._log,
                pass_fds=(theirs.fileno(),),
                env=_environment(self.address),
                start_new_session=True,  # Ctrl-C reaches this process alone, which ends the other
            )
            self._pipe = Connection(mine.detach())

    def _send(self, message: Any) -> None:
        try:
            self._connection.send(message)
        except OSError as error:
            raise self._is_lost() from error

    def _receive(self, *kinds: str) -> tuple[str, Any]:
        try:
            kind, what = self._connection.recv()
        except (EOFError, OSError) as error:
            raise self._is_lost() from error
        if kind == "error":
            raise pickle.loads(what)  # noqa: S301  # of our own process
        assert kind in kinds, kind
        return kind, what

    def _is_lost(self) -> MachineError:
        self._log.seek(0)
        lines = [line.strip() for line in self._log.read().decode(errors="replace").splitlines()]
        said = next((line for line in reversed(lines) if line), "it said nothing")
        said = _PREFIX.sub("", said).partition(". ")[0]
        return MachineError(f"{self._where} was lost: {said[:300]}")


def _short_place() -> str:
    """Where Ray's folder is: the names of its sockets, some 80 characters longer, may have 107."""
    usual = tempfile.gettempdir()
    return usual if len(usual) <= LONGEST_PLACE else "/tmp"


def _check_reachable(address: str) -> None:
    host, _, port = address.rpartition(":")
    try:
        with socket.create_connection((host.strip("[]"), int(port)), REACH) as connection:
            speaks = os.environ.get("RAY_USE_TLS", "0").lower() in ("1", "true") or _greets(connection)
    except OSError as error:
        raise MachineError(
            f"no Ray cluster answers at {address} ({error.strerror or error}): start its head there with "
            f"'ray start --head --port {port}'"
        ) from error
    if not speaks:
        raise MachineError(
            f"what listens at {address} does not answer as the head of a Ray cluster: give the address and "
            "port that its 'ray start --head' names"
        )


def _greets(connection: socket.socket) -> bool:
    """Whether the other end begins as a Ray head does, which speaks HTTP/2: with a frame of settings."""
    connection.settimeout(GREET)
    begin = b""
    try:
        while len(begin) < 9 and (more := connection.recv(9 - len(begin))):
            begin += more
    except TimeoutError:
        return False
    return len(begin) == 9 and begin[3] == SETTINGS_FRAME and begin[5:] == bytes(4)


def _environment(address: str) -> dict[str, str]:
    found = {**os.environ, **child.ONE_THREAD, **child.VARIABLES}
    places = [os.environ.get("PYTHONPATH", ""), str(HOME.parent)]
    found["PYTHONPATH"] = os.pathsep.join(filter(None, places))
    found.pop("RAY_ADDRESS", None)
    if address == LOCAL:
        found |= {**_ALONE, "RAY_AUTH_TOKEN": secrets.token_hex(32)}
    return found


def _kill_session(leader: int) -> None:
    """Kill what is left of a process and all that it has started; none of them has left its session."""
    for place in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError, ValueError):
            fields = place.read_text().rpartition(")")[2].split()
            if int(fields[3]) == leader and fields[0] != "Z":
                os.kill(int(place.parent.name), signal.SIGKILL)
