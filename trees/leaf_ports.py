"""Parameters and settings of concepts and conditions as ports: attributes of their elements in XML."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import MISSING, Parameter, Quantity
from bt_tasksim.core.errors import InputError, nearest

Leaf = type[ConceptModel] | type[Condition]
Nodes = Mapping[str, Leaf]

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


def is_concept(leaf: type[Any]) -> bool:
    """A concept (an action), not a condition."""
    return issubclass(leaf, ConceptModel)


def leaf_ports(leaf: Leaf) -> tuple[str, ...]:
    """Names of all ports of a concept or condition, in order.

    Raises:
        InputError: A parameter has a name that BehaviorTree.CPP keeps for itself, or that of a setting.
    """
    own = tuple(leaf.parameters())
    settings = tuple(SETTING_DOCS) if is_concept(leaf) else ()
    for name in own:
        if name in ("ID", "name", *settings) or not (name[0].isalpha() and name.isascii()):
            raise InputError(
                f"{leaf.__name__}: a port in XML cannot be called '{name}'; rename the parameter"
            )
    return (*own, *settings)


def port_to_text(leaf: Leaf, name: str, value: Any, owner: str) -> str:
    """The text of a leaf's parameter or setting.

    Raises:
        InputError: The text would not read back as the same value.
    """
    if name == "uncertainty" and is_concept(leaf):
        return ";".join(f"{key}={float(sigma)!r}" for key, sigma in value.items())
    parameter = _port(leaf, name)
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
    if name == "uncertainty" and is_concept(leaf):
        return _uncertainty(text, owner)
    return _port(leaf, name).from_text(text, owner)


def is_reference(text: str) -> bool:
    """BehaviorTree.CPP takes this text for a reference to its blackboard, such as ``{cup}``."""
    stripped = text.strip()
    return text == "=" or (len(stripped) >= 3 and stripped[0] == "{" and stripped[-1] == "}")


def default_text(parameter: Parameter) -> str | None:
    """The default of a parameter as text; None where there is none."""
    if parameter.default is MISSING or parameter.default is None:
        return None
    return parameter.to_text(parameter.default)


def _port(leaf: Leaf, name: str) -> Parameter:
    own = leaf.parameters().get(name)
    return SETTINGS[name] if own is None else own


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
