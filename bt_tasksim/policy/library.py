"""The policies at hand: those of ``assets/policies``, which of them are pinned, and others by path.

``assets/policies/pins.json`` says which policy a leaf takes that names none: a mapping of concepts to
mappings of robots to folders beside it, such as ``{"grasp": {"panda": "grasp-panda"}}``. In a
folder's place ``programmed`` says that the concept's own policy was measured to be the better one: without a
pin leaves do the same, but nobody has chosen.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Protocol

from bt_tasksim.core.bounded_text import read_text
from bt_tasksim.core.errors import InputError, nearest
from bt_tasksim.core.files import write_text
from bt_tasksim.core.json_text import parse_json
from bt_tasksim.core.plain import printable
from bt_tasksim.core.registry import parts
from bt_tasksim.core.resources import asset
from bt_tasksim.policy.files import (
    FILES,
    PolicyCard,
    PolicySlot,
    check_fits,
    load_card,
    load_policy,
    unfinished,
)
from bt_tasksim.robot.description import RobotDescription, load_robot

PROGRAMMED = "programmed"
"""Name of the policy that is a concept's own."""
PINS = "pins.json"
NEVER = "never measured"

Pins = dict[str, dict[str, str]]
"""Names of policies by concept and robot."""


class Learnable(Protocol):
    """What the list of policies knows of a concept."""

    actions: ClassVar[int]
    """Size of the action's motion part."""

    @classmethod
    def layout(cls, robot: RobotDescription) -> Mapping[str, int]:
        """Names and sizes of what a learned policy sees, in order."""


@dataclass(frozen=True)
class PolicyEntry:
    """A policy in a list.

    Attributes:
        name: Its folder's name.
        folder: Its folder.
        card: Its card, None where it is damaged.
        problem: Why it cannot be used; empty where it can.
        pinned: A leaf of its concept on its robot takes it without naming it.
    """

    name: str
    folder: Path
    card: PolicyCard | None
    problem: str
    pinned: bool

    def to_json(self) -> dict[str, Any]:
        """The entry as plain data."""
        return {
            "name": self.name,
            "folder": str(self.folder),
            "hash": self.card.hash if self.card else None,
            "pinned": self.pinned,
            "problem": self.problem,
            "card": self.card.to_json() if self.card else None,
        }


def find_policy(name: str) -> Path | None:
    """The folder of a policy that a leaf names, None for the programmed one.

    A name of ``assets/policies`` comes before a folder of this name; write ``./name`` for the folder.

    Raises:
        InputError: There is no such policy.
    """
    if name == PROGRAMMED:
        return None
    shipped = asset("policies")
    known = _policy_folders(shipped)
    if name in known:
        return known[name]
    path = Path(name)
    if path.is_dir():
        return path
    if path.exists():
        raise InputError(f"'{name}' is a file; a policy is a folder")
    if said := unfinished(path):
        raise InputError(said)
    if len(path.parts) > 1:
        hint = nearest(path.name, _policy_folders(path.parent))
        raise InputError(f"there is no policy folder '{name}'{hint}")
    raise InputError(f"no policy '{name}'{nearest(name, [PROGRAMMED, *known])} (or give a policy's folder)")


def is_bundled(name: str) -> bool:
    """Whether a leaf that names this gets the programmed policy, or one of ``assets/policies``."""
    return name == PROGRAMMED or name in _policy_folders(asset("policies"))


def source_of(folder: Path) -> str:
    """What a leaf has to name to get this policy again, from any working folder."""
    whole = folder.resolve()
    return whole.name if whole.parent == asset("policies").resolve() else str(whole)


def folder_of_pinned(concept: str, robot: str) -> Path | None:
    """The folder of the policy that is pinned for a concept and a robot; None for programmed or none.

    Raises:
        InputError: The pins are damaged, or the pinned policy is missing.
    """
    name = read_pins().get(concept, {}).get(robot)
    if name is None or name == PROGRAMMED:
        return None
    folder = asset("policies", name)
    if not folder.is_dir():
        known = nearest(name, _policy_folders(asset("policies")))
        raise InputError(
            f"the policy '{name}', pinned for '{concept}' on '{robot}', is not in '{folder.parent}'{known} "
            f"(or take it out with 'bt-tasksim policies --unpin {concept} {robot}')"
        )
    return folder


def pinned_programmed() -> list[str]:
    """Where the programmed policy is pinned, in the words of `describe`."""
    pins = sorted(read_pins().items())
    return [
        printable(f"{PROGRAMMED}  {concept} on {robot}  pinned")
        for concept, robots in pins
        for robot, name in sorted(robots.items())
        if name == PROGRAMMED
    ]


def read_pins() -> Pins:
    """The pins; none where there is no file.

    Raises:
        InputError: The file does not hold pins.
    """
    file = asset("policies", PINS)
    if not file.exists():
        return {}
    owner = f"pins '{file}'"
    content: Any = parse_json(read_text(file, owner) or "{}", owner)
    if not isinstance(content, dict):
        raise InputError(f"pins '{file}' should map concepts to robots to names of policies")
    for concept, robots in content.items():
        if not isinstance(robots, dict) or not all(_is_name(name) for name in robots.values()):
            raise InputError(f"pins '{file}': '{concept}' should map robots to names of policies beside it")
    return content


