"""Shapes, units and sizes of what a concept's functions give for one world, and what its actions do."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from bt_tasksim.checking.bundles import numbers, without_worlds
from bt_tasksim.checking.findings import ERROR, FAILED, WARNING, Case
from bt_tasksim.checking.situations import Situation, Situations, perturbed
from bt_tasksim.concept.functions import ConceptFunctions, sequence_of
from bt_tasksim.concept.seen import Seen
from bt_tasksim.core.bundles import parts
from bt_tasksim.core.errors import InputError, NoWayError
from bt_tasksim.core.outcomes import Statement
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Command

FAR = 3.0
"""Metres from the robot's base beyond which no arm reaches."""
HUGE = 100.0
"""Size of a feature beyond which a network has to unlearn it first."""
UNIT = 1e-3
"""Deviation from one of a quaternion's length."""
STEADY = 12
"""Control periods for which an action is held to see what it does."""
BOOLEAN = ("done", "violated", "decides", "maintained")
COSTS = ("necessary_cost", "sufficient_cost")


def check_values(case: Case, situations: Situations) -> None:
    """What the functions give in situations that happen, and in ones near by."""
    rng = np.random.default_rng(1)
    real = situations.single[: situations.real]
    near = [perturbed(s, rng, memory=False) for s in real]
    for situation in (*real, *near):
        for name in (n for n in BOOLEAN if n in case.functions):
            _check_boolean(case, name, case.ask(name, situation, situations))
        for name in (n for n in COSTS if n in case.functions):
            _check_cost(case, name, case.ask(name, situation, situations))
        _check_command(case, case.ask("command", situation, situations), situations)
        if "advance" in case.functions:
            _check_memory(case, situation.memory, case.ask("advance", situation, situations))
    if "features" in case.functions:
        _check_features(case, situations)
    _check_begin(case, situations)
    _check_actions(case, situations)
    _check_words(case, situations)


def _check_boolean(case: Case, name: str, answer: Any) -> None:
    if answer is FAILED:
        return
    found = numbers(answer)
    if found.dtype != bool or found.shape != (1,):
        what = f"gives {_kind(answer)} for one world"
        case.add(ERROR, name, what, "give a boolean for each world: a comparison such as cost < limit")


def _check_cost(case: Case, name: str, answer: Any) -> None:
    if answer is FAILED:
        return
    found = numbers(answer)
    if found.dtype.kind not in "fiu" or found.shape != (1,):
        what = f"gives {_kind(answer)} for one world"
        case.add(ERROR, name, what, "give a number for each world: poses.norm(v), or xp.sum(v, axis=-1)")
    elif not np.isfinite(found).all():
        case.add(
            ERROR,
            name,
            f"gives {found[0]}",
            "give a finite number, where nothing is known a large one",
            "finite",
        )
    elif found[0] < 0.0:
        case.add(
            ERROR,
            name,
            f"gives {found[0]:.3g}",
            "a cost is 0 when the goal is reached, and never negative",
            "sign",
        )


def _check_command(case: Case, answer: Any, situations: Situations) -> None:
    if answer is FAILED:
        return
    if not isinstance(answer, Command):
        case.add(ERROR, "command", f"gives a {type(answer).__name__}", "return Command(tool=..., hand=...)")
        return
    if answer.tool is not None:
        _check_tool(case, numbers(answer.tool))
    if answer.hand is None:
        return
    hand, n = numbers(answer.hand), 1 + len(situations.robot.synergies)
    if hand.shape != (1, n):
        what = f"gives a hand target of shape {hand.shape} for one world"
        remedy = f"(N, {n}) is the closure and {n - 1} synergies: closure[..., None]"
        case.add(ERROR, "command", what, remedy, "hand")
    elif not np.isfinite(hand).all():
        case.add(
            ERROR, "command", "gives a hand target that is not finite", "find the division by zero", "hand"
        )
    elif not 0.0 <= hand[0, 0] <= 1.0:
        what = f"gives a closure of {hand[0, 0]:.3g}"
        case.add(
            ERROR,
            "command",
            what,
            "closure is 0 for open and 1 for shut: poses.clip(closure, 0.0, 1.0)",
            "hand",
        )


