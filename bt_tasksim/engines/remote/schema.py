"""The messages between a client and a served engine: what each kind holds.

The arrays of a message are of the types and shapes that its kind says; shapes are numbers, or names of sizes
that follow from the robot and the drawn world. How messages become bytes stands in
`bt_tasksim.engines.remote.messages`.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bt_tasksim.engines.images import CameraModel
from bt_tasksim.engines.remote.plain import spelled, to_plain
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration

Frame = bytes | memoryview
"""One frame of a message."""
PROTOCOL = 1
LARGEST_HEADER = 1 << 20
"""Bytes of the first frame, the drawn world in it."""
MOST_FRAMES = 48
MOST_IMAGES = 8
LARGEST_SIDE = 8192
"""Of what no message says beforehand, such as an image's width."""
DTYPES: Mapping[str, np.dtype[Any]] = {name: np.dtype(name) for name in ("<f8", "<f4", "|u1", "|b1")}
"""The types that arrays may have: NumPy's names with their byte order."""


@dataclass(frozen=True)
class ArraySpec:
    """What an array in a message must be.

    Attributes:
        shape: Numbers, or names of sizes that are the same throughout a message and an episode.
        dtype: One of `DTYPES`.
        values: ``finite`` (and within `LARGEST`), ``not NaN`` or ``any``.
        optional: It may be missing.
    """

    shape: tuple[int | str, ...]
    dtype: str = "<f8"
    values: str = "finite"
    optional: bool = False


@dataclass(frozen=True)
class MessageSpec:
    """What a kind of message holds: fields with their types, arrays, and images by their cameras."""

    fields: Mapping[str, Any] = field(default_factory=dict)
    arrays: Mapping[str, ArraySpec] = field(default_factory=dict)
    images: bool = False


_STATE = {
    "time": ArraySpec(()),
    "joint_position": ArraySpec(("joints",)),
    "joint_velocity": ArraySpec(("joints",)),
    "joint_effort": ArraySpec(("joints",)),
    "tip_force": ArraySpec(("tips", 3)),
    "wrench": ArraySpec((6,)),
    "tool_pose": ArraySpec((7,)),
    "tips": ArraySpec(("tips", 3)),
    "objects": ArraySpec(("objects", 7), optional=True),
    "velocities": ArraySpec(("objects", 6), optional=True),
}
_HIDDEN = {
    "time": ArraySpec(()),
    "objects": ArraySpec(("objects", 7)),
    "velocities": ArraySpec(("objects", 6)),
    "hand_force": ArraySpec(("objects",)),
    "hand_distance": ArraySpec(("objects",), values="not NaN"),
    "support": ArraySpec(("objects", "bodies"), "|b1"),
    "penetration": ArraySpec(()),
    "tool_pose": ArraySpec((7,)),
}
_OBSERVATION = {
    "time": ArraySpec(()),
    "arm_position": ArraySpec(("arm",)),
    "arm_velocity": ArraySpec(("arm",)),
    "hand_position": ArraySpec(("hand",)),
    "hand_effort": ArraySpec(("hand",)),
    "closure": ArraySpec(()),
    "tool_pose": ArraySpec((7,)),
    "tips": ArraySpec(("tips", 3)),
    "contacts": ArraySpec(("tips",), "|b1"),
    "contact_force": ArraySpec(("tips", 3)),
    "wrench": ArraySpec((6,)),
    "objects": ArraySpec(("objects", 7), values="any"),
    "contact_points": ArraySpec(("tips", 3)),
    "motion": ArraySpec((6,)),
}
_TARGET = {"position": ArraySpec(("joints",)), "velocity": ArraySpec(("joints",))}
_COMMAND = {
    "tool": ArraySpec((7,), optional=True),
    "hand": ArraySpec(("closures",), optional=True),
    "posture": ArraySpec(("arm",), values="any", optional=True),
}
IMAGE = {
    "colour": ArraySpec(("height", "width", 3), "|u1"),
    "depth": ArraySpec(("height", "width"), "<f4", optional=True),
    "taken": ArraySpec((), optional=True),
}

