"""What a concept is, apart from any tree: class attributes that declare it, and pure functions of arrays."""

from __future__ import annotations

import abc
import operator
from collections.abc import Mapping, Sequence
from functools import reduce
from typing import Any, ClassVar, Generic, Protocol, cast

from typing_extensions import TypeVar

from bt_tasksim.concept.aim import Aim
from bt_tasksim.concept.contact import ContactChange
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.demonstrated import Shown, plain_argument, plain_words
from bt_tasksim.concept.limit import Limit
from bt_tasksim.concept.parameters import Parameter, declared_parameters
from bt_tasksim.concept.presentation import Presentation
from bt_tasksim.concept.seen import Known, Seen
from bt_tasksim.concept.task import Task
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.outcomes import Outcome, Possible, Statement
from bt_tasksim.core.poses import Array, array_namespace
from bt_tasksim.core.world import Command
from bt_tasksim.robot.description import RobotDescription

MemoryT = TypeVar("MemoryT", default=Any)


class ConceptFunctions(abc.ABC, Generic[MemoryT]):
    """What a concept declares and computes; `bt_tasksim.concept.model.ConceptModel` adds its parameters.

    In all functions ``seen`` is a `Seen`, ``memory`` whatever `begin` and `advance` returned, and every array
    has a leading axis of worlds ``(N, ...)``: a single run has N = 1. None of them may change anything, and
    what they give for one world may not depend on the others. A concept says the memory's type in its head,
    ``class Push(ConceptModel[PushMemory])``: a bundle of arrays (`bt_tasksim.core.bundles`), or None.
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
    establishes: ClassVar[tuple[ConditionOf, ...]] = ()
    """Conditions that hold after its SUCCESS, the strongest first; trees from goals are chained by them."""
    requires: ClassVar[tuple[ConditionOf, ...]] = ()
    """Conditions that must hold when it begins, besides the goals that it maintains."""
    default_timeout: ClassVar[float] = 10.0
    """Seconds."""
    default_tolerance: ClassVar[float] = 0.005
    """Metres."""
    contact: ClassVar[ContactChange | None] = None
    """The contact state that it breaks, keeps or makes, by which it is recognised in a demonstration."""
    presentation: ClassVar[Presentation] = Presentation()
    """How it is drawn and spoken of."""
    is_task_model: ClassVar[bool] = True
    """Nothing is unknown: the programmed policy is the last word."""
    is_programmed: ClassVar[bool] = True
    """It has a programmed policy; else a leaf of it needs a learned one."""

    values: Mapping[str, Any]
    """Values of the declared parameters, by name."""
    timeout: float
    """Seconds after which it fails."""
    tolerance: float
    """Metres within which its goal counts as reached."""
    patient: bool = True
    """Its timeout is the usual one: what `planned` says comes on top of it."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        doing = {"carry_out", "command", "advance"}
        last = next(kind for kind in cls.__mro__ if doing & vars(kind).keys())
        if "carry_out" not in vars(last):
            cls.carry_out = ConceptFunctions.carry_out  # type: ignore[method-assign]  # asks the other two

    @classmethod
    def parameters(cls) -> dict[str, Parameter]:
        """The declared parameters, by name, in the order of the constructor's arguments."""
        cached: dict[str, Parameter] | None = cls.__dict__.get("_declared")
        if cached is None:
            cached = {p.name: p for p in declared_parameters(cls, ConceptFunctions)}
            cls._declared = cached  # type: ignore[attr-defined]
        return cached

    @property
    def actor(self) -> str:
        """Name of the object that this concept acts on."""
        return str(self.values.get("target", ""))

    def contradiction(self) -> str:
        """Why the parameters cannot stand together, as the end of a sentence; empty where they can.

        Asked once, when the leaf is made.
        """
        return ""

    def initial_state(self, seen: Seen) -> Possible | Sequence[Possible]:
        """Why the concept cannot start, each with the worlds in which it applies; the first one is said."""
        return ()

    def begin(self, seen: Seen) -> MemoryT:
        """The memory at the first tick: start poses, planned paths.

        What cannot be batched, such as a search for a way, is a call for each world that needs it.

        Raises:
            NoWayError: There is no way in one of these worlds; then they are asked one by one.
        """
        return cast("MemoryT", None)

    def planned(self, memory: MemoryT) -> Array | float:
        """Seconds ``(N,)`` that a way takes which had to be searched for.

        They come on top of a timeout that nobody gave.
        """
        return 0.0

    def aim(self, view: Any) -> Aim | None:
        """Where this concept brings its target, for those before it: a grasp has to serve what follows.

        Args:
            view: One world (`bt_tasksim.concept_nodes.view.WorldView`).

        Returns:
            None where it brings it nowhere.
        """
        return None

    def advance(self, action: Array, seen: Seen, memory: MemoryT) -> MemoryT:
        """The memory for the next tick, after the action ``(N, actions)``."""
        return memory

    @classmethod
    def layout(cls, robot: RobotDescription) -> Mapping[str, int]:
        """Names and sizes of what `features` holds, in its order; none: the concept cannot be learned."""
        return {}

    def features(self, seen: Seen, memory: MemoryT) -> Array:
        """What a learned policy sees: ``(N, n)``, from the declared observables only, as in `layout`."""
        raise NotImplementedError(f"{type(self).__name__} declares no features: it cannot be learned")

    def decides(self, seen: Seen, memory: MemoryT) -> Array:
        """Boolean ``(N,)``: a learned policy is asked at this tick; else the reference motion goes on."""
        return booleans(seen.tool, True)

    @abc.abstractmethod
    def command(self, action: Array, seen: Seen, memory: MemoryT) -> Command:
        """The command for an action ``(N, actions)`` of offsets on the reference motion."""

    def carry_out(self, action: Array, seen: Seen, memory: MemoryT) -> tuple[Command, MemoryT]:
        """What `command` and `advance` say, of one action; to override where both need the same numbers.

        This is what a run asks. A class that overrides one of the two again is asked for them, in a run too.
        """
        return self.command(action, seen, memory), self.advance(action, seen, memory)

    def programmed_motion(self, seen: Seen, memory: MemoryT) -> Array:
        """The programmed policy's action ``(N, actions)``; by default none: the reference motion itself."""
        return zeros(seen.tool, self.actions)

    @abc.abstractmethod
    def done(self, seen: Seen, memory: MemoryT) -> Array:
        """The programmed policy's completion signal: boolean ``(N,)``."""

    def necessary_cost(self, seen: Seen, memory: MemoryT) -> Array:
        """How far the observed state is from the necessary goal: ``(N,)``, 0 when reached."""
        return zeros(seen.tool)

    def limits(self, seen: Seen, memory: MemoryT) -> Sequence[Limit]:
        """What must not be exceeded (stress, crushing), each with its reason; the first exceeded is said."""
        return ()

    def violated(self, seen: Seen, memory: MemoryT) -> Array:
        """A limit is exceeded: boolean ``(N,)``; to override where it is more than `limits` can say."""
        return any_of(seen.tool, self.limits(seen, memory))

    def maintained(self, goal: str, seen: Seen, memory: MemoryT) -> Array:
        """A goal of `maintains` still holds: boolean ``(N,)``."""
        return booleans(seen.tool, True)

    def sufficient_cost(self, known: Known, memory: MemoryT) -> Array:
        """How far the hidden state is from the sufficient goal at the completion signal: ``(N,)``.

        In units of what is tolerable: below 1 the goal is reached.
        """
        return zeros(known.hidden.tool_pose)

    def explain(self, seen: Seen, memory: MemoryT) -> Statement | str | None:
        """Where things stand: a `Form` with its numbers ``(N,)``, or words that are true of all worlds."""
        return None

    # ---- demonstrations --------------------------------------------------------------------------------

    @classmethod
    def recognise(cls, shown: Shown, tasks: Sequence[Task]) -> Sequence[Task]:
        """The tasks of a demonstration in order of time, with those of this concept found among them.

        Args:
            shown: The demonstration.
            tasks: What was recognised so far: whatever breaks, keeps or makes a contact (see `contact`).
        """
        return tasks

    @classmethod
    def describe_task(cls, parameters: Mapping[str, Any]) -> str:
        """A recognised task in words with numbers and units, without its concept and its target."""
        return plain_words(parameters, cls.parameters())

    @classmethod
    def from_task(cls, task: Task, later: Sequence[Task]) -> dict[str, Any]:
        """Arguments of the leaf that does what was demonstrated.

        Args:
            task: What was recognised.
            later: The tasks that follow it.

        Raises:
            InputError: The demonstration does not tell enough.
        """
        declared = cls.parameters()
        return {
            name: plain_argument(value, declared[name])
            for name, value in task.parameters.items()
            if name in declared
        }


