"""What looks the same after a turn: how much a surface and itself turned may differ."""

from __future__ import annotations

import numpy as np

from bt_tasksim.core.poses import Array

LEAST, SHARE, MOST = 0.0002, 0.01, 0.001
"""Metres between a surface and itself turned up to which the two look the same: at least 0.2 mm, which
finding nearest points on a mesh costs; else this share of its size; at most 1 mm, as much as a depth camera
is wrong by."""


def symmetry_tolerance(extent: Array | tuple[float, float, float]) -> float:
    """Metres up to which something of a full size ``(3,)``, metres, looks the same turned."""
    return min(max(LEAST, SHARE * float(np.linalg.norm(extent))), MOST)


def as_wide_as_long(extent: Array | tuple[float, float, float]) -> bool:
    """Whether sizes along x and y are the same, of a full size ``(3,)`` in metres.

    A quarter turn moves a face by half of the difference.
    """
    return bool(abs(extent[0] - extent[1]) / 2 <= symmetry_tolerance(extent))


def order_of_quarters(extent: Array | tuple[float, float, float]) -> int:
    """Order of the symmetry about z of what has two planes of symmetry and looks alike along x and y.

    4 where it is as wide as long, else 2.
    """
    return 4 if as_wide_as_long(extent) else 2
