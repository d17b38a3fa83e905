"""Policies on disk: a folder with ``policy.safetensors`` (weights, normalisation) and ``card.json``.

The card says what the policy is for, how it was trained and what was measured. Its hash names the policy in
results. Nothing here is executed when it is read, and NumPy and safetensors are all that it needs.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import safetensors.numpy

from bt_tasksim.core.bounded_text import read_bytes
from bt_tasksim.core.errors import InputError, nearest
from bt_tasksim.core.files import whole_folder, write_bytes, write_text
from bt_tasksim.core.json_text import parse_json
from bt_tasksim.policy.network import Network

VERSION = 1
"""Version of the card that is written, and the only one that is read."""
WEIGHTS, CARD = "policy.safetensors", "card.json"
FILES = (WEIGHTS, CARD)
"""Names of the files in a policy's folder."""
LARGEST_WEIGHTS = 64 << 20
"""Bytes of a file of weights; the shipped ones have 30 kB."""
CHECKPOINT = "checkpoint.safetensors"
"""Name of the file from which a training goes on, in the folder beside the policy's own."""

_TOLD = ("measured", "remarks")
_COUNTS = ("episodes", "successes")


@dataclass(frozen=True)
class PolicyCard:
    """What a policy is for, where it comes from, and what it can do.

    Attributes:
        concept: The concept's class name in lower case, such as ``grasp``.
        robot: The robot's name.
        features: Names and sizes of the features, in order: the concept's `layout` for the robot.
        actions: Size of the action's motion part; the network has one output more, the completion signal.
        tree: Name of the training tree.
        scene: Name of the scene it was trained in.
        noise: How perception erred in training, such as ``original``.
        algorithm: What trained it.
        steps: Decisions that were taken in training.
        seeds: Seeds of the training runs that it comes from.
        wall_seconds: Seconds that training took.
        configuration: Numbers and words that training can be repeated with.
        measured: What was measured: a mapping each, with ``tree``, ``episodes``, ``successes``,
            ``confidence_interval`` (two shares) and whatever else, such as ``perception`` or ``baseline``.
        remarks: Anything else that a reader should know.
        weights: SHA-256 of the weights' file; `save_policy` puts it in.
        version: Version of the card.
    """

    concept: str
    robot: str
    features: tuple[tuple[str, int], ...]
    actions: int
    tree: str
    scene: str = ""
    noise: str = ""
    algorithm: str = ""
    steps: int = 0
    seeds: tuple[int, ...] = ()
    wall_seconds: float = 0.0
    configuration: Mapping[str, Any] = field(default_factory=dict)
    measured: tuple[Mapping[str, Any], ...] = ()
    remarks: str = ""
    weights: str = ""
    version: int = VERSION

    @property
    def layout_hash(self) -> str:
        """SHA-256 of the features and the count of actions."""
        return _sha256(_canonical(self._layout()).encode())

    @property
    def hash(self) -> str:
        """The first 12 hexadecimal digits of the card's SHA-256: they name the policy in results.

        What was measured and remarked is left out: it is written when results that carry this hash exist.
        """
        content = {name: value for name, value in self.to_json().items() if name not in _TOLD}
        return _sha256(_canonical(content).encode())[:12]

    def to_json(self) -> dict[str, Any]:
        """The card as plain data, as it stands in ``card.json``."""
        out: dict[str, Any] = {"version": self.version}
        for name in (f.name for f in fields(self)):
            if name == "features":
                out["layout"] = {**self._layout(), "sha256": self.layout_hash}
            elif name not in ("version", "actions"):
                value = getattr(self, name)
                out[name] = list(value) if isinstance(value, tuple) else value
        return out

    def _layout(self) -> dict[str, Any]:
        return {"features": [list(pair) for pair in self.features], "actions": self.actions}


class PolicySlot(NamedTuple):
    """What a policy has to fit: a concept on a robot.

    Attributes:
        concept: The concept's class name in lower case.
        robot: The robot's name.
        layout: Names and sizes of the concept's features for this robot, in order.
        actions: Size of the concept's motion part.
    """

    concept: str
    robot: str
    layout: Mapping[str, int]
    actions: int


def save_policy(folder: str | Path, network: Network, card: PolicyCard) -> PolicyCard:
    """Write a policy, whole or not at all; an older policy in the folder is replaced.

    Args:
        folder: Where to; folders above it are made.
        network: From features to outputs.
        card: What it is; the weights' hash is put in here.

    Returns:
        The card as it was written.

    Raises:
        InputError: The folder holds other things, the network does not fit the card, or the card holds
            something that JSON cannot.
        MachineError: The disk is full or not writable.
    """
    owner = f"policy '{folder}'"
    _check_network(network, card, owner)
    content = safetensors.numpy.save({k: np.ascontiguousarray(v) for k, v in network.arrays().items()})
    card = dataclasses.replace(card, weights=_sha256(content), version=VERSION)
    try:
        text = json.dumps(card.to_json(), indent=2, allow_nan=False, ensure_ascii=False)
    except (TypeError, ValueError) as error:
        raise InputError(f"{owner}: the card cannot be written as JSON: {error}") from error
    card = _card(json.loads(text), f"{owner}: {CARD}")  # as it will be read
    with whole_folder(folder, FILES) as inside:
        write_bytes(inside / WEIGHTS, content)
        write_text(inside / CARD, text + "\n")
    return card


