"""What a scene says of its things, and from which ranges they are drawn."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bt_tasksim.core.errors import FieldError, InputError, nearest, within
from bt_tasksim.core.names import check_name
from bt_tasksim.core.registry import parts
from bt_tasksim.core.renamed import renamed_fields
from bt_tasksim.scene.shapes import shape_kind

SPLITS = ("all", "even", "odd")
"""Parts of a range from which draws are made, see `ObjectSpec`."""
OLD_RELATION = "stands"
"""What files of version 0.1 call the goal relation ``on``."""


@renamed_fields(strips="split")
@dataclass(frozen=True)
class ObjectSpec:
    """What an object may be; ranges are uniform.

    Attributes:
        kinds: Categories drawn from, such as ``("box", "cylinder")``.
        on: Name of the place where it starts.
        area: Half sizes ``(2,)`` in metres of the rectangle on that place in which its centre is drawn; None
            for the place's own default.
        centre: Centre ``(2,)`` of that rectangle in the place's frame, metres.
        yaw: Half width in radians of the range of its heading.
        size: Low and high full sizes ``((3,), (3,))`` in metres; None for the kind's own range, or the size
            of the mesh file.
        mass: Low and high, kg.
        friction: Low and high friction coefficient.
        exponents: Low and high shape exponents ``(e1, e2)`` of a superellipsoid; or ``((e1, e2), (e1, e2))``
            where the two have ranges of their own.
        mesh: Path of a mesh file, for kind ``mesh``.
        split: Which of the ten equal strips of each range of size and exponents are drawn from: ``all``,
            ``even`` or ``odd`` ones. This keeps draws apart where both have the same ranges; where these
            differ, strips overlap.
        size_error: Half width of the relative error with which the size is known beforehand.
    """

    kinds: tuple[str, ...]
    on: str
    area: tuple[float, float] | None = None
    centre: tuple[float, float] = (0.0, 0.0)
    yaw: float = np.pi
    size: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None
    mass: tuple[float, float] = (0.08, 0.25)
    friction: tuple[float, float] = (0.4, 0.9)
    exponents: tuple[float, float] | tuple[tuple[float, float], tuple[float, float]] = (0.2, 1.0)
    mesh: str | None = None
    split: str = "all"
    size_error: float = 0.0

    def __post_init__(self) -> None:
        if self.split not in SPLITS:
            raise FieldError(f"unknown split '{self.split}'{nearest(self.split, SPLITS)}", "split")
        if not 0.0 <= self.size_error < 1.0:
            raise InputError(f"'size_error' should be at least 0 and below 1, found {self.size_error:g}")
        for kind in self.kinds:
            with within("kind"):
                shape_kind(kind)


@dataclass(frozen=True)
class SpotSpec:
    """A spot marked on another place, where something is to stand.

    Attributes:
        name: The spot's name, a place like any other.
        on: Name of the place it lies on.
        centre: Centre ``(2,)`` of the rectangle in which it is drawn, in that place's frame, metres.
        area: Half sizes ``(2,)`` of that rectangle, metres.
        extent: Full size ``(2,)`` of the spot, metres.
        yaw: Half width in radians of the range of its heading.
    """

    name: str
    on: str
    centre: tuple[float, float]
    area: tuple[float, float]
    extent: tuple[float, float] = (0.12, 0.12)
    yaw: float = 0.0

    def __post_init__(self) -> None:
        check_name(self.name, "the name of a spot")


@dataclass(frozen=True)
class HandStart:
    """Where the hand is when an episode begins, instead of in its rest posture.

    Attributes:
        over: Name of the object that it is above.
        height: Lowest and highest height above the object's centre, metres.
        aside: Half width of the square about the object's centre, metres.
        turn: Half width of the range of its turn from its neutral orientation, pointing down, radians.
    """

    over: str
    height: tuple[float, float] = (0.20, 0.30)
    aside: float = 0.04
    turn: float = 0.4


@dataclass(frozen=True)
class Goal:
    """Where an object should be at the end, judged by the hidden state.

    Attributes:
        object: Name of the object.
        place: Name of the place.
        relation: Name of a goal relation (`bt_tasksim.scene.relations`): ``on`` (upright on the place's
            origin, with its heading up to the object's symmetry), ``inside`` (within the container, below its
            rim), ``lifted`` (held in the hand alone, ``height`` above where it stood on the place, and as
            upright), or one of your own.
        position_tolerance: Metres.
        angle_tolerance: Radians.
        height: Metres, for ``lifted``.
    """

    object: str
    place: str
    relation: str = "on"
    position_tolerance: float = 0.03
    angle_tolerance: float = float(np.deg2rad(10.0))
    height: float = 0.3

    def __post_init__(self) -> None:
        if self.relation == OLD_RELATION:
            object.__setattr__(self, "relation", "on")
        relations = parts("goal relation")
        if self.relation not in relations:
            raise FieldError(
                f"unknown relation '{self.relation}'{nearest(self.relation, relations)}", "relation"
            )
        for name in ("position_tolerance", "angle_tolerance", "height"):
            value = getattr(self, name)
            if not 0.0 < value < np.inf:
                raise FieldError(f"'{name}' of a goal should be positive, found {value:g}", name)


def object_spec(name: str, spec: ObjectSpec | str) -> ObjectSpec:
    """The spec that ``"cup on upper_board"`` or ``"on upper_board"`` stands for.

    Args:
        name: The object's name, and its kind where the text names none.
        spec: The text, or a spec, which is handed on.

    Raises:
        InputError: The text does not read like that.
    """
    if isinstance(spec, ObjectSpec):
        return spec
    kind, _, place = spec.partition("on ")
    kind = kind.strip() or name
    if not place.strip():
        raise FieldError(f"object '{name}': '{spec}' should read '<kind> on <place>' or 'on <place>'")
    return ObjectSpec(kinds=(kind,), on=place.strip())
