"""A sequence cut into stages: one for each time that something is taken, until the hand is free again."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from py_trees import composites
from py_trees.behaviour import Behaviour

from bt_tasksim.concept.contact import Change, ContactState
from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.core.errors import InputError
from bt_tasksim.trees.backchain import Wanted, act_of, after, asked_by, condition_named, goals_of
from bt_tasksim.trees.nodes.any_order import AnyOrder
from bt_tasksim.trees.walk import preorder

Held = list[tuple[str, str]]
"""Goals that were reached and not ended yet, with the objects that they are about."""


@dataclass(frozen=True)
class Stage:
    """Nodes that stand in a row in a sequence.

    Attributes:
        nodes: The nodes.
        guards: The conditions that hold when they have done their work; none where they take nothing, and are
            ticked in every attempt.
        own: They are one node that asks its guard itself.
    """

    nodes: tuple[Behaviour, ...]
    guards: tuple[Wanted, ...] = ()
    own: bool = False

    @property
    def behind(self) -> tuple[Behaviour, ...]:
        """The conditions behind the last of the nodes that acts."""
        return self.nodes[_end(self.nodes) :]


def cut(children: Sequence[Behaviour]) -> list[Stage]:
    """The stages of a sequence, and what stands between them.

    A stage begins with what ``reaches`` a goal and ends with what ``ends`` it; conditions right behind it
    belong to it, and have to hold, too, where it is skipped.

    Args:
        children: The nodes of the sequence.

    Raises:
        InputError: Nothing tells whether a stage is done.
    """
    return [_stage(row) if takes else Stage(tuple(row)) for row, takes in _rows(children)]


def opened(children: Iterable[Behaviour]) -> list[Behaviour]:
    """The nodes of a sequence, with those of a sequence among them in its place that has several stages.

    Args:
        children: The nodes; nothing is moved.
    """
    found: list[Behaviour] = []
    for child in children:
        inner = opened(child.children) if is_sequence(child) else []
        acting_rows = [row for row, _ in _rows(inner) if actors_of(row)]
        several = len(acting_rows) > 1 or any(isinstance(node, AnyOrder) for node in inner)
        found += inner if several else [child]
    return found


def is_sequence(node: Behaviour) -> bool:
    """It is a sequence with memory."""
    return type(node) is composites.Sequence and node.memory and bool(node.children)


def actors_of(nodes: Iterable[Behaviour]) -> list[str]:
    """The objects that are acted on at or below nodes, each once, in order."""
    return list(dict.fromkeys(leaf.model.actor for n in nodes for leaf in acting(n) if leaf.model.actor))


def taken_by(nodes: Iterable[Behaviour]) -> list[str]:
    """Those of them that are taken."""
    leaves = (leaf for node in nodes for leaf in acting(node))
    return list(dict.fromkeys(leaf.model.actor for leaf in leaves if leaf.model.reaches))


def _rows(children: Iterable[Behaviour]) -> list[tuple[list[Behaviour], bool]]:
    """Nodes in rows, see `cut`; and whether something is taken in a row."""
    rows: list[list[Behaviour]] = []
    taking: list[bool] = []
    held: Held = []
    for child in children:
        goes_on = bool(held)
        held = held_after(held, acting(child))
        takes = any(leaf.model.reaches for leaf in acting(child))
        behind = bool(taking) and taking[-1] and asked_by(child) is not None
        if goes_on or (behind and asks_itself(rows[-1][0]) is None):
            rows[-1].append(child)
        else:
            rows.append([child])
            taking.append(takes)
    return list(zip(rows, taking, strict=True))


def acting(root: Behaviour) -> Iterator[ConceptNode]:
    """The concepts below a node, in order."""
    return (node for _, node in preorder(root) if isinstance(node, ConceptNode))


def held_after(held: Held, leaves: Iterator[ConceptNode] | Sequence[ConceptNode]) -> Held:
    """Goals that are reached and not ended after some more concepts."""
    for leaf in leaves:
        step = act_of(leaf)
        ended = goals_of(step, step.concept.ends)
        held = [goal for goal in held if goal not in ended] + goals_of(step, step.concept.reaches)
    return held


def lasting(leaves: Iterable[ConceptNode], actor: str) -> Wanted | None:
    """The condition that tells that concepts have done their work with an object, and still holds at the end.

    It is the strongest one about the object that the last concept establishes which establishes any. What can
    hold only in the hand ends where the object is let go, and the strongest of the others of that concept is
    left. A concept that has the object in the hand afterwards, and does not only put it down there or press
    it, has moved it from where it stood.

    Args:
        leaves: The concepts, in order.
        actor: The object.
    """
    found: list[Wanted] = []
    held: Held = []
    for leaf in (leaf for leaf in leaves if leaf.model.actor == actor):
        held = held_after(held, [leaf])
        about = [asked for asked in after(act_of(leaf)) if actor in asked.arguments.values()]
        if _moves_on(leaf):
            found = [asked for asked in found if is_in_hand(asked)]
        lasts, left = ([one for one in all_ if held or not is_in_hand(one)] for all_ in (about, found))
        found = lasts or left
    return found[0] if found else None


def _moves_on(leaf: ConceptNode) -> bool:
    """It moves what is in the hand, and leaves it where it can move on."""
    change = leaf.model.contact
    if not leaf.model.maintains or change is None or change.motion == "rotation":
        return False
    return change.change is not Change.MAKES and change.after is not ContactState.FT


def asks_itself(node: Behaviour) -> Wanted | None:
    """The condition with which a fallback begins: it says itself when it is done. None for other nodes."""
    if isinstance(node, composites.Selector) and len(node.children) > 1:
        return asked_by(node.children[0])
    return None


def _stage(nodes: Sequence[Behaviour]) -> Stage:
    """A stage, with what tells that it is done: of each object that it acts on.

    Raises:
        InputError: Of one that it takes nothing does.
    """
    own = asks_itself(nodes[0]) if len(nodes) == 1 else None
    if own is not None:
        return Stage(tuple(nodes), (own,), own=True)
    leaves = [leaf for node in nodes for leaf in acting(node)]
    about = (lasting(leaves, actor) for actor in actors_of(nodes))
    found = [*about, *(asked_by(node) for node in nodes[_end(nodes) :])]
    guards = each_once(guard for guard in found if guard is not None)
    told = {value for guard in guards for value in guard.arguments.values()}
    for actor in taken_by(nodes):
        if actor in told:
            continue
        last = [leaf for leaf in leaves if leaf.model.actor == actor][-1]
        raise InputError(
            f"nothing tells whether '{last.model.actor}' is done after '{last.name}', so it cannot be "
            f"skipped then: say where it goes (as with Release's 'into'), or put a condition behind it"
        )
    return Stage(tuple(nodes), tuple(guards))


def _end(nodes: Sequence[Behaviour]) -> int:
    """How many nodes there are up to the last one that acts."""
    return 1 + max(k for k, node in enumerate(nodes) if any(acting(node)))


def passing(row: Sequence[Stage]) -> list[tuple[Wanted, ...]]:
    """What stands for each stage that a later one undoes on purpose; nothing for all others.

    A drawer that is opened and shut at last is open only in between, and what is moved on does not stay where
    it was put first. Such a stage has served where those between it and the one that undoes it are done;
    where there are none, where the latter is.

    Args:
        row: The stages, in order.
    """
    found: list[tuple[Wanted, ...]] = []
    for i, stage in enumerate(row):
        later = next((j for j in range(i + 1, len(row)) if _undoes(row[j], stage)), None)
        if later is None:
            found.append(())
            continue
        between = [guard for other in row[i + 1 : later] for guard in other.guards]
        found.append(tuple(each_once(between or row[later].guards)))
    return found


def _undoes(later: Stage, stage: Stage) -> bool:
    """A later stage acts on what this one acts on, and leaves it otherwise."""
    for actor in set(actors_of(stage.nodes)) & set(actors_of(later.nodes)):
        mine, others = (
            [guard for guard in each.guards if actor in guard.arguments.values()] for each in (stage, later)
        )
        if mine and others and not any(same(a, b) for a in mine for b in others):
            return True
    return False


def each_once(asked: Iterable[Wanted]) -> list[Wanted]:
    """Conditions in order, without those that ask what one before them does."""
    found: list[Wanted] = []
    for one in asked:
        if not any(same(one, other) for other in found):
            found.append(one)
    return found


def same(first: Wanted, second: Wanted) -> bool:
    """Two conditions ask the same, whether defaults are given or not."""
    kind = condition_named(first.condition)
    return first.condition == second.condition and bool(
        kind.value(**first.arguments) == kind.value(**second.arguments)
    )


def is_in_hand(asked: Wanted) -> bool:
    """A condition that can hold only while the object is in the hand."""
    return condition_named(asked.condition).in_hand
