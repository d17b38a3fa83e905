"""The objects of a random task: every kind and every form of mesh, and what of them others can stand on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.any_tree.meshes import FORMS, made, obj_text
from benchmarks.any_tree.settings import Setting
from bt_tasksim import ObjectSpec
from bt_tasksim.core.files import write_text
from bt_tasksim.scene.configuration import ObjectActor
from bt_tasksim.scene.shapes import ShapeSize, shape_kind

KINDS = ("box", "cube", "cylinder", "cup", "diamond", "oval", "superellipsoid")
"""Kinds of the simulator that need no file."""
MESHES = 0.45
"""Share of the objects that are meshes."""
FLAT = frozenset({"box", "cube", "cylinder", "diamond", "oval", "book", "frustum", "star"})
"""What others can stand on."""
OPEN = frozenset({"ring", "tube", "nut", "dumbbell"})
"""What stands on its rim or its ends alone, and falls from what is narrower."""
ON = 0.55
"""Share of the upper one's width that the lower one must have, so that it stands."""
STANDING = ((0.2, 0.6), (0.2, 1.0))
"""Exponents of superellipsoids that are flat enough below to be put somewhere upright."""
SAME = 200
"""So many seeds in a row share their meshes: to cut one into convex parts takes seconds."""
TALLEST = 2.5
"""Height of a tower over the least width of its foot, at most."""


@dataclass(frozen=True)
class Thing:
    """An object that is drawn: its name, its kind or form, and what it may be.

    Attributes:
        name: Its name, ``<form>_<number>``.
        form: Kind, or form of a mesh.
        spec: The fields of its `ObjectSpec` that do not say where it starts.
    """

    name: str
    form: str
    spec: dict[str, object]

    def starting(self, **where: object) -> ObjectSpec:
        """As it starts somewhere."""
        return ObjectSpec(**{**self.spec, **where})  # type: ignore[arg-type]


def draw_things(
    count: int, setting: Setting, seed: int, folder: Path, rng: np.random.Generator
) -> list[Thing]:
    """So many things; their meshes are written into a folder."""
    found = []
    for k in range(1, count + 1):
        mesh = rng.random() < MESHES
        form = str(rng.choice(list(FORMS) if mesh else list(KINDS)))
        found.append(thing_of(k, form, setting, seed // SAME, folder))
    return found


def thing_of(number: int, form: str, setting: Setting, seed: int, folder: Path) -> Thing:
    """A thing of a kind or form; its mesh, made from a seed, is written into a folder."""
    spec: dict[str, object] = {"mass": setting.mass}
    if form in FORMS:
        spec |= {"kinds": ("mesh",), "mesh": str(mesh_file(folder, form, seed, setting.mesh_scale))}
    else:
        spec |= {"kinds": (form,), "size": setting.sizes.get(form), "exponents": STANDING}
    return Thing(f"{form}_{number}", form, spec)


def mesh_file(folder: Path, form: str, seed: int, scale: float) -> Path:
    """The file of a form, made from a seed; written unless it is there."""
    path = folder / f"{form}-{seed}-{scale:g}.obj"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        vertices, faces = made(form, seed)
        write_text(path, obj_text(scale * vertices, faces, f"{form}, seed {seed}, times {scale:g}"))
    return path.resolve()


def extent(actor: ObjectActor) -> tuple[float, float, float]:
    """Full size ``(3,)`` of its bounding box, metres."""
    return shape_kind(actor.kind).extent(ShapeSize(actor.size, actor.exponents, actor.mesh))


def width(actor: ObjectActor) -> tuple[float, float]:
    """The narrower and the wider side of its bounding box from above, metres."""
    x, y, _ = extent(actor)
    return min(x, y), max(x, y)


def radius(actor: ObjectActor) -> float:
    """Of the circle about its bounding box from above, metres."""
    x, y, _ = extent(actor)
    return float(np.hypot(x, y)) / 2


def bears(lower: ObjectActor, upper: ObjectActor, forms: Mapping[str, str], height: float = 0.0) -> bool:
    """Whether one can stand on the other: it is flat and wide enough, and the tower not too tall.

    Args:
        lower: What would bear it.
        upper: What would stand on it.
        forms: Kind or form of each object.
        height: Of what is below the lower one, metres.
    """
    least, tall = width(lower)[0], height + extent(lower)[2]
    share = 1.05 if forms[upper.name] in OPEN else ON
    wide = least >= share * width(upper)[1]
    return forms[lower.name] in FLAT and wide and tall <= TALLEST * least + 0.05
