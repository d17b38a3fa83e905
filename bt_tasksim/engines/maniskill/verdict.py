"""What became of a run, as the environment itself judges it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from bt_tasksim.core.outcomes import Form, register_reason
from bt_tasksim.core.units import METRES
from bt_tasksim.scene.success import Verdict

ENVIRONMENT_SUCCESS = register_reason("environment_success", "{environment} calls it a success ({said})")
ENVIRONMENT_NO_SUCCESS = register_reason(
    "environment_no_success", "{environment} calls it no success ({said})"
)
APART = Form("{object} {distance} from {place}", {"distance": METRES})


def verdict(
    environment: str,
    said: Mapping[str, Any],
    distance: tuple[str, str, float] | None,
    penetration: float,
) -> Verdict:
    """The verdict on what an environment's ``evaluate`` says.

    Args:
        environment: Its id.
        said: What it says, in plain values; ``success`` is what counts.
        distance: An object, a place, and the metres between them, where the environment's file asks for it.
        penetration: Deepest overlap of two bodies during the run, metres.
    """
    success: bool = said["success"]
    flags = [
        f"{name} {'yes' if value else 'no'}" if isinstance(value, bool) else f"{name} {value:.3g}"
        for name, value in said.items()
        if name != "success" and isinstance(value, bool | int | float)
    ]
    reason = ENVIRONMENT_SUCCESS if success else ENVIRONMENT_NO_SUCCESS
    detail = None if distance is None else APART(object=distance[0], place=distance[1], distance=distance[2])
    return Verdict(
        success,
        reason(detail, environment=environment, said=", ".join(flags) or "it says no more"),
        math.nan if distance is None else distance[2],
        math.nan,
        penetration,
    )
