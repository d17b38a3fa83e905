"""What runs on the nodes of a cluster: an actor that keeps something and does shares of work with it.

It travels there by value, and imports nothing of this project before it was asked which version is there.
"""

from __future__ import annotations

import functools
import os
import pickle
import platform
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any


class Member:
    """An actor of a `bt_tasksim.core.cluster.Cluster`; what it gives and takes of ours are bytes.

    (Pickled ones: whoever may speak to a Ray cluster may run anything there anyway.)
    """

    def __init__(self) -> None:
        for library in ("OMP", "OPENBLAS", "MKL"):
            os.environ[f"{library}_NUM_THREADS"] = "1"  # the actors are the parallelism
        self._state: Callable[[], Any] | None = None
        self._answers: Iterator[tuple[str, Any]] = iter(())

    def about(self) -> tuple[str, dict[str, str], str]:
        """The machine's name, the identity of the bt-tasksim that is there, and why there is none."""
        try:
            from bt_tasksim.core.identity import identity
        except Exception as error:
            return platform.node(), {}, f"{type(error).__name__}: {error}"
        return platform.node(), identity(), ""

    def begin(self, folder: str, make: bytes) -> bytes:
        """Make what it keeps.

        Args:
            folder: Where files are looked for, if there is such a folder.
            make: Pickled, makes it.

        Returns:
            A pickled error; nothing where there is none.
        """
        from bt_tasksim.core.fleet import sendable

        if os.path.isdir(folder):
            os.chdir(folder)
        try:
            self._state = functools.cache(pickle.loads(make))  # noqa: S301  # see the class
            self._state()
        except Exception as error:
            return pickle.dumps(sendable(error))
        return b""

    def more(
        self, share: tuple[bytes, Sequence[bytes]] | None, seconds: float
    ) -> list[tuple[str, int, bytes]]:
        """Some of the results of a share: of so many seconds, and one at least.

        Args:
            share: The work and the items of a new share, pickled; None to go on with the last one.
            seconds: How long to gather results.

        Returns:
            ``part``, the item's index and the pickled result; or ``error``, 0 and the pickled error.
        """
        if share is not None:
            self._answers = self._begun(share)
        found: list[tuple[str, int, bytes]] = []
        until = time.monotonic() + seconds
        for kind, what in self._answers:
            if kind == "error":
                return [*found, ("error", 0, pickle.dumps(what))]
            index, result = what
            found.append(("part", index, pickle.dumps(result)))
            if time.monotonic() >= until:
                break
        return found

    def _begun(self, share: tuple[bytes, Sequence[bytes]]) -> Iterator[tuple[str, Any]]:
        from bt_tasksim.core.fleet import results_of

        assert self._state is not None
        work = pickle.loads(share[0])  # noqa: S301  # see the class
        items = [pickle.loads(item) for item in share[1]]  # noqa: S301
        return results_of(self._state, work, items)
