"""PhysX, of which a process has one: made for things of centimetres.

PhysX is told how long things usually are and how fast, and takes from that within how much it may err, as
where two shapes meet and along which normal. SAPIEN says 10 cm and 0.2 m/s. Where a jaw holds something of
some centimetres, normals of contacts then jump from one step to the next, and the grip is gone for a step,
though nothing moves.
"""

from __future__ import annotations

import functools
from typing import Any

TOLERANCES = (0.01, 0.1)
"""Metres and metres a second that PhysX takes for usual. In random tasks of seeds 995000 to 995029 29 of 30
succeed with the SO-100 (SAPIEN's own tolerances: 27; 0.03 m: 28; 0.02 m: 29), and of six things that had
crept out of its jaw all stay in it (0.03 m: four). The Ability hand does as before, 48 of 50 and 49 of 50,
and so does the Panda, 60 of 60 and 59 of 60. Fewer contacts are made up between meshes, none instead of 46
with the SO-100, but more between a box and a mesh, 66 instead of 12 with the Panda
(`bt_tasksim.engines.physics.sapien_phantoms`). Steps take as long."""


@functools.cache
def start_physx() -> Any:
    """PhysX with `TOLERANCES`; to be called before anything else of SAPIEN's is made.

    SAPIEN makes it with its own where something else comes first in the process, and keeps it then.
    """
    from sapien import physx

    return physx.PhysxEngine(*TOLERANCES)
