"""Pegs."""

from __future__ import annotations

from bt_tasksim.core.registry import register
from bt_tasksim.scene.kinds.box import BoxKind


@register("shape", "peg")
class PegKind(BoxKind):
    """A long box, as wide as it is thick, to be pushed into a hole."""

    size_range = ((0.030, 0.030, 0.11), (0.033, 0.033, 0.14))
    round = True
    symmetry = 4
