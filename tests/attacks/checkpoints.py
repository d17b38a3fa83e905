"""Checkpoints of trainings and folders of policies: read as far as a learner would take them."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import gymnasium
import numpy as np
import safetensors.numpy

from bt_tasksim.core.resources import asset
from bt_tasksim.policy.files import load_policy
from bt_tasksim.training.checkpoint import (
    Facts,
    _digest,
    check_same,
    check_tensors,
    read_checkpoint,
    write_checkpoint,
)
from bt_tasksim.training.config import TrainConfig
from bt_tasksim.training.learner import Learner
from tests.attacks.mutations import Bait, Rng, damaged_bytes, damaged_data, one_of

CONFIG = TrainConfig(steps=64, n_envs=2, n_steps=32, hidden=(8,), minibatch=32)


def learner() -> Learner:
    """A small one."""
    return Learner(
        gymnasium.spaces.Box(-np.inf, np.inf, (5,), np.float32),
        gymnasium.spaces.Box(-1.0, 1.0, (3,), np.float32),
        CONFIG,
    )


def begin(folder: Path, bait: Bait) -> Callable[[Rng], Callable[[], object]]:
    """See `tests.attacks.__main__.KINDS`."""
    made, path = learner(), folder / "checkpoint.safetensors"
    expected, about = made.tensors(), {"tree": "0" * 64}
    row = {"stage": "", "held_apart": {"successes": 1, "draws": 4}}
    write_checkpoint(path, expected, Facts(CONFIG, about, 1, 0, [True], None, 1.0, [row]))
    sound = path.read_bytes()
    tensors, _ = read_checkpoint(path)
    facts = {"config": CONFIG.to_dict(), "about": about, "iteration": 1, "stage": 0, "recent": [True],
             "best": None, "seconds": 1.0, "history": [row]}  # fmt: skip
    policies = [p for p in sorted(asset("policies").iterdir()) if (p / "card.json").is_file()]

    def case() -> None:
        found, told = read_checkpoint(path)
        check_same(path, told, CONFIG, about)
        check_tensors(path, found, expected)
        learner().restore(found, 64)

    def make(rng: Rng) -> Callable[[], object]:
        kind = rng.random()
        if kind < 0.3 and policies:
            return _policy(one_of(rng, policies), folder / "policy", rng, bait)
        if kind < 0.6:
            path.write_bytes(damaged_bytes(sound, rng))
            return case
        arrays = dict(tensors)
        if rng.random() < 0.5:
            name = one_of(rng, list(arrays))
            arrays[
                one_of(rng, [name, "best/mean", "optimizer/0/step", "optimizer/x/y", "optimizer/9", "x"])
            ] = one_of(rng, [np.zeros(3), np.full(arrays[name].shape, np.nan), np.zeros((2, 2), np.int64)])
        changed = damaged_data(json.loads(json.dumps(facts)), rng, bait) if rng.random() < 0.8 else facts
        text = json.dumps(changed)
        metadata = {"facts": text}
        if rng.random() < 0.7:  # whoever wrote it knows the hash
            metadata["sha256"] = _digest(text, arrays)
        path.write_bytes(safetensors.numpy.save(arrays, metadata=metadata))
        return case

    return make


def _policy(source: Path, folder: Path, rng: Rng, bait: Bait) -> Callable[[], object]:
    """A policy's folder with one of its files damaged."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(source, folder)
    file = one_of(rng, sorted(folder.iterdir()))
    if file.suffix == ".json" and rng.random() < 0.7:
        data = damaged_data(json.loads(file.read_text(encoding="utf-8")), rng, bait)
        file.write_text(json.dumps(data), encoding="utf-8", errors="replace")
    else:
        file.write_bytes(damaged_bytes(file.read_bytes(), rng))
    return lambda: load_policy(folder)
