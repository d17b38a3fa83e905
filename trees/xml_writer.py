"""Trees as XML that BehaviorTree.CPP v4 and Groot2 read."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape, quoteattr

from py_trees.behaviour import Behaviour

from bt_tasksim.concept import ConceptModel, Condition
from bt_tasksim.errors import InputError
from bt_tasksim.files import write_text
from bt_tasksim.parameters import Parameter
from trees.authoring import check_tree
from trees.decorators import SubTree
from trees.vocabulary import (
    CATEGORIES,
    KINDS,
    OUTSIDE,
    SETTING_DOCS,
    SETTINGS,
    Leaf,
    default_text,
    is_concept,
    kind_of,
    leaf_ports,
    port_to_text,
)

INDENT = "  "
PORT_TYPES = {
    "number": "double",
    "flag": "bool",
    "vector": "std::vector<double>",
    "points": "std::vector<double>",
}
PORT_DOCS = {
    "object": "name of an object",
    "place": "name of a place or an object",
    "vector": "three numbers",
    "points": "three numbers a point",
}
OWN = tuple(tag for tag, kind in KINDS.items() if kind.own)
"""Decorators that BehaviorTree.CPP does not have."""
TAKEN = {*KINDS, *OUTSIDE, *CATEGORIES}
FORBIDDEN = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def save_tree(root: Behaviour, path: str | Path, *, scene: str | None = None) -> None:
    """Write a tree to a file; it is written whole or not at all.

    Args:
        root: The tree's root.
        path: The file.
        scene: Name or file of the scene that it is meant for.

    Raises:
        InputError: The tree has a node outside the subset, or the folder does not exist.
        MachineError: The file cannot be written.
    """
    write_text(path, tree_to_xml(root, scene=scene))


def tree_to_xml(root: Behaviour, *, scene: str | None = None) -> str:
    """A tree as XML of BehaviorTree.CPP v4, with the models of its leaves.

    Args:
        root: The tree's root.
        scene: Name or file of the scene that it is meant for; an attribute of ``<root>`` that
            BehaviorTree.CPP passes over.

    Raises:
        InputError: The tree is no good (`check_tree`), or has a node outside the subset.
    """
    check_tree(root)
    return _Writer(root).document(scene)


def node_models(leaves: Mapping[str, Leaf], decorators: Iterable[str] = OWN) -> str:
    """The ``TreeNodesModel`` of concepts and conditions, for Groot2's palette and for BehaviorTree.CPP.

    Args:
        leaves: The classes, by name.
        decorators: Decorators that BehaviorTree.CPP does not have.

    Raises:
        InputError: A parameter has a name that BehaviorTree.CPP keeps for itself.
    """
    lines = ["<TreeNodesModel>", *(f'{INDENT}<Decorator ID="{name}"/>' for name in sorted(decorators))]
    for name in sorted(leaves):
        leaf = leaves[name]
        tag = "Action" if is_concept(leaf) else "Condition"
        ports = [_port_model(leaf, port) for port in leaf_ports(leaf)]
        if ports:
            lines += [f"{INDENT}<{tag} ID={_quote(name, name)}>", *ports, f"{INDENT}</{tag}>"]
        else:
            lines.append(f"{INDENT}<{tag} ID={_quote(name, name)}/>")
    return "\n".join([*lines, "</TreeNodesModel>"])


class _Writer:
    """Writes each subtree once, and gives it an ID of its own."""

    def __init__(self, root: Behaviour) -> None:
        from concept_nodes import catalogue

        self.root = root
        self.leaves: dict[str, Leaf] = {}
        self.own: set[str] = set()
        for node in root.iterate():
            if isinstance(node, ConceptModel | Condition):
                name = type(node).__name__
                if self.leaves.setdefault(name, type(node)) is not type(node):
                    raise InputError(f"two different leaves are called {name}: rename one of the classes")
                if name in TAKEN:
                    raise InputError(f"leaf {name} has the name of a node of BehaviorTree.CPP: rename it")
            elif (kind := kind_of(node)) is not None and kind.own:
                self.own.add(kind.tag)
        reserved = {*TAKEN, *self.leaves, *catalogue()}
        self.taken = {name.casefold() for name in reserved} | {"root", "undefined"}
        self.trees: dict[str, str] = {}
        self.ids: dict[tuple[str, str], str] = {}

    def document(self, scene: str | None = None) -> str:
        main = self._identify(self.root.name)
        body = self._body(self.root)
        named = "" if scene is None else f" scene={_quote(scene, 'scene')}"
        parts = [
            '<?xml version="1.0" encoding="UTF-8"?>',
            f'<root BTCPP_format="4" main_tree_to_execute={_quote(main, main)}{named}>',
            _tree(main, body),
            *(_tree(name, text) for name, text in self.trees.items()),
        ]
        if self.leaves or self.own:
            parts.append(_shift(node_models(self.leaves, self.own), 1))
        return "\n".join([*parts, "</root>\n"])

    def _body(self, root: Behaviour) -> str:
        """The element of a node with all below it, except what stands in subtrees."""
        lines: list[str] = []
        names: set[str] = set()
        stack: list[tuple[int, Behaviour | str]] = [(0, root)]
        while stack:
            depth, node = stack.pop()
            pad = INDENT * depth
            if isinstance(node, str):
                lines.append(f"{pad}</{node}>")
                continue
            tag, attributes = self._element(node, names)
            text = "".join(f" {key}={_quote(value, node.name)}" for key, value in attributes.items())
            if tag == "SubTree" or not node.children:
                lines.append(f"{pad}<{tag}{text}/>")
                continue
            lines.append(f"{pad}<{tag}{text}>")
            stack.append((depth, tag))
            stack.extend((depth + 1, child) for child in reversed(node.children))
        return "\n".join(lines)

    def _element(self, node: Behaviour, names: set[str]) -> tuple[str, dict[str, str]]:
        if type(node) is SubTree:
            return "SubTree", self._subtree(node, names)
        if isinstance(node, ConceptModel | Condition):
            return type(node).__name__, self._leaf(node)
        kind = kind_of(node)
        if kind is None:
            cls = type(node)
            raise InputError(
                f"'{node.name}' is a {cls.__module__}.{cls.__name__}, which cannot be written as XML; "
                f"XML holds concepts, conditions and {', '.join(KINDS)} as made by the helpers of trees"
            )
        attributes = {} if node.name == kind.tag else {"name": node.name}
        values = kind.read(node)
        for port in kind.ports:
            if values[port.name] != port.default:
                attributes[port.name] = str(values[port.name])
        return kind.tag, attributes

    def _leaf(self, node: ConceptModel | Condition) -> dict[str, str]:
        arguments: dict[str, Any] = node.arguments()
        attributes = {"name": arguments.pop("name")} if arguments.get("name") else {}
        owner = f"'{node.name}'"
        for port in leaf_ports(type(node)):
            if port in arguments:
                attributes[port] = port_to_text(type(node), port, arguments[port], owner)
        return attributes

    def _subtree(self, node: SubTree, names: set[str]) -> dict[str, str]:
        body = self._body(node.decorated)
        key = (node.name, body)
        if key not in self.ids:
            self.ids[key] = self._identify(node.name)
            self.trees[self.ids[key]] = body
        name = self.ids[key]
        if name == node.name:
            return {"ID": name}
        # BehaviorTree.CPP refuses two subtrees of one name in a tree, and ignores attributes with "_".
        label = "_name" if node.name in names else "name"
        names.add(node.name)
        return {"ID": name, label: node.name}

    def _identify(self, name: str) -> str:
        """An ID that BehaviorTree.CPP takes: letters, digits, ``_`` and ``-``, and not a node's name."""
        base = "".join(c if c.isalnum() or c in "_-" else "_" for c in name).strip("_") or "tree"
        if not base[0].isalpha():
            base = f"tree_{base}"
        found, count = base, 1
        while found.casefold() in self.taken:
            count += 1
            found = f"{base}_{count}"
        self.taken.add(found.casefold())
        return found


