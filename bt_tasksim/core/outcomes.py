"""Outcomes are values: a registered reason, its numbers in SI units, and the names that it is about.

A part that can fail declares its reasons beside its code, each with one sentence for people::

    TOO_WIDE = register_reason(
        "too_wide", "{object} is {width} wide, the hand opens {opening}", width=METRES, opening=METRES
    )
    ...
    return TOO_WIDE(object="box", width=0.11, opening=0.08)

Whoever counts or compares looks at the reason, whoever computes at the numbers. The sentence is made in
`Statement.sentence` alone, when somebody reads it, and nothing reads it back. Within a process a reason also
has an integer code, for arrays with one outcome a world; files hold its name.

Numbers may be arrays with one value a world, and names tuples with one text a world: such a statement is
about a batch, and `Statement.at` is what it says of one world.
"""

from __future__ import annotations

import string
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import isfinite, nan
from typing import Any, NamedTuple, Self

from bt_tasksim.core.errors import (
    BtTasksimError,
    InputError,
    LeafError,
    MachineError,
    NoDrawError,
    NotToldApartError,
    NoWayError,
    UnreachableError,
)
from bt_tasksim.core.markup import html_pairs
from bt_tasksim.core.poses import Array, host
from bt_tasksim.core.registry import part, register
from bt_tasksim.core.units import METRES, RADIANS, SECONDS, Measured, Unit, told_apart


@dataclass(frozen=True, eq=False)
class Form:
    """A sentence with gaps for numbers and names; called, it gives a `Statement`.

    Attributes:
        template: The sentence; ``{gap}`` stands for a number with its unit or for a name, ``{gap:.1f}`` for a
            number in another format than its unit's own.
        units: Units of the numbers, by gap.
        names: The other gaps.
        shown: The numbers that the sentence shows, each with the format that it asks for.
    """

    template: str
    units: Mapping[str, Unit] = field(default_factory=dict)
    names: tuple[str, ...] = field(init=False)
    shown: tuple[tuple[str, str], ...] = field(init=False)

    def __post_init__(self) -> None:
        parsed = [
            (gap, spec or "")
            for _, gap, spec, _ in string.Formatter().parse(self.template)
            if gap is not None
        ]
        gaps = [gap for gap, _ in parsed]
        object.__setattr__(self, "shown", tuple(dict.fromkeys(p for p in parsed if p[0] in self.units)))
        object.__setattr__(self, "names", tuple(dict.fromkeys(g for g in gaps if g not in self.units)))

    def __call__(self, detail: Statement | None = None, /, **values: Any) -> Statement:
        """The statement with these numbers and names; what else is known stands in ``detail``.

        Raises:
            TypeError: A number or a name is missing, or is not declared.
        """
        return Statement(self, *self._split(values), detail)

    def _split(self, values: Mapping[str, Any]) -> tuple[dict[str, float], dict[str, str]]:
        declared = (*self.units, *self.names)
        if set(values) != set(declared):
            raise TypeError(f"'{self.template}' takes {', '.join(declared) or 'nothing'}, not {list(values)}")
        numbers = {name: _number(values[name]) for name in self.units}
        return numbers, {name: _text(values[name]) for name in self.names}


def _number(value: Any) -> Any:
    """A number, or one for each world."""
    return value if getattr(value, "ndim", 0) else float(value)


def _text(value: Any) -> Any:
    """A text, or one for each world."""
    return tuple(map(str, value)) if isinstance(value, tuple) else str(value)


def _number_at(value: Any, world: int) -> float:
    return float(value[world]) if getattr(value, "ndim", 0) else float(value)


def _text_at(value: Any, world: int) -> str:
    return str(value[world]) if isinstance(value, tuple) else str(value)


@dataclass(frozen=True)
class Statement:
    """What is to be said, as a value.

    Attributes:
        form: The sentence with gaps.
        numbers: Its numbers in SI units.
        names: Its names: of objects, places, joints.
        detail: What stands behind it: the outcome that caused it, or what was measured then.
    """

    form: Form
    numbers: Mapping[str, float]
    names: Mapping[str, str]
    detail: Statement | None = None

    def on_host(self) -> Self:
        """The same, with its numbers in NumPy, wherever they are: to be asked before many worlds are."""
        numbers: Any = {n: host(v) if getattr(v, "ndim", 0) else v for n, v in self.numbers.items()}
        return replace(self, numbers=numbers, detail=None if self.detail is None else self.detail.on_host())

    def at(self, world: int) -> Self:
        """What a statement about a batch says of one world, by its row."""
        numbers = {name: _number_at(value, world) for name, value in self.numbers.items()}
        names = {name: _text_at(value, world) for name, value in self.names.items()}
        return replace(
            self, numbers=numbers, names=names, detail=None if self.detail is None else self.detail.at(world)
        )

    @property
    def own_sentence(self) -> str:
        """The sentence without the detail; the only place where one is made."""
        asked = [(n, spec) for n, spec in self.form.shown if n in self.numbers]
        texts = told_apart([Measured(self.numbers[n], self.form.units[n], spec) for n, spec in asked])
        told = dict(zip(asked, texts, strict=True))
        gaps = {name: _Gap(name, told) for name in self.numbers}
        return self.form.template.format(**gaps, **self.names)

    @property
    def sentence(self) -> str:
        """The sentence for people, with what stands behind it."""
        behind = self.detail.sentence if self.detail is not None else ""
        return ": ".join(part for part in (self.own_sentence, behind) if part)

    @property
    def values(self) -> dict[str, str]:
        """What fills the gaps, as people read it: known numbers with their units, and names."""
        known = {n: Measured(v, self.form.units[n]) for n, v in self.numbers.items() if isfinite(v)}
        return {**dict(zip(known, told_apart(list(known.values())), strict=True)), **self.names}

    def __str__(self) -> str:
        return self.sentence

    def to_data(self) -> dict[str, Any]:
        """As plain data, for files: numbers with their units, names, its own sentence, and the detail."""
        return {
            "numbers": {k: v if isfinite(v) else None for k, v in self.numbers.items()},
            "units": {name: self.form.units[name].symbol for name in self.numbers},
            "names": dict(self.names),
            "sentence": self.own_sentence,
            "detail": None if self.detail is None else self.detail.to_data(),
        }