def zeros(like: Array, *shape: int) -> Array:
    """Zeros ``(N, *shape)`` in the library and with the worlds of ``like (N, n)``."""
    xp = array_namespace(like)
    return xp.zeros((*like.shape[:-1], *shape), dtype=like.dtype, device=like.device)


def booleans(like: Array, value: bool) -> Array:
    """The same answer ``(N,)`` for all worlds of ``like (N, n)``."""
    xp = array_namespace(like)
    return xp.full(like.shape[:-1], value, dtype=xp.bool, device=like.device)


class Applying(Protocol):
    """A `Possible` outcome or a `Limit`."""

    @property
    def applies(self) -> Array:
        """Boolean ``(N,)``."""

    def at(self, world: int) -> Outcome:
        """The outcome of one world."""


def any_of(like: Array, possibles: Sequence[Applying]) -> Array:
    """Boolean ``(N,)``: one of these applies; ``like (N, n)`` says how many worlds there are."""
    if not possibles:
        return booleans(like, False)
    return reduce(operator.or_, (possible.applies for possible in possibles))


def sequence_of(possibles: Any, owner: str) -> Sequence[Possible]:
    """What `ConceptFunctions.initial_state` gives, which may be one or several.

    Args:
        possibles: What it gave.
        owner: The concept's name, for the sentence.

    Raises:
        InputError: It gave something else.
    """
    if isinstance(possibles, Possible):
        return (possibles,)
    if possibles is None:
        return ()
    if isinstance(possibles, tuple | list) and all(isinstance(each, Possible) for each in possibles):
        return possibles
    raise InputError(
        f"{owner}: initial_state should give what REASON.where(...) gives, or several of them, "
        f"found {possibles!r}"
    )


def first_of(possibles: Sequence[Applying], world: int) -> Outcome | None:
    """The first of these that applies in a world, by its row."""
    return next((possible.at(world) for possible in possibles if bool(possible.applies[world])), None)
