"""Trees from XML of BehaviorTree.CPP v4: the subset in `trees.vocabulary`, all else refused by line.

There is no blackboard. A value ``{key}`` inside a subtree stands for the attribute ``key`` of the ``SubTree``
element that uses it, and is put in place while the tree is read.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from py_trees.behaviour import Behaviour

from bt_tasksim.core.bounded_text import read_bytes
from bt_tasksim.core.errors import InputError, nearest
from bt_tasksim.core.plain import shown
from bt_tasksim.policy.policy import concept_name
from bt_tasksim.trees.check import DEEPEST, find_problem
from bt_tasksim.trees.leaf_ports import Leaf, Nodes, is_concept, is_reference, port_from_text
from bt_tasksim.trees.named_files import policy_beside
from bt_tasksim.trees.nodes.base import NodeKind
from bt_tasksim.trees.nodes.subtree import subtree
from bt_tasksim.trees.vocabulary import CATEGORIES, OUTSIDE, node_kinds
from bt_tasksim.trees.xml_source import LARGEST, Element, parse

LEAST, MOST = -(2**31), 2**32 - 1
"""Whole numbers that BehaviorTree.CPP's ports can hold, which have or have not a sign."""
MOST_NODES = 10_000
"""Nodes that a tree may have once its subtrees are put in place."""
HARMLESS = frozenset(("_autoremap", "_collapsed", "_fullpath", "_uid", "_description", "_name"))
"""Attributes that editors leave behind."""
SCRIPTED = ("_skipIf", "_failureIf", "_successIf", "_while", "_onSuccess", "_onFailure", "_onHalted", "_post")


def load_tree(
    path: str | Path, nodes: Nodes | None = None, *, given: Collection[str] = frozenset()
) -> Behaviour:
    """Read a tree from a file, which opens nothing but what lies with it.

    Args:
        path: The file.
        nodes: Concepts and conditions by name, besides those of `concept_nodes.catalogue`.
        given: Concepts, in lower case, whose policies the caller gives: what the file says of these does not
            count.

    Returns:
        The root; its tree has passed `check_tree`.

    Raises:
        InputError: The file cannot be read, or holds something that is not read; the sentence says where.
    """
    return load_tree_with_lines(path, nodes, given)[0]


def load_tree_with_lines(
    path: str | Path, nodes: Nodes | None = None, given: Collection[str] = frozenset()
) -> tuple[Behaviour, Callable[[Behaviour], str]]:
    """Read a tree from a file, see `load_tree`.

    Returns:
        The root, and what tells where one of the tree's nodes stands: ``tree.xml, line 7: ``.

    Raises:
        InputError: See `load_tree`.
    """
    content = _content(path)
    reader = _reader(content, nodes, str(path))
    reader.folder, reader.given = Path(path).parent, given
    root = reader.tree()
    return root, lambda node: f"{path}, line {reader.lines[id(node)]}: "


def tree_from_xml(text: str | bytes, nodes: Nodes | None = None, *, source: str = "tree") -> Behaviour:
    """Read a tree from XML text.

    Args:
        text: The document.
        nodes: Concepts and conditions by name, besides those of `concept_nodes.catalogue`.
        source: Where it comes from, for the error's sentence.

    Returns:
        The root; its tree has passed `check_tree`.

    Raises:
        InputError: Something in it is not read; the sentence says what and on which line.
    """
    return _reader(text, nodes, source).tree()


def scene_of_tree(path: str | Path) -> str | None:
    """Name or file of the scene that a tree file names for itself (``<root scene="...">``), or None.

    Args:
        path: The file.

    Raises:
        InputError: The file is missing or malformed.
    """
    content = _content(path)
    return parse(content, str(path)).attributes.get("scene")


def _content(path: str | Path) -> bytes:
    return read_bytes(path, f"tree file '{path}'", LARGEST, f"there is no tree file '{path}'")


def _reader(text: str | bytes, nodes: Nodes | None, source: str) -> _Reader:
    from bt_tasksim.concept_nodes import catalogue

    return _Reader(parse(text, source), {**catalogue(), **(nodes or {})}, source)


