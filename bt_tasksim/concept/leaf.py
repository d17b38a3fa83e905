"""Concept models: leaves of a behaviour tree whose SUCCESS is their completion signal.

`ConceptModel` is what one writes: typed parameters and pure functions. `ConceptNode`, its base, is the thin
py_trees leaf that calls these functions once a tick with a batch of one.
"""

from __future__ import annotations

import abc
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.context import Context, Known, Seen
from bt_tasksim.errors import InputError, NoWayError, nearest
from bt_tasksim.parameters import Parameter, bind_arguments, declared_parameters
from bt_tasksim.policy import PROGRAMMED, Action, Policy, resolve_policy
from bt_tasksim.poses import Array, array_namespace
from bt_tasksim.robot import RobotDescription
from bt_tasksim.world import Command

LOST_TICKS = 3
"""Ticks in a row without a maintained goal after which it counts as lost (contacts flicker)."""
VIOLATED = "limit violated"
"""How the feedback message of a leaf begins that failed because it exceeded a limit."""
TIMED_OUT = "not done within"
"""How the feedback message of a leaf begins that ran into its own time-out."""


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


class ContextLeaf(Behaviour):
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
            raise RuntimeError(f"leaf '{self.name}' was ticked before it was set up")
        return self._context


class ConceptNode(ContextLeaf, abc.ABC):
    """The shell: RUNNING while acting, SUCCESS when the policy says done, FAILURE with a reason otherwise."""

    _model: ConceptModel

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
            raise RuntimeError(f"leaf '{self.name}' was ticked before it was set up")
        return self._policy

    @property
    def model(self) -> ConceptModel:
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
        self._policy = resolve_policy(model, self.context.robot)
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
                action = Action(_zeros(found.tool, model.actions), np.False_)
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
            raise RuntimeError(f"leaf '{self.name}' was ticked before it was set up")
        if context.refused is not None and context.refused[0] is self:
            return self._fail(f"out of reach: {context.refused[1]}")
        if not self._active:
            self._started = context.now
            seen = context.seen(0.0)
            why = model.initial_state(seen)
            if why:
                return self._fail(f"cannot start: {why}")
            try:
                self.memory = model.begin(seen)
            except NoWayError as error:
                return self._fail(f"cannot start: {error}")
            self._active = True
        else:
            seen = context.seen(context.now - self._started)
        memory = self.memory
        if bool(model.violated(seen, memory)):
            return self._fail(f"{VIOLATED}: {model.explain(seen, memory)}")
        for goal in model.maintains:
            if context.reached(goal, model.actor) and not bool(model.maintained(goal, seen, memory)):
                self._lost += 1
                if self._lost >= LOST_TICKS:
                    context.end(goal, model.actor)
                    return self._fail(
                        f"lost: {model.actor} is no longer {goal}; {model.explain(seen, memory)}"
                    )
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
            self.feedback_message = f"done after {seen.elapsed:.2f} s: {model.explain(seen, memory)}"
            return Status.SUCCESS
        if seen.elapsed > model.timeout:
            return self._fail(f"{TIMED_OUT} {model.timeout:g} s: {model.explain(seen, memory)}")
        command, after = model.carry_out(action.motion, seen, memory)
        context.write(command, self)
        if model.looks(seen, memory):
            context.look = True
        self.memory = after
        self.feedback_message = ""
        return Status.RUNNING

    def terminate(self, new_status: Status) -> None:
        """py_trees calls this when the leaf ends, or is interrupted: then its command is dropped."""
        if new_status != Status.INVALID:
            return
        if self.status == Status.RUNNING:
            self.feedback_message = "interrupted"
        if self._context is not None:
            self._context.withdraw(self)

    def _fail(self, why: str) -> Status:
        self.feedback_message = why
        return Status.FAILURE


