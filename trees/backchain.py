"""From a condition that should hold to the concepts that make it hold, backwards by what they declare.

A concept says what it ``establishes`` and ``requires`` (conditions), and which goals it ``reaches``,
``maintains`` and ``ends`` (`bt_tasksim.concept.functions.ConceptFunctions`). To make a condition hold, take a
concept that establishes it, and before that, whatever makes hold what this one needs. This is the expansion
of a failed condition in M. Colledanchise, D. Almeida and P. Ögren, "Towards blended reactive planning and
acting using behavior trees", ICRA 2019, with one difference: their tree asks for each condition on the way;
here the concepts follow each other in a chain, since one that ends with SUCCESS has reached what the next one
needs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from py_trees.behaviour import Behaviour

from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.leaf import ConceptNode, ModelLeaf
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.core.errors import InputError, nearest
from bt_tasksim.core.registry import parts

Arguments = dict[str, Any]


@dataclass(frozen=True)
class Act:
    """A concept with its arguments, as a link of a chain."""

    concept: type[ConceptModel]
    arguments: Arguments

    @property
    def actor(self) -> str:
        """The object that it acts on."""
        return str(self.arguments.get("target", ""))

    @property
    def values(self) -> Arguments:
        """The arguments, and the defaults of what they leave open."""
        declared = self.concept.parameters().values()
        return {**{p.name: p.default for p in declared if not p.required}, **self.arguments}


@dataclass(frozen=True)
class Wanted:
    """A condition with its arguments."""

    condition: str
    arguments: Arguments


@dataclass
class ActChain:
    """What makes a condition hold.

    Attributes:
        steps: The concepts, in order.
        given: Conditions that they need and that no concept brings about: they have to hold beforehand.
        held: Goals that an earlier step has reached and none has ended, with their objects.
    """

    steps: list[Act] = field(default_factory=list)
    given: list[Wanted] = field(default_factory=list)
    held: list[tuple[str, str]] = field(default_factory=list)

    def copy(self) -> ActChain:
        """A chain that can be made longer apart from this one."""
        return ActChain([*self.steps], [*self.given], [*self.held])

    def add(self, step: Act) -> None:
        """Make it longer by a step."""
        self.steps.append(step)
        self.held = [goal for goal in self.held if goal not in goals_of(step, step.concept.ends)]
        self.held += goals_of(step, step.concept.reaches)


def chain_to(wanted: Wanted) -> ActChain:
    """The shortest chain of concepts that makes a condition hold.

    Raises:
        InputError: No concept establishes it, or what one needs leads back to where it began.
    """
    return _achieved(ActChain(), wanted, ())


def chains_to(wanted: Wanted) -> list[ActChain]:
    """The chains that make a condition hold, one for each kind of thing that it may be about.

    What never changes (`Condition.lasting`), such as whether a part of furniture slides or turns, tells them
    apart; of those that need the same of it the surest and shortest counts.

    Raises:
        InputError: No concept establishes it, or what one needs leads back to where it began.
    """
    found: dict[tuple[str, ...], ActChain] = {}
    for chain in _every(ActChain(), wanted, ()):
        kind = tuple(said(need) for need in chain.given if condition_named(need.condition).lasting)
        found.setdefault(kind, chain)
    return list(found.values())


def let_go(chain: ActChain) -> ActChain:
    """A chain with what ends the goals that it has reached: after it the hand is free.

    Raises:
        InputError: There is no concept that does.
    """
    out = chain.copy()
    for goal, target in chain.held:
        out.add(_one_that(goal, "ends", target))
    return out


def goals_of(step: Act, names: tuple[str, ...]) -> list[tuple[str, str]]:
    """Goals of a concept, with the object that it acts on."""
    return [(name, step.actor) for name in names]


def condition_named(name: str) -> type[Condition]:
    """The condition of this name.

    Raises:
        InputError: There is none.
    """
    found = parts("concept").get(name)
    if found is None or not issubclass(found, Condition):
        known = [key for key, value in parts("concept").items() if issubclass(value, Condition)]
        raise InputError(
            f"a concept declares the condition '{name}', which does not exist{nearest(name, known)}"
        )
    kind: type[Condition] = found
    return kind


def concept_kinds() -> Iterator[type[ConceptModel]]:
    """All concepts that are known."""
    yield from (kind for kind in parts("concept").values() if issubclass(kind, ConceptModel))


def _achieved(chain: ActChain, wanted: Wanted, asking: tuple[str, ...]) -> ActChain:
    """A chain made longer until a condition holds, in the shortest way."""
    return _every(chain, wanted, asking)[0]


def _every(chain: ActChain, wanted: Wanted, asking: tuple[str, ...]) -> list[ActChain]:
    """A chain made longer until a condition holds, in each of the ways, the surest and shortest first."""
    if wanted.condition in asking:
        way = " needs ".join((*asking[asking.index(wanted.condition) :], wanted.condition))
        raise InputError(f"no chain of concepts leads to {said(wanted)}: {way}")
    found: list[tuple[bool, ActChain]] = []
    problems: list[str] = []
    for step, sometimes in _candidates(wanted):
        lacks = [
            p.name for p in step.concept.parameters().values() if p.required and p.name not in step.arguments
        ]
        if lacks:
            problems.append(f"{step.concept.__name__} does, and nothing says its '{lacks[0]}'")
            continue
        try:
            found.append((sometimes, _with(chain, step, (*asking, wanted.condition))))
        except InputError as error:
            problems.append(str(error))
    if not found:
        why = f": {problems[0]}" if problems else "; write one that declares it in its 'establishes'"
        raise InputError(f"no concept establishes {said(wanted)}{why}")
    return [one for _, one in sorted(found, key=lambda pair: (pair[0], len(pair[1].steps)))]


def _candidates(wanted: Wanted) -> Iterator[tuple[Act, bool]]:
    """Concepts that establish a condition, with the arguments with which they do, as far as it says them.

    And whether they do so only `sometimes` (`ConditionOf`).
    """
    for kind in concept_kinds():
        for one in kind.establishes:
            arguments = one.inverted(wanted.arguments) if one.condition == wanted.condition else None
            if arguments is not None:
                yield Act(kind, arguments), one.sometimes


def _with(chain: ActChain, step: Act, asking: tuple[str, ...]) -> ActChain:
    """A chain made longer by all that a step needs, and by the step."""
    out = chain.copy()
    if step in out.steps:
        return out
    for goal, target in goals_of(step, step.concept.maintains):
        if (goal, target) not in out.held:
            out = _with(out, _one_that(goal, "reaches", target), asking)
    for need in step.concept.requires:
        arguments = need.arguments(step.values)
        if arguments is None:
            continue
        asked = Wanted(need.condition, arguments)
        if _is_brought_about(need):
            out = _achieved(out, asked, asking)
        elif asked not in out.given:
            condition_named(need.condition)
            out.given.append(asked)
    if step not in out.steps:
        out.add(step)
    return out


def _is_brought_about(need: ConditionOf) -> bool:
    return any(one.condition == need.condition for kind in concept_kinds() for one in kind.establishes)


def _one_that(goal: str, does: str, target: str) -> Act:
    """A concept that reaches or ends a goal of an object, and takes no more than the object."""
    for kind in concept_kinds():
        needed = {p.name for p in kind.parameters().values() if p.required}
        if goal in getattr(kind, does) and needed == {"target"}:
            return Act(kind, {"target": target})
    raise InputError(f"no concept {does} the goal '{goal}' of '{target}'")


def said(wanted: Wanted) -> str:
    """A condition with its arguments, for people: ``Beside(target='box', other='cup')``."""
    return f"{wanted.condition}({', '.join(f'{k}={v!r}' for k, v in wanted.arguments.items())})"


def after(step: Act) -> list[Wanted]:
    """The conditions that hold after a step, the strongest first."""
    found = ((one, one.arguments(step.values)) for one in step.concept.establishes)
    return [Wanted(one.condition, arguments) for one, arguments in found if arguments is not None]


def act_of(leaf: ConceptNode) -> Act:
    """The link of a chain that a leaf is."""
    kind: Any = type(leaf.model)
    return Act(kind, dict(leaf.model.values))


def asked_by(node: Behaviour) -> Wanted | None:
    """What a leaf asks; None where a node is no condition."""
    if not isinstance(node, ModelLeaf) or not isinstance(node.model, Condition):
        return None
    return Wanted(type(node.model).__name__, node.model.arguments())


def condition_leaf(asked: Wanted) -> Behaviour:
    """A leaf that asks a condition."""
    found: Behaviour = condition_named(asked.condition)(**asked.arguments)
    return found


def concept_leaf(step: Act) -> Behaviour:
    """A leaf that takes a step."""
    found: Behaviour = step.concept(**step.arguments)
    return found
