"""What leaves a connection to rosbridge: the newest message of a topic, in time or not at all."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from bt_tasksim.hardware.ros.link import Link


def link_of(sent: list[Any], waiting: list[Callable[[], None]]) -> Link:
    """A link whose connection's thread does nothing by itself."""
    link = Link.__new__(Link)
    loop = SimpleNamespace(call_soon_threadsafe=lambda act, *words: waiting.append(lambda: act(*words)))
    link._ros = SimpleNamespace(factory=SimpleNamespace(manager=SimpleNamespace(loop=loop)))
    link._roslibpy = SimpleNamespace(Message=lambda message: message)
    link._topics = {"/arm": SimpleNamespace(publish=sent.append)}
    link._slots, link._lock, link.lost = {}, threading.Lock(), ""
    return link


def test_the_newest_message_leaves_and_none_that_was_held_up() -> None:
    sent: list[Any] = []
    waiting: list[Callable[[], None]] = []
    link = link_of(sent, waiting)
    link.publish("/arm", {"n": 1}, 0.05)
    link.publish("/arm", {"n": 2}, 0.05)
    waiting.pop()()
    assert sent == [{"n": 2}] and not waiting
    link.publish("/arm", {"n": 3}, 0.05)
    time.sleep(0.06)
    waiting.pop()()
    assert sent == [{"n": 2}], "a command that is late is not sent"
    link.publish("/arm", {"n": 4})
    waiting.pop()()
    assert sent[-1] == {"n": 4}