def _tree(name: str, body: str) -> str:
    return _shift(f"<BehaviorTree ID={_quote(name, name)}>\n{_shift(body, 1)}\n</BehaviorTree>", 1)


def _shift(text: str, levels: int) -> str:
    pad = INDENT * levels
    return "\n".join(pad + line for line in text.split("\n"))


def _quote(text: str, owner: str) -> str:
    bad = FORBIDDEN.search(text)
    if bad:
        raise InputError(f"'{owner}': the character {bad.group()!r} cannot be written as XML")
    return quoteattr(text, {'"': "&quot;"})


def _port_model(leaf: Leaf, port: str) -> str:
    own = leaf.parameters().get(port)
    if own is not None:
        kind, default, doc = (
            PORT_TYPES.get(own.quantity.kind, "std::string"),
            default_text(own),
            _port_doc(own),
        )
    else:
        doc = SETTING_DOCS[port]
        is_number = port in SETTINGS and SETTINGS[port].quantity.kind == "number"
        kind = "double" if is_number else "std::string"
        default = repr(float(getattr(leaf, f"default_{port}"))) if is_number else None
    attributes = {"name": port, "type": kind} | ({} if default is None else {"default": default})
    start = "<input_port" + "".join(f" {k}={_quote(v, leaf.__name__)}" for k, v in attributes.items())
    return INDENT * 2 + (f"{start}>{escape(doc)}</input_port>" if doc else f"{start}/>")


def _port_doc(parameter: Parameter) -> str:
    quantity = parameter.quantity
    unit = quantity.unit if quantity.unit not in ("", "1") else "unit vector" if quantity.unit_vector else ""
    chosen = "the concept chooses if left out" if parameter.optional else ""
    return ", ".join(part for part in (PORT_DOCS.get(quantity.kind, ""), unit, chosen) if part)
