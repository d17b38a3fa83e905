"""What is seen, what is hidden and what is remembered, changed at random."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from bt_tasksim.checking.bundles import parts
from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Hidden, Observation
from bt_tasksim.planning.reference_motion import Path


def changed_observation(o: Observation, rng: np.random.Generator) -> Observation:
    """Elsewhere, otherwise felt, at another time."""
    return dataclasses.replace(
        o,
        time=o.time + rng.uniform(0, 1),
        tool_pose=changed_pose(o.tool_pose, rng),
        objects=changed_pose(o.objects, rng),
        tips=o.tips + rng.normal(scale=0.01, size=o.tips.shape),
        contacts=rng.random(o.contacts.shape) < 0.6,
        closure=np.float64(rng.choice([0.0, 1.0, np.clip(o.closure + rng.normal(scale=0.2), 0, 1)])),
        wrench=o.wrench + rng.normal(scale=3.0, size=6),
    )


def changed_hidden(h: Hidden, rng: np.random.Generator) -> Hidden:
    """Elsewhere, otherwise held and supported."""
    return dataclasses.replace(
        h,
        objects=changed_pose(h.objects, rng),
        hand_force=h.hand_force * (rng.random(h.hand_force.shape) < 0.7),
        support=rng.random(h.support.shape) < 0.3,
    )


def changed_pose(pose: Array, rng: np.random.Generator, metres: float = 0.02, radians: float = 0.2) -> Array:
    """Poses ``(..., 7)``, each moved and turned a little."""
    turn = poses.from_rotation_vector(rng.normal(scale=radians, size=(*pose.shape[:-1], 3)))
    position = pose[..., :3] + rng.normal(scale=metres, size=(*pose.shape[:-1], 3))
    return np.concatenate([position, poses.quat_multiply(turn, pose[..., 3:])], axis=-1)


def changed_memory(memory: Any, rng: np.random.Generator) -> Any:
    """A memory of the same kind with other numbers."""
    if isinstance(memory, Path):
        table = memory.table.copy()
        table[:, :3] += rng.normal(scale=0.01, size=3)
        return memory._replace(table=table, duration=memory.duration * rng.uniform(0.7, 1.3))
    inner = parts(memory)
    if inner is None:
        return _changed(memory, rng)
    made = {k: changed_memory(v, rng) for k, v in inner.items()}
    if isinstance(memory, Mapping):
        return dict(zip(memory, made.values(), strict=True))
    if isinstance(memory, tuple | list) and not hasattr(memory, "_asdict"):
        return type(memory)(made.values())
    return type(memory)(**made)


def _changed(value: Any, rng: np.random.Generator) -> Any:
    if isinstance(value, bool | np.bool_):
        return np.bool_(rng.random() < 0.5)
    if isinstance(value, int | np.integer):
        return np.int64(rng.integers(0, 5))
    if isinstance(value, float | np.floating):
        return np.float64(value + rng.choice([0.0, 1.0, 2.5]))
    if not isinstance(value, np.ndarray):
        return value
    if value.dtype == bool:
        return rng.random(value.shape) < 0.5
    if value.dtype.kind == "i":
        return rng.integers(0, 5, value.shape)
    if value.shape[-1:] == (7,) and np.allclose(np.linalg.norm(value[..., 3:], axis=-1), 1.0):
        return changed_pose(value, rng)
    return value + rng.choice([0.0, 1.0, 2.5])