@dataclass(frozen=True)
class _Scope:
    """The subtree that is being put in place: its ID, its parameters, and the IDs of those around it."""

    tree: str
    values: dict[str, str] = field(default_factory=dict)
    around: tuple[str, ...] = ()
    used: set[str] = field(default_factory=set)


class _Reader:
    def __init__(self, root: Element, nodes: Nodes, source: str) -> None:
        self.nodes = nodes
        self.kinds = node_kinds()
        self.source = source
        self.folder: Path | None = None  # where its policies lie; None: wherever they are
        self.given: Collection[str] = ()
        self.lines: dict[int, int] = {}
        self.trees: dict[str, Element] = {}
        self.defaults: dict[str, dict[str, str]] = {}
        self.main = self._document(root)

    def tree(self) -> Behaviour:
        root = self._node(self.trees[self.main].children[0], _Scope(self.main), 1)
        problem = find_problem(root)
        if problem is not None:
            node, sentence = problem
            raise InputError(f"{self.source}, line {self.lines[id(node)]}: {sentence}")
        return root

    # ---- the document ----------------------------------------------------------------------------------

    def _document(self, root: Element) -> str:
        if root.tag != "root":
            raise self._wrong(root, f"the first element should be <root>, found <{root.tag}>")
        version = root.attributes.get("BTCPP_format")
        if version is None:
            raise self._wrong(
                root, '<root> should have BTCPP_format="4"; version 3 of the format is not read'
            )
        if version != "4":
            raise self._wrong(root, f'BTCPP_format should be "4", found "{version}"')
        self._only(root, ("BTCPP_format", "main_tree_to_execute", "scene"))
        models = 0
        for child in root.children:
            match child.tag:
                case "BehaviorTree":
                    self._definition(child)
                case "TreeNodesModel":
                    models += 1
                    if models > 1:
                        raise self._wrong(child, "there is a second <TreeNodesModel>")
                    self._models(child)
                case "include":
                    raise self._wrong(child, "<include> is not read; put its subtrees into this file")
                case _:
                    known = ("BehaviorTree", "TreeNodesModel")
                    raise self._wrong(child, f"unknown element <{child.tag}>{nearest(child.tag, known)}")
        return self._main(root)

    def _definition(self, element: Element) -> None:
        self._only(element, ("ID",))
        name = element.attributes.get("ID", "")
        if name in self.trees:
            first = self.trees[name].line
            raise self._wrong(
                element, f"a second <BehaviorTree> has the ID '{name}', the first is on line {first}"
            )
        if name in self.kinds:
            raise self._wrong(
                element, f"a <BehaviorTree> may not have the ID '{name}', which is a node's name"
            )
        if len(element.children) != 1:
            raise self._wrong(element, f"<BehaviorTree> should hold one node, found {len(element.children)}")
        self.trees[name] = element

    def _main(self, root: Element) -> str:
        if not self.trees:
            raise self._wrong(root, "there is no <BehaviorTree>")
        if "" in self.trees and len(self.trees) > 1:
            raise self._wrong(self.trees[""], "one of several <BehaviorTree> has no ID")
        main = root.attributes.get("main_tree_to_execute")
        if main is None:
            if len(self.trees) > 1:
                names = ", ".join(self.trees)
                raise self._wrong(root, f"of several trees ({names}), main_tree_to_execute should name one")
            main = next(iter(self.trees))
        if main not in self.trees:
            raise self._wrong(root, f"main_tree_to_execute names no tree '{main}'{nearest(main, self.trees)}")
        return main

    def _models(self, element: Element) -> None:
        """Defaults of the parameters of subtrees; everything else in the models is for editors."""
        for model in element.children:
            if model.tag != "SubTree":
                continue
            defaults = self.defaults.setdefault(model.attributes.get("ID", ""), {})
            for port in model.children:
                if "default" in port.attributes:
                    defaults[port.attributes.get("name", "")] = port.attributes["default"]

    # ---- nodes -----------------------------------------------------------------------------------------

    def _node(self, element: Element, scope: _Scope, depth: int) -> Behaviour:
        if depth > DEEPEST:
            raise self._wrong(element, f"the tree has more than {DEEPEST} levels")
        if len(self.lines) >= MOST_NODES:
            raise self._wrong(element, f"the tree has more than {MOST_NODES} nodes")
        if element.text:
            raise self._wrong(element, f"<{element.tag}> holds text: {element.text[:40]!r}")
        name, category = self._identify(element)
        if category == "SubTree":
            inner = self._enter(element, name, scope)
            body = self._node(self.trees[name].children[0], inner, depth + 1)
            self._check_used(element, inner)
            label = element.attributes.get("_name") or element.attributes.get("name") or name
            return self._made(element, subtree(label, body))
        if category in ("Action", "Condition"):
            return self._made(element, self._leaf(element, self.nodes[name], scope))
        kind = self.kinds[name]
        self._check_children(element, kind)
        ports = self._ports(element, kind, scope)
        children = []
        for child in element.children:  # a loop, so that a level costs one stack frame
            children.append(self._node(child, scope, depth + 1))  # noqa: PERF401
        try:
            node: Behaviour = kind.make(element.attributes.get("name") or kind.tag, children, ports)
        except InputError as error:
            raise self._wrong(element, str(error)) from None
        return self._made(element, node)

    def _made(self, element: Element, node: Behaviour) -> Behaviour:
        self.lines[id(node)] = element.line
        return node

    def _identify(self, element: Element) -> tuple[str, str]:
        """The node's own name and its category, from the compact or the explicit form."""
        tag, given = element.tag, element.attributes.get("ID")
        explicit = tag in CATEGORIES
        if explicit and not given:
            raise self._wrong(element, f"<{tag}> should have an ID")
        if not explicit and given is not None:
            raise self._wrong(element, f'<{tag}> may not have an ID; write <{tag}> or <Action ID="{tag}">')
        name = given if explicit and given else tag
        if tag == "SubTree":
            if name not in self.trees:
                raise self._wrong(element, f"there is no subtree '{name}'{nearest(name, self.trees)}")
            return name, tag
        category = self._category(name)
        if category is None:
            if name in OUTSIDE:
                raise self._wrong(element, f"<{name}> of BehaviorTree.CPP is outside the subset that is read")
            known = (*self.kinds, *self.nodes, "SubTree")
            hint = f'; to use the tree, write <SubTree ID="{name}"/>' if name in self.trees else None
            hint = hint or self._in_python(name)
            own = "; a node of your own comes with --plugin FILE.py"
            raise self._wrong(element, f"unknown node '{name}'{hint or nearest(name, known) + own}")
        if explicit and tag != category:
            raise self._wrong(element, f"'{name}' is no {tag}; write <{category} ID=\"{name}\"> or <{name}>")
        return name, category

    def _in_python(self, name: str) -> str | None:
        """What a node is called here that is called so in Python, such as ``retry`` or ``Selector``."""
        for tag, kind in self.kinds.items():
            helper = "" if kind.helper is None else kind.helper.__name__.replace("_", "")
            if name.replace("_", "").casefold() in (helper.casefold(), kind.behaviour.__name__.casefold()):
                return f"; did you mean '{tag}'?"
        return None

    def _category(self, name: str) -> str | None:
        if name in self.kinds:
            return self.kinds[name].category
        if name in self.nodes:
            return "Action" if is_concept(self.nodes[name]) else "Condition"
        return None

    def _enter(self, element: Element, name: str, scope: _Scope) -> _Scope:
        around = (*scope.around, scope.tree)
        if name in around:
            path = " -> ".join((*around[around.index(name) :], name))
            raise self._wrong(element, f"subtrees go round in a circle: {path}")
        if element.children:
            raise self._wrong(
                element, f'<SubTree ID="{name}"> may not hold nodes; they stand in its <BehaviorTree>'
            )
        if element.attributes.get("_autoremap", "false").lower() not in ("false", "0"):
            raise self._wrong(element, "_autoremap is not read; give the subtree its parameters one by one")
        values = dict(self.defaults.get(name, {}))
        for key, text in self._given(element):
            values[key] = self._value(element, key, text, scope)
        return _Scope(name, values, around)

    def _check_used(self, element: Element, scope: _Scope) -> None:
        for key, _ in self._given(element):
            if key not in scope.used:
                hint = nearest(key, scope.used) if scope.used else "; it has none"
                raise self._wrong(element, f"subtree '{scope.tree}' has no parameter '{key}'{hint}")

    def _leaf(self, element: Element, leaf: Leaf, scope: _Scope) -> Behaviour:
        name = leaf.__name__
        if element.children:
            raise self._wrong(element, f"<{name}> may not hold nodes, found <{element.children[0].tag}>")
        texts = {key: self._value(element, key, text, scope) for key, text in self._given(element)}
        try:
            arguments: dict[str, Any] = {k: port_from_text(leaf, k, text, name) for k, text in texts.items()}
            if element.attributes.get("name"):
                arguments["name"] = element.attributes["name"]
            if is_concept(leaf) and self.folder is not None and arguments.get("policy"):
                concept, policy = concept_name(leaf), arguments["policy"]
                arguments["policy"] = (
                    None if concept in self.given else policy_beside(policy, concept, self.folder)
                )
            return leaf(**arguments)
        except InputError as error:
            raise self._wrong(element, str(error)) from None

    def _ports(self, element: Element, kind: NodeKind[Any], scope: _Scope) -> dict[str, int]:
        known = [port.name for port in kind.ports]
        values = {port.name: port.default for port in kind.ports}
        for key, text in self._given(element):
            if key not in known:
                hint = nearest(key, (*known, "name"))
                raise self._wrong(element, f"<{kind.tag}> has no parameter '{key}'{hint}")
            text = self._value(element, key, text, scope)
            try:
                values[key] = _whole(text)
            except ValueError:
                raise self._wrong(
                    element,
                    f"<{kind.tag}>: parameter '{key}' should be a whole number from {LEAST} to {MOST}, found "
                    f"'{shown(text, 40)}'",
                ) from None
        out = {}
        for key, value in values.items():
            if value is None:
                raise self._wrong(element, f"<{kind.tag}>: parameter '{key}' is missing")
            out[key] = value
        return out

    def _value(self, element: Element, key: str, text: str, scope: _Scope) -> str:
        """The text itself, or what a reference stands for in this subtree."""
        if not is_reference(text):
            return text
        wanted = key if text.strip() in ("=", "{=}") else text.strip()[1:-1]
        scope.used.add(wanted)
        if wanted in scope.values:
            return scope.values[wanted]
        if not scope.around:
            raise self._wrong(
                element, f"'{key}' refers to a blackboard ({text}), which is read inside of subtrees only"
            )
        raise self._wrong(
            element,
            f"'{key}' refers to {text}, but subtree '{scope.tree}' is used without parameter '{wanted}'"
            f"{nearest(wanted, scope.values) if scope.values else ''}",
        )

    def _check_children(self, element: Element, kind: NodeKind[Any]) -> None:
        count = len(element.children)
        if kind.category == "Decorator" and count != 1:
            raise self._wrong(element, f"<{kind.tag}> should have one child, found {count}")
        if count == 0:
            raise self._wrong(element, f"<{kind.tag}> should have at least one child")

    def _given(self, element: Element) -> Iterable[tuple[str, str]]:
        """The attributes that are parameters."""
        for key, text in element.attributes.items():
            if key in SCRIPTED:
                raise self._wrong(element, f"the script '{key}' is outside the subset that is read")
            if key in ("ID", "name") or key in HARMLESS:
                continue
            yield key, text

    def _only(self, element: Element, known: tuple[str, ...]) -> None:
        for key in element.attributes:
            if key not in known and key not in HARMLESS:
                raise self._wrong(
                    element, f"<{element.tag}> has an unknown attribute '{key}'{nearest(key, known)}"
                )
        if element.text:
            raise self._wrong(element, f"<{element.tag}> holds text: {element.text[:40]!r}")

    def _wrong(self, element: Element, sentence: str) -> InputError:
        return InputError(f"{self.source}, line {element.line}: {sentence}")


def _whole(text: str) -> int:
    value = int(text)
    if not LEAST <= value <= MOST:
        raise ValueError
    return value
