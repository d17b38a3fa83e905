"""Typed parameters of concepts, with units and uncertainty.

A concept declares its parameters as annotated class attributes, in the order of its constructor's arguments:

    class Wipe(ConceptModel):
        target: ObjectName
        direction: Direction
        distance: Metres
        press: Newtons = 5.0

Every value is checked when the leaf is made, so that a tree with a missing or mistyped parameter cannot be
built; the same declarations are the ports of the XML form.
"""

from __future__ import annotations

import inspect
import math
import typing
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from bt_tasksim.core.errors import InputError, nearest

MISSING: Any = object()


@dataclass(frozen=True)
class Quantity:
    """What a parameter measures.

    Attributes:
        unit: SI unit; empty for names, counts and unit vectors.
        kind: ``number``, ``vector`` (three numbers), ``points`` (any count of vectors), ``object``,
            ``place`` (or an object to put something on), ``text`` or ``flag``.
        unit_vector: A direction; scaled to length one.
        two_sided: A direction that means the same as its opposite.
        low: Smallest allowed value of a number.
        high: Largest allowed value of a number.
    """

    unit: str
    kind: str = "number"
    unit_vector: bool = False
    two_sided: bool = False
    low: float = -math.inf
    high: float = math.inf


Vector = tuple[float, float, float]

MOST = 1e6
"""What no length, angle, force or speed of a robot comes near, and motions are still computed with."""

SLOWEST = 1e-4
"""Metres per second: slower, and nothing would ever get there."""

Metres = Annotated[float, Quantity("m", low=0.0, high=MOST)]
Offset = Annotated[float, Quantity("m", low=-MOST, high=MOST)]
Radians = Annotated[float, Quantity("rad", low=-MOST, high=MOST)]
Seconds = Annotated[float, Quantity("s", low=0.0)]
Newtons = Annotated[float, Quantity("N", low=0.0, high=MOST)]
MetresPerSecond = Annotated[float, Quantity("m/s", low=SLOWEST, high=MOST)]
Ratio = Annotated[float, Quantity("1", low=0.0, high=1.0)]
Direction = Annotated[Vector, Quantity("1", "vector", unit_vector=True)]
Axis = Annotated[Vector, Quantity("1", "vector", unit_vector=True, two_sided=True)]
Position = Annotated[Vector, Quantity("m", "vector", low=-MOST, high=MOST)]
Points = Annotated[tuple[Vector, ...], Quantity("m", "points", low=-MOST, high=MOST)]
ObjectName = Annotated[str, Quantity("", "object")]
PlaceName = Annotated[str, Quantity("", "place")]
Text = Annotated[str, Quantity("", "text")]
Flag = Annotated[bool, Quantity("", "flag")]


@dataclass(frozen=True)
class Parameter:
    """One declared parameter.

    Attributes:
        name: Its name, an argument of the constructor.
        quantity: What it measures.
        default: Its default, `MISSING` where it must be given.
        optional: None is allowed: the concept chooses.
    """

    name: str
    quantity: Quantity
    default: Any = MISSING
    optional: bool = False

    @property
    def required(self) -> bool:
        """It has no default."""
        return self.default is MISSING

    def check(self, value: Any, owner: str) -> Any:
        """The value in its proper type.

        Args:
            value: What was given.
            owner: Who has the parameter, for the error's sentence.

        Raises:
            InputError: The value does not fit.
        """
        if value is None:
            if self.optional:
                return None
            raise InputError(f"{owner}: parameter '{self.name}' may not be left empty")
        try:
            return _coerce(value, self.quantity)
        except (TypeError, ValueError) as error:
            unit = f" in {self.quantity.unit}" if self.quantity.unit not in ("", "1") else ""
            raise InputError(
                f"{owner}: parameter '{self.name}' should be {_EXPECTED[self.quantity.kind]}{unit}, "
                f"found {value!r}{': ' + str(error) if str(error) else ''}"
            ) from None

    def to_text(self, value: Any) -> str:
        """The value as text, in the notation of BehaviorTree.CPP: numbers of a vector joined by ``;``."""
        if value is None:
            return ""
        match self.quantity.kind:
            case "number":
                return repr(float(value))
            case "vector":
                return ";".join(repr(float(v)) for v in value)
            case "points":
                return ";".join(repr(float(v)) for point in value for v in point)
            case "flag":
                return "true" if value else "false"
            case _:
                return str(value)

    def from_text(self, text: str, owner: str) -> Any:
        """The value written by `to_text`.

        Raises:
            InputError: The text does not fit.
        """
        kind = self.quantity.kind
        if text == "" and kind in ("number", "vector", "object", "place", "flag"):
            return self.check(None, owner)
        try:
            if kind == "number":
                return self.check(float(text), owner)
            if kind == "vector":
                return self.check(tuple(float(v) for v in text.split(";")), owner)
            if kind == "points":
                numbers = [float(v) for v in text.split(";")] if text else []
                if len(numbers) % 3:
                    raise ValueError
                return self.check(tuple(zip(*[iter(numbers)] * 3, strict=True)), owner)
            if kind == "flag":
                return self.check({"true": True, "false": False, "1": True, "0": False}[text.lower()], owner)
        except (ValueError, KeyError) as error:
            if isinstance(error, InputError):
                raise
            return self.check(_Unreadable(text), owner)
        return self.check(text, owner)


