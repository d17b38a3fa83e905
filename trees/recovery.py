"""Around a sequence: what goes wrong is put right, and goes on from there, a bounded number of times."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import groupby

from py_trees import composites
from py_trees.behaviour import Behaviour

from bt_tasksim.concept_nodes import HandEmpty, Holding, Place, Release, Settle, Withdraw
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.plain import short
from bt_tasksim.trees.backchain import Wanted, asked_by, condition_leaf
from bt_tasksim.trees.nodes.any_order import AnyOrder, any_order
from bt_tasksim.trees.nodes.fallback import fallback
from bt_tasksim.trees.nodes.retry import Retry
from bt_tasksim.trees.nodes.retry_while_acting import retry_while_acting
from bt_tasksim.trees.nodes.sequence import sequence
from bt_tasksim.trees.stages import (
    Stage,
    actors_of,
    asks_itself,
    cut,
    each_once,
    is_in_hand,
    is_sequence,
    opened,
    passing,
    same,
    taken_by,
)
from bt_tasksim.trees.steps import Step, in_steps


def recovering(tree: Behaviour, *, attempts: int = 3, name: str | None = None) -> Behaviour:
    """A tree that does the same, and recovers: a lost or missed object, or one out of place, is taken again.

    The sequence is cut into stages, one for each time that something is held, by the goals that its concepts
    ``reaches`` and ``ends``. A stage is guarded by what it ``establishes``: where that holds it is skipped,
    and it is asked again after the stage, and at the end of all; what a later stage undoes on purpose, as who
    shuts a drawer again, is done where what stands between the two is. Whatever fails begins another attempt.
    In it the hand first puts down what it holds, opens and draws back, unless it is free or all is done and
    what it holds is to be held, and waits until nothing moves; then the first stage that is not done has its
    turn. Each attempt plans anew, from what is seen then.

    A stage that cannot begin, such as one for which no grasp is found, waits until others have acted, those
    behind it that name nothing that it names, and any others of what `tidy` gives
    (`bt_tasksim.trees.nodes.any_order`). An attempt in which nothing has acted is the last one: it would be
    the same again.

    A guard before each action, so that a tree goes on from whatever it finds, is the form of
    M. Colledanchise, D. Almeida and P. Ögren, "Towards blended reactive planning and acting using behavior
    trees", ICRA 2019.

    Args:
        tree: A sequence, such as one from a demonstration, one in any order, or what `tidy` gives. Its nodes
            stand in the new tree afterwards, and no more in this one.
        attempts: How often a stage may be tried; what one of them does not need another one may use.
        name: Name of the new tree; by default that of the old one.

    Raises:
        InputError: It is no sequence, nothing in it takes anything, or nothing tells whether a stage is done.
    """
    if isinstance(attempts, bool) or not isinstance(attempts, int) or attempts < 1:
        raise InputError(f"recovering: 'attempts' should be a positive whole number, found {attempts!r}")
    if not isinstance(tree, Behaviour):
        raise InputError(f"recovering takes a tree, such as sequence('tidy up', ...), found {short(tree)}")
    if tree.parent is not None:
        raise InputError(f"'{tree.name}' stands under '{tree.parent.name}': recover the root of a tree")
    rounds, body = (tree.attempts, tree.decorated) if isinstance(tree, Retry) else (1, tree)
    children = _children(body)
    steps = _steps(children)
    row = [stage for step in steps for block in step for stage in block]
    stages = [stage for stage in row if stage.guards]
    if not stages:
        raise InputError(f"'{tree.name}' holds nothing that takes an object, so there is nothing to recover")
    for node in (node for stage in row for node in stage.nodes):
        if node.parent is not None and node is not body:
            node.parent.children.remove(node)
        node.parent = None
    for emptied in (body, *children):
        if isinstance(emptied, AnyOrder) or (emptied is body and body not in children):
            emptied.children.clear()
    limit = -1 if rounds < 0 else rounds + (attempts - 1) * len(stages)
    called = name or tree.name
    free = hand_is_free(*_held_as_wanted(stages), taken=taken_by(n for stage in stages for n in stage.nodes))
    served = dict(zip(map(id, row), passing(row), strict=True))
    made = [node for step in steps for node in _joined(step, called, served)]
    work = sequence(called, free, *made, *_checks([stage for stage in row if not served[id(stage)]]))
    return retry_while_acting(limit, work, name=f"{called}, recovering")


def hand_is_free(*unless: Behaviour, taken: Iterable[str] = ()) -> Behaviour:
    """The hand is free; else it becomes so, whichever way the arm can go, and things come to rest.

    What it holds is put down where it is, or on a free spot near by; only where there is none it falls.

    Args:
        unless: Asked first: where it holds the hand keeps what it has.
        taken: What it may hold.
    """
    down = (
        sequence(
            f"put {name} down",
            Holding(name),
            Place(name, anywhere=True, name=f"{name} to what is below"),
            Release(name, name=f"let go of {name}"),
        )
        for name in taken
    )
    away = fallback(
        "open and withdraw",
        *down,
        Withdraw(name="back"),
        Withdraw(direction=(0.0, 0.0, 1.0), name="up"),
        Withdraw(direction=(-1.0, 0.0, 0.0), name="towards the robot"),
    )
    free = sequence("begin anew", away, Settle(name="let things come to rest"))
    return fallback("hand is free", *unless, HandEmpty(name="hand empty"), free)


def _children(body: Behaviour) -> list[Behaviour]:
    """The nodes of a sequence, see `opened`; what stands in any order, or asks itself, is like one of one.

    Raises:
        InputError: It is no sequence with memory.
    """
    if is_sequence(body):
        return opened(body.children)
    if isinstance(body, AnyOrder) or asks_itself(body) is not None:
        return [body]
    if isinstance(body, composites.Sequence) and not body.children:
        raise InputError(
            f"'{body.name}' is empty: nothing was put into it, or it was made anew by recovering before"
        )
    raise InputError(
        f"recovering takes a sequence, or what tidy gives, and '{body.name}' is a {type(body).__name__}: "
        f"put it into a sequence"
    )


def _steps(children: list[Behaviour]) -> list[Step]:
    """The stages of a sequence, by what has to follow each other.

    Raises:
        InputError: Nothing tells whether a stage is done.
    """
    steps: list[Step] = []
    for free, some in groupby(children, lambda child: isinstance(child, AnyOrder)):
        if free:
            steps += [[cut(opened([below])) for below in child.children] for child in some]
        else:
            steps += in_steps(cut(list(some)))
    return steps


def _joined(step: Step, called: str, served: Mapping[int, tuple[Wanted, ...]]) -> list[Behaviour]:
    """The nodes that stand for a step in the new tree."""
    made = [[_made(stage, served[id(stage)]) for stage in block] for block in step]
    if len(made) == 1:
        return made[0]
    blocks = [b[0] if len(b) == 1 else sequence(", then ".join(n.name for n in b), *b) for b in made]
    return [any_order(f"{called} in any order", *blocks)]


def _made(stage: Stage, served: Sequence[Wanted]) -> Behaviour:
    """The node that stands for a stage in the new tree.

    Args:
        stage: The stage.
        served: Conditions with which it has served its purpose, see `passing`.
    """
    if not stage.guards or stage.own:
        return stage.nodes[0]
    actors = actors_of(stage.nodes)
    called = " and ".join(actors)
    asked = [asked_by(node) for node in stage.behind]
    missing = [g for g in stage.guards if not any(one is not None and same(one, g) for one in asked)]
    first, last = stage.nodes[0].name, stage.nodes[-1].name
    named = first if len(stage.nodes) == 1 else f"{first} to {last}"
    work = sequence(named, *stage.nodes, *map(condition_leaf, missing))
    guards = [condition_leaf(guard) for guard in stage.guards]
    is_so, is_done = ("is so", "is done") if len(actors) == 1 else ("are so", "are done")
    guard = guards[0] if len(guards) == 1 else sequence(f"{called} {is_so}", *guards)
    if served:
        purpose = sequence("it has served", *map(condition_leaf, served))
        guard = fallback(f"{called} {is_so}, or has served", guard, purpose)
    return fallback(f"{called} {is_done}", guard, work)


def _held_as_wanted(stages: list[Stage]) -> list[Behaviour]:
    """What asks whether all is done, where at last something is to be in the hand: it is not dropped then.

    Args:
        stages: Those that are guarded, in order.
    """
    if not any(is_in_hand(guard) for guard in stages[-1].guards):
        return []
    asked = [condition_leaf(guard) for guard in each_once(g for stage in stages for g in stage.guards)]
    return [asked[0] if len(asked) == 1 else sequence("all is so", *asked)]


def _checks(row: list[Stage]) -> list[Behaviour]:
    """What is asked at the end of all, where it is not yet: a stage may undo what one before it did."""
    if sum(bool(stage.guards) for stage in row) < 2:
        return []
    asked = [asked_by(stage.nodes[0]) for stage in row if not stage.guards]
    return [
        condition_leaf(guard)
        for guard in each_once(guard for stage in row for guard in stage.guards)
        if not any(one is not None and same(one, guard) for one in asked)
    ]
