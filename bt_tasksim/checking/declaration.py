"""What a concept declares: parameters with units, what it learns from, and its words."""

from __future__ import annotations

import inspect
import re
from typing import Any

from bt_tasksim.checking.findings import ERROR, WARNING, Case
from bt_tasksim.checking.values import degrees_like
from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.core.errors import nearest
from bt_tasksim.core.registry import parts

UNITS = re.compile(
    r"\b(metres?|m|mm|millimetres?|N|Nm|newtons?|rad|radians?|degrees?|s|seconds?|ticks?|share|ratio|over|"
    r"times|kg|units?|tolerable|number|tips?|fingertips|\d+(\.\d+)?)\b"
)
"""Words that say in what a cost is counted."""
LONG = {"m": 10.0, "m/s": 5.0}
"""Sizes of defaults beyond which a unit was mistaken."""


def check_declaration(case: Case) -> None:
    """Everything that can be said without running it."""
    _check_parameters(case)
    _check_learning(case)
    _check_conditions(case)
    _check_words(case)


def _check_parameters(case: Case) -> None:
    concept = case.concept
    declared = concept.parameters()
    for owner in concept.__mro__:
        if owner is ConceptModel or not issubclass(owner, ConceptModel):
            continue
        for name, hint in inspect.get_annotations(owner).items():
            bare = hint in (float, int, "float", "int", "float | None", "int | None")
            if bare and name not in declared:
                what = f"'{name}: {getattr(hint, '__name__', hint)}' has no unit, so it is no parameter"
                case.add(ERROR, "", what, "declare it as Metres, Radians, Seconds, Newtons or Ratio")
    given = dict(case.model.values) if case.model is not None else {}
    for name, parameter in declared.items():
        unit = parameter.quantity.unit
        values = [] if parameter.required else [parameter.default]
        values += [given[name]] if name in given else []
        for value in values:
            if unit == "rad" and degrees_like(value):
                case.add(
                    ERROR, "", f"'{name}' is {value:g} rad", f"angles are in radians: math.radians({value:g})"
                )
            if unit in LONG and isinstance(value, int | float) and abs(value) > LONG[unit]:
                case.add(ERROR, "", f"'{name}' is {value:g} {unit}", "lengths are in metres: 0.1 for 100 mm")


def _check_learning(case: Case) -> None:
    concept = case.concept
    learnable = not concept.is_task_model
    if case.overrides("features") != case.overrides("layout"):
        missing = "layout" if case.overrides("features") else "features"
        case.add(ERROR, missing, "is missing", "features and layout go together: write both", "missing")
    elif learnable and not case.overrides("features"):
        what = "has something unknown (is_task_model = False), and nothing to learn from"
        case.add(ERROR, "features", what, "write features and layout", "missing")
    if learnable and case.overrides("features") and not concept.observables:
        case.add(
            ERROR, "", "declares no observables", "name what features reads: observables = ('tool_pose', ...)"
        )
    if not learnable and case.overrides("features"):
        what = "has features, and says that nothing is unknown"
        case.add(WARNING, "", what, "say is_task_model = False, so that it can be learned")
    if learnable and not case.overrides("sufficient_cost") and not case.followed:
        what = "is not overridden: whether the completion signal was right is never judged"
        remedy = "write it, or train the leaf before a sibling that judges it, as Pick judges Grasp"
        case.add(WARNING, "sufficient_cost", what, remedy)
    if learnable and not case.overrides("necessary_cost"):
        what = "is not overridden: nothing shows a learner the way"
        case.add(WARNING, "necessary_cost", what, "write how far the observed state is from the goal")
    if not concept.is_programmed and not learnable:
        what = "is neither programmed nor to be learned"
        case.add(ERROR, "", what, "say is_task_model = False, or leave is_programmed = True")


def _check_conditions(case: Case) -> None:
    """What it says to bring about and to need is said of conditions and parameters that there are."""
    ours = case.concept.parameters()
    known = {name: kind for name, kind in parts("concept").items() if issubclass(kind, Condition)}
    for name in ("establishes", "requires"):
        for one in getattr(case.concept, name):
            if one.condition not in known:
                what = f"'{name}' names the condition '{one.condition}', which does not exist"
                case.add(ERROR, "", what, f"name a registered one{nearest(one.condition, known)}")
                continue
            theirs = known[one.condition].parameters()
            for key in one.parameters:
                if key not in theirs:
                    what = f"'{name}' gives {one.condition} a '{key}', which it does not take"
                    case.add(ERROR, "", what, f"it takes {', '.join(theirs) or 'nothing'}")
            for value in (*one.parameters.values(), *one.given):
                if value not in ours:
                    what = f"'{name}' speaks of its parameter '{value}', which it does not have"
                    case.add(ERROR, "", what, f"its parameters are {', '.join(ours) or 'none'}")


def _check_words(case: Case) -> None:
    concept = case.concept
    text = concept.__doc__ if "__doc__" in vars(concept) else None
    if not text:
        case.add(
            WARNING,
            "",
            "has no docstring",
            "say in a sentence what it does, and under Args what each parameter is",
        )
    elif text != ConceptModel.__doc__:
        for name in concept.parameters():
            if not re.search(rf"\b{re.escape(name)}\b", text):
                what = f"its docstring does not describe the parameter '{name}'"
                case.add(WARNING, "", what, "add a line under Args:")
    for name in ("necessary_cost", "sufficient_cost"):
        if not case.overrides(name):
            continue
        own: Any = getattr(concept, name)
        said = own.__doc__ or ""
        if own.__doc__ is None or said == getattr(ConceptModel, name).__doc__ or not UNITS.search(said):
            case.add(
                WARNING,
                name,
                "its docstring names no unit",
                "say in what it is counted, such as metres, or over what",
            )