class _Unreadable:
    def __init__(self, text: str) -> None:
        self.text = text

    def __repr__(self) -> str:
        return repr(self.text)


_EXPECTED = {
    "number": "a number",
    "vector": "three numbers",
    "points": "a list of points of three numbers each",
    "object": "the name of an object",
    "place": "the name of a place or an object",
    "text": "text",
    "flag": "true or false",
}


def _coerce(value: Any, quantity: Quantity) -> Any:
    match quantity.kind:
        case "number":
            return _number(value, quantity)
        case "vector":
            return _vector(value, quantity)
        case "points":
            if isinstance(value, str | _Unreadable):
                raise TypeError
            return tuple(_vector(v, quantity) for v in value)
        case "flag":
            if not isinstance(value, bool):
                raise TypeError
            return value
        case _:
            if not isinstance(value, str):
                raise TypeError
            if not value.strip():
                raise ValueError("it is empty")
            return value


def _number(value: Any, quantity: Quantity) -> float:
    if isinstance(value, bool | str | _Unreadable):
        raise TypeError
    number = float(value)
    if not math.isfinite(number):
        raise ValueError("it is not finite")
    if number < quantity.low and quantity.high >= MOST > -quantity.low:
        raise ValueError(f"it should not be below {quantity.low:g}")
    if number > quantity.high >= MOST:
        raise ValueError(f"it should not be above {quantity.high:g}")
    if not quantity.low <= number <= quantity.high:
        raise ValueError(f"it should lie between {quantity.low:g} and {quantity.high:g}")
    return number


def _vector(value: Any, quantity: Quantity) -> Vector:
    if isinstance(value, str | _Unreadable) or (
        not isinstance(value, Sequence) and not hasattr(value, "__len__")
    ):
        raise TypeError
    numbers = [_number(v, quantity) for v in value]
    if len(numbers) != 3:
        raise ValueError(f"it has {len(numbers)} numbers")
    if quantity.unit_vector:
        length = math.hypot(*numbers)
        if length < 1e-9:
            raise ValueError("a direction may not be zero")
        if abs(length - 1.0) > 1e-12:
            numbers = [v / length for v in numbers]
    return numbers[0], numbers[1], numbers[2]


def bind_arguments(
    declared: Mapping[str, Parameter], args: Sequence[Any], kwargs: Mapping[str, Any], owner: str
) -> dict[str, Any]:
    """Checked values of all declared parameters, from a call's arguments.

    Raises:
        InputError: An argument is unknown, missing, given twice or does not fit.
    """
    if len(args) > len(declared):
        raise InputError(f"{owner} takes at most {len(declared)} arguments, {len(args)} were given")
    values = dict(zip(declared, args, strict=False))
    for key, value in kwargs.items():
        if key in values:
            raise InputError(f"{owner}: parameter '{key}' is given twice")
        if key not in declared:
            raise InputError(f"{owner} has no parameter '{key}'{nearest(key, declared)}")
        values[key] = value
    for key, parameter in declared.items():
        if key not in values and parameter.required:
            raise InputError(f"{owner}: parameter '{key}' is missing")
    return {k: p.check(values[k], owner) if k in values else p.default for k, p in declared.items()}


def declared_parameters(cls: type, base: type) -> tuple[Parameter, ...]:
    """The parameters that a concept class and its parents below ``base`` declare, in order."""
    found: dict[str, Parameter] = {}
    for owner in reversed(cls.__mro__):
        if owner is base or not issubclass(owner, base):
            continue
        hints = typing.get_type_hints(owner, include_extras=True)
        for name in inspect.get_annotations(owner):
            hint = hints[name]
            quantity, optional = _quantity(hint)
            if quantity is not None:
                found[name] = Parameter(name, quantity, getattr(owner, name, MISSING), optional)
    required = [p for p in found.values() if p.required]
    return (*required, *(p for p in found.values() if not p.required))


def _quantity(hint: Any) -> tuple[Quantity | None, bool]:
    for meta in getattr(hint, "__metadata__", ()):
        if isinstance(meta, Quantity):
            return meta, False
    args = typing.get_args(hint)
    if type(None) in args:
        for arg in args:
            quantity, _ = _quantity(arg)
            if quantity is not None:
                return quantity, True
    return None, False
