"""PhysX, of which a process has one: made for things of some centimetres.

PhysX is told how long things usually are and how fast, and takes from that within how much it may err, as
where two shapes meet and along which normal. SAPIEN says 10 cm and 0.2 m/s. Where a jaw holds something of
some centimetres, normals of contacts then jump from one step to the next, and the grip is gone for a step,
though nothing moves.
"""

from __future__ import annotations

import functools
from typing import Any

TOLERANCES = (0.03, 0.3)
"""Metres and metres a second that PhysX takes for usual. With smaller ones normals of contacts are steadier,
which one jaw needs that presses on a small thing; but with 0.01 m things creep or turn in the Ability hand,
whose fingers tremble: two of 40 that neither 0.03 m nor SAPIEN's own tolerances lose.

In random tasks of seeds 995000 on, 996000 on and 996300 on, of those that are possible, 106 of 109 succeed
with the SO-100, 88 of 90 with the Ability hand and 59 of 60 with the Panda; with 0.01 m 107, 85 and 60. With
SAPIEN's own 27 of the first 30 with the SO-100 (28 with these), 49 of the first 50 with the Ability hand (49)
and 59 with the Panda."""


@functools.cache
def start_physx() -> Any:
    """PhysX with `TOLERANCES`; to be called before anything else of SAPIEN's is made.

    SAPIEN makes it with its own where something else comes first in the process, and keeps it then.
    """
    from sapien import physx

    return physx.PhysxEngine(*TOLERANCES)
