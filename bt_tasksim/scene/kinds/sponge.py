"""Sponges: light, flat boxes to wipe with."""

from __future__ import annotations

from bt_tasksim.core.registry import register
from bt_tasksim.scene.kinds.box import BoxKind


@register("shape", "sponge")
class SpongeKind(BoxKind):
    """A flat box that a hand takes across its narrow side."""

    size_range = ((0.085, 0.050, 0.045), (0.110, 0.065, 0.060))
