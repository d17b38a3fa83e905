"""What pictures and listings say about a node: its symbol, its title, its arguments."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.composites import Composite
from py_trees.decorators import Decorator

from bt_tasksim.concept import ConceptModel, Condition
from bt_tasksim.parameters import Parameter
from trees.decorators import SubTree
from trees.vocabulary import Kind, kind_of

SYMBOLS = {
    "Sequence": "→",
    "Fallback": "?",
    "ReactiveSequence": "→ᴿ",
    "ReactiveFallback": "?ᴿ",
    "Parallel": "⇉",
    "Inverter": "¬",
    "RetryUntilSuccessful": "↺",
    "Repeat": "↻",
    "Timeout": "◷",
    "ForceSuccess": "✓",
    "ForceFailure": "✗",
    "Train": "✎",
}
WORDS = {
    "Sequence": "sequence",
    "Fallback": "fallback",
    "ReactiveSequence": "reactive sequence",
    "ReactiveFallback": "reactive fallback",
    "Parallel": "parallel",
    "Inverter": "not",
    "RetryUntilSuccessful": "retry",
    "Repeat": "repeat",
    "Timeout": "time-out",
    "ForceSuccess": "force success",
    "ForceFailure": "force failure",
    "Train": "train",
}
SETTING_UNITS = {"timeout": "s", "tolerance": "m", "policy": ""}


@dataclass(frozen=True)
class Label:
    """What is said about a node.

    Attributes:
        shape: ``control``, ``decorator``, ``subtree``, ``condition``, ``concept`` or ``other``.
        symbol: A sign for control nodes and decorators; empty for the others.
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
    if isinstance(node, ConceptModel | Condition):
        return _leaf_label(node)
    shape = (
        "decorator" if isinstance(node, Decorator) else "control" if isinstance(node, Composite) else "other"
    )
    name = type(node).__name__
    return Label(shape, "", node.name, (name,) if name != node.name else ())


def preorder(root: Behaviour) -> Iterator[tuple[int, Behaviour]]:
    """Depth and node, each node before its children."""
    stack = [(0, root)]
    while stack:
        depth, node = stack.pop()
        yield depth, node
        stack.extend((depth + 1, child) for child in reversed(node.children))


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
    return f"{head}  ({', '.join(label.details)})" if label.details else head


def _kind_label(node: Behaviour, kind: Kind) -> Label:
    word, values = WORDS[kind.tag], kind.read(node)
    match kind.tag:
        case "Parallel":
            total = len(node.children)
            word += f", {_count(values['success_count'], total)} must succeed"
            if values["failure_count"] != 1:
                word += f", {_count(values['failure_count'], total)} failed ends it"
        case "RetryUntilSuccessful":
            word += " without end" if values["num_attempts"] < 0 else f" up to {values['num_attempts']} times"
        case "Repeat":
            word += " without end" if values["num_cycles"] < 0 else f" {values['num_cycles']} times"
        case "Timeout":
            word += f" {values['msec'] / 1000:g} s"
    named = node.name != kind.tag
    shape = "control" if kind.category == "Control" else "decorator"
    return Label(shape, SYMBOLS[kind.tag], node.name if named else word, (word,) if named else ())


def _count(count: int, total: int) -> str:
    number = count if count > 0 else total + count + 1
    return "all" if number == total else f"{number} of {total}"


def _leaf_label(node: ConceptModel | Condition) -> Label:
    shape = "concept" if isinstance(node, ConceptModel) else "condition"
    arguments: dict[str, Any] = node.arguments()
    declared = node.parameters()
    name = arguments.pop("name", None)
    first = next(iter(declared), None)
    subject = (
        str(arguments.pop(first)) if first in arguments and declared[first].quantity.kind == "object" else ""
    )
    plain = f"{type(node).__name__} {subject}".strip()
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
    return Label(shape, "", name or plain, tuple(details))


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
