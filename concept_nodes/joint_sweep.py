"""What a part of furniture would meet on its way along its joint, by itself."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

from bt_tasksim.concept_nodes.view import WorldView
from bt_tasksim.core.narrow_phase import coal
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import FURNITURE
from bt_tasksim.planning.surroundings import pieces_of, things_of
from bt_tasksim.planning.things import Thing, inner, shapes_of
from bt_tasksim.robot.kinematics.models import se3


def met(view: WorldView, target: str, parts: Array, apart: Collection[str] = ()) -> tuple[int, str] | None:
    """The first of some poses at which a part would meet something, and the name of that.

    What stands flush with it is not met: of the part the inside is looked at, see
    `bt_tasksim.planning.things.shrunk`. Its own fixture and the parts of that bear it, and what it meets at
    the first pose it touches already.

    Args:
        view: The world.
        target: The part.
        parts: Its poses ``(n, 7)``, close together, from where it is.
        apart: Other things that are not looked at, such as what goes along.
    """
    own = own_furniture(view, target)
    others = {name: at for name, at in view.objects.items() if name not in {target, *apart, *view.adrift}}
    around = [thing for thing in things_of(view.world, others) if thing.name not in own]
    solids = [(thing.name, se3(thing.pose), shapes_of(thing)) for thing in around]
    inside = inner(Thing(target, parts[0], pieces=pieces_of(view.model(target))))
    shapes = [shape for piece in inside for shape in shapes_of(piece)]
    for k, pose in enumerate(parts):
        at = se3(pose)
        touched = [solid for solid in solids if _meets(shapes, at, solid[2], solid[1])]
        if k == 0:
            solids = [solid for solid in solids if solid not in touched]
        elif touched:
            return k, touched[0][0]
    return None


def own_furniture(view: WorldView, target: str) -> frozenset[str]:
    """Names of the fixture that a part belongs to, and of all parts of that."""
    joint = view.model(target).joint
    assert joint is not None, "it is a part of furniture"
    parts = {m.name for m in view.world.objects if m.joint is not None and m.joint.fixture == joint.fixture}
    return frozenset({joint.fixture or FURNITURE, *parts})


def _meets(shapes: Sequence[Any], at: Any, others: Sequence[Any], there: Any) -> bool:
    asked, answer = coal.CollisionRequest(), coal.CollisionResult()
    return any(bool(coal.collide(a, at, b, there, asked, answer)) for a in shapes for b in others)
