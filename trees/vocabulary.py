"""The nodes of BehaviorTree.CPP v4 that trees are read from and written to, `Train`, and the ports of leaves.

One table serves the reader, the writer, the node models, tree equality and pictures.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.composites import Selector, Sequence
from py_trees.decorators import FailureIsSuccess, Inverter, SuccessIsFailure

from bt_tasksim.concept import ConceptModel, Condition
from bt_tasksim.errors import InputError, nearest
from bt_tasksim.parameters import MISSING, Parameter, Quantity
from bt_tasksim.training.decorator import Train
from trees.authoring import (
    fallback,
    force_failure,
    force_success,
    invert,
    parallel,
    reactive_fallback,
    reactive_sequence,
    repeat,
    retry,
    sequence,
    timeout,
)
from trees.decorators import Parallel, Repeat, Retry, Timeout

Leaf = type[ConceptModel] | type[Condition]
Nodes = Mapping[str, Leaf]


@dataclass(frozen=True)
class Port:
    """A whole-number attribute of a control node or decorator; without a default it must be given."""

    name: str
    default: int | None = None


@dataclass(frozen=True)
class Kind:
    """A control node or decorator.

    Attributes:
        tag: Its name in BehaviorTree.CPP, which is also the default name of an instance.
        category: ``Control`` or ``Decorator``.
        cls: Its class here.
        make: Builds it from a name, its children and its ports.
        ports: Its attributes.
        read: Values of its ports.
        memory: ``memory`` of a py_trees sequence or selector; None for the others.
        own: BehaviorTree.CPP does not have it: a file declares it in its node models.
    """

    tag: str
    category: str
    cls: type[Behaviour]
    make: Callable[[str, list[Behaviour], dict[str, int]], Behaviour]
    ports: tuple[Port, ...] = ()
    read: Callable[[Any], dict[str, int]] = lambda node: {}
    memory: bool | None = None
    own: bool = False

    def describes(self, node: Behaviour) -> bool:
        """The node is of this kind."""
        return type(node) is self.cls and (
            self.memory is None or getattr(node, "memory", None) is self.memory
        )


KINDS: dict[str, Kind] = {
    kind.tag: kind
    for kind in (
        Kind("Sequence", "Control", Sequence, lambda n, c, p: sequence(n, *c), memory=True),
        Kind("Fallback", "Control", Selector, lambda n, c, p: fallback(n, *c), memory=True),
        Kind("ReactiveSequence", "Control", Sequence, lambda n, c, p: reactive_sequence(n, *c), memory=False),
        Kind("ReactiveFallback", "Control", Selector, lambda n, c, p: reactive_fallback(n, *c), memory=False),
        Kind(
            "Parallel",
            "Control",
            Parallel,
            lambda n, c, p: parallel(n, *c, success=p["success_count"], failure=p["failure_count"]),
            (Port("success_count", -1), Port("failure_count", 1)),
            lambda node: {"success_count": node.success_count, "failure_count": node.failure_count},
        ),
        Kind("Inverter", "Decorator", Inverter, lambda n, c, p: invert(c[0], name=n)),
        Kind("ForceSuccess", "Decorator", FailureIsSuccess, lambda n, c, p: force_success(c[0], name=n)),
        Kind("ForceFailure", "Decorator", SuccessIsFailure, lambda n, c, p: force_failure(c[0], name=n)),
        Kind(
            "RetryUntilSuccessful",
            "Decorator",
            Retry,
            lambda n, c, p: retry(p["num_attempts"], c[0], name=n),
            (Port("num_attempts"),),
            lambda node: {"num_attempts": node.attempts},
        ),
        Kind(
            "Repeat",
            "Decorator",
            Repeat,
            lambda n, c, p: repeat(p["num_cycles"], c[0], name=n),
            (Port("num_cycles"),),
            lambda node: {"num_cycles": node.times},
        ),
        Kind(
            "Timeout",
            "Decorator",
            Timeout,
            lambda n, c, p: timeout(p["msec"] / 1000, c[0], name=n),
            (Port("msec"),),
            lambda node: {"msec": round(node.seconds * 1000)},
        ),
        Kind("Train", "Decorator", Train, lambda n, c, p: Train(c[0], n), own=True),
    )
}

CATEGORIES = ("Action", "Condition", "Control", "Decorator", "SubTree")
"""Tags of the explicit form, in which the node's own name stands in the attribute ``ID``."""