def training_folder(policy: Path, suffix: str = "") -> Path:
    """The folder beside a policy's own in which its training keeps checkpoint, history and events."""
    return policy.with_name(f"{policy.name}.training{suffix}")


def unfinished(folder: Path) -> str:
    """One sentence where a folder has no policy because its training did not end; empty elsewhere."""
    several = sorted(folder.glob("*.training")) if folder.is_dir() and not (folder / CARD).exists() else []
    policies = [folder, *(each.with_suffix("") for each in several)]
    for policy in policies if folder.name else []:
        beside = training_folder(policy)
        if (beside / CHECKPOINT).is_file() and not (policy / CARD).exists():
            return (
                f"there is no policy in '{policy}' yet: its training was interrupted; '{beside}' holds the "
                "checkpoint; go on with the command that began it and --resume: bt-tasksim train ... --resume"
            )
    return ""


def load_policy(folder: str | Path) -> tuple[Network, PolicyCard]:
    """Read a policy and check that its parts fit together; `check_fits` says whether it fits a concept.

    Raises:
        InputError: The folder or a file is missing, the card is no good, or the weights are damaged.
    """
    card = load_card(folder)
    file = Path(folder) / WEIGHTS
    again = "copy the policy's folder again, or train it again"
    missing = f"policy '{folder}' has no {WEIGHTS}; {again}"
    content = read_bytes(file, f"weights file '{file}'", LARGEST_WEIGHTS, missing)
    found = _sha256(content)
    if found != card.weights:
        raise InputError(
            f"weights file '{file}' is damaged or not the card's: its SHA-256 begins with {found[:12]}, "
            f"the card says {card.weights[:12]}; {again}"
        )
    try:
        network = Network.from_arrays(safetensors.numpy.load(content))
    except InputError as error:
        raise InputError(f"weights file '{file}': {error}; {again}") from error
    except Exception as error:  # safetensors raises its own error, and others for types that NumPy lacks
        raise InputError(f"weights file '{file}' is no safetensors file ({error}); {again}") from error
    _check_network(network, card, f"policy '{folder}'")
    return network, card


def load_card(folder: str | Path) -> PolicyCard:
    """Read a policy's card alone.

    Raises:
        InputError: The folder or the card is missing, or the card is no good.
    """
    folder = Path(folder)
    if said := unfinished(folder):
        raise InputError(said)
    if not folder.is_dir():
        what = "is a file; a policy is a folder" if folder.exists() else "does not exist; check the path"
        raise InputError(f"policy folder '{folder}' {what}")
    file = folder / CARD
    missing = f"policy '{folder}' has no {CARD}; name a folder that training has written"
    text = read_bytes(file, f"card '{file}'", missing=missing)
    try:
        content = parse_json(text, f"card '{file}'")
    except InputError as error:
        raise InputError(f"{error}; copy the policy's folder again") from error
    return _card(content, f"card '{file}'")


def check_fits(card: PolicyCard, folder: str | Path, slot: PolicySlot) -> None:
    """Check that a policy is for a concept on a robot.

    Args:
        card: The policy's card.
        folder: Its folder, for the sentence.
        slot: What it has to fit.

    Raises:
        InputError: It does not; says what differs.
    """
    owner = f"policy '{folder}'"
    concept, robot, layout, actions = slot
    if card.concept != concept:
        raise InputError(
            f"{owner} is for the concept '{card.concept}', not for '{concept}'; name another one"
        )
    if card.robot != robot:
        raise InputError(
            f"{owner} is for the robot '{card.robot}', not for '{robot}'; train one for '{robot}'"
        )
    differs = _difference(card.features, tuple(layout.items()))
    if not differs and card.actions != actions:
        differs = f"it has {card.actions} actions, the concept has {actions}"
    if differs:
        raise InputError(
            f"{owner} does not fit the concept '{concept}' on '{robot}' as it is now: {differs}; "
            f"train it again"
        )


def _difference(trained: tuple[tuple[str, int], ...], now: tuple[tuple[str, int], ...]) -> str:
    """The first way in which two layouts differ; empty where they do not."""
    before, after = dict(trained), dict(now)
    for name, size in trained:
        if name not in after:
            return f"its feature '{name}' is none of the concept's"
        if after[name] != size:
            return f"its feature '{name}' has size {size}, the concept's has {after[name]}"
    for name in after:
        if name not in before:
            return f"the concept's feature '{name}' is none of its own"
    for place, ((name, _), (other, _)) in enumerate(zip(trained, now, strict=True), 1):
        if name != other:
            return f"its feature {place} is '{name}', the concept's is '{other}'"
    return ""


