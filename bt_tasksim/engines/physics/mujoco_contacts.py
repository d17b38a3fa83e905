"""How bodies touch in MuJoCo: which pairs of shapes can, and the parameters of their contacts.

MuJoCo takes the larger of two frictions, and PhysX their mean; so that one configuration means the same in
both, every pair of shapes that can touch is stated, with its own parameters, and no others are looked for.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bt_tasksim.engines.physics.rolling import SPINNING_RESISTANCE

if TYPE_CHECKING:
    import mujoco as mj

ROLES = ("base", "link", "object", "fixture")
"""What a shape belongs to: a link of the robot that stands still, any other link, an object, a fixture."""

TIMESTEP = 0.002
"""Seconds of a step, at most: a whole number of them makes a control period."""
FINE_STEP = 0.00025
"""Seconds of a step, at most, while an object falls or is pushed: what lands at 2 m/s then goes less than a
millimetre deep."""
REACH = 0.0005
"""Metres of distance up to which contacts are looked for, and bodies count as touching; they carry force
from 0 on. MuJoCo keeps four points of a pair of faces, those that lie far apart: looked for from farther
away, the lowest point of a round base would not always be one of them."""
SOLREF = (4 * FINE_STEP, 1.0)
"""Time constant in seconds and damping ratio of contacts among objects and fixtures. MuJoCo raises the time
to twice the step, which is what counts in ordinary steps; twice the fine step would let things that slide
hop."""
FRICTION_SOLREF = (2 * TIMESTEP, 1.0)
"""The same of all friction. Slower, and things slide below the angle of friction; faster, and what slides
hops: MuJoCo's friction pushes bodies apart in proportion to the rate at which it would stop them."""
HAND_SOLREF = (0.012, 1.0)
"""The same of what the robot presses on: pads and the structure behind them give way. 30 N of a finger press
some 0.6 mm deep; an arm that hits something at 0.3 m/s comes to rest within a millimetre or two. Harder,
and every brush of a finger with a cup's rim is a blow of 150 N; softer, and the judge's 2 mm of overlap
come near."""
TIP_SOLREF = (0.0075, 1.0)
"""The same of fingertips on objects: two that close at 0.18 m/s on the wall of a mug, 3 mm thick, met 3.1 mm
deep at 12 ms, and meet 1.6 mm deep at this; of 60 random tasks 60 succeed, and 58 at 12 ms."""
SOLIMP = (0.99, 0.998, 0.001, 0.5, 2.0)
"""Impedance of contacts among objects and fixtures: nearly that of rigid bodies. MuJoCo measures it by the
masses that touch, so that it must carry a light cup which a heavy arm sets down."""
HAND_SOLIMP = (0.98, 0.99, 0.001, 0.5, 2.0)
"""The same of what the robot presses on."""
IMPRATIO = 100.0
"""Impedance of friction over that of the normal force. The lower it is, the faster things creep under a load:
with this what is held creeps by some 0.01 mm in 5 s. With 1000 steps take 15 % longer, and of 54 things on
slopes that they should stick to three slid by 0.2 to 0.7 mm in a second."""
ROLLING = 5e-4
"""Metres: what an object rolls on resists with this lever times the normal force, as wood and plastic do
(`bt_tasksim.engines.physics.rolling` has the law). Without it a cup that leans in a corner rocks for ever."""
FRICTION = 0.5
"""Friction of the robot's links other than the pads."""
_NO_TWIST = 1e-5


@dataclass(frozen=True)
class Body:
    """What a shape belongs to.

    Attributes:
        role: One of `ROLES`.
        index: Number of the object, or of the fixture behind the objects; -1 for links.
        name: Name of the link, the object or the fixture.
        tip: Number of the fingertip, or -1.
        neighbours: Names of what a joint joins to it: links, or a fixture and its other parts.
    """

    role: str
    index: int
    name: str
    tip: int = -1
    neighbours: frozenset[str] = frozenset()


@dataclass(frozen=True)
class ContactSurface:
    """Friction, and radius in metres of the contact patch that resists twisting; 0: a point."""

    friction: float
    patch: float = 0.0


@dataclass(frozen=True)
class Solid:
    """A convex shape: its name in the model, its body and surface."""

    name: str
    body: Body
    surface: ContactSurface


def touching_pairs(solids: Sequence[Solid]) -> Iterator[tuple[Solid, Solid]]:
    """All pairs of shapes that can touch.

    Objects touch everything. Links touch objects and fixtures; of each other, only fingertips touch links,
    unless a joint joins the two. What stands still does not touch what stands still.
    """
    for a, b in itertools.combinations(solids, 2):
        if _can_touch(a.body, b.body):
            yield a, b


def _can_touch(a: Body, b: Body) -> bool:
    roles = {a.role, b.role}
    if "object" in roles:
        if "link" not in roles and (a.name in b.neighbours or b.name in a.neighbours):
            return False
        return a.role != b.role or a.index != b.index
    if "link" not in roles:
        return False
    if "fixture" in roles:
        return True
    if a.name == b.name or a.name in b.neighbours or b.name in a.neighbours:
        return False
    return a.tip >= 0 or b.tip >= 0


def add_pair(spec: mj.MjSpec, a: Solid, b: Solid) -> None:
    """State a pair in a ``mujoco.MjSpec``.

    Friction is Coulomb's with an elliptic cone, its coefficient the mean of both, as in PhysX. A pad's
    patch of radius r that presses with the force f resists twisting with up to friction * r * f; an object
    that lies or stands on something resists rolling and spinning.
    """
    friction = (a.surface.friction + b.surface.friction) / 2
    patch = max(a.surface.patch, b.surface.patch)
    pair = spec.add_pair(name=f"{a.name} {b.name}", geomname1=a.name, geomname2=b.name)
    robot = not {"link", "base"}.isdisjoint((a.body.role, b.body.role))
    pair.condim = (4 if patch > 0.0 else 3) if robot else 6
    twist = max(friction * patch, _NO_TWIST) if robot else SPINNING_RESISTANCE
    pair.friction = [friction, friction, twist, ROLLING, ROLLING]
    pair.solreffriction = list(FRICTION_SOLREF)
    grips = max(a.body.tip, b.body.tip) >= 0 and "object" in (a.body.role, b.body.role)
    pair.solref = list(TIP_SOLREF if grips else HAND_SOLREF if robot else SOLREF)
    pair.solimp = list(HAND_SOLIMP if robot else SOLIMP)
    pair.margin = 0.0
    pair.gap = REACH
