"""Where two fingers may hold an object: candidates in its own frame, apart from hands and tables."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array

_ACROSS = 0.7
"""Cosine of the angle from which two closing axes differ."""
_MOST_AXES = 3
_FAR = 100.0
_ALONG = math.cos(math.radians(10.0))
"""Cosine of the least angle between the direction in which a hand comes and that in which it closes."""
WIDER = 0.004
"""Metres by which a hand opens wider than what it takes; one with an uncertain estimate is glad of more."""
ALONG = "a grasp's 'approach' should lie across its 'closing', and they are parallel"


def along(closing: Sequence[float], approach: Sequence[float]) -> bool:
    """Whether a hand would come along the direction ``(3,)`` in which its fingers close."""
    dot = sum(a * b for a, b in zip(closing, approach, strict=True))
    return abs(dot) > _ALONG * math.hypot(*closing) * math.hypot(*approach)


def fits_between(widths: Array, opening: float) -> Array:
    """Booleans ``(n,)``: fingers that open so many metres come about what is ``widths (n,)`` metres wide."""
    found: Array = np.asarray(widths) < opening - WIDER
    return found


@dataclass(frozen=True)
class GivenGrip:
    """One place where two fingers may hold an object, as somebody gives it; plain numbers, see `Grips`.

    Attributes:
        point: Middle ``(3,)`` between the contacts in the object's frame, metres.
        closing: Direction ``(3,)`` along which fingers close.
        width: Between the contacts, metres.
        approach: Direction ``(3,)`` along which the hand comes; None: any across the closing one.
        firmness: From 0 to 1.

    Raises:
        InputError: A number is none or not finite, a direction zero, both directions the same, the width not
            positive, or the firmness beyond its bounds.
    """

    point: tuple[float, float, float]
    closing: tuple[float, float, float]
    width: float
    approach: tuple[float, float, float] | None = None
    firmness: float = 1.0

    def __post_init__(self) -> None:
        for name in ("point", "closing", "approach"):
            object.__setattr__(self, name, _vector(name, getattr(self, name)))
        numbers = (*self.point, *self.closing, *(self.approach or ()), self.width, self.firmness)
        if not all(_is_number(v) and math.isfinite(v) and abs(v) <= _FAR for v in numbers):
            raise InputError("a grasp's numbers should be finite, and in metres")
        if any(sum(v * v for v in way) < 1e-12 for way in (self.closing, self.approach) if way is not None):
            raise InputError("a grasp's 'closing' and 'approach' should be directions, and not zero")
        if not (self.width > 0.0 and 0.0 <= self.firmness <= 1.0):
            raise InputError("a grasp's width should be positive, and its firmness between 0 and 1")
        if self.approach is not None and along(self.closing, self.approach):
            raise InputError(ALONG)


def _vector(name: str, said: object) -> tuple[float, ...] | None:
    """Three numbers as a tuple; none where the approach is left open.

    Raises:
        InputError: They are not three numbers.
    """
    if said is None and name == "approach":
        return None
    listed = said.tolist() if isinstance(said, np.ndarray) else said
    if not isinstance(listed, list | tuple) or len(listed) != 3 or not all(map(_is_number, listed)):
        raise InputError(f"a grasp's '{name}' should be 3 numbers, found {said!r:.60}")
    return tuple(float(v) for v in listed)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float | np.number) and not isinstance(value, bool)


@dataclass(frozen=True, eq=False)
class Grips:
    """Candidates for grasps, in the object's frame.

    Attributes:
        points: Middles ``(g, 3)`` between the two contacts, metres.
        closing: Unit vectors ``(g, 3)`` along which fingers close; their sign is of no meaning.
        widths: Distances ``(g,)`` between the contacts, metres.
        approach: Unit vectors ``(g, 3)`` along which the hand comes; NaN where any direction across the
            closing one will do.
        firmness: How well each holds ``(g,)``, from 0 to 1: flat faces that are opposite each other, near the
            centre of mass, hold best.
    """

    points: Array
    closing: Array
    widths: Array
    approach: Array
    firmness: Array

    def __len__(self) -> int:
        return len(self.widths)

    @classmethod
    def of(
        cls,
        points: Sequence[Sequence[float]] | Array,
        closing: Sequence[Sequence[float]] | Array,
        widths: Sequence[float] | Array,
        approach: Sequence[Sequence[float]] | Array | None = None,
        firmness: Sequence[float] | Array | None = None,
    ) -> Grips:
        """Candidates from sequences; by default from anywhere, and all as firm."""
        n = len(widths)
        come = np.full((n, 3), np.nan) if approach is None else np.array(approach, float).reshape(n, 3)
        firm = np.ones(n) if firmness is None else np.array(firmness, float)
        axes = np.array(closing, float).reshape(n, 3)
        return cls(
            np.array(points, float).reshape(n, 3),
            axes / np.linalg.norm(axes, axis=-1, keepdims=True),
            np.array(widths, float),
            come / np.linalg.norm(come, axis=-1, keepdims=True),
            firm,
        )

    def taken(self, which: Array) -> Grips:
        """Some of them, by number or mask."""
        return Grips(
            self.points[which],
            self.closing[which],
            self.widths[which],
            self.approach[which],
            self.firmness[which],
        )

    @classmethod
    def given(cls, grips: Sequence[GivenGrip]) -> Grips:
        """As somebody gives them, the firmest first."""
        whole = cls.of(
            [grip.point for grip in grips],
            [grip.closing for grip in grips],
            [grip.width for grip in grips],
            [grip.approach or (np.nan,) * 3 for grip in grips],
            [grip.firmness for grip in grips],
        )
        return whole.taken(np.argsort(-whole.firmness, kind="stable"))

    def axes(self, widest: float = np.inf) -> tuple[tuple[tuple[float, float, float], float], ...]:
        """Closing axes and widths of the firmest ones that are level and unlike each other, at most three.

        Args:
            widest: Metres; wider ones are left out.
        """
        axes: list[tuple[tuple[float, float, float], float]] = []
        for closing, width in zip(self.closing, self.widths.tolist(), strict=True):
            unlike = all(abs(float(closing @ np.array(axis))) < _ACROSS for axis, _ in axes)
            fits = width <= widest and abs(closing[2]) < 1.0 - _ACROSS
            if len(axes) < _MOST_AXES and unlike and fits:
                x, y, z = (closing if closing[np.argmax(np.abs(closing))] > 0 else -closing).tolist()
                axes.append(((x, y, z), width))
        return tuple(axes)

    @classmethod
    def joined(cls, parts: Sequence[Grips]) -> Grips:
        """All of them together, the firmest first."""
        whole = cls(
            *(
                np.concatenate([getattr(part, name) for part in parts])
                for name in ("points", "closing", "widths", "approach", "firmness")
            )
        )
        return whole.taken(np.argsort(-whole.firmness, kind="stable"))


LEVER = 0.05
"""Metres from the centre of mass at which a grip is half as firm."""


def firm_about(points: Array, centre: Array) -> Array:
    """How firm grips at points ``(g, 3)`` are for their distance from the centre of mass, from 0 to 1.

    Held aside of it, a thing turns between two fingers under its own weight.
    """
    aside = points - centre
    return 1.0 / (1.0 + np.sum(aside * aside, axis=-1) / LEVER**2)