def _check_tool(case: Case, tool: Array) -> None:
    if tool.shape != (1, 7):
        what = f"gives a tool target of shape {tool.shape} for one world"
        case.add(
            ERROR,
            "command",
            what,
            "(N, 7) is position and quaternion w x y z: xp.concat([p, q], axis=-1)",
            "tool",
        )
    elif not np.isfinite(tool).all():
        case.add(
            ERROR, "command", "gives a tool target that is not finite", "find the division by zero", "tool"
        )
    elif abs(float(np.linalg.norm(tool[0, 3:])) - 1.0) > UNIT:
        what = f"gives a quaternion of length {np.linalg.norm(tool[0, 3:]):.3g}"
        case.add(
            ERROR, "command", what, "its order is w x y z, its length one: poses.normalise(q)", "quaternion"
        )
    elif float(np.linalg.norm(tool[0, :3])) > FAR:
        what = f"commands the tool {np.linalg.norm(tool[0, :3]):.3g} m away from the robot's base"
        case.add(ERROR, "command", what, "positions are in metres, in the robot base frame", "far")


def _check_memory(case: Case, before: Any, after: Any) -> None:
    if after is FAILED:
        return
    a, b = _structure(before), _structure(after)
    if wrong := without_worlds(after, 1, "memory"):
        case.add(
            ERROR, "advance", f"gives no array with a row for each world: {wrong} for one world", ROWS, "rows"
        )
    elif a != b:
        what = f"loses the memory's structure: {_first_difference(before, after)}"
        case.add(
            ERROR, "advance", what, "return a memory of the same kind: memory._replace(...)", "structure"
        )


def _structure(memory: Any) -> Any:
    inner = parts(memory)
    if inner is not None:
        return type(memory).__name__, {k: _structure(v) for k, v in inner.items()}
    if memory is None or isinstance(memory, str):
        return type(memory).__name__
    array = numbers(memory)
    return array.shape, array.dtype == bool


def _first_difference(before: Any, after: Any, name: str = "memory") -> str:
    a, b = parts(before), parts(after)
    if a is not None and b is not None and type(before) is type(after) and set(a) == set(b):
        for k in a:
            if _structure(a[k]) != _structure(b[k]):
                return _first_difference(a[k], b[k], f"{name}.{k}")
    if a is None and b is None and before is not None and after is not None:
        was, now = numbers(before), numbers(after)
        return f"{name} was {was.dtype} {was.shape}, and is {now.dtype} {now.shape}"
    return f"{name} was a {type(before).__name__}, and is a {type(after).__name__}"


def _check_features(case: Case, situations: Situations) -> None:
    model = case.model
    assert model is not None
    layout = case.call("layout", lambda: dict(model.layout(situations.robot)))
    if layout is FAILED:
        return
    rows = []
    for situation in situations.single[: situations.real]:
        found = case.ask("features", situation, situations)
        if found is FAILED:
            return
        row = numbers(found)
        if row.shape != (1, sum(layout.values())):
            what = f"gives the shape {row.shape} for one world, and layout says (1, {sum(layout.values())})"
            case.add(ERROR, "features", what, "have both hold the same things in the same order", "shape")
            return
        if not np.isfinite(row).all():
            where = _named(layout, int(np.flatnonzero(~np.isfinite(row[0]))[0]))
            case.add(ERROR, "features", f"{where} is not finite", "find the division by zero", "finite")
            return
        rows.append(row[0].astype(float))
    table = np.array(rows)
    for column in np.flatnonzero(np.abs(table).max(axis=0) > HUGE):
        what = f"{_named(layout, int(column))} is as large as {np.abs(table[:, column]).max():.3g}"
        remedy = "divide it by what is usual, so that it is of the order of one"
        case.add(WARNING, "features", what, remedy, f"large {_named(layout, int(column))}")
    if len(_decided(case, situations)) > 4:
        chosen = np.array(
            [numbers(case.ask("features", s, situations))[0] for s in _decided(case, situations)], float
        )
        for column in np.flatnonzero(np.ptp(chosen, axis=0) == 0.0):
            what = f"{_named(layout, int(column))} was always {chosen[0, column]:.3g}"
            remedy = "leave it out, or see whether it says what it should"
            case.add(WARNING, "features", what, remedy, f"constant {_named(layout, int(column))}")


def _decided(case: Case, situations: Situations) -> list[Situation]:
    """The real situations in which a learned policy is asked."""
    real = situations.single[: situations.real]
    if "decides" not in case.functions:
        return real
    return [s for s in real if (d := case.ask("decides", s, situations)) is not FAILED and np.all(numbers(d))]


def _named(layout: dict[str, int], column: int) -> str:
    for name, size in layout.items():
        if column < size:
            return f"'{name}'" if size == 1 else f"'{name}'[{column}]"
        column -= size
    return f"number {column}"


