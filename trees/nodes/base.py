"""What a kind of control node or decorator says about itself, as a part."""

from __future__ import annotations

import abc
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Generic, Literal, TypeVar

from py_trees.behaviour import Behaviour

from bt_tasksim.core.errors import InputError
from bt_tasksim.trees.nodes.batch import BatchNode, NodePlace

NodeT = TypeVar("NodeT", bound=Behaviour)


@dataclass(frozen=True)
class Port:
    """A whole-number attribute of a control node or decorator, as those of BehaviorTree.CPP are.

    Attributes:
        name: Its name in XML.
        default: Its default; None: it must be given.
        doc: What it means, for the node models of editors.
    """

    name: str
    default: int | None = None
    doc: str = ""


class NodeKind(abc.ABC, Generic[NodeT]):
    """A kind of control node or decorator; a subclass announces itself with ``@register("tree node", TAG)``.

    Args:
        tag: The name that it is announced under: its name in XML, which is also the default name of an
            instance.
    """

    category: ClassVar[Literal["Control", "Decorator"]]
    """Which of BehaviorTree.CPP's categories: a decorator has one child."""
    behaviour: ClassVar[type[Behaviour]]
    """Its class here."""
    symbol: ClassVar[str] = ""
    """A sign for pictures and listings."""
    label: ClassVar[str]
    """What people call it."""
    ports: ClassVar[tuple[Port, ...]] = ()
    """Its attributes in XML."""
    own: ClassVar[bool] = False
    """BehaviorTree.CPP does not have it: a file declares it in its node models."""
    helper: ClassVar[Callable[..., Behaviour] | None] = None
    """A function that makes one in a tree's file (a static method); ``trees`` hands it on by its name."""

    def __init__(self, tag: str) -> None:
        self.tag = tag

    def describes(self, node: Behaviour) -> bool:
        """Whether a node is of this kind."""
        return type(node) is self.behaviour

    @abc.abstractmethod
    def make(self, name: str, children: list[Behaviour], ports: Mapping[str, int]) -> NodeT:
        """A node of this kind.

        Args:
            name: Its name.
            children: Its children; one, where it is a decorator.
            ports: Values of all ports.

        Raises:
            InputError: A value does not fit.
        """

    def read(self, node: NodeT) -> dict[str, int]:
        """Values of a node's ports."""
        return {}

    def describe(self, node: NodeT) -> str:
        """A node in a few words, with its values."""
        return self.label

    def ticked_again(self, node: NodeT) -> Iterable[Behaviour]:
        """Children that are ticked again after they have finished, while others still run.

        Concepts may not stand there: they would be started anew at every tick.
        """
        return ()

    def compiled(self, node: NodeT, place: NodePlace) -> BatchNode | None:
        """What a node does in many worlds at once; None: only py_trees can tick it, world by world.

        Args:
            node: The node.
            place: Where it stands in the batch.
        """
        return None


def free_children(owner: str, children: Sequence[Behaviour]) -> list[Behaviour]:
    """The children of a node that is being made.

    Args:
        owner: The node's name.
        children: What is to stand under it.

    Raises:
        InputError: The name is no text, or a child is not a behaviour or already has a parent.
    """
    if not isinstance(owner, str):
        raise InputError(f"a node's name should be text, found {owner!r}: the name comes before the children")
    seen = set()
    for child in children:
        if not isinstance(child, Behaviour):
            raise InputError(f"'{owner}': a child should be a behaviour, found {child!r}")
        if child.parent is not None or id(child) in seen:
            where = child.parent.name if child.parent is not None else owner
            raise InputError(
                f"'{owner}': node '{child.name}' already stands under '{where}'; make a second one instead"
            )
        seen.add(id(child))
    return list(children)