REQUESTS: Mapping[str, MessageSpec] = {
    "hello": MessageSpec({"role": str, "version": str, "robot": str, "digests": dict[str, str]}),
    "reset": MessageSpec({"configuration": ActorConfiguration}),
    "step": MessageSpec(arrays=_TARGET),
    "hidden": MessageSpec(),
    "solve": MessageSpec(arrays={**_STATE, **_COMMAND}),
    "hand_start": MessageSpec(arrays={"start": ArraySpec((4,))}),
    "render": MessageSpec({"camera": str, "depth": bool, "width": int, "height": int}, _STATE),
    "cameras": MessageSpec({"first": bool}),
    "observe": MessageSpec(arrays=_STATE, images=True),
}
"""What a client may send: what it is for is in `bt_tasksim.engines.remote.session`."""
REPLIES: Mapping[str, MessageSpec] = {
    "welcome": MessageSpec(
        {
            "role": str,
            "engine": str,
            "wants_images": bool,
            "version": str,
            "robot": str,
            "digests": dict[str, str],
        }
    ),
    "done": MessageSpec(),
    "state": MessageSpec(arrays=_STATE),
    "truth": MessageSpec(arrays=_HIDDEN),
    "no truth": MessageSpec(),
    "target": MessageSpec(arrays=_TARGET),
    "joints": MessageSpec(arrays={"position": ArraySpec(("joints",))}),
    "image": MessageSpec(images=True),
    "names": MessageSpec({"names": tuple[str, ...]}),
    "observation": MessageSpec({"unseen": dict[str, str]}, _OBSERVATION),
    "error": MessageSpec({"error": str, "sentence": str, "distance": float, "angle": float}),
    "notice": MessageSpec(),
}
"""What a server may send; ``notice`` answers nothing, and finds out whether a client is still there."""
SCHEMA: Mapping[str, MessageSpec] = {**REQUESTS, **REPLIES}


def sizes_of(robot: RobotDescription, configuration: ActorConfiguration | None = None) -> dict[str, int]:
    """The named sizes of arrays for a robot and, once it is known, a drawn world."""
    sizes = {
        "joints": len(robot.joints),
        "arm": len(robot.arm_joints),
        "hand": len(robot.hand_joints),
        "tips": len(robot.tips),
        "closures": 1 + len(robot.synergies),
    }
    if configuration is not None:
        objects = len(configuration.objects)
        sizes |= {"objects": objects, "bodies": objects + len(configuration.fixtures)}
    return sizes


def layout_digest() -> str:
    """A hash of the whole schema: two sides that have the same one lay their messages out alike.

    Every dataclass in it counts with all its fields, down to a drawn world's boxes.
    """
    whole = {"protocol": PROTOCOL, "kinds": {kind: _spelled(kind, spec) for kind, spec in SCHEMA.items()}}
    return hashlib.sha256(json.dumps(whole, sort_keys=True).encode()).hexdigest()


def _spelled(kind: str, spec: MessageSpec) -> dict[str, Any]:
    """A kind of message as plain data, one image standing for all that it may have."""
    return {
        "fields": {name: spelled(t) for name, t in spec.fields.items()},
        "arrays": to_plain(array_specs(kind, 1 if spec.images else 0)),
        "images": spelled(CameraModel) if spec.images else None,
    }


def array_specs(kind: str, images: int) -> dict[str, ArraySpec]:
    """The arrays of a kind of message, those of its images by their number."""
    specs = dict(SCHEMA[kind].arrays)
    for i in range(images):
        named = {"height": f"height {i}", "width": f"width {i}"}
        for part, spec in IMAGE.items():
            shape = tuple(named.get(n, n) if isinstance(n, str) else n for n in spec.shape)
            specs[f"{part} {i}"] = ArraySpec(shape, spec.dtype, spec.values, spec.optional)
    return specs
