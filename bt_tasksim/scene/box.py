"""Boxes, of which furniture is made."""

from __future__ import annotations

from dataclasses import dataclass

from bt_tasksim.core.renamed import renamed_fields


@renamed_fields(look="material")
@dataclass(frozen=True)
class Box:
    """A solid box of a fixture: pose ``(7,)`` in its frame, full size (m), sRGB colour, friction.

    ``material`` says what it is drawn like: ``matte``, ``wood`` or ``metal``.
    """

    pose: tuple[float, ...]
    size: tuple[float, float, float]
    colour: tuple[float, float, float] = (0.6, 0.5, 0.4)
    friction: float = 0.6
    material: str = "matte"
