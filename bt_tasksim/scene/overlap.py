"""Whether the things of a drawn world overlap before anything has moved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.core.poses import Array
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.shapes import BoxPiece, Piece

TOLERANCE = 5e-4
"""Metres of overlap that count as touching."""


@dataclass(frozen=True)
class _Body:
    name: str
    parts: tuple[tuple[Any, Any], ...]
    low: Array
    high: Array


def check_configuration(configuration: ActorConfiguration) -> None:
    """Refuse a world whose objects overlap each other or the fixtures at the start.

    A part of a fixture may be in its own fixture, and in other parts of it: engines let these pass.

    Args:
        configuration: The world as drawn.

    Raises:
        InputError: Two things overlap; names them and says by how much.
        MachineError: The package that checks collisions is not installed.
    """
    try:
        from bt_tasksim.core.narrow_phase import coal
    except ImportError:
        raise MachineError("collision checks need the package coal: install bt-tasksim with 'plan'") from None
    objects = [
        _body(coal, f"object '{actor.name}'", np.array(actor.pose), actor.shape().collision)
        for actor in configuration.objects
    ]
    fixtures = [
        _body(
            coal,
            f"fixture '{fixture.name}'",
            fixture.pose_array(),
            [BoxPiece(np.array(box.pose), np.array(box.size) / 2) for box in fixture.boxes],
        )
        for fixture in configuration.fixtures
    ]
    owners = [None if actor.joint is None else actor.joint.fixture for actor in configuration.objects]
    still = [fixture.name for fixture in configuration.fixtures]
    for i, body in enumerate(objects):
        others = zip([*objects[:i], *fixtures], [*owners[:i], *still], strict=True)
        for other in (other for other, owner in others if owners[i] is None or owner != owners[i]):
            depth = _overlap(coal, body, other)
            if depth > TOLERANCE:
                raise InputError(
                    f"{body.name} and {other.name} overlap by {1000 * depth:.1f} mm at the start: "
                    f"move one of them, or draw it from another area"
                )


def _body(coal: Any, name: str, pose: Array, pieces: Sequence[Piece]) -> _Body:
    from bt_tasksim.scene.hulls import placed

    parts = []
    corners = []
    for piece in pieces:
        parts.append(placed(piece, pose))
        corners.append(poses.transform(pose, piece.corners()))
    every = np.concatenate([*corners, np.zeros((0, 3))])
    if not len(every):  # furniture may be no more than places
        return _Body(name, (), np.full(3, np.inf), np.full(3, -np.inf))
    return _Body(name, tuple(parts), np.min(every, axis=0), np.max(every, axis=0))


def _overlap(coal: Any, a: _Body, b: _Body) -> float:
    """Depth in metres to which any two parts overlap; 0 where none does."""
    if np.any(a.low > b.high) or np.any(b.low > a.high):
        return 0.0
    request = coal.DistanceRequest()
    return max(
        -min(float(coal.distance(s, at, t, to, request, coal.DistanceResult())), 0.0)
        for s, at in a.parts
        for t, to in b.parts
    )