class ConceptModel(ConceptNode):
    """A task described well enough to learn it, or programmed where nothing is unknown.

    A subclass declares parameters as annotated attributes (`bt_tasksim.parameters`) and overrides the pure
    functions below. In all of them ``seen`` is a `Seen`, ``memory`` whatever `begin` and `advance` returned,
    and every array has leading batch dimensions ``(...)``; none of them may change anything.

    Every concept takes these keyword arguments besides its own parameters:

    - ``name``: the leaf's name; by default the concept and its first parameter.
    - ``policy``: ``"programmed"``, or the folder of a learned policy; by default the one pinned.
    - ``timeout``: seconds after which it fails; by default the concept's own.
    - ``tolerance``: metres within which its goal counts as reached; by default the concept's own.
    - ``uncertainty``: standard deviations of numeric parameters, by name, in their units.
    """

    actions: ClassVar[int] = 0
    """Size of the action's motion part."""
    observables: ClassVar[tuple[str, ...]] = ()
    """What a learned policy of this concept may look at, by attribute of `Observation`."""
    maintains: ClassVar[tuple[str, ...]] = ()
    """Goals that earlier concepts reached and this one must keep."""
    reaches: ClassVar[tuple[str, ...]] = ()
    """Goals that hold after its SUCCESS."""
    ends: ClassVar[tuple[str, ...]] = ()
    """Goals that no longer hold after its SUCCESS."""
    default_timeout: ClassVar[float] = 10.0
    """Seconds."""
    default_tolerance: ClassVar[float] = 0.005
    """Metres."""
    is_task_model: ClassVar[bool] = True
    """Nothing is unknown: the programmed policy is the last word."""
    is_programmed: ClassVar[bool] = True
    """It has a programmed policy; else a leaf of it needs a learned one."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        concept = type(self).__name__
        settings = {k: kwargs.pop(k, None) for k in ("name", "policy", "timeout", "tolerance", "uncertainty")}
        declared = self.parameters()
        owner = f"{concept.lower()} '{settings['name']}'" if settings["name"] else concept.lower()
        checked = bind_arguments(declared, args, kwargs, owner)
        self._settings = settings
        first = next(iter(checked.values()), "")
        super().__init__(settings["name"] or f"{concept.lower()} {first}".strip())
        self._model = self
        for key, value in checked.items():
            object.__setattr__(self, key, value)
        self.values: Mapping[str, Any] = checked
        self.policy: str | None = _text(settings["policy"], owner, "policy")
        self.timeout = _positive(settings["timeout"], self.default_timeout, owner, "timeout")
        self.tolerance = _positive(settings["tolerance"], self.default_tolerance, owner, "tolerance")
        self.uncertainty = _uncertainty(settings["uncertainty"], declared, owner)

    @classmethod
    def parameters(cls) -> dict[str, Parameter]:
        """The declared parameters, by name, in the order of the constructor's arguments."""
        cached: dict[str, Parameter] | None = cls.__dict__.get("_declared")
        if cached is None:
            cached = {p.name: p for p in declared_parameters(cls, ConceptModel)}
            cls._declared = cached  # type: ignore[attr-defined]
        return cached

    def arguments(self) -> dict[str, Any]:
        """Keyword arguments that build an equal leaf: parameters and settings that are not defaults."""
        out = {k: v for k, v in self.values.items() if (p := self.parameters()[k]).required or v != p.default}
        out |= {k: v for k, v in self._settings.items() if v not in (None, {})}
        return out

    @property
    def actor(self) -> str:
        """Name of the object that this concept acts on."""
        return str(self.values.get("target", ""))

    # ---- the pure functions ----------------------------------------------------------------------------

    def initial_state(self, seen: Seen) -> str:
        """Why the concept cannot start now, as the end of a sentence; empty when it can."""
        return ""

    def begin(self, seen: Seen) -> Any:
        """The memory at the first tick: start poses, planned paths. What cannot be batched happens here."""
        return None

    def advance(self, action: Array, seen: Seen, memory: Any) -> Any:
        """The memory for the next tick, after the action ``(..., actions)``."""
        return memory

    @classmethod
    def layout(cls, robot: RobotDescription) -> Mapping[str, int]:
        """Names and sizes of what `features` holds, in its order; none: the concept cannot be learned."""
        return {}

    def features(self, seen: Seen, memory: Any) -> Array:
        """What a learned policy sees: ``(..., n)``, from the declared observables only, as in `layout`."""
        raise NotImplementedError(f"{type(self).__name__} declares no features: it cannot be learned")

    def decides(self, seen: Seen, memory: Any) -> Array:
        """Boolean ``(...)``: a learned policy is asked at this tick; else the reference motion goes on."""
        return np.True_

    @abc.abstractmethod
    def command(self, action: Array, seen: Seen, memory: Any) -> Command:
        """The command for an action ``(..., actions)`` of offsets on the reference motion."""

    def carry_out(self, action: Array, seen: Seen, memory: Any) -> tuple[Command, Any]:
        """What `command` and `advance` say, of one action; to override where both need the same numbers."""
        return self.command(action, seen, memory), self.advance(action, seen, memory)

    def programmed_motion(self, seen: Seen, memory: Any) -> Array:
        """The programmed policy's action ``(..., actions)``; by default none: the reference motion itself."""
        return _zeros(seen.tool, self.actions)

    @abc.abstractmethod
    def done(self, seen: Seen, memory: Any) -> Array:
        """The programmed policy's completion signal: boolean ``(...)``."""

    def necessary_cost(self, seen: Seen, memory: Any) -> Array:
        """How far the observed state is from the necessary goal: ``(...)``, 0 when reached."""
        return _zeros(seen.tool)

    def violated(self, seen: Seen, memory: Any) -> Array:
        """A limit is exceeded (stress, crushing): boolean ``(...)``."""
        return np.False_

    def maintained(self, goal: str, seen: Seen, memory: Any) -> Array:
        """A goal of `maintains` still holds: boolean ``(...)``."""
        return np.True_

    def sufficient_cost(self, known: Known, memory: Any) -> Array:
        """How far the hidden state is from the sufficient goal at the completion signal: ``(...)``.

        In units of what is tolerable: below 1 the goal is reached.
        """
        return _zeros(known.hidden.tool_pose)

    def looks(self, seen: Seen, memory: Any) -> bool:
        """Fresh images are wanted for the next tick."""
        return False

    def explain(self, seen: Seen, memory: Any) -> str:
        """Where things stand, in numbers with units, for the feedback message."""
        return ""


