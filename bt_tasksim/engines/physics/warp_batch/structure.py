"""The structure of a model, which worlds of one batch of MuJoCo Warp share, and what may differ within it."""

from __future__ import annotations

import dataclasses
import hashlib
from dataclasses import dataclass, field, replace
from functools import cache
from types import ModuleType

import numpy as np

from bt_tasksim.core.poses import Array
from bt_tasksim.engines.physics.mujoco_model import World
from bt_tasksim.engines.physics.mujoco_timing import StepPlan
from bt_tasksim.engines.physics.warp_batch.geoms import GeomTable
from bt_tasksim.engines.physics.warp_batch.meshes import Hull
from bt_tasksim.engines.physics.warp_batch.words import host_words

OUT_OF_IT = ("mesh_", "nmesh", "tex_", "ntex", "mat_", "vis_", "dof_length")
"""Fields of a model that are no part of its structure: hulls have their own store, looks do not matter, and
lengths of degrees of freedom are for bodies that may fall asleep, which none here may."""
APART = 100.0
"""Metres to an object of a world in which nothing goes on, and from one to the next."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """A world as it goes to the device.

    Attributes:
        world: The model, and where things are in its arrays.
        timing: How it is stepped.
        geoms: What its geoms belong to.
        hulls: Its meshes, in the model's order.
        state: Words ``(m,)`` that its state begins with, by the field of MuJoCo Warp's data.
        fields: Words of the model's fields that may differ between worlds, by name.
        key: The same for worlds of one structure.
    """

    world: World
    timing: StepPlan
    geoms: GeomTable
    hulls: tuple[Hull, ...]
    state: dict[str, Array]
    fields: dict[str, Array] = field(repr=False)
    key: bytes = b""


def idle(first: Prepared) -> Prepared:
    """A world of the same structure in which nothing goes on: its objects lie far apart, without weight."""
    qpos = first.state["qpos"].view(np.float32).copy()
    for k, (x, y, z) in enumerate(first.world.object_qpos[:, :3].tolist()):
        if x < y:  # and no part of a fixture, which stays on its joint
            qpos[[x, y, z]] = APART * (k + 1), 0.0, APART
    state = first.state | {"qpos": qpos.view(np.int32)}
    return replace(first, state=state | {"xfrc_applied": np.zeros_like(state["xfrc_applied"])})


def prepare(library: ModuleType, world: World, timing: StepPlan, state: dict[str, Array]) -> Prepared:
    """What the device needs of a world.

    Args:
        library: MuJoCo Warp.
        world: Its model.
        timing: How it is stepped.
        state: What its state begins with, by the field of MuJoCo Warp's data.
    """
    model, geoms = world.model, GeomTable.of(world)
    shared, own = _fields(library)
    digest = hashlib.sha256(repr(timing).encode() + geoms.key)
    for name in shared:
        value = np.asarray(getattr(model, name))
        digest.update(f"{name}{value.shape}".encode() + value.tobytes())
    rows = {}
    for name in own:
        value = np.asarray(getattr(model, name))
        digest.update(f"{name}{value.shape}".encode())
        if name != "geom_dataid":
            rows[name] = host_words(value[None], _kind(value))[0]
    return Prepared(
        world=world,
        timing=timing,
        geoms=geoms,
        hulls=tuple(Hull.of(model, k) for k in range(model.nmesh)),
        state={name: host_words(value[None], np.float32)[0] for name, value in state.items()},
        fields=rows,
        key=digest.digest(),
    )


def _kind(value: Array) -> type:
    return np.int32 if np.issubdtype(value.dtype, np.integer) else np.float32


@cache
def _fields(library: ModuleType) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Fields of a model that all worlds of a batch share, and those that each can have for itself."""
    import mujoco

    shared, own = [], []
    for item in dataclasses.fields(library.Model):
        there = hasattr(mujoco.MjModel, item.name)
        if not there or item.name.startswith(OUT_OF_IT) or item.name == "opt":
            continue
        shape = getattr(item.type, "shape", None)
        if shape is not None and len(shape) > 1 and shape[0] == "*":
            own.append(item.name)
        elif item.type is int or shape is not None:
            shared.append(item.name)
    return tuple(shared), tuple(own)
