"""Judges one case: its result or error, its time, its memory, and what it opened."""

from __future__ import annotations

import resource
import signal
import socket
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from bt_tasksim.core.errors import BtTasksimError
from tests.attacks.mutations import Bait

SECONDS = 10.0
GIBIBYTES = 2.0


class TooLong(BaseException):
    """A case does not end."""


@dataclass
class Count:
    """What became of the cases of a kind.

    Attributes:
        right: A result.
        errors: A clear error.
        violations: Everything else: what happened, and in which case.
    """

    right: int = 0
    errors: int = 0
    violations: list[tuple[int, str]] = field(default_factory=list)

    @property
    def cases(self) -> int:
        """All of them."""
        return self.right + self.errors + len(self.violations)


@dataclass
class Watch:
    """Counts cases, and sees what they open; one of them in a process, since audit hooks stay.

    Args:
        bait: What no case may open.
    """

    bait: Bait
    count: Count = field(default_factory=Count)
    _watching: bool = False
    _opened: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        sys.addaudithook(self._hook)
        self._most = max(GIBIBYTES, _peak())  # a process begins with the peak of the one that starts it

    def _hook(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self._watching:
            return
        if event in ("open", "os.listdir", "os.scandir", "subprocess.Popen"):
            if Path(self.bait.path).parent.name in str(arguments[:2]):
                self._opened.append(f"{event} {str(arguments[0])[:200]}")
        elif event == "socket.connect" and not isinstance(arguments[1], str | bytes):
            self._opened.append(f"connected to {arguments[1]}")
        elif event == "socket.getaddrinfo":
            self._opened.append(f"asked for {arguments[0]}")

    def judge(self, number: int, case: Callable[[], object]) -> None:
        """Run a case and count it."""
        self._opened.clear()
        started, self._watching, said = time.monotonic(), True, ""
        error: BaseException | None = None
        try:
            with _limited(3.0 * SECONDS):
                case()
        except (BtTasksimError, KeyboardInterrupt) as found:
            if isinstance(found, KeyboardInterrupt):
                raise
            error, sentence = found, str(found)
            if not sentence.isprintable() or not sentence or len(sentence) > 2000:
                said = f"no clear sentence: {sentence[:300]!r}"
        except TooLong:
            said = "it does not end"
        except BaseException as found:
            where = traceback.extract_tb(found.__traceback__)[-1]
            said = f"{type(found).__name__}: {str(found)[:150]} ({Path(where.filename).name}:{where.lineno})"
        finally:
            self._watching = False
        seconds = time.monotonic() - started
        peak = _peak()
        if self._opened:
            said = said or f"opened: {self._opened[0]}"
        elif seconds > SECONDS:
            said = said or f"took {seconds:.1f} s"
        elif peak > self._most:
            said = said or f"took {peak:.1f} GiB"
        if said:
            self.count.violations.append((number, said))
        elif error is None:
            self.count.right += 1
        else:
            self.count.errors += 1


@contextmanager
def baited(folder: Path) -> Iterator[Bait]:
    """A file and an address to be left alone."""
    outside = folder / "outside-c0ffee"
    outside.mkdir()
    (outside / "bait.yaml").write_text("name: bait\n")
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield Bait(str(outside / "bait.yaml"), f"127.0.0.1:{server.getsockname()[1]}")


@contextmanager
def _limited(seconds: float) -> Iterator[None]:
    def ring(number: int, frame: Any) -> None:
        raise TooLong

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def _peak() -> float:
    """The most memory that this process has had, GiB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