class Condition(ContextLeaf):
    """A leaf that asks a question and answers at once: SUCCESS for yes, FAILURE for no.

    A subclass declares parameters like a concept and overrides `holds`.
    """

    values: Mapping[str, Any]

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        name = kwargs.pop("name", None)
        kind = type(self).__name__
        owner = f"condition {kind}"
        checked = bind_arguments(self.parameters(), args, kwargs, owner)
        first = next(iter(checked.values()), "")
        super().__init__(name or f"{kind.lower()} {first}".strip())
        self._named = name
        self.values = checked
        for key, value in checked.items():
            setattr(self, key, value)

    @classmethod
    def parameters(cls) -> dict[str, Parameter]:
        """The declared parameters, by name."""
        return {p.name: p for p in declared_parameters(cls, Condition)}

    def arguments(self) -> dict[str, Any]:
        """Keyword arguments that build an equal leaf."""
        out = {k: v for k, v in self.values.items() if (p := self.parameters()[k]).required or v != p.default}
        return out | ({"name": self._named} if self._named else {})

    @abc.abstractmethod
    def holds(self, seen: Seen) -> Array:
        """The answer: boolean ``(...)``; pure and batched."""

    def explain(self, seen: Seen) -> str:
        """The answer in words and numbers."""
        return ""

    def update(self) -> Status:
        """Ask once."""
        seen = self.context.seen(0.0)
        yes = bool(self.holds(seen))
        self.feedback_message = self.explain(seen)
        return Status.SUCCESS if yes else Status.FAILURE


def _zeros(like: Array, *shape: int) -> Array:
    """Zeros ``(..., *shape)`` in the library and with the batch dimensions of ``like (..., n)``."""
    if type(like) is np.ndarray:
        return np.zeros(like.shape[:-1] + shape)
    return array_namespace(like).zeros((*like.shape[:-1], *shape), dtype=like.dtype, device=like.device)


def _text(value: Any, owner: str, what: str) -> str | None:
    if value is not None and not isinstance(value, str):
        raise InputError(f"{owner}: '{what}' should be text, found {value!r}")
    return value


def _positive(value: Any, default: float, owner: str, what: str) -> float:
    if value is None:
        return default
    if isinstance(value, bool | str) or not np.isfinite(value) or value <= 0:
        raise InputError(f"{owner}: '{what}' should be a positive number, found {value!r}")
    return float(value)


def _uncertainty(value: Any, declared: Mapping[str, Parameter], owner: str) -> dict[str, float]:
    out = {}
    for key, sigma in dict(value or {}).items():
        if key not in declared:
            raise InputError(f"{owner}: uncertainty of unknown parameter '{key}'{nearest(key, declared)}")
        if not declared[key].quantity.unit:
            raise InputError(f"{owner}: parameter '{key}' is not a number and has no uncertainty")
        out[key] = _positive(sigma, 0.0, owner, f"uncertainty of {key}")
    return out
