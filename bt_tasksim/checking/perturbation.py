"""What is seen, what is hidden and what is remembered, changed at random; all arrays are ``(N, ...)``."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from bt_tasksim.core import poses
from bt_tasksim.core.bundles import mapped
from bt_tasksim.core.poses import Array
from bt_tasksim.core.world import Hidden, Observation
from bt_tasksim.planning.reference_motion import Path


def changed_observation(o: Observation, rng: np.random.Generator) -> Observation:
    """Elsewhere, otherwise felt, at another time."""
    closure = np.clip(o.closure + rng.normal(scale=0.2, size=o.closure.shape), 0, 1)
    which = rng.integers(0, 3, o.closure.shape)
    return dataclasses.replace(
        o,
        time=o.time + rng.uniform(0, 1, o.time.shape),
        tool_pose=changed_pose(o.tool_pose, rng),
        objects=changed_pose(o.objects, rng),
        tips=o.tips + rng.normal(scale=0.01, size=o.tips.shape),
        contacts=rng.random(o.contacts.shape) < 0.6,
        closure=np.where(which == 0, 0.0, np.where(which == 1, 1.0, closure)),
        wrench=o.wrench + rng.normal(scale=3.0, size=o.wrench.shape),
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
        table[..., :3] += rng.normal(scale=0.01, size=(len(table), 1, 3))
        return memory._replace(table=table, duration=memory.duration * rng.uniform(0.7, 1.3))
    if hasattr(memory, "_fields"):
        return type(memory)(*(changed_memory(value, rng) for value in memory))
    return mapped(lambda value: _changed(value, rng), memory)


def _changed(value: Any, rng: np.random.Generator) -> Any:
    if not isinstance(value, np.ndarray):
        return value
    if value.dtype == bool:
        return rng.random(value.shape) < 0.5
    if value.dtype.kind == "i":
        return rng.integers(0, 5, value.shape)
    if value.shape[-1:] == (7,) and np.allclose(np.linalg.norm(value[..., 3:], axis=-1), 1.0):
        return changed_pose(value, rng)
    return value + rng.choice([0.0, 1.0, 2.5])
