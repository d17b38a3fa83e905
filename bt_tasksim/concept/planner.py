"""Planning beside the control loop of a real robot.

A concept plans when it becomes active, which may take seconds among many things. In a simulation time stands
still meanwhile. A robot's loop goes on: what takes longer than a part of a control period is done on a thread
of its own, nobody commands anything, so the arm stays where it was told to be, and every state is checked and
every sign of life given as usual.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, TimeoutError
from typing import Any

import numpy as np

from bt_tasksim.concept.seen import Seen
from bt_tasksim.core.poses import Array, host

SOON = 0.015
"""Seconds for which a tick waits for a plan, of a control period of 20 to 50 ms: a straight way is there by
then, and its motion begins at once."""
PATIENCE = 60.0
"""Seconds after which a plan is not waited for any more. Searches end after a number of questions, on a slow
machine after some seconds; this is for a concept's own that does not end."""
MOVED = 0.02
"""Radians by which joints of the arm may differ from those that a plan begins with. An arm that was moving
when it was asked for comes to rest in the meantime, and then it is planned once more."""
ANEW = 3
"""How often that may happen."""
THREADS = 2
"""One more than is needed, for a plan that was dropped may still be under way."""


class Planner:
    """Makes plans on threads of its own."""

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(THREADS, thread_name_prefix="planning")

    def begin(self, plan: Callable[[Seen], Any], seen: Seen, anew: int = 0) -> Plan:
        """Have a plan made.

        Args:
            plan: Makes it from what is seen in one world.
            seen: That.
            anew: How often it was begun before, since the arm still moved.
        """
        still = seen.believing(seen.objects)  # asked for here, where nobody goes on to the next tick
        return Plan(self._pool.submit(plan, still), _joints(seen), anew)

    def close(self) -> None:
        """Begin no other plan; what is under way ends by itself."""
        self._pool.shutdown(wait=False, cancel_futures=True)


class Plan:
    """A plan that is being made.

    Args:
        future: It.
        joints: The arm's ``(n_arm,)`` with which it begins.
        anew: How often it was begun before, since the arm still moved.
    """

    def __init__(self, future: Future[Any], joints: Array, anew: int) -> None:
        self._future, self._joints, self.anew = future, joints, anew

    def ready(self, wait: float) -> bool:
        """Whether it is there, at the latest after so many seconds."""
        try:
            self._future.exception(wait)
        except TimeoutError:
            return False
        return True

    def outdated(self, seen: Seen) -> bool:
        """The arm is not where the plan begins any more, and it may be made once more."""
        return self.anew < ANEW and float(np.abs(_joints(seen) - self._joints).max(initial=0.0)) > MOVED

    def result(self) -> Any:
        """What was planned.

        Raises:
            Exception: Whatever the planning has raised.
        """
        return self._future.result()


def _joints(seen: Seen) -> Array:
    found: Array = np.array(host(seen.observation.arm_position), float)
    return found
