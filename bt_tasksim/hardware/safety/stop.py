"""The exception that says why a robot was stopped, and the units of its numbers."""

from __future__ import annotations

from bt_tasksim.core.errors import MachineError
from bt_tasksim.core.outcomes import Outcome, Reason
from bt_tasksim.core.units import Unit

RAD = Unit("rad", "rad", 1.0, ".3g")
RAD_PER_S = Unit("rad/s", "rad/s", 1.0, ".3g")
RAD_PER_S2 = Unit("rad/s^2", "rad/s^2", 1.0, ".3g")
M_PER_S = Unit("m/s", "m/s", 1.0, ".3g")
M_PER_S2 = Unit("m/s^2", "m/s^2", 1.0, ".3g")
M = Unit("m", "m", 1.0, ".3f")
N = Unit("N", "N", 1.0, ".3g")
NM = Unit("Nm", "Nm", 1.0, ".3g")


class SafetyStop(MachineError):  # noqa: N818  # a robot that stops in time has made no error
    """The robot was stopped, and stays so until a new run.

    Args:
        outcome: What was exceeded or went wrong, where and by how much.
    """

    def __init__(self, outcome: Outcome) -> None:
        super().__init__(outcome.sentence)
        self.outcome = outcome

    @property
    def reason(self) -> Reason:
        """The reason of the outcome."""
        return self.outcome.reason
