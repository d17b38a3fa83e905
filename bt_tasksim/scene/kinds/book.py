"""Books."""

from __future__ import annotations

from bt_tasksim.core.registry import register
from bt_tasksim.scene.kinds.box import BoxKind


@register("shape", "book")
class BookKind(BoxKind):
    """A book that stands upright, its spine to the side."""

    size_range = ((0.110, 0.030, 0.160), (0.135, 0.034, 0.200))