@dataclass(frozen=True, eq=False)
class Reason(Form):
    """A registered form, which outcomes are counted by; made by `register_reason`.

    Attributes:
        name: Its name in files, in snake case.
        code: Its number within this process, from 1 on; 0 is kept for "no outcome". It may differ in
            another process.
    """

    name: str = ""
    code: int = 0

    def __call__(self, detail: Statement | None = None, /, **values: Any) -> Outcome:
        """The outcome with these numbers and names, see `Form`."""
        return Outcome(self, *self._split(values), detail)

    def where(self, applies: Array, /, **values: Any) -> Possible:
        """What is said of those worlds of a batch in which ``applies (N,)`` is true.

        Args:
            applies: Boolean.
            values: Numbers and names as of a call, each one for all worlds or ``(N,)``.

        Raises:
            TypeError: A number or a name is missing, or is not declared.
        """
        return Possible(applies, Outcome(self, *self._split(values)))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Reason) and other.name == self.name

    def __hash__(self) -> int:
        return hash(self.name)

    def __reduce__(self) -> tuple[Any, ...]:
        return _arrived, (self.name, self.template, dict(self.units))

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True)
class Outcome(Statement):
    """How something ended: a `Reason` with its numbers and names."""

    form: Reason

    @property
    def reason(self) -> Reason:
        """What it is counted by."""
        return self.form

    @property
    def cause(self) -> Outcome:
        """The innermost outcome behind it: where a leaf cannot start, why not."""
        return self.detail.cause if isinstance(self.detail, Outcome) else self

    def with_detail(self, detail: Statement | None) -> Outcome:
        """The same, with a detail put behind its cause."""
        inner = self.detail.with_detail(detail) if isinstance(self.detail, Outcome) else detail
        return replace(self, detail=inner)

    def is_a(self, *reasons: Reason) -> bool:
        """It, or an outcome behind it, has one of these reasons."""
        if self.form in reasons:
            return True
        return isinstance(self.detail, Outcome) and self.detail.is_a(*reasons)

    def _repr_html_(self) -> str:
        """A small table, for notebooks: the sentence, the reason and what it was filled with."""
        return html_pairs({"why": self.sentence, **self.cause.table_rows()})

    def table_rows(self) -> dict[str, str]:
        """Its reason, numbers and names, as rows of a table for people."""
        said = ", ".join(f"{name.replace('_', ' ')} {text}" for name, text in self.values.items())
        return {"reason": self.reason.name, "measured": said}

    def to_data(self) -> dict[str, Any]:
        """As plain data, with the reason's name."""
        return {"reason": self.form.name, **super().to_data()}


class Possible(NamedTuple):
    """An outcome of those worlds of a batch in which it applies.

    Attributes:
        applies: Boolean ``(N,)``.
        outcome: What it is, its numbers ``(N,)``.
    """

    applies: Array
    outcome: Outcome

    def on_host(self) -> Possible:
        """The same, with all numbers in NumPy: to be asked before many worlds are."""
        return Possible(host(self.applies), self.outcome.on_host())

    def at(self, world: int) -> Outcome:
        """The outcome of one world, by its row."""
        return self.outcome.at(world)


class _Gap:
    """A number that shows itself as it was told apart from the others, by its name and format."""

    def __init__(self, name: str, told: Mapping[tuple[str, str], str]) -> None:
        self._name, self._told = name, told

    def __format__(self, spec: str) -> str:
        return self._told[self._name, spec]


# ---- the register -----------------------------------------------------------------------------------------

_announced: dict[str, Reason] = {}
"""Every reason of this process, in the order of the codes."""