OUTSIDE = frozenset((
    "AlwaysFailure", "AlwaysSuccess", "AsyncFallback", "AsyncSequence", "Delay", "IfThenElse",
    "KeepRunningUntilFailure", "LoopBool", "LoopDouble", "LoopInt", "LoopString", "ManualSelector",
    "ParallelAll", "Precondition", "RunOnce", "Script", "ScriptCondition", "SequenceStar",
    "SequenceWithMemory", "SetBlackboard", "SkipUnlessUpdated", "Sleep", "SubTreePlus", "Switch2",
    "Switch3", "Switch4", "Switch5", "Switch6", "TryCatch", "UnsetBlackboard", "WaitValueUpdate",
    "WasEntryUpdated", "WhileDoElse",
))  # fmt: skip
"""Nodes of BehaviorTree.CPP that are outside the subset."""

SETTINGS = {
    "policy": Parameter("policy", Quantity("", "text"), None, True),
    "timeout": Parameter("timeout", Quantity("s"), None, True),
    "tolerance": Parameter("tolerance", Quantity("m"), None, True),
}
"""Ports that every concept has besides its own parameters and ``uncertainty``."""

SETTING_DOCS = {
    "policy": "programmed, or the folder of a learned policy; by default the one pinned",
    "timeout": "seconds after which the concept fails",
    "tolerance": "metres within which the goal counts as reached",
    "uncertainty": "standard deviations of numeric parameters, such as distance=0.01;angle=0.1",
}


def kind_of(node: Behaviour) -> Kind | None:
    """The kind of a control node or decorator; None where it has no counterpart."""
    return next((kind for kind in KINDS.values() if kind.describes(node)), None)


def is_concept(leaf: type[Any]) -> bool:
    """A concept (an action), not a condition."""
    return issubclass(leaf, ConceptModel)


def leaf_ports(leaf: Leaf) -> tuple[str, ...]:
    """Names of all ports of a concept or condition, in order.

    Raises:
        InputError: A parameter has a name that BehaviorTree.CPP keeps for itself.
    """
    own = tuple(leaf.parameters())
    for name in own:
        if name in ("ID", "name", *SETTING_DOCS) or not (name[0].isalpha() and name.isascii()):
            raise InputError(
                f"{leaf.__name__}: a port in XML cannot be called '{name}'; rename the parameter"
            )
    return (*own, *SETTING_DOCS) if is_concept(leaf) else own


def port_to_text(leaf: Leaf, name: str, value: Any, owner: str) -> str:
    """The text of a leaf's parameter or setting.

    Raises:
        InputError: The text would not read back as the same value.
    """
    if name == "uncertainty":
        return ";".join(f"{key}={float(sigma)!r}" for key, sigma in value.items())
    parameter = leaf.parameters().get(name) or SETTINGS[name]
    text = parameter.to_text(value)
    if is_reference(text):
        raise InputError(f"{owner}: '{name}' is '{text}', which in XML would refer to a blackboard")
    try:
        same = parameter.from_text(text, owner) == parameter.check(value, owner)
    except InputError:
        same = False
    if not same:
        raise InputError(f"{owner}: '{name}' is {value!r}, which cannot be written as XML")
    return text


def port_from_text(leaf: Leaf, name: str, text: str, owner: str) -> Any:
    """The value that `port_to_text` wrote.

    Raises:
        InputError: The port is unknown, or the text does not fit.
    """
    known = leaf_ports(leaf)
    if name not in known:
        raise InputError(f"{owner} has no parameter '{name}'{nearest(name, (*known, 'name'))}")
    if name == "uncertainty":
        return _uncertainty(text, owner)
    return (leaf.parameters().get(name) or SETTINGS[name]).from_text(text, owner)


def is_reference(text: str) -> bool:
    """BehaviorTree.CPP takes this text for a reference to its blackboard, such as ``{cup}``."""
    stripped = text.strip()
    return text == "=" or (len(stripped) >= 3 and stripped[0] == "{" and stripped[-1] == "}")


def default_text(parameter: Parameter) -> str | None:
    """The default of a parameter as text; None where there is none."""
    if parameter.default is MISSING or parameter.default is None:
        return None
    return parameter.to_text(parameter.default)


def _uncertainty(text: str, owner: str) -> dict[str, float]:
    out = {}
    for part in text.split(";") if text else ():
        key, equals, sigma = part.partition("=")
        try:
            if not equals:
                raise ValueError
            out[key.strip()] = float(sigma)
        except ValueError:
            raise InputError(
                f"{owner}: 'uncertainty' should read like 'distance=0.01;angle=0.1', found {text!r}"
            ) from None
    return out
