"""The emergency stop's topic: what it says, and whether it still says anything."""

from __future__ import annotations

import math
import time
from typing import Any

from bt_tasksim.hardware.ros import messages
from bt_tasksim.hardware.ros.link import LOG
from bt_tasksim.hardware.safety.engine import EmergencyStop


class EmergencyStopTopic:
    """Feeds an emergency stop from a topic.

    Attributes:
        pressed: What the newest message said.

    Args:
        topic: Its name.
        every: Longest time in seconds between two messages; infinite where it speaks on a change alone.
        emergency: The stop.
    """

    def __init__(self, topic: str, every: float, emergency: EmergencyStop) -> None:
        self.topic, self._every, self._emergency = topic, every, emergency
        self.anew()

    def anew(self) -> None:
        """A new connection: nothing has come yet."""
        self.pressed, self._heard = False, -math.inf

    def take(self, message: Any, arrived: float) -> None:
        """Take a std_msgs/Bool.

        Raises:
            UnusableMessageError: It is none.
        """
        pressed = messages.flag(message)
        before, self.pressed, self._heard = self.pressed, pressed, arrived
        if pressed and not before:
            LOG.warning("emergency stop on %s", self.topic)
            self._emergency.press(self.topic)

    def silent(self) -> str:
        """One sentence where it has not spoken for too long; else empty."""
        age = time.monotonic() - self._heard
        if age <= self._every or math.isinf(self._every):
            return ""
        since = "nothing has come" if math.isinf(age) else f"nothing for {1000 * age:.0f} ms"
        return f"stale: {since} on {self.topic}, which should speak every {1000 * self._every:.0f} ms"

    def warn(self) -> None:
        """Say so in the log where nobody has ever heard of it, and nothing says that one should."""
        if math.isinf(self._heard) and math.isinf(self._every):
            LOG.warning(
                "nothing has come on %s so far: is that the emergency stop's topic? One that speaks all the "
                "time is watched where its file says how often (every)",
                self.topic,
            )
