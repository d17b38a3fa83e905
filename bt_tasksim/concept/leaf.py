"""The leaf of a behaviour tree that runs a concept: once a tick it calls the concept's pure functions."""

from __future__ import annotations

import abc
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.concept.context import Context, Seen
from bt_tasksim.concept.functions import ConceptFunctions, zeros
from bt_tasksim.concept.reporting import Reporting, as_outcome, as_statement
from bt_tasksim.core.errors import InputError, NoWayError
from bt_tasksim.core.outcomes import (
    CANNOT_START,
    DONE,
    GOAL_LOST,
    INTERRUPTED,
    LIMIT_VIOLATED,
    NO_WAY,
    PRECONDITION_UNMET,
    TIMED_OUT,
    Outcome,
    Statement,
)
from bt_tasksim.policy.policy import PROGRAMMED, Action, Policy, PolicySlot, concept_name, named_policy
from bt_tasksim.robot.description import RobotDescription

LOST_TICKS = 3
"""Ticks in a row without a maintained goal after which it counts as lost (contacts flicker)."""


class Decision(NamedTuple):
    """What the tick of a leaf under training yields right before it acts: whoever trains it decides.

    Attributes:
        leaf: The leaf; its `ConceptNode.decide` takes the action before the tick goes on.
        seen: What is seen.
        memory: The leaf's memory.
    """

    leaf: ConceptNode
    seen: Seen
    memory: Any


