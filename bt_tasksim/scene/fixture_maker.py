"""Fixtures that are made by numbers: each parameter has a value, or a range from which worlds draw it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field

from bt_tasksim.core import poses
from bt_tasksim.core.errors import FieldError, InputError
from bt_tasksim.core.plain import short
from bt_tasksim.core.typed_file import Model, Number, checked
from bt_tasksim.scene.fixtures import Fixture

NOMINAL = 0.5
"""Share of each range at which a fixture stands for all that may be drawn."""
CORNERS = 32
"""Corners of what parameters leave open that are tried, besides those where all are low, or high."""
_USUAL = "usual"


def usually(*values: float | str, ge: float | None = None, le: float | None = None) -> Any:
    """A parameter's field, whose value is drawn where nobody gives one.

    Args:
        values: The value; or the lowest and the highest number; or the words to choose from.
        ge: Least that it may be.
        le: Most that it may be.
    """
    usual: Any = values[0] if len(values) == 1 else list(values)
    return Field(default=values[0], ge=ge, le=le, json_schema_extra={_USUAL: usual})


class FixtureMaker(Model):
    """Makes one fixture; its fields are the parameters, as drawn for one world.

    A subclass registers as a ``fixture``, and scenes give its parameters by name: a value, two numbers
    between which each world draws one, or several words of which it chooses one.
    """

    x: Annotated[Number, usually(0.60, 0.64, ge=-5.0, le=5.0)]
    """Where its front is, robot base frame, m."""
    y: Annotated[Number, usually(-0.02, 0.02, ge=-5.0, le=5.0)]
    """Where its middle is, robot base frame, m."""
    heading: Annotated[Number, usually(-0.05, 0.05, ge=-6.3, le=6.3)]
    """Its heading in the robot base frame, rad."""

    @abstractmethod
    def make(self, name: str) -> Fixture:
        """The fixture.

        Args:
            name: What it is called.

        Raises:
            InputError: The parameters do not fit together.
        """

    def pose(self) -> tuple[float, ...]:
        """Where the fixture stands ``(7,)``, robot base frame."""
        return (self.x, self.y, 0.0, *(float(v) for v in poses.yaw(self.heading)))

    @classmethod
    def fixture(
        cls, name: str, parameters: Mapping[str, Any], rng: np.random.Generator | None = None
    ) -> Fixture:
        """A fixture as drawn, or the one in the middle of all ranges.

        Raises:
            FieldError: A parameter is unknown, or out of bounds, or some do not fit together.
        """
        shares = [NOMINAL] * len(cls.model_fields) if rng is None else rng.uniform(size=len(cls.model_fields))
        return cls._made(name, parameters, [float(share) for share in shares])

    @classmethod
    def check(cls, name: str, parameters: Mapping[str, Any]) -> None:
        """Check that what parameters leave open can be made in its middle, and where each is at an end.

        Raises:
            FieldError: See `fixture`.
        """
        count = len(cls.model_fields)
        corners = np.random.default_rng(0).integers(2, size=(CORNERS, count)).astype(float)
        for shares in ([0.0] * count, [1.0] * count, [NOMINAL] * count, *corners.tolist()):
            cls._made(name, parameters, shares)

    @classmethod
    def _made(cls, name: str, parameters: Mapping[str, Any], shares: list[float]) -> Fixture:
        maker = cls._drawn(name, parameters, shares)
        try:
            return maker.make(name)
        except InputError as error:
            raise FieldError(f"the fixture '{name}' cannot be made: {error}", "parameters") from None

    @classmethod
    def _drawn(cls, name: str, parameters: Mapping[str, Any], shares: list[float]) -> Self:
        values = dict(parameters)
        for (field_name, field), share in zip(cls.model_fields.items(), shares, strict=True):
            extra = field.json_schema_extra
            usual = extra[_USUAL] if isinstance(extra, dict) else field.default
            values[field_name] = _chosen(field_name, parameters.get(field_name, usual), share)
        return checked(cls, values, f"the parameters of the fixture '{name}'")


def _chosen(name: str, given: Any, share: float) -> Any:
    """One value of those that are given, at a share of them.

    Raises:
        FieldError: They are neither two numbers in order nor several words.
    """
    if not isinstance(given, list | tuple):
        return float(given) if isinstance(given, int) and not isinstance(given, bool) else given
    if given and all(isinstance(value, str) for value in given):
        return given[min(int(share * len(given)), len(given) - 1)]
    numbers = [v for v in given if isinstance(v, int | float) and not isinstance(v, bool)]
    if len(numbers) != 2 or len(given) != 2 or not numbers[0] <= numbers[1]:
        raise FieldError(
            f"the parameter '{name}' should be a value, two numbers, the lower one first, or several words, "
            f"found {short(given)}",
            "parameters",
            name,
        )
    low, high = float(numbers[0]), float(numbers[1])
    return low + share * (high - low)
