"""Checkpoints of trainings: tensors with facts about them, whole, undamaged, and of the same training.

A checkpoint is a safetensors file. Its metadata hold two texts: ``facts`` (JSON) and ``sha256``, over the
facts and every tensor. Checkpoints from before November 2026 have neither ``sha256`` nor ``about``, and are
still read.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import safetensors.numpy
from safetensors import safe_open

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.files import write_bytes
from bt_tasksim.core.identity import differing
from bt_tasksim.core.json_text import parse_json
from bt_tasksim.core.poses import Array
from bt_tasksim.core.renamed import with_present_names
from bt_tasksim.engines.remote.plain import from_plain, shown
from bt_tasksim.training.config import TrainConfig

FORMER = {"lesson": "stage"}
"""Present names of facts by those that they had in earlier versions."""
LARGEST = 1 << 30
"""Bytes of a checkpoint that is read."""


def damaged(path: Path, reason: str) -> InputError:
    """A checkpoint that cannot be gone on with."""
    return InputError(f"checkpoint '{path}' is damaged ({reason}): remove it and train anew")


@dataclass(frozen=True)
class Facts:
    """Where a training stands.

    Attributes:
        config: Its settings.
        about: What it is a training of, see `training_subject`; empty where an older checkpoint does not say.
        iteration: Rollouts that are done.
        stage: Number of the stage.
        recent: Whether the last episodes were successes.
        best: Share of held-apart draws of the best policy so far.
        seconds: Time spent.
        history: A mapping for each rollout.
    """

    config: TrainConfig
    about: Mapping[str, str]
    iteration: int
    stage: int
    recent: Sequence[bool]
    best: float | None
    seconds: float
    history: Sequence[Mapping[str, Any]]


def write_checkpoint(path: Path, tensors: Mapping[str, Array], facts: Facts) -> None:
    """Write a checkpoint, whole or not at all.

    Raises:
        InputError: The folder does not exist.
        MachineError: The disk is full or not writable.
    """
    content = {**vars(facts), "config": facts.config.to_dict()}
    text = json.dumps(content)
    arrays = {name: np.ascontiguousarray(values) for name, values in tensors.items()}
    metadata = {"facts": text, "sha256": _digest(text, arrays)}
    write_bytes(path, safetensors.numpy.save(arrays, metadata=metadata))


def read_checkpoint(path: Path) -> tuple[dict[str, Array], Facts]:
    """Read a checkpoint.

    Returns:
        Its tensors, and the facts.

    Raises:
        InputError: It is damaged.
    """
    try:
        size = path.stat().st_size
        if size > LARGEST:
            raise damaged(path, f"it has {size} bytes, more than {LARGEST}")
        with safe_open(path, framework="np") as file:
            tensors = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118
            metadata = dict(file.metadata() or {})
    except InputError:
        raise
    except Exception as error:  # safetensors raises its own error, and others for types that NumPy lacks
        raise damaged(path, _one_line(error)) from error
    text = metadata.get("facts")
    if text is None:
        raise damaged(path, "it holds no facts about its training")
    if metadata.get("sha256", "") != _digest(text, tensors) and not _is_old(text, metadata):
        raise damaged(path, "its content is not what was written")
    for name, values in tensors.items():
        if values.dtype.kind != "f" or not np.isfinite(values).all():
            raise damaged(path, f"'{name[:60]}' does not hold finite numbers")
    return tensors, _facts(text, path)


def check_same(path: Path, facts: Facts, config: TrainConfig, about: Mapping[str, str]) -> None:
    """Check that a checkpoint is of this training; only its number of steps may differ.

    Raises:
        InputError: It is not; says in what they differ.
    """
    then, now = _flat(facts.config.to_dict()), _flat(config.to_dict())
    differ = [
        f"{name} {_short(then.get(name))}, now {_short(now.get(name))}"
        for name in {**now, **then}
        if name != "steps" and then.get(name) != now.get(name)
    ]
    if differ:
        raise InputError(
            f"checkpoint '{path}' was written with other settings ({'; '.join(differ)}): resume with the "
            "same, or train anew"
        )
    # An earlier one may not say all of it; what it says must be the same.
    if others := differing(facts.about, {name: about.get(name, "") for name in facts.about}):
        raise InputError(
            f"checkpoint '{path}' is of a training with another {others}: resume with the same, or train anew"
        )


def check_tensors(path: Path, tensors: Mapping[str, Array], expected: Mapping[str, Array]) -> None:
    """Check that a learner can take a checkpoint's tensors.

    Args:
        path: The checkpoint, for the sentence.
        tensors: What was read.
        expected: What the learner has itself, by name; its optimiser's state may still be missing.

    Raises:
        InputError: One is missing, unknown or of another shape.
    """
    shapes = {name: values.shape for name, values in expected.items()}
    weights = {name: values.shape for name, values in expected.items() if name.startswith("policy/")}
    for name, values in tensors.items():
        if name.startswith("best/"):
            continue
        wanted: tuple[int, ...] | None = shapes.get(name)
        if name.startswith("optimizer/"):
            wanted = _optimiser_shape(name, list(weights.values()))
        if wanted != values.shape:
            found = "is unknown" if wanted is None else f"has shape {values.shape} instead of {wanted}"
            raise damaged(path, f"'{name[:60]}' {found}")
    missing = sorted(name for name in shapes if name not in tensors and not name.startswith("optimizer/"))
    if missing:
        raise damaged(path, f"'{missing[0]}' is missing")


def _digest(text: str, arrays: Mapping[str, Array]) -> str:
    found = hashlib.sha256(text.encode())
    for name in sorted(arrays):
        values = np.ascontiguousarray(arrays[name])
        found.update(f"{name} {values.dtype.str} {values.shape}".encode())
        found.update(values.tobytes())
    return found.hexdigest()


def _is_old(text: str, metadata: Mapping[str, str]) -> bool:
    return "sha256" not in metadata and '"about"' not in text


def _optimiser_shape(name: str, weights: Sequence[tuple[int, ...]]) -> tuple[int, ...] | None:
    found = re.fullmatch(r"optimizer/([0-9]{1,6})/(step|exp_avg|exp_avg_sq)", name)
    if found is None or int(found[1]) >= len(weights):
        return None
    return (1,) if found[2] == "step" else weights[int(found[1])]


def _facts(text: str, path: Path) -> Facts:
    try:
        content: Any = parse_json(text, "its facts")
        if not isinstance(content, dict) or not isinstance(content.get("config"), dict):
            raise InputError(f"its facts should be a mapping, found {shown(content)}")
        content = with_present_names(content, FORMER)
        read: dict[str, Any] = {
            name: from_plain(kind, content.get(name, default), name)
            for name, kind, default in (
                ("about", dict[str, str], {}),
                ("iteration", int, None),
                ("stage", int, None),
                ("best", float | None, None),
                ("seconds", float, None),
            )
        }
        recent, history = content.get("recent"), content.get("history")
        if not isinstance(recent, list) or not all(isinstance(value, bool) for value in recent):
            raise InputError("'recent' should be a list of true and false")
        if isinstance(history, list):
            history = [with_present_names(r, FORMER) if isinstance(r, dict) else r for r in history]
        if not isinstance(history, list) or not all(_is_row(row) for row in history):
            raise InputError("'history' should hold what became of each rollout")
        if min(read["iteration"], read["stage"], read["seconds"]) < 0:
            raise InputError("a count is negative")
        if read["iteration"] != len(history):
            raise InputError(f"it tells of {len(history)} rollouts out of {read['iteration']}")
        return Facts(TrainConfig.from_dict(content["config"]), recent=recent, history=history, **read)
    except (InputError, ValueError, TypeError, RecursionError) as error:
        raise damaged(path, _one_line(error)) from error


def _is_row(row: Any) -> bool:
    if not isinstance(row, dict) or not isinstance(row.get("stage"), str):
        return False
    held = row.get("held_apart") or {"successes": 0, "draws": 1}
    if not isinstance(held, dict):
        return False
    wins, draws = held.get("successes"), held.get("draws")
    return type(wins) is int and type(draws) is int and 0 <= wins <= draws and draws > 0


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())[:200]


def _flat(settings: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Settings inside of settings by the way that leads there, such as ``reward.success``."""
    out: dict[str, Any] = {}
    for name, value in settings.items():
        out |= _flat(value, f"{before}{name}.") if isinstance(value, Mapping) else {before + name: value}
    return out


def _short(value: Any) -> str:
    text = f"{value:g}" if isinstance(value, float) and math.isfinite(value) else str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
