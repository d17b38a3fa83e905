"""The leaves of a behaviour tree that run models: thin shells, which ask and tell a model once a tick."""

from __future__ import annotations

import inspect
from typing import Any, ClassVar

import numpy as np
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.concept.activation import Activation, Judged
from bt_tasksim.concept.context import Context
from bt_tasksim.concept.contract import Contract
from bt_tasksim.concept.functions import ConceptFunctions
from bt_tasksim.concept.reporting import Reporting
from bt_tasksim.concept.status import STATUSES
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.outcomes import INTERRUPTED
from bt_tasksim.policy.policy import PROGRAMMED, Action, Policy, PolicySlot, concept_name, named_policy
from bt_tasksim.robot.description import RobotDescription

PLANS = "plans, and the arm stands where it is"
"""What a leaf says that waits for its plan on a robot."""
ONE = np.array([0])
"""Numbers of the worlds of a tree of py_trees: there is one."""


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


class ModelLeaf(ContextLeaf):
    """A leaf that stands for a model; each model has its own class of leaf (`bt_tasksim.concept.model`)."""

    model_class: ClassVar[Any]
    """The model that it is a leaf of."""

    def __init__(self, model: Any, name: str | None) -> None:
        kind, first = type(model).__name__.lower(), next(iter(model.values.values()), "")
        super().__init__(name or f"{kind} {first}".strip())
        self._named = name
        self._model = model

    @property
    def model(self) -> Any:
        """What it does, as a value."""
        return self._model

    def arguments(self) -> dict[str, Any]:
        """Keyword arguments that build an equal leaf: parameters and settings that are not defaults."""
        arguments: dict[str, Any] = self._model.arguments()
        return arguments | ({"name": self._named} if self._named else {})