def _check_begin(case: Case, situations: Situations) -> None:
    """The first memory comes from what is seen alone, and is a bundle of arrays with a row for each world."""
    model = case.model
    assert model is not None
    for situation in situations.firsts[:3]:
        seen = situations.asked(situation).seen
        why = case.call("initial_state", lambda seen=seen: model.initial_state(seen))  # type: ignore[misc]
        if why is not FAILED:
            _check_possible(case, why)
        memory = case.call("begin", lambda seen=seen: _memory(model, seen))  # type: ignore[misc]
        if memory is not FAILED and (wrong := without_worlds(memory, 1, "memory")):
            what = f"gives no array with a row for each world: {wrong} for one world"
            case.add(ERROR, "begin", what, f"{ROWS}, such as zeros(seen.tool)", "rows")


ROWS = "what is remembered is (N, ...)"


def _memory(model: ConceptFunctions, seen: Seen) -> Any:
    try:
        return model.begin(seen)
    except NoWayError:
        return None


def _check_possible(case: Case, why: Any) -> None:
    remedy = "give what REASON.where(mask, ...) gives, or several of them, and () where it can always start"
    try:
        unmet = sequence_of(why, case.concept.__name__) if why is not None else why
    except (InputError, TypeError):
        unmet = None
    if unmet is None:
        case.add(ERROR, "initial_state", f"gives {why!r}", remedy, "text")
        return
    for one in unmet:
        applies = numbers(one.applies)
        if applies.dtype != bool or applies.shape != (1,):
            what = f"says where it cannot start by {_kind(one.applies)} for one world"
            case.add(ERROR, "initial_state", what, "give a boolean for each world: ~held", "mask")


def _kind(value: Any) -> str:
    found = numbers(value)
    return f"{found.dtype} of shape {found.shape}"


def _check_words(case: Case, situations: Situations) -> None:
    model = case.model
    assert model is not None
    for situation in situations.single[: situations.real]:
        at = situations.asked(situation)
        said = case.call("explain", lambda at=at: model.explain(at.seen, at.memory))  # type: ignore[misc]
        if said is not FAILED and not isinstance(said, Statement | str | None):
            case.add(
                ERROR,
                "explain",
                f"gives a {type(said).__name__}",
                "give a Form with its numbers, or a sentence that is true of all worlds",
                "text",
            )
        case.call("limits", lambda at=at: [x.at(0).sentence for x in model.limits(at.seen, at.memory)])  # type: ignore[misc]


def _check_actions(case: Case, situations: Situations) -> None:
    """Every action does something somewhere, and more of it does more."""
    decided = _decided(case, situations)
    step = max(1, len(decided) // 8)
    chosen = [s for first in range(step) for s in decided[first::step]]  # from all over the runs first
    for k in range(case.concept.actions):
        effect, half = False, False
        for situation in chosen:
            if effect and half:
                break
            found = [_held(case, situation, situations, k, size) for size in (-1.0, -0.5, 0.0, 0.5, 1.0)]
            if any(f is None for f in found):
                return
            low, less, none, more, high = found
            effect |= not _close(low, none) or not _close(high, none)
            half |= not _close(low, less) or not _close(high, more)
        if not chosen:
            return
        if not effect:
            what = f"action {k} changes nothing"
            case.add(
                ERROR,
                "command",
                what,
                f"use it in command or advance, or say actions = {case.concept.actions - 1}",
                what,
            )
        elif not half:
            what = f"action {k} at 0.5 does as much as at 1"
            case.add(
                WARNING, "command", what, "scale it so that 1 is the most: it is clipped too early", what
            )


def _held(case: Case, situation: Situation, situations: Situations, k: int, size: float) -> Array | None:
    """The commands of an action that is held for a while."""
    model = case.model
    assert model is not None
    action = np.zeros((1, case.concept.actions))
    action[:, k] = size
    memory, given = situation.memory, []
    for tick in range(STEADY):
        later = situation._replace(elapsed=situation.elapsed + tick * situations.period)
        seen = situations.asked(later).seen
        command = case.call("command", lambda s=seen, m=memory: model.command(action, s, m))  # type: ignore[misc]
        memory = case.call("advance", lambda s=seen, m=memory: model.advance(action, s, m))  # type: ignore[misc]
        if command is FAILED or memory is FAILED or not isinstance(command, Command):
            return None
        given += [numbers(p).ravel() for p in (command.tool, command.hand) if p is not None]
    return np.concatenate(given) if given else np.zeros(0)


def _close(a: Array | None, b: Array | None) -> bool:
    return a is not None and b is not None and a.shape == b.shape and np.allclose(a, b, rtol=0.0, atol=1e-9)


def degrees_like(value: Any) -> bool:
    """A number that is hardly an angle in radians."""
    return isinstance(value, int | float) and math.isfinite(value) and abs(value) > 2 * math.pi + 1e-9
