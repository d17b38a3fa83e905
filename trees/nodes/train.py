"""`Train`: the decorator that marks what is to be learned."""

from __future__ import annotations

from collections.abc import Mapping

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Sequence
from py_trees.decorators import Decorator

from bt_tasksim.concept.functions import ConceptFunctions
from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.core.registry import register
from bt_tasksim.trees.nodes.base import NodeKind
from bt_tasksim.trees.nodes.batch import NodePlace, PassesOn
from bt_tasksim.trees.walk import nodes_of


class Train(Decorator):
    """Marks a leaf or a subtree that is to be learned inside the tree that will execute it.

    When the tree runs, ticks and statuses pass through. In training one activation of the subtree is an
    episode: what stands before it makes the initial state, and what follows it judges.

    Args:
        child: A concept, or a subtree with at least one concept that can be learned.
        name: The node's name; by default ``train`` and the child's.
    """

    def __init__(self, child: Behaviour, name: str | None = None) -> None:
        if not isinstance(child, Behaviour):
            raise InputError(f"Train(...) takes a leaf or a subtree, found {child!r}")
        if child.parent is not None:
            raise InputError(f"'{child.name}' already has a parent, '{child.parent.name}': build a new one")
        super().__init__(name or f"train {child.name}", child)
        self.activations = 0

    def initialise(self) -> None:
        """A new activation."""
        self.activations += 1

    def update(self) -> Status:
        """The child's status."""
        return self.decorated.status

    def concepts(self) -> list[ConceptNode]:
        """All concepts of the subtree."""
        return concepts_in(self)

    def learners(self) -> list[ConceptNode]:
        """The concepts that learn: those with something unknown, whose policy is not named ``programmed``.

        Raises:
            InputError: There is none, one cannot be learned, or Train stands below another Train.
        """
        below = [node for node in self.iterate() if isinstance(node, Train) and node is not self]
        if below:
            raise InputError(f"'{below[0].name}' stands below '{self.name}': one Train inside another")
        found = [
            leaf for leaf in self.concepts() if not leaf.model.is_task_model and leaf.policy != "programmed"
        ]
        if not found:
            names = ", ".join(f"'{leaf.name}'" for leaf in self.concepts()) or "no concept at all"
            raise InputError(
                f"nothing below '{self.name}' can learn ({names}): a concept with something unknown sets "
                f'is_task_model = False, and its leaf does not say policy="programmed"'
            )
        for leaf in found:
            concept = type(leaf.model)
            if concept.features is ConceptModel.features or _inherits_layout(concept):
                raise InputError(
                    f"'{leaf.name}' below '{self.name}' cannot learn: "
                    f"{concept.__name__} has no features() with its layout()"
                )
        return found


@register("tree node", "Train")
class TrainKind(NodeKind[Train]):
    """See `Train`."""

    category = "Decorator"
    behaviour = Train
    symbol = "✎"
    label = "train"
    own = True

    def make(self, name: str, children: list[Behaviour], ports: Mapping[str, int]) -> Train:
        """See `NodeKind.make`."""
        return Train(children[0], name)

    def compiled(self, node: Train, place: NodePlace) -> BatchTrain:
        """See `NodeKind.compiled`."""
        return BatchTrain(place)


class BatchTrain(PassesOn):
    """`Train` in many worlds at once.

    Attributes:
        activations: ``(N,)`` how often it has begun.
    """

    def __init__(self, place: NodePlace) -> None:
        super().__init__(place)
        self.activations = self.arrays.full(0, "int64")

    def tick(self, rows: Array) -> None:
        """Count activations."""
        self.activations[self.begins(rows)] += 1
        super().tick(rows)


def _inherits_layout(cls: type[ConceptFunctions]) -> bool:
    return not any("layout" in vars(base) for base in cls.__mro__[: cls.__mro__.index(ConceptModel)])


def concepts_in(root: Behaviour) -> list[ConceptNode]:
    """The concepts of a tree, in its order from left to right."""
    return [node for node in nodes_of(root) if isinstance(node, ConceptNode)]


def train_nodes(root: Behaviour) -> list[Train]:
    """The Train nodes of a tree, in its order from left to right."""
    return [node for node in nodes_of(root) if isinstance(node, Train)]


def judges(leaf: ConceptNode) -> bool:
    """The concept says what must be true when it has succeeded."""
    return type(leaf.model).sufficient_cost is not ConceptModel.sufficient_cost


def follower_of(train: Behaviour) -> tuple[Behaviour, Sequence] | None:
    """What judges a Train node, and the sequence in which it follows.

    The next sibling in the nearest sequence above, else its parent's next one, and so on up. Siblings without
    a concept that can judge (conditions, waiting) are passed over. One with a leaf that has no policy yet can
    not be run, nor what comes after it. The later children of a selector are fallbacks, and those of a
    parallel run beside: they follow nothing.

    Returns:
        None where nothing follows.
    """
    node = train
    while node.parent is not None:
        parent = node.parent
        if isinstance(parent, Sequence):
            for sibling in parent.children[parent.children.index(node) + 1 :]:
                leaves = concepts_in(sibling)
                if any(leaf.lacks_policy for leaf in leaves):
                    return None
                if any(judges(leaf) for leaf in leaves):
                    return sibling, parent
        node = parent
    return None
