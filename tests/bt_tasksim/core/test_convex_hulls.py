"""Hulls as coal has them: what has no volume is refused, and does not end the process."""

import numpy as np
import pytest

from bt_tasksim.core.convex_hulls import convex
from bt_tasksim.core.errors import InputError

CUBE = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], float) - 0.5


@pytest.mark.parametrize(
    "corners",
    [
        np.zeros((0, 3)),
        CUBE[:3],
        CUBE * (1.0, 1.0, 0.0),
        np.tile(CUBE[:1], (8, 1)),
        np.where(CUBE > 0.4, np.nan, CUBE),
        np.outer(np.arange(5.0), [1.0, 2.0, 3.0]),
    ],
)
def test_what_has_no_volume_is_refused(corners):
    with pytest.raises(InputError, match="corners"):
        convex(corners)
