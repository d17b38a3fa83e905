"""PhysX, of which a process has one: made for things of some centimetres.

PhysX is told how long things usually are and how fast (``PxTolerancesScale``), and takes from that within how
much it may err, as where two shapes meet. SAPIEN says 10 cm and 0.2 m/s.
"""

from __future__ import annotations

import functools
from typing import Any

TOLERANCES = (0.03, 0.3)
"""Metres and metres a second that PhysX takes for usual.

Of random tasks that are possible (`benchmarks.any_tree`, seeds 995000, 996000 and 996300 on) there succeed

| tolerances | SO-100 | Ability hand | Panda |
|---|---|---|---|
| 0.01 m, 0.1 m/s | 107 of 109 | 85 of 90 | 60 of 60 |
| 0.03 m, 0.3 m/s | 106 of 109 | 88 of 90 | 59 of 60 |
| 0.1 m, 0.2 m/s, SAPIEN's own | 27 of 30 | 49 of 50 | 59 of 60 |

These differences are within chance. What decided are grips that were looked at: with SAPIEN's own tolerances
normals of contacts jump from one step to the next where the SO-100's jaw holds something small and still, and
with 0.01 m two things turn in the Ability hand (996302 and 996328) that are held with the other two."""


@functools.cache
def start_physx() -> Any:
    """PhysX with `TOLERANCES`; to be called before anything else of SAPIEN's is made.

    A process has one: where something else of SAPIEN's comes first it has SAPIEN's own tolerances, and no
    word is said of that. It lives as long as somebody keeps it, which the cache does.
    """
    from sapien import physx

    return physx.PhysxEngine(*TOLERANCES)
