"""From goals alone to a tree that reaches them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from py_trees.behaviour import Behaviour

from bt_tasksim.concept.condition import Condition
from bt_tasksim.core.errors import InputError, nearest
from bt_tasksim.core.plain import short
from bt_tasksim.core.registry import parts
from bt_tasksim.scene.specs import Goal
from bt_tasksim.trees.backchain import (
    Act,
    ActChain,
    Wanted,
    after,
    chain_to,
    chains_to,
    concept_leaf,
    condition_leaf,
    condition_named,
    goals_of,
    let_go,
)
from bt_tasksim.trees.nodes.any_order import any_order
from bt_tasksim.trees.nodes.fallback import fallback
from bt_tasksim.trees.nodes.retry_while_acting import retry_while_acting
from bt_tasksim.trees.nodes.sequence import sequence


def tidy(goals: Sequence[Goal], *, parking: str | None = None, name: str = "tidy") -> Behaviour:
    """A tree that reaches goals, made of what concepts say that they bring about and need.

    Each goal becomes a fallback: it is as it should be, or a sequence of concepts makes it so. The sequence
    is found backwards from the goal's condition (`bt_tasksim.trees.backchain`), and ends by asking it again.
    What others are to stand on has its turn before them, and what is to be held in the end comes last.

    Several goals are reached in an order that is found on the way (`bt_tasksim.trees.nodes.any_order`): one
    whose spot is taken, on whose object something stands, or for which no grasp and no way is found, waits
    until others have been reached, which may have been in its way, and what stands on an object waits for
    that one. Where none of those that are left can begin, the tree fails, and says why of each. A goal that
    fails on its way begins another round, and there are as many rounds as goals. Where spots are taken
    crosswise, ``parking`` names a place anywhere on which objects may stand meanwhile; there are twice as
    many rounds then.

    The tree is made of the nodes and leaves that authors use: show it, edit it, save it. Reactivity by
    conditions that are asked anew and chains by pre- and postconditions are those of M. Colledanchise,
    D. Almeida and P. Ögren, "Towards blended reactive planning and acting using behavior trees", ICRA 2019;
    other than there sequences have memory, so that concepts are not begun anew while they act.

    Args:
        goals: What should be true at the end, one goal for an object.
        parking: A place where an object may stand meanwhile.
        name: Name of the tree's root.

    Raises:
        InputError: There is no goal, goals contradict each other, or no concept brings one about.
    """
    order = in_order(goals)
    if any(parking == goal.object for goal in order):
        raise InputError(f"tidy: '{parking}' cannot be the parking place, since a goal moves it")
    stages = [_stage(goal, _about(order[:k], goal.place)) for k, goal in enumerate(order)]
    if len(order) == 1:
        stages[0].name = name
        return stages[0]
    waiting = [] if parking is None else [leaf for goal in order for leaf in _parked(goal, parking)]
    checks = [_check(goal) for goal in order]
    rounds = len(order) * (1 if parking is None else 2)
    last = [stages.pop()] if _condition(order[-1]).in_hand else []  # nothing is taken while it is held
    free = [*stages, *waiting]
    work = free if len(free) == 1 else [any_order(f"{name} in any order", *free)]
    return retry_while_acting(rounds, sequence(name, *work, *last, *checks), name=f"{name}, round by round")


def in_order(goals: Sequence[Goal]) -> list[Goal]:
    """Goals in an order in which they can be reached: towers from below, and what is held at last.

    What may stand anywhere on a place comes after what may not. What others are to stand beside comes before
    them, unless they all stand beside each other.

    Raises:
        InputError: There is none, or goals contradict each other.
    """
    if isinstance(goals, Goal):
        raise InputError("tidy takes a sequence of goals, found one goal: write tidy([goal])")
    if not isinstance(goals, Iterable):
        raise InputError(f"tidy takes a sequence of goals, found {short(goals)}")
    goals = list(goals)
    _check_goals(goals)
    of = {goal.object: goal for goal in goals}
    out: list[Goal] = []

    def put(goal: Goal, above: tuple[Goal, ...]) -> None:
        if goal in above:
            _check_circle(above[above.index(goal) :])
            return
        if goal in out:
            return
        if goal.place in of:
            put(of[goal.place], (*above, goal))
        if goal not in out:
            out.append(goal)

    for goal in sorted(goals, key=lambda goal: (_condition(goal).in_hand, _condition(goal).leaves_open)):
        put(goal, ())
    return out


def _check_circle(goals: Sequence[Goal]) -> None:
    """Goals of which each refers to the next one's object, and the last one to the first one's.

    Raises:
        InputError: One of them has to rest on what rests on it.
    """
    if any(_condition(goal).rests_on_place for goal in goals):
        said = ", ".join(str(goal) for goal in goals)
        raise InputError(f"the goals go round in a circle: {said}; let one of them go to a place")


def _check_goals(goals: Sequence[Goal]) -> None:
    if not goals:
        raise InputError("there is no goal to make a tree from: give at least one Goal")
    for goal in goals:
        if not isinstance(goal, Goal):
            raise InputError(
                f"'{goal}' is a function, or no goal at all, of which nobody knows what brings it about: "
                f"give tidy the goals that are a Goal, [g for g in scene.goals if isinstance(g, Goal)]"
            )
    taken: dict[tuple[str, str], str] = {}
    seen: set[str] = set()
    held = [goal.object for goal in goals if _condition(goal).in_hand]
    for goal in goals:
        if goal.object in seen:
            raise InputError(
                f"two goals are about '{goal.object}': give one for each object, or write the tree yourself"
            )
        seen.add(goal.object)
        if goal.place == goal.object:
            raise InputError(f"'{goal.object}' cannot be {goal.relation} itself: name another place")
        if _condition(goal).takes_middle:
            other = taken.setdefault((goal.relation, goal.place), goal.object)
            if other != goal.object:
                raise InputError(
                    f"'{other}' and '{goal.object}' cannot both stand on the middle of '{goal.place}': "
                    f"give one of them another spot"
                )
        if goal.place in held:
            raise InputError(
                f"'{goal.object}' cannot be {goal.relation} '{goal.place}', which is to be held in the end"
            )
    if len(held) > 1:
        once = any(goal.when != "end" and goal.object in held for goal in goals)
        said = "; tidy takes goals that should hold once for such as hold in the end" if once else ""
        raise InputError(
            f"the hand can hold one object in the end, and goals ask for {' and '.join(held)}{said}"
        )


def _condition(goal: Goal) -> type[Condition]:
    """The condition that asks about a goal's relation.

    Raises:
        InputError: There is none.
    """
    found: dict[str, type[Condition]] = {
        kind.relation: kind
        for kind in parts("concept").values()
        if issubclass(kind, Condition) and kind.relation is not None
    }
    if goal.relation not in found:
        raise InputError(
            f"no condition asks whether '{goal.object}' is {goal.relation} '{goal.place}': write one whose "
            f"'relation' is '{goal.relation}'{nearest(goal.relation, found)}"
        )
    return found[goal.relation]


def _asked(goal: Goal) -> Wanted:
    kind = _condition(goal)
    return Wanted(kind.__name__, kind.from_goal(goal))


def _check(goal: Goal) -> Behaviour:
    """A leaf that asks whether a goal is reached."""
    return condition_leaf(_asked(goal))


def _about(goals: Sequence[Goal], name: str) -> Goal | None:
    """The goal of an object, if it has one of these."""
    return next((goal for goal in goals if goal.object == name), None)


def _stage(goal: Goal, below: Goal | None = None) -> Behaviour:
    """A fallback that reaches one goal.

    Args:
        goal: The goal.
        below: The goal of what the object is to stand on or beside, where that comes first.
    """
    wanted, title = _asked(goal), f"{goal.object} {goal.relation} {goal.place}".strip()
    works = []
    chains = _chains(goal, wanted)
    for chain in chains:
        needs = sorted(chain.given, key=lambda need: not condition_named(need.condition).lasting)
        asked = [condition_leaf(need) for need in needs if len(chains) > 1 or not _lasting(need)]
        if below is not None:
            asked.insert(0, _check(below))
        called = f"get {title}" if len(chains) == 1 else f"get {title}: {asked[0].name}"
        works.append(sequence(called, *asked, *_acts(chain), condition_leaf(wanted)))
    return fallback(title, condition_leaf(wanted), *works)


def _lasting(need: Wanted) -> bool:
    """Whether it never changes: then nobody need ask where there is one way alone."""
    return condition_named(need.condition).lasting


def _chains(goal: Goal, wanted: Wanted) -> list[ActChain]:
    """What reaches a goal, by kinds of things, and lets go where the object is not to be held."""
    try:
        chains = chains_to(wanted)
        return chains if _condition(goal).in_hand else [let_go(chain) for chain in chains]
    except InputError as error:
        raise InputError(f"goal '{goal.object} {goal.relation} {goal.place}': {error}") from error


def _acts(chain: ActChain) -> list[Behaviour]:
    """The leaves of a chain; what reaches a goal that later steps maintain is left out where it holds."""
    kept = {goal for step in chain.steps for goal in goals_of(step, step.concept.maintains)}
    return [
        _guarded(step) if kept & set(goals_of(step, step.concept.reaches)) else concept_leaf(step)
        for step in chain.steps
    ]


def _guarded(step: Act) -> Behaviour:
    holds = after(step)
    if not holds:
        return concept_leaf(step)
    return fallback(f"{step.actor} in hand", condition_leaf(holds[0]), concept_leaf(step))


def _parked(goal: Goal, parking: str) -> list[Behaviour]:
    """A fallback that brings an object to the parking place where its own spot is still taken by another."""
    wanted = _asked(goal)
    blocked = [
        condition_leaf(a) for a in _chains(goal, wanted)[0].given if a.arguments.get("place") == goal.place
    ]
    if not blocked:
        return []
    there = Wanted("StandsOn", {"target": goal.object, "place": parking})
    chain = let_go(chain_to(there))
    needs = [condition_leaf(need) for need in chain.given]
    work = sequence(f"{goal.object} waits on {parking}", *needs, *_acts(chain))
    return [fallback(f"{goal.object} need not wait", condition_leaf(wanted), *blocked, work)]
