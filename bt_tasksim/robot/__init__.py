"""What a robot is: its description, its limits, and its URDF.

The names that people import are handed on when they are first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from bt_tasksim.core.lazy import handed_on

if TYPE_CHECKING:
    from bt_tasksim.robot.description import RobotDescription, load_robot
    from bt_tasksim.robot.limits import SafetyLimits

__getattr__, __dir__ = handed_on(
    __name__,
    {
        "description": ("RobotDescription", "load_robot"),
        "limits": ("SafetyLimits",),
    },
)

__all__ = ["RobotDescription", "SafetyLimits", "load_robot"]