def register_reason(name: str, template: str, **units: Unit) -> Reason:
    """Announce a reason, as a constant beside the part that gives it.

    Args:
        name: Its name in files: lower-case words joined by ``_``.
        template: Its sentence, see `Form`.
        units: Units of the numbers among its gaps; the other gaps are names.

    Raises:
        InputError: The name is not in snake case, or another module has registered another reason under it.
    """
    if not name.isidentifier() or name != name.lower():
        raise InputError(f"a reason's name should be lower-case words joined by '_', found {name!r}")
    module = str(sys._getframe(1).f_globals.get("__name__", ""))
    old = _announced.get(name)
    reason = Reason(template, units, name, len(_announced) + 1 if old is None else old.code)
    object.__setattr__(reason, "__qualname__", name)  # by which the registry knows a repeated definition
    _announced[name] = register("reason", name, module)(reason)
    return reason


def reason_named(name: str) -> Reason:
    """The reason of a name.

    Raises:
        InputError: None is registered under it.
    """
    found: Reason = part("reason", name)
    return found


def reason_of(code: int) -> Reason | None:
    """The reason of a code; None for 0.

    Raises:
        InputError: No reason has this code in this process.
    """
    if code == 0:
        return None
    for reason in _announced.values():
        if reason.code == code:
            return reason
    raise InputError(f"no reason has the code {code} in this process")


def _arrived(name: str, template: str, units: Mapping[str, Unit]) -> Reason:
    """A reason from another process: the one of that name here, else one that is not registered."""
    try:
        return reason_named(name)
    except InputError:
        return Reason(template, units, name)


def outcome_from_data(data: Mapping[str, Any]) -> Outcome:
    """The outcome that `Outcome.to_data` wrote, whether or not its reason is known here."""
    found = _from_data(data)
    assert isinstance(found, Outcome)
    return found


def recorded_outcome(name: str, sentence: str) -> Outcome:
    """An outcome of which a file holds no more than a reason and a sentence, as older ones do."""
    return outcome_from_data({"reason": name.replace(" ", "_"), "sentence": sentence})


def _from_data(data: Mapping[str, Any]) -> Statement:
    numbers = {name: nan if v is None else float(v) for name, v in data.get("numbers", {}).items()}
    names = {name: str(value) for name, value in data.get("names", {}).items()}
    detail = None if data.get("detail") is None else _from_data(data["detail"])
    units = {name: Unit(symbol, symbol) for name, symbol in data.get("units", {}).items()}
    literal = str(data["sentence"]).replace("{", "{{").replace("}", "}}")
    if "reason" not in data:
        return Statement(Form(literal, units), numbers, names, detail)
    reason = _arrived(str(data["reason"]), literal, units)
    if set(reason.units) != set(numbers) or set(reason.names) != set(names):
        reason = Reason(literal, units, reason.name)
    return Outcome(reason, numbers, names, detail)


# ---- what several rooms give ------------------------------------------------------------------------------

TEXT = Form("{text}")
"""Words that somebody wrote without numbers to it."""
DONE = register_reason("done", "done after {elapsed:.2f}", elapsed=SECONDS)
FAILED = register_reason("failed", "{text}")
"""A failure of which only words are known, such as those of a plain py_trees behaviour."""
INTERRUPTED = register_reason("interrupted", "interrupted")
TIMED_OUT = register_reason("timed_out", "not done within {limit:g}", limit=SECONDS)
TIME_OVER = register_reason(
    "time_over", "the episode was stopped after {limit:g}, its longest time", limit=SECONDS
)
CANNOT_START = register_reason("cannot_start", "cannot start")
PRECONDITION_UNMET = register_reason("precondition_unmet", "{text}")
"""Of a concept that says in words why it cannot start."""
LIMIT_VIOLATED = register_reason("limit_violated", "limit violated")
GOAL_LOST = register_reason("goal_lost", "{object} is no longer {goal}")
OUT_OF_REACH = register_reason("out_of_reach", "out of reach: {what}", distance=METRES, angle=RADIANS)
NO_WAY = register_reason("no_way", "{what}")
LEAF_RAISED = register_reason("leaf_raised", "{text}")
MACHINE_FAILED = register_reason("machine_failed", "{text}")
NO_DRAW = register_reason("no_draw", "{text}")
"""No world can be drawn with the episode's seed, so there was no episode; the sentence says why."""

NOT_TOLD_APART = register_reason("not_told_apart", "{text}")
"""Perception has refused the episode before anything moved; the sentence says of which objects."""


def outcome_of_error(error: BtTasksimError) -> Outcome:
    """An error as the outcome of an episode."""
    if isinstance(error, UnreachableError):
        return OUT_OF_REACH(what=error, distance=error.distance, angle=error.angle)
    if isinstance(error, NoWayError):
        return NO_WAY(what=error)
    reason = next((reason for kind, reason in _ERRORS if isinstance(error, kind)), FAILED)
    return reason(text=error)


_ERRORS = (
    (LeafError, LEAF_RAISED),
    (MachineError, MACHINE_FAILED),
    (NoDrawError, NO_DRAW),
    (NotToldApartError, NOT_TOLD_APART),
)