def pin(name: str, concepts: Mapping[str, type[Learnable]]) -> PolicyCard:
    """Have leaves of a policy's concept take it on its robot, where they name none.

    Args:
        name: Name of a policy of ``assets/policies``.
        concepts: Concepts by their names in lower case.

    Returns:
        The policy's card.

    Raises:
        InputError: There is no such policy there, it is damaged, or does not fit its concept and robot.
        MachineError: The pins cannot be written.
    """
    known = _policy_folders(asset("policies"))
    if name == PROGRAMMED:
        raise InputError(
            f"every concept has its '{PROGRAMMED}' policy: say in '{asset('policies', PINS)}' for which "
            f"concept and robot it is to be taken"
        )
    if name not in known:
        raise InputError(
            f"no policy '{name}' in '{asset('policies')}'{nearest(name, known)}; "
            f"only a policy that is there can be pinned"
        )
    _, card = load_policy(known[name])
    if card.concept not in concepts:
        raise InputError(
            f"policy '{name}' is for the concept '{card.concept}', which is not a bundled one"
            f"{nearest(card.concept, concepts)}; name it in the tree instead"
        )
    _check_as_it_is(card, known[name], concepts[card.concept])
    pins = read_pins()
    pins.setdefault(card.concept, {})[card.robot] = name
    _write_pins(pins)
    return card


def unpin(concept: str, robot: str) -> str:
    """Have leaves of a concept that name no policy take the programmed one again.

    Returns:
        Name of the policy that was pinned.

    Raises:
        InputError: None was.
        MachineError: The pins cannot be written.
    """
    pins = read_pins()
    for known, word in ((pins, concept), (pins.get(concept, {}), robot)):
        if word not in known:
            raise InputError(f"no policy is pinned for '{concept}' on '{robot}'{nearest(word, known)}")
    name = pins[concept].pop(robot)
    _write_pins({c: robots for c, robots in pins.items() if robots})
    return name


def list_policies(
    folder: str | Path | None = None, concepts: Mapping[str, type[Learnable]] | None = None
) -> list[PolicyEntry]:
    """The policies in a folder, damaged ones with their problem.

    Args:
        folder: A folder of policies' folders, or one policy's folder; by default ``assets/policies``.
        concepts: Concepts by their names in lower case: the policies of these are checked against them.

    Raises:
        InputError: There is no such folder.
    """
    at = asset("policies") if folder is None else Path(folder)
    if folder is not None and not at.is_dir():
        if said := unfinished(at):
            raise InputError(said)
        raise InputError(f"there is no folder '{folder}' to look for policies in")
    shipped = at.resolve() == asset("policies").resolve()
    pins = read_pins() if shipped else {}
    found = {at.resolve().name: at} if _is_policy(at) else _policy_folders(at)
    pinned = {name for robots in pins.values() for name in robots.values()} - {PROGRAMMED}
    found |= {name: at / name for name in pinned if name not in found}
    return [_entry(name, path, pins, concepts or {}) for name, path in sorted(found.items())]


def describe(entry: PolicyEntry) -> str:
    """A policy in a list: one line, and one more for each measurement."""
    card = entry.card
    mark = "  pinned" if entry.pinned else ""
    if card is None or entry.problem:
        return f"{printable(entry.name)}{mark}\n  cannot be used: {printable(entry.problem)}"
    first = f"{entry.name}@{card.hash}  {card.concept} on {card.robot}{mark}"
    lines = [first, f"  trained in {card.tree}, {card.steps:,} steps {card.algorithm}".rstrip()]
    lines += [f"  {measured_text(entry)}" for entry in card.measured] or [f"  {NEVER}"]
    return "\n".join(map(printable, lines))


def measured_text(measured: Mapping[str, Any]) -> str:
    """A measurement of a card, such as ``960 of 1000 (96.0 %, 94.6 to 97.0) pick_and_place, noise fine``."""
    n, k = measured["episodes"], measured["successes"]
    low, high = measured["confidence_interval"]
    noise = f"noise {measured['noise']}" if "noise" in measured else ""
    how = str(measured.get("perception", noise)).removeprefix("state, ")
    text = f"{k} of {n} ({100 * k / n:.1f} %, {100 * low:.1f} to {100 * high:.1f}) {measured['tree']}"
    return f"{text}, {how}" if how else text


def _entry(name: str, folder: Path, pins: Pins, concepts: Mapping[str, type[Learnable]]) -> PolicyEntry:
    card, problem = None, ""
    try:
        card = load_card(folder)
        load_policy(folder)
        if card.concept in concepts and card.robot in parts("robot"):
            _check_as_it_is(card, folder, concepts[card.concept])
    except InputError as error:
        problem = str(error)
    pinned = any(name in robots.values() for robots in pins.values())
    return PolicyEntry(name, folder, card, problem, pinned)


def _check_as_it_is(card: PolicyCard, folder: Path, concept: type[Learnable]) -> None:
    """Check that a policy fits its concept and robot as they are now."""
    robot = load_robot(card.robot)
    slot = PolicySlot(card.concept, robot.name, concept.layout(robot), concept.actions)
    check_fits(card, folder, slot)


def _write_pins(pins: Pins) -> None:
    write_text(asset("policies", PINS), json.dumps(pins, indent=2, sort_keys=True) + "\n")


def _policy_folders(folder: Path) -> dict[str, Path]:
    """Folders in a folder that hold a policy or a part of one, by name."""
    if not folder.is_dir():
        return {}
    return {p.name: p for p in folder.iterdir() if not p.name.startswith(".") and _is_policy(p)}


def _is_policy(folder: Path) -> bool:
    return any((folder / name).exists() for name in FILES)


def _is_name(name: Any) -> bool:
    """A folder's name and not a path that leads elsewhere."""
    return isinstance(name, str) and bool(name) and Path(name).name == name and name != ".."
