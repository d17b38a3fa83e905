"""Drinks cans."""

from __future__ import annotations

from bt_tasksim.core.registry import register
from bt_tasksim.scene.kinds.cylinder import CylinderKind


@register("shape", "can")
class CanKind(CylinderKind):
    """A cylinder as large as a drinks can, from a slim one of 150 ml to the usual one of 330 ml."""

    size_range = ((0.053, 0.053, 0.088), (0.066, 0.066, 0.122))
