"""A twin of real ROS processes for the tests of this folder."""

from __future__ import annotations

import json
import os
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import pytest

from benchmarks.faults import Bench
from bt_tasksim.core.errors import MachineError
from bt_tasksim.hardware.ros.websocket import WebSocket
from bt_tasksim.hardware.twin.environment import environment


@pytest.fixture(scope="module")
def bench() -> Iterator[Bench]:
    """Bridge and node, in a ROS domain of this process's own."""
    try:
        environment()
    except MachineError as error:
        pytest.skip(str(error))
    made = Bench(domain=1 + os.getpid() % 100)
    yield made
    made.close()


class Stranger:
    """Somebody else in the cell who publishes whatever comes to mind.

    Attributes:
        sent: Messages by topic.
    """

    def __init__(self, port: int, kinds: Mapping[str, str]) -> None:
        self.socket, self.sent = WebSocket("127.0.0.1", port), Counter[str]()
        self._n = 0
        for topic, kind in kinds.items():
            self.socket.send(json.dumps({"op": "advertise", "topic": topic, "type": kind}))

    def publish(self, topic: str, message: Any) -> None:
        self.sent[topic] += 1
        self.socket.send(json.dumps({"op": "publish", "topic": topic, "msg": message}))
        self._n += 1
        if self._n % 8 == 0:
            self._meet()

    def _meet(self) -> None:
        """Wait until the bridge has dealt with everything: it lets go of who leaves 16 complaints unread."""
        self.socket.send(json.dumps({"op": "are you there", "id": str(self._n)}))
        end = time.monotonic() + 10.0
        while time.monotonic() < end:
            text = self.socket.receive(1.0)
            if text is not None and json.loads(text).get("id") == str(self._n):
                return
        raise AssertionError("the bridge has not answered for 10 s")


@pytest.fixture
def stranger(bench: Bench) -> Iterator[Callable[[Mapping[str, str]], Stranger]]:
    """Somebody who publishes on topics of these types."""
    made: list[Stranger] = []

    def make(kinds: Mapping[str, str]) -> Stranger:
        made.append(Stranger(bench.twin.port, kinds))
        return made[-1]

    yield make
    for one in made:
        one.socket.close()