class ConceptNode(ModelLeaf):
    """The leaf of a concept: RUNNING while acting, SUCCESS when the policy says done, else FAILURE.

    Args:
        args: Parameters of the concept, in their order.
        name: The leaf's name; by default the concept and its first parameter.
        policy: ``"programmed"``, or the folder of a learned policy; by default the one pinned.
        kwargs: Parameters and settings by name, see `bt_tasksim.concept.model.ConceptModel`.

    Raises:
        InputError: A parameter or setting is unknown, missing or does not fit.
    """

    def __init__(self, *args: Any, name: str | None = None, policy: str | None = None, **kwargs: Any) -> None:
        concept = self.model_class.__name__.lower()
        owner = f"{concept} '{name}'" if name else concept
        super().__init__(self.model_class.value(*args, owner=owner, **kwargs), name)
        self.policy: str | None = _text(policy, owner, "policy")
        """The policy that decides: ``"programmed"``, or the folder of a learned one; None: the one pinned."""
        self.lacks_policy = False
        """It has no policy: it is not programmed, and nothing was learned yet."""
        self.under_training = False
        """Whoever trains it decides: it is ticked in a `BatchTree`, which waits there for decisions."""
        self._activation: Activation | None = None
        self._contract = Contract(self, self.model)
        self._policy: Policy | None = None

    @property
    def model(self) -> ConceptFunctions:
        """What it does, as a value."""
        found: ConceptFunctions = self._model
        return found

    @property
    def activation(self) -> Activation:
        """The concept as it runs in the tree's world.

        Raises:
            RuntimeError: The leaf was not set up.
        """
        if self._activation is None:
            raise not_set_up(self)
        return self._activation

    @property
    def memory(self) -> Any:
        """What the concept remembers ``(1, ...)``; None before it first began."""
        return None if self._activation is None else self._activation.memory

    @property
    def activations(self) -> int:
        """How often it has begun."""
        return 0 if self._activation is None else int(self._activation.activations[0])

    @property
    def plans(self) -> bool:
        """It waits for its plan: it has become active, and does not act yet; on a robot only."""
        return self._activation is not None and self._activation.plans

    @property
    def policy_in_use(self) -> Policy:
        """The policy that decides; resolved when the tree is set up."""
        if self.lacks_policy:
            concept = self.model_class.__name__
            raise InputError(
                f"leaf '{self.name}' has no policy yet: {concept} is not programmed, and none is pinned for "
                f"robot '{self.context.robot.name}'; train one, or name one with policy=..."
            )
        if self._policy is None:
            raise not_set_up(self)
        return self._policy

    def arguments(self) -> dict[str, Any]:
        """See `ModelLeaf.arguments`; with the policy, where one is named."""
        return super().arguments() | ({"policy": self.policy} if self.policy else {})

    def setup(self, **kwargs: Any) -> None:
        """Take the tree's context and resolve the policy."""
        super().setup(**kwargs)
        self._activation = Activation(self, self.model, self.context)
        self.lacks_policy = False
        if self.under_training:
            self._policy = None
            return
        self._policy = resolve_policy(self, self.context.robot)
        if not self.model.is_programmed and self._policy.name == PROGRAMMED:
            self.lacks_policy, self._policy = True, None

    def use(self, policy: Policy) -> None:
        """Let another policy decide, from now on and until the tree is set up again."""
        self._policy, self.lacks_policy = policy, False

    def update(self) -> Status:
        """One tick: judge, then act."""
        judged = self.activation.judge(ONE, np.array([self.status != Status.RUNNING]))
        if not len(judged.rows):
            return self._said(judged.statuses)
        return self._said(self.activation.act(judged, self.decision(judged)))

    def decision(self, judged: Judged) -> Action:
        """What its policy decides in the worlds in which it goes on.

        Raises:
            LeafError: It decides what is no action of so many worlds.
        """
        policy, worlds = self.policy_in_use, len(judged.rows)
        action = policy.act(self.model, judged.seen, judged.memory)
        motion, terminate, held = "programmed_motion", "done", self._contract
        if policy.name != PROGRAMMED:
            motion, terminate, held = "act", "act", Contract(self, policy)
        held.motion(action.motion, worlds, self.model.actions, motion)
        held.shares(action.terminate, worlds, terminate)
        return self.amended(action, judged.memory)

    def amended(self, action: Action, memory: Any) -> Action:
        """What is made of a decision ``(k, ...)``, whoever decided, in as many worlds; by default it itself.

        Args:
            action: The decision.
            memory: What is remembered there ``(k, ...)``.
        """
        return action

    def _said(self, statuses: Any) -> Status:
        """Report what has ended it."""
        outcome = self.activation.outcomes.get(0)
        if outcome is not None or self.outcome is not None or self.feedback_message:
            self.report(outcome)
        if self.plans:
            self.feedback_message = PLANS
        return STATUSES[int(statuses[0])]

    def terminate(self, new_status: Status) -> None:
        """py_trees calls this when the leaf ends, or is interrupted: then its command is dropped."""
        if new_status != Status.INVALID:
            return
        if self.status == Status.RUNNING:
            self.report(INTERRUPTED())
        if self._activation is not None:
            self._activation.stopped(ONE)


def leaf_class_of(model: type, base: type[ModelLeaf]) -> type[ModelLeaf]:
    """The class of a model's leaves: it has the model's name and documentation.

    Args:
        model: The model's class.
        base: What its leaves do.
    """
    return type(
        model.__name__,
        (base,),
        {
            "__module__": model.__module__,
            "__qualname__": f"{model.__qualname__}.leaf_class",
            "__doc__": inspect.getdoc(model),
            "model_class": model,
        },
    )


def not_set_up(node: Behaviour) -> RuntimeError:
    """What is raised when a node is ticked that has no context yet."""
    return RuntimeError(
        f"'{node.name}' was ticked before it was set up: run the tree with bt_tasksim.run or a Runner, "
        f"or call tree.setup(context=Context(robot)) first"
    )


def resolve_policy(leaf: ConceptNode, robot: RobotDescription) -> Policy:
    """The policy that a leaf names, or the one pinned for its concept and robot, or the programmed one.

    Args:
        leaf: The leaf.
        robot: The robot that it runs on.

    Raises:
        InputError: There is no such policy, it is damaged, or it is none for this concept and robot.
    """
    model = leaf.model
    try:
        slot = PolicySlot(concept_name(type(model)), robot.name, model.layout(robot), model.actions)
        return named_policy(leaf.policy, slot)
    except InputError as error:
        raise InputError(f"leaf '{leaf.name}': {error}") from error


def _text(value: Any, owner: str, what: str) -> str | None:
    if value is not None and not isinstance(value, str):
        raise InputError(f"{owner}: '{what}' should be text, found {value!r}")
    return value