def _check_network(network: Network, card: PolicyCard, owner: str) -> None:
    features = sum(size for _, size in card.features)
    if network.inputs != features:
        raise InputError(f"{owner}: the weights take {network.inputs} features, the card has {features}")
    if network.outputs != card.actions + 1:
        raise InputError(
            f"{owner}: the weights give {network.outputs} outputs, the card has {card.actions} actions "
            f"and the completion signal"
        )


# ---- reading the card -------------------------------------------------------------------------------------

_KINDS: dict[str, tuple[type | tuple[type, ...], str]] = {
    "concept": (str, "text"),
    "robot": (str, "text"),
    "layout": (dict, "a mapping"),
    "tree": (str, "text"),
    "scene": (str, "text"),
    "noise": (str, "text"),
    "algorithm": (str, "text"),
    "steps": (int, "a whole number"),
    "seeds": (list, "a list of whole numbers"),
    "wall_seconds": ((int, float), "a number"),
    "configuration": (dict, "a mapping"),
    "measured": (list, "a list of mappings"),
    "remarks": (str, "text"),
    "weights": (str, "text"),
}


def _card(content: Any, owner: str) -> PolicyCard:
    """The card in plain data."""
    if not isinstance(content, dict):
        raise InputError(f"{owner}: a card should be a mapping, found {_short(content)}")
    version = _entry(content, "version", int, "a whole number", owner)
    if version != VERSION:
        raise InputError(
            f"{owner}: its version is {version}, and only {VERSION} is known; use a matching bt-tasksim"
        )
    for name in content:
        if name not in _KINDS and name != "version":
            raise InputError(f"{owner}: unknown field '{name}'{nearest(name, _KINDS)}")
    values = {name: _entry(content, name, kind, word, owner) for name, (kind, word) in _KINDS.items()}
    for seed in values["seeds"]:
        _kind(seed, int, "whole numbers", owner, "seeds")
    for number in ("steps", "wall_seconds"):
        if values[number] < 0:
            raise InputError(f"{owner}: '{number}' should not be negative, found {values[number]}")
    layout = values.pop("layout")
    features = tuple(
        _feature(pair, owner)
        for pair in _entry(layout, "features", list, "a list of names and sizes", owner, "layout.")
    )
    if len(dict(features)) != len(features) or not features:
        raise InputError(f"{owner}: 'layout.features' should name at least one feature, and none twice")
    actions = _entry(layout, "actions", int, "a whole number", owner, "layout.")
    stated = _entry(layout, "sha256", str, "text", owner, "layout.")
    values |= {
        "seeds": tuple(values["seeds"]),
        "measured": tuple(_measured(entry, owner) for entry in values["measured"]),
        "wall_seconds": float(values["wall_seconds"]),
    }
    card = PolicyCard(**values, features=features, actions=actions, version=version)
    if stated != card.layout_hash:
        raise InputError(f"{owner}: 'layout' was changed: its 'sha256' is of another one; take it as it was")
    return card


def _entry(
    content: Mapping[str, Any],
    name: str,
    kind: type | tuple[type, ...],
    word: str,
    owner: str,
    within: str = "",
) -> Any:
    if name not in content:
        raise InputError(f"{owner}: '{within}{name}' is missing: it should be {word}")
    return _kind(content[name], kind, word, owner, within + name)


def _kind(value: Any, kind: type | tuple[type, ...], word: str, owner: str, name: str) -> Any:
    if not isinstance(value, kind) or isinstance(value, bool):
        raise InputError(f"{owner}: '{name}' should be {word}, found {_short(value)}")
    return value


def _feature(pair: Any, owner: str) -> tuple[str, int]:
    if (
        not isinstance(pair, list)
        or [type(part) for part in pair] != [str, int]  # a boolean is no size
        or pair[1] < 1
    ):
        raise InputError(f"{owner}: 'layout.features' should hold a name and a size, found {_short(pair)}")
    return pair[0], pair[1]


def _measured(entry: Any, owner: str) -> Mapping[str, Any]:
    _kind(entry, dict, "a list of mappings", owner, "measured")
    _entry(entry, "tree", str, "text", owner, "measured.")
    for name in _COUNTS:
        _entry(entry, name, int, "a whole number", owner, "measured.")
    if not 0 <= entry["successes"] <= entry["episodes"] or entry["episodes"] == 0:
        raise InputError(
            f"{owner}: 'measured' counts {entry['successes']} successes in {entry['episodes']} episodes"
        )
    interval = _entry(entry, "confidence_interval", list, "two shares", owner, "measured.")
    if len(interval) != 2 or any(type(v) not in (int, float) or not 0 <= v <= 1 for v in interval):
        raise InputError(
            f"{owner}: 'measured.confidence_interval' should be two shares, found {_short(interval)}"
        )
    checked: Mapping[str, Any] = entry
    return checked


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _canonical(content: Any) -> str:
    return json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
