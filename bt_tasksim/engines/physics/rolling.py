"""Rolling and spinning resistance: why what rolls, or spins on a point, comes to rest.

Rigid bodies would roll on a level floor for ever. Real ones and their supports deform, so that the normal
force ``N`` acts a little ahead of the point of contact: by the lever ``b``, the coefficient of rolling
resistance with the dimension of a length. The torque ``b * N`` then opposes rolling, whatever the speed
(Johnson, *Contact Mechanics*, 1985, section 9.1; Hibbeler, *Engineering Mechanics: Statics*, section 8.8).

For the same reason contact is no point but a patch, which resists spinning about its normal. Of radius ``a``,
under Hertz's pressure and with Coulomb's friction ``mu``, it does so with ``3 pi / 16 * mu * a * N``
(Johnson, section 7.4): another lever.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

ROLLING_RESISTANCE = 1e-3
"""The lever ``b`` in metres; tables of engineering have 0.5 to 2 mm for wood and plastics.

PhysX feeds energy into hulls that roll from face to face: without resistance a cylinder of 6 cm never falls
below 0.1 m/s, and a cup rolls to and fro in a bin for ever. 0.5 mm only just overcomes that.
"""
SPINNING_RESISTANCE = 3.0 * math.pi / 16.0 * 0.5 * 1e-3
"""The lever in metres of a patch of 1 mm radius and the friction 0.5.

Without it a superellipsoid that stands on a small facet of its hull spins for seconds once a finger has left
it, at 14 degrees a second: in MuJoCo two of a hundred random tasks were missed by that (1070047, 1070096).
"""


def rolling_damping(
    spin: Sequence[float], inertia: Sequence[float], loads: Iterable[Sequence[float]]
) -> float:
    """The rate at which its supports slow an object's turning down now, as a share of its spin a second.

    Each contact resists rolling, the part of the angular velocity that is perpendicular to its normal, and
    spinning, the part about it.

    Args:
        spin: Angular velocity ``(3,)`` in the frame of the principal axes, rad/s, not zero.
        inertia: Principal moments of inertia ``(3,)``, kg m^2.
        loads: Normal forces ``(3,)`` on the object in that frame, N.

    Returns:
        1/s; the resisting torque is this times the angular momentum.
    """
    speed = math.hypot(*spin)
    moment = sum(i * s * s for i, s in zip(inertia, spin, strict=True)) / speed**2
    torque = 0.0
    for load in loads:
        size = math.hypot(*load)
        if size > 0.0:
            about = sum(n * s for n, s in zip(load, spin, strict=True)) / size
            rolls = math.sqrt(max(speed**2 - about**2, 0.0))
            torque += size * (ROLLING_RESISTANCE * rolls + SPINNING_RESISTANCE * abs(about)) / speed
    return torque / (moment * speed)