class ContextLeaf(Reporting):
    """A leaf that reads and writes the tree's `Context`."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._context: Context | None = None

    def setup(self, **kwargs: Any) -> None:
        """Take the tree's context.

        Raises:
            InputError: There is none: the tree was set up without a Runner.
        """
        context = kwargs.get("context")
        if not isinstance(context, Context):
            raise InputError(
                f"leaf '{self.name}' needs a context: run the tree with bt_tasksim.run or a Runner, "
                f"or call tree.setup(context=Context(robot))"
            )
        self._context = context

    @property
    def context(self) -> Context:
        """The tree's context.

        Raises:
            RuntimeError: The leaf was not set up.
        """
        if self._context is None:
            raise not_set_up(self)
        return self._context


class ConceptNode(ContextLeaf, abc.ABC):
    """The shell: RUNNING while acting, SUCCESS when the policy says done, FAILURE with a reason otherwise."""

    _model: ConceptFunctions

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.memory: Any = None
        self.activations = 0
        self.lacks_policy = False
        """It has no policy: it is not programmed, and nothing was learned yet."""
        self.under_training = False
        """The leaf's ticks are suspended before it acts, see `Decision`."""
        self._started = 0.0
        self._active = False
        self._lost = 0
        self._policy: Policy | None = None
        self._decided: Action | None = None

    @property
    def policy_in_use(self) -> Policy:
        """The policy that decides; resolved when the tree is set up."""
        if self.lacks_policy:
            concept = type(self).__name__
            raise InputError(
                f"leaf '{self.name}' has no policy yet: {concept} is not programmed, and none is pinned for "
                f"robot '{self.context.robot.name}'; train one, or name one with policy=..."
            )
        if self._policy is None:
            raise not_set_up(self)
        return self._policy

    @property
    def model(self) -> ConceptFunctions:
        """The concept's functions."""
        return self._model

    def setup(self, **kwargs: Any) -> None:
        """Take the tree's context and resolve the policy."""
        super().setup(**kwargs)
        model = self._model
        self.lacks_policy = False
        if self.under_training:
            self._policy = None
            return
        self._policy = resolve_policy(model, self.name, self.context.robot)
        if not model.is_programmed and self._policy.name == PROGRAMMED:
            self.lacks_policy, self._policy = True, None

    def use(self, policy: Policy) -> None:
        """Let another policy decide, from now on and until the tree is set up again."""
        self._policy, self.lacks_policy = policy, False

    def decide(self, action: Action) -> None:
        """Take the action that the suspended tick waits for, see `Decision`."""
        self._decided = action

    def initialise(self) -> None:
        """py_trees calls this when the leaf becomes active."""
        self._active = False
        self._lost = 0
        self._decided = None
        self._nearer = 0.0
        self.activations += 1

    def tick(self) -> Iterator[Behaviour]:
        """One tick; under training it is suspended right before the leaf acts, by yielding a `Decision`."""
        if not self.under_training:
            yield from super().tick()
            return
        if self.status != Status.RUNNING:
            self.initialise()
        found = self._judge()
        if isinstance(found, Seen):
            model, memory = self._model, self.memory
            if bool(model.decides(found, memory)):
                yield Decision(self, found, memory)  # type: ignore[misc]  # not a behaviour, on purpose
                if self._decided is None:
                    raise RuntimeError(f"leaf '{self.name}' is under training and was given no action")
                action, self._decided = self._decided, None
            else:
                action = Action(zeros(found.tool, model.actions), np.False_)
            found = self._act(action, found)
        if found != Status.RUNNING:
            self.stop(found)
        self.status = found
        yield self

    def update(self) -> Status:
        """One tick: judge, then act."""
        found = self._judge()
        if not isinstance(found, Seen):
            return found
        return self._act(self.policy_in_use.act(self._model, found, self.memory), found)

    def _judge(self) -> Seen | Status:
        """What is seen, or FAILURE where the leaf cannot start or go on."""
        model, context = self._model, self._context
        if context is None:
            raise not_set_up(self)
        if context.refused is not None and context.refused[0] is self:
            return self._fail(context.refused[1])
        if not self._active:
            self._started = context.now
            seen = context.seen(0.0)
            unmet = as_outcome(model.initial_state(seen), PRECONDITION_UNMET)
            if unmet is not None:
                return self._fail(CANNOT_START(unmet))
            try:
                self.memory = model.begin(seen)
            except NoWayError as error:
                return self._fail(CANNOT_START(NO_WAY(what=error)))
            self._active = True
        else:
            seen = context.seen(context.now - self._started)
        memory = self.memory
        if bool(model.violated(seen, memory)):
            return self._fail(LIMIT_VIOLATED(_exceeded(model, seen, memory)))
        for goal in model.maintains:
            if context.reached(goal, model.actor) and not bool(model.maintained(goal, seen, memory)):
                self._lost += 1
                if self._lost >= LOST_TICKS:
                    context.end(goal, model.actor)
                    measured = as_statement(model.explain(seen, memory))
                    return self._fail(GOAL_LOST(measured, object=model.actor, goal=goal))
                break
        else:
            self._lost = 0
        return seen

    def _act(self, action: Action, seen: Seen) -> Status:
        """Carry a decision out."""
        model, memory, context = self._model, self.memory, self.context
        self._nearer += float(action.terminate)
        if self._nearer >= 1.0:
            for goal in model.ends:
                context.end(goal, model.actor)
            for goal in model.reaches:
                context.reach(goal, model.actor)
            self.report(DONE(as_statement(model.explain(seen, memory)), elapsed=seen.elapsed))
            return Status.SUCCESS
        if seen.elapsed > model.timeout:
            return self._fail(TIMED_OUT(as_statement(model.explain(seen, memory)), limit=model.timeout))
        command, after = model.carry_out(action.motion, seen, memory)
        context.write(command, self)
        self.memory = after
        if self.outcome is not None or self.feedback_message:
            self.report(None)
        return Status.RUNNING

    def terminate(self, new_status: Status) -> None:
        """py_trees calls this when the leaf ends, or is interrupted: then its command is dropped."""
        if new_status != Status.INVALID:
            return
        if self.status == Status.RUNNING:
            self.report(INTERRUPTED())
        if self._context is not None:
            self._context.withdraw(self)

    def _fail(self, why: Outcome) -> Status:
        self.report(why)
        return Status.FAILURE


def _exceeded(model: ConceptFunctions, seen: Seen, memory: Any) -> Statement | None:
    """Which limit, and by how much; where the concept does not say it, where things stand."""
    measured = as_statement(model.explain(seen, memory))
    exceeded = (limit.outcome(measured) for limit in model.limits(seen, memory) if bool(limit.exceeded))
    return next(exceeded, measured)


def not_set_up(node: Behaviour) -> RuntimeError:
    """What is raised when a node is ticked that has no context yet."""
    return RuntimeError(
        f"'{node.name}' was ticked before it was set up: run the tree with bt_tasksim.run or a Runner, "
        f"or call tree.setup(context=Context(robot)) first"
    )


def resolve_policy(model: ConceptFunctions, leaf: str, robot: RobotDescription) -> Policy:
    """The policy that a leaf names, or the one pinned for its concept and robot, or the programmed one.

    Args:
        model: The leaf's concept.
        leaf: The leaf's name, for the sentence.
        robot: The robot that it runs on.

    Raises:
        InputError: There is no such policy, it is damaged, or it is none for this concept and robot.
    """
    try:
        slot = PolicySlot(concept_name(type(model)), robot.name, model.layout(robot), model.actions)
        return named_policy(model.policy, slot)
    except InputError as error:
        raise InputError(f"leaf '{leaf}': {error}") from error
