"""What a concept's functions look at: declared observables, and only those that a robot sees as well."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from bt_tasksim.checking.bundles import numbers
from bt_tasksim.checking.findings import ERROR, FAILED, WARNING, Case
from bt_tasksim.checking.situations import Situation, Situations
from bt_tasksim.concept.seen import Seen
from bt_tasksim.core.errors import nearest
from bt_tasksim.core.facts import WorldFacts
from bt_tasksim.core.observables import FIELDS, observable, observables
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Observation
from bt_tasksim.robot.description import RobotDescription

WITHOUT_HIDDEN = (
    "features",
    "decides",
    "command",
    "done",
    "necessary_cost",
    "violated",
    "advance",
    "maintained",
)
LOUDER = 1.3
"""Factor on an observable of which only the size is not to be trusted."""


class WatchedObservation:
    """An observation that notes what is read of it."""

    def __init__(self, observation: Observation) -> None:
        self.plain = observation
        self.read: set[str] = set()
        self.missed: set[str] = set()

    def __getattr__(self, name: str) -> Any:
        if name in FIELDS:
            self.read.add(name)
            return getattr(self.plain, name)
        if not name.startswith("__"):
            self.missed.add(name)
        raise AttributeError(f"an observation has no '{name}'")


class WatchedSeen(Seen):
    """What is seen, noting what is looked at; ``elapsed`` counts as time."""

    __slots__ = ("_elapsed", "watched")

    def __init__(
        self, observation: Observation, world: WorldFacts, robot: RobotDescription, elapsed: Array
    ) -> None:
        self.watched = WatchedObservation(observation)
        self._elapsed = elapsed
        self.observation = self.watched  # type: ignore[assignment]  # quacks like one
        self.world, self.robot = world, robot
        self._derived = self._believed = self._made = self._whole = None

    def observable(self, name: str) -> Array:
        """See `Seen.observable`."""
        self.watched.read.add(name)
        return observable(name).read(self.watched.plain, self.world)

    @property
    def elapsed(self) -> Array:
        """``(N,)`` seconds since the concept became active."""
        self.watched.read.add("time")
        return self._elapsed


def check_observables(case: Case) -> None:
    """Observables are some, and ones with a small gap."""
    known = observables()
    for name in case.concept.observables:
        if name not in known:
            case.add(ERROR, "", f"observables names '{name}', which is none", f"{nearest(name, known)[2:]}")
        elif known[name].gap == "large":
            case.add(
                ERROR,
                "",
                f"observables declares '{name}', of which simulation and reality differ ({_why(name)})",
                "take it out: a policy that is learned in simulation should not look at it",
            )


def check_watching(case: Case, situations: Situations) -> None:
    """Observables: declared, with a small gap, and nothing else."""
    concept = case.concept
    check_observables(case)
    read = _read(case, situations)
    for name in sorted(n for n in read - set(concept.observables) if _depends(case, situations, n)):
        what = f"reads '{name}', which is not declared"
        if observable(name).gap == "large":
            why = f"{what}, and of which simulation and reality differ ({_why(name)})"
            case.add(ERROR, "features", why, "leave it out; in limits, it is allowed")
        else:
            case.add(ERROR, "features", what, f"add it: observables = (..., {name!r}), or leave it out")
    if case.overrides("features"):
        for name in concept.observables:
            if name in observables() and name not in read and not _kept(case, situations, name):
                case.add(
                    WARNING, "", f"observables declares '{name}', which features never uses", "take it out"
                )
    large = [n for n in FIELDS if observable(n).gap == "large"]
    for name in _through_memory(case, situations, large) if not concept.is_task_model else []:
        case.add(
            WARNING,
            "advance",
            f"carries the size of '{name}' through the memory into features ({_why(name)})",
            "keep what does not depend on its size, such as whether it is above a threshold",
        )


def _why(name: str) -> str:
    return observable(name).why


def _kept(case: Case, situations: Situations, name: str) -> bool:
    return name in FIELDS and name in _through_memory(case, situations, [name])


def _read(case: Case, situations: Situations) -> set[str]:
    """What features reads; and findings where a function asks for what no observation holds."""
    read: set[str] = set()
    for name in WITHOUT_HIDDEN:
        if name not in case.functions:
            continue
        for situation in situations.single:
            seen = WatchedSeen(situation.observation, situation.world, situations.robot, situation.elapsed)
            case.ask(name, situation, situations, seen)
            if name == "features":
                read |= seen.watched.read
            for missed in sorted(seen.watched.missed):
                case.add(
                    ERROR,
                    name,
                    f"looks for '{missed}' in the observation",
                    "a robot does not see it: of the hidden state only sufficient_cost knows",
                    f"looks for {missed}",
                )
    return read


def _depends(case: Case, situations: Situations, name: str) -> bool:
    """The answer of features is another one where an observable is; it may be read for its type alone."""
    if name not in FIELDS:  # it is computed from others: there is nothing to change
        return True
    real = situations.single[: situations.real]
    for k, situation in enumerate(real):
        usual = _features(case, situation, situations)
        if usual is FAILED:
            return True
        value: Array = np.asarray(getattr(situation.observation, name))
        others: list[Any] = [o for o in [getattr(real[k - 1].observation, name)] if o.shape == value.shape]
        others += [~value] if value.dtype == bool else [np.zeros_like(value), 1e3 * value + 1.0]
        for other in others:
            if name == "time":
                changed = situation._replace(elapsed=situation.elapsed + 0.5)
            else:
                shown = dataclasses.replace(situation.observation, **{name: other})
                changed = situation._replace(observation=shown)
            answer = _features(case, changed, situations)
            if answer is not FAILED and not np.allclose(answer, usual, rtol=0.0, atol=1e-9, equal_nan=True):
                return True
    return False


def _through_memory(case: Case, situations: Situations, names: list[str]) -> list[str]:
    """Observables on whose size features depends at the next tick, because advance has kept them."""
    if "features" not in case.functions or "advance" not in case.functions:
        return []
    out = []
    for name in names:
        for situation in situations.single[: situations.real]:
            value: Array = np.asarray(getattr(situation.observation, name))
            other: Array = (
                ~value if value.dtype == bool else value * LOUDER + (0.0 if name in _SIZES else 0.01)
            )
            observation = dataclasses.replace(situation.observation, **{name: other})
            answers = []
            for shown in (situation, situation._replace(observation=observation)):
                memory = case.ask("advance", shown, situations)
                answers.append(
                    FAILED
                    if memory is FAILED
                    else _features(case, situation._replace(memory=memory), situations)
                )
            if any(a is FAILED for a in answers):
                break
            if not np.allclose(answers[0], answers[1], rtol=0.0, atol=1e-9, equal_nan=True):
                out.append(name)
                break
    return out


_SIZES = ("contact_force", "hand_effort", "wrench", "arm_velocity")


def _features(case: Case, situation: Situation, situations: Situations) -> Any:
    found = case.ask("features", situation, situations)
    return FAILED if found is FAILED else numbers(found)
