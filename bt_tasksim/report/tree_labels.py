"""What pictures and listings say about a node: its symbol, its title, its arguments."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.composites import Composite
from py_trees.decorators import Decorator

from bt_tasksim.concept.leaf import ConceptNode, ModelLeaf
from bt_tasksim.concept.parameters import Parameter
from bt_tasksim.core.plain import printable
from bt_tasksim.trees.nodes.base import NodeKind
from bt_tasksim.trees.nodes.subtree import SubTree
from bt_tasksim.trees.vocabulary import kind_of

SETTING_UNITS = {"timeout": "s", "tolerance": "m", "policy": ""}


@dataclass(frozen=True)
class Label:
    """What is said about a node.

    Attributes:
        shape: ``control``, ``decorator``, ``subtree``, ``condition``, ``concept`` or ``other``.
        symbol: A sign; empty for none.
        title: One line.
        details: Further lines: arguments that are not defaults, with units.
    """

    shape: str
    symbol: str
    title: str
    details: tuple[str, ...] = ()


def label_of(node: Behaviour) -> Label:
    """What is said about a node."""
    kind = kind_of(node)
    if kind is not None:
        return _kind_label(node, kind)
    if isinstance(node, SubTree):
        return Label("subtree", "", node.name, ("subtree",))
    if isinstance(node, ModelLeaf):
        return _leaf_label(node)
    shape = (
        "decorator" if isinstance(node, Decorator) else "control" if isinstance(node, Composite) else "other"
    )
    name = type(node).__name__
    return Label(shape, "", node.name, (name,) if name != node.name else ())


def tree_text(root: Behaviour) -> str:
    """A tree as lines of text, one a node.

    Args:
        root: The tree's root.
    """
    lines: list[str] = []
    stack: list[tuple[Behaviour, str, str]] = [(root, "", "")]
    while stack:
        node, first, rest = stack.pop()
        lines.append(first + _line(node))
        last = len(node.children) - 1
        for index in range(last, -1, -1):
            branch, bar = ("└─ ", "   ") if index == last else ("├─ ", "│  ")
            stack.append((node.children[index], rest + branch, rest + bar))
    return "\n".join(lines)


def _line(node: Behaviour) -> str:
    label = label_of(node)
    head = " ".join(part for part in (label.symbol, label.title) if part)
    return printable(f"{head}  ({', '.join(label.details)})" if label.details else head)


def _kind_label(node: Behaviour, kind: NodeKind[Any]) -> Label:
    words = kind.describe(node)
    named = node.name != kind.tag
    return Label(kind.category.lower(), kind.symbol, node.name if named else words, (words,) if named else ())


def _leaf_label(node: ModelLeaf) -> Label:
    shape = "concept" if isinstance(node, ConceptNode) else "condition"
    arguments: dict[str, Any] = node.arguments()
    declared = node.model.parameters()
    name = arguments.pop("name", None)
    first = next(iter(declared), None)
    subject = (
        str(arguments.pop(first)) if first in arguments and declared[first].quantity.kind == "object" else ""
    )
    plain = f"{type(node.model).__name__} {subject}".strip()
    details = [plain] if name else []
    for key, value in arguments.items():
        if key in declared:
            details.append(f"{key} {_value(value, declared[key])}")
        elif key == "uncertainty":
            details += [
                f"{k} ± {sigma:g} {declared[k].quantity.unit}".rstrip(" 1") for k, sigma in value.items()
            ]
        else:
            shown = f"{value:g}" if isinstance(value, int | float) else str(value)
            details.append(f"{key} {shown} {SETTING_UNITS[key]}".rstrip())
    symbol = node.model.presentation.symbol if isinstance(node, ConceptNode) else ""
    return Label(shape, symbol, name or plain, tuple(details))


def _value(value: Any, parameter: Parameter) -> str:
    quantity = parameter.quantity
    unit = f" {quantity.unit}" if quantity.unit not in ("", "1") else ""
    if value is None:
        return "left open"
    match quantity.kind:
        case "number":
            return f"{value:.4g}{unit}"
        case "vector":
            return f"({', '.join(f'{v:.3g}' for v in value)}){unit}"
        case "points":
            return f"{len(value)} point{'' if len(value) == 1 else 's'}"
        case "flag":
            return "yes" if value else "no"
        case _:
            return str(value)
