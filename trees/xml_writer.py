"""Trees as XML that BehaviorTree.CPP v4 and Groot2 read."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape, quoteattr

from py_trees.behaviour import Behaviour

from bt_tasksim.concept.leaf import ConceptNode, ModelLeaf
from bt_tasksim.concept.parameters import Parameter
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.files import write_text
from bt_tasksim.policy.policy import concept_name
from bt_tasksim.trees.check import check_tree
from bt_tasksim.trees.leaf_ports import (
    SETTING_DOCS,
    SETTINGS,
    Leaf,
    default_text,
    is_concept,
    leaf_ports,
    port_to_text,
)
from bt_tasksim.trees.named_files import policy_from_beside
from bt_tasksim.trees.nodes.base import NodeKind, Port
from bt_tasksim.trees.nodes.subtree import SubTree
from bt_tasksim.trees.vocabulary import CATEGORIES, OUTSIDE, kind_of, node_kinds

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
FORBIDDEN = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def save_tree(root: Behaviour, path: str | Path, *, scene: str | None = None) -> None:
    """Write a tree to a file; it is written whole or not at all.

    Args:
        root: The tree's root.
        path: The file.
        scene: Name or file of the scene that it is meant for.

    Policies that lie with the file are named by their path from its folder.

    Raises:
        InputError: The tree has a node outside the subset, the folder does not exist, or a leaf's policy lies
            elsewhere.
        MachineError: The file cannot be written.
    """
    write_text(path, tree_to_xml(root, scene=scene, file=path))


def tree_to_xml(root: Behaviour, *, scene: str | None = None, file: str | Path | None = None) -> str:
    """A tree as XML of BehaviorTree.CPP v4, with the models of its leaves.

    Args:
        root: The tree's root.
        scene: Name or file of the scene that it is meant for; an attribute of ``<root>`` that
            BehaviorTree.CPP passes over.
        file: The file that it is written to, from whose folder policies are named; None: as leaves name them.

    Raises:
        InputError: The tree is no good (`check_tree`), has a node outside the subset, or a leaf's policy does
            not lie with the file.
    """
    check_tree(root)
    return _Writer(root, None if file is None else Path(file)).document(scene)


def node_models(leaves: Mapping[str, Leaf], own: Iterable[NodeKind[Any]] | None = None) -> str:
    """The ``TreeNodesModel`` of concepts and conditions, for Groot2's palette and for BehaviorTree.CPP.

    Args:
        leaves: The classes, by name.
        own: Control nodes and decorators that BehaviorTree.CPP does not have; None: all that are known.

    Raises:
        InputError: A parameter has a name that BehaviorTree.CPP keeps for itself.
    """
    kinds = [kind for kind in node_kinds().values() if kind.own] if own is None else own
    lines = ["<TreeNodesModel>"]
    for kind in sorted(kinds, key=lambda kind: kind.tag):
        ports = [_attribute_model(kind.tag, port) for port in kind.ports]
        lines += _model(kind.category, kind.tag, ports)
    for name in sorted(leaves):
        leaf = leaves[name]
        tag = "Action" if is_concept(leaf) else "Condition"
        lines += _model(tag, name, [_port_model(leaf, port) for port in leaf_ports(leaf)])
    return "\n".join([*lines, "</TreeNodesModel>"])


def _model(category: str, name: str, ports: list[str]) -> list[str]:
    start = f"{INDENT}<{category} ID={_quote(name, name)}"
    return [f"{start}>", *ports, f"{INDENT}</{category}>"] if ports else [f"{start}/>"]


class _Writer:
    """Writes each subtree once, and gives it an ID of its own."""

    def __init__(self, root: Behaviour, file: Path | None) -> None:
        from bt_tasksim.concept_nodes import catalogue

        self.root, self.file = root, file
        self.leaves: dict[str, Leaf] = {}
        self.own: dict[str, NodeKind[Any]] = {}
        taken = {*node_kinds(), *OUTSIDE, *CATEGORIES}
        for node in root.iterate():
            if isinstance(node, ModelLeaf):
                name = type(node.model).__name__
                if self.leaves.setdefault(name, type(node.model)) is not type(node.model):
                    raise InputError(f"two different leaves are called {name}: rename one of the classes")
                if name in taken:
                    raise InputError(f"leaf {name} has the name of a node of BehaviorTree.CPP: rename it")
            elif (kind := kind_of(node)) is not None and kind.own:
                self.own[kind.tag] = kind
        reserved = {*taken, *self.leaves, *catalogue()}
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
            parts.append(_shift(node_models(self.leaves, self.own.values()), 1))
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
        if isinstance(node, ModelLeaf):
            return type(node.model).__name__, self._leaf(node)
        kind = kind_of(node)
        if kind is None:
            cls = type(node)
            raise InputError(
                f"'{node.name}' is a {cls.__module__}.{cls.__name__}, which cannot be written as XML; "
                f"XML holds concepts, conditions and {', '.join(node_kinds())}"
            )
        attributes = {} if node.name == kind.tag else {"name": node.name}
        values = kind.read(node)
        for port in kind.ports:
            if values[port.name] != port.default:
                attributes[port.name] = str(values[port.name])
        return kind.tag, attributes

    def _leaf(self, node: ModelLeaf) -> dict[str, str]:
        arguments: dict[str, Any] = node.arguments()
        attributes = {"name": arguments.pop("name")} if arguments.get("name") else {}
        owner = f"'{node.name}'"
        for port in leaf_ports(type(node.model)):
            if port in arguments:
                value = arguments[port]
                if port == "policy" and isinstance(node, ConceptNode) and self.file is not None:
                    value = policy_from_beside(value, concept_name(type(node.model)), self.file)
                attributes[port] = port_to_text(type(node.model), port, value, owner)
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


def _attribute_model(tag: str, port: Port) -> str:
    attributes = {"name": port.name, "type": "int"}
    if port.default is not None:
        attributes["default"] = str(port.default)
    return _input_port(tag, attributes, port.doc)


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
    return _input_port(leaf.__name__, attributes, doc)


def _input_port(owner: str, attributes: Mapping[str, str], doc: str) -> str:
    start = "<input_port" + "".join(f" {k}={_quote(v, owner)}" for k, v in attributes.items())
    return INDENT * 2 + (f"{start}>{escape(doc)}</input_port>" if doc else f"{start}/>")


def _port_doc(parameter: Parameter) -> str:
    quantity = parameter.quantity
    unit = quantity.unit if quantity.unit not in ("", "1") else "unit vector" if quantity.unit_vector else ""
    chosen = "the concept chooses if left out" if parameter.optional else ""
    return ", ".join(part for part in (PORT_DOCS.get(quantity.kind, ""), unit, chosen) if part)
