"""Models: what one writes to describe a task or to ask a question, as values.

A model holds typed parameters and pure functions of arrays, and knows no tree, engine or leaf. Calling a
model's class, as authors of trees do, makes a leaf of a behaviour tree that holds such a model:
``Grasp("cup")`` is a `py_trees.behaviour.Behaviour`, and ``Grasp("cup").model`` the value. `LeafModel.value`
makes the value alone.
"""

from __future__ import annotations

import abc
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Self, cast

import numpy as np

from bt_tasksim.concept.functions import ConceptFunctions, MemoryT
from bt_tasksim.concept.leaf import ConceptNode, ModelLeaf, leaf_class_of
from bt_tasksim.concept.parameters import Parameter, bind_arguments
from bt_tasksim.core.errors import InputError, nearest


class ModelType(abc.ABCMeta):
    """The type of models' classes: each has a class of leaves, of which a call makes one."""

    leaf_base: type[ModelLeaf]
    leaf_class: type[ModelLeaf]

    def __init__(cls, name: str, bases: tuple[type, ...], namespace: dict[str, Any], **kwargs: Any) -> None:
        super().__init__(name, bases, namespace, **kwargs)
        if hasattr(cls, "leaf_base"):
            cls.leaf_class = leaf_class_of(cls, cls.leaf_base)

    def __call__(cls, *args: Any, **kwargs: Any) -> Any:
        """A leaf; its class has the arguments."""
        return cls.leaf_class(*args, **kwargs)


class LeafModel(metaclass=ModelType):
    """A value that a leaf holds: typed parameters, and pure functions."""

    values: Mapping[str, Any]
    """Values of the declared parameters, by name."""

    @classmethod
    def value(cls, *args: Any, **kwargs: Any) -> Self:
        """The model itself, without a leaf.

        Raises:
            InputError: A parameter or setting is unknown, missing or does not fit.
        """
        return cast("Self", type.__call__(cls, *args, **kwargs))

    @classmethod
    def parameters(cls) -> dict[str, Parameter]:
        """The declared parameters, by name, in the order of the constructor's arguments."""
        raise NotImplementedError

    def _bind(self, args: tuple[Any, ...], kwargs: Mapping[str, Any], owner: str) -> None:
        """Take the parameters."""
        self.values = bind_arguments(self.parameters(), args, kwargs, owner)
        vars(self).update(self.values)

    def __setattr__(self, name: str, value: Any) -> None:
        if name in vars(self).get("values", ()):
            made = type(self).__name__
            raise AttributeError(
                f"{name} of a {made} cannot be changed: a model is a value, make another one: {made}(...)"
            )
        super().__setattr__(name, value)

    def arguments(self) -> dict[str, Any]:
        """Keyword arguments that build an equal model: parameters that are not defaults."""
        declared = self.parameters()
        return {k: v for k, v in self.values.items() if (p := declared[k]).required or v != p.default}

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and other._compared() == self._compared()

    def __hash__(self) -> int:
        return hash((type(self), tuple(self.values.items())))

    def _compared(self) -> tuple[Any, ...]:
        """What makes a model equal to another one of its class."""
        return (dict(self.values),)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{k}={v!r}' for k, v in self.arguments().items())})"


if TYPE_CHECKING:
    # To type checkers, which do not follow a metaclass's __call__, a concept is what calling it makes.
    _CalledConcept = ConceptNode
else:
    _CalledConcept = object


class ConceptModel(ConceptFunctions[MemoryT], LeafModel, _CalledConcept):
    """A task described well enough to learn it, or programmed where nothing is unknown.

    A subclass declares parameters as annotated attributes (`bt_tasksim.concept.parameters`) and overrides the
    pure functions of `ConceptFunctions`.

    Every concept takes these keyword arguments besides its own parameters; ``name`` and ``policy`` are the
    leaf's:

    - ``name``: the leaf's name; by default the concept and its first parameter.
    - ``policy``: ``"programmed"``, or the folder of a learned policy; by default the one pinned.
    - ``timeout``: seconds after which it fails; by default the concept's own.
    - ``tolerance``: metres within which its goal counts as reached; by default the concept's own.
    - ``uncertainty``: standard deviations of numeric parameters, by name, in their units.
    """

    leaf_base: ClassVar[type[ModelLeaf]] = ConceptNode

    def __init__(self, *args: Any, owner: str = "", **kwargs: Any) -> None:
        owner = owner or type(self).__name__.lower()
        settings = {k: kwargs.pop(k, None) for k in ("timeout", "tolerance", "uncertainty")}
        self._bind(args, kwargs, owner)
        self._settings = settings
        self.patient = settings["timeout"] is None
        self.timeout = _positive(settings["timeout"], self.default_timeout, owner, "timeout")
        self.tolerance = _positive(settings["tolerance"], self.default_tolerance, owner, "tolerance")
        self.uncertainty = _uncertainty(settings["uncertainty"], self.parameters(), owner)
        contradiction = self.contradiction()
        if contradiction:
            raise InputError(f"{owner}: {contradiction}")

    def arguments(self) -> dict[str, Any]:
        """Keyword arguments that build an equal model: parameters that are not defaults, settings given."""
        return super().arguments() | {k: v for k, v in self._settings.items() if v not in (None, {})}

    def _compared(self) -> tuple[Any, ...]:
        return (*super()._compared(), self.timeout, self.tolerance, self.uncertainty)


def _positive(value: Any, default: float, owner: str, what: str) -> float:
    if value is None:
        return default
    if isinstance(value, bool | str) or not np.isfinite(value) or value <= 0:
        raise InputError(f"{owner}: '{what}' should be a positive number, found {value!r}")
    return float(value)


def _uncertainty(value: Any, declared: Mapping[str, Parameter], owner: str) -> dict[str, float]:
    out = {}
    for key, sigma in dict(value or {}).items():
        if key not in declared:
            raise InputError(f"{owner}: uncertainty of unknown parameter '{key}'{nearest(key, declared)}")
        if not declared[key].quantity.unit:
            raise InputError(f"{owner}: parameter '{key}' is not a number and has no uncertainty")
        out[key] = _positive(sigma, 0.0, owner, f"uncertainty of {key}")
    return out
