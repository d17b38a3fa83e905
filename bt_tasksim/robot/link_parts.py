"""A robot's links as convex parts: what its URDF says that they collide with, each mesh as its hull.

These are the hulls themselves, for questions of a millimetre. Ways are planned with
`bt_tasksim.planning.bodies`, whose hulls have few corners and are up to some millimetres larger for that.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from bt_tasksim.core.errors import NoVolumeError
from bt_tasksim.core.poses import Array
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.robot.mesh_hulls import mesh_hull
from bt_tasksim.robot.urdf_visuals import LinkVisual, load_collisions

DEEP = 0.01
"""Metres by which a link may be in furniture, or in another link: a robot stands on something, and hulls are
larger than the links."""


class LinkPart(NamedTuple):
    """A convex part of a link, as coal has it, at ``pose (7,)`` in the link's frame."""

    link: str
    form: Any
    pose: Array


class LinkParts(NamedTuple):
    """The parts of a robot's links, link by link.

    Attributes:
        parts: Those that are bodies.
        left_out: One sentence for each of the others: which it is, and why it is none.
    """

    parts: tuple[LinkPart, ...]
    left_out: tuple[str, ...]


def link_parts(robot: RobotDescription) -> LinkParts:
    """The parts of a robot's links, made once.

    Raises:
        InputError: The URDF, or a file of its shapes, is missing or cannot be read.
    """
    found: LinkParts = robot.derived("link parts", _link_parts)
    return found


def _link_parts(robot: RobotDescription) -> LinkParts:
    parts, left_out = list[LinkPart](), list[str]()
    for shape in load_collisions(robot.urdf):
        try:
            parts.append(LinkPart(shape.link, _form(shape), np.array(shape.pose)))
        except NoVolumeError as error:
            left_out.append(f"a collision shape of '{shape.link}' was left out: {error}")
    return LinkParts(tuple(parts), tuple(left_out))


def _form(shape: LinkVisual) -> Any:
    """A shape as coal has it.

    Raises:
        NoVolumeError: It is no body.
        InputError: Its file cannot be read.
    """
    from bt_tasksim.core.convex_hulls import convex
    from bt_tasksim.core.narrow_phase import coal

    match shape.kind:
        case "box":
            return coal.Box(*shape.size)
        case "sphere":
            return coal.Sphere(shape.size[0])
        case "cylinder":
            return coal.Cylinder(*shape.size)
        case _:
            assert shape.mesh is not None
            x, y, z = shape.size
            return convex(mesh_hull(shape.mesh, (x, y, z)))
