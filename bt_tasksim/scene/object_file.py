"""Objects from data files: one's own things, each with its mesh, its colour, and where it may be held."""

from __future__ import annotations

from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from bt_tasksim.core.beside import beside
from bt_tasksim.core.document import located
from bt_tasksim.core.errors import FieldError, InputError, nearest, within
from bt_tasksim.core.own_files import looked_in, own_file
from bt_tasksim.core.resources import asset
from bt_tasksim.core.typed_file import load_typed
from bt_tasksim.scene.antipodal import width_at
from bt_tasksim.scene.grips import GivenGrip
from bt_tasksim.scene.mesh_file import check_size, mesh_extent
from bt_tasksim.scene.object_schema import GraspEntry, ObjectFile, SizeRange
from bt_tasksim.scene.shapes import ShapeSize, shape, size_range

Entry = TypeVar("Entry", bound=ObjectFile)


def object_file(name: str, folder: Path | None = None) -> Path:
    """Path of an object file.

    Args:
        name: Its path, or the name of a bundled one, such as ``mug.yaml``.
        folder: Folder of the file that names it; it lies there or below, or is bundled. None: any path.

    Raises:
        InputError: There is none.
    """
    own = own_file(name) if folder is None else beside(folder, name, "an object file")
    if own.is_file():
        return own
    known = [path.name for path in sorted(asset("objects").glob("*.yaml"))]
    if name not in known:
        where = looked_in() if folder is None else folder
        raise InputError(
            f"no object file '{name}'{nearest(name, known)} (in {where} and among the bundled ones)"
        )
    return asset("objects", name)


def load_object(path: Path) -> ObjectFile:
    """The content of an object file, all of which was checked; docs/scenes.md says what may stand in it.

    Raises:
        InputError: It does not describe an object that can be: one sentence says what and where.
    """
    content, document = load_typed(ObjectFile, path, "object file")
    with located(document):
        if content.kind is None and content.mesh is None:
            raise FieldError("an object file should name a 'mesh' or a 'kind'")
        object_fields(content, path)
    return content


def overridden(content: ObjectFile, entry: Entry) -> Entry:
    """An entry that names an object file, with what the file says wherever the entry does not."""
    said = content.model_fields_set - entry.model_fields_set
    if "size" in entry.model_fields_set:
        said -= {"scale"}
    if "scale" in entry.model_fields_set:
        said -= {"size"}
    if "mesh" in entry.model_fields_set:
        said -= {"kind", "scale", "size", "grasps"}
    return entry.model_copy(update={name: getattr(content, name) for name in said})


def object_fields(entry: ObjectFile, file: Path, owner: str = "the object") -> dict[str, Any]:
    """What a file says of an object, as fields of an `ObjectSpec`.

    Args:
        entry: Its content.
        file: The file, beside which its mesh lies, unless this is bundled.
        owner: What to call it in errors.

    Raises:
        InputError: It cannot be; says what, and in which field.
    """
    kinds = entry.kind or ("mesh",)
    size, mesh = entry.size, None
    if "mesh" in kinds:
        mesh, size = _mesh(owner, entry, file)
    elif entry.mesh is not None or entry.scale is not None:
        raise FieldError(
            f"{owner}: 'mesh' and 'scale' belong to the kind 'mesh', and its kind is '{kinds[0]}'", "kind"
        )
    grasps = []
    for i, grasp in enumerate(entry.grasps):
        with within("grasps", i):
            grasps.append(given_grip(grasp, kinds[0], size, mesh))
    return {
        "kinds": kinds,
        "size": size,
        "mass": entry.mass,
        "friction": entry.friction,
        "exponents": entry.exponents,
        "mesh": mesh,
        "colour": entry.colour,
        "grasps": tuple(grasps),
        "symmetry": entry.symmetry,
        "category": entry.category,
    }


def _mesh(owner: str, entry: ObjectFile, file: Path) -> tuple[str, SizeRange]:
    """Path and size of an object's mesh."""
    if entry.mesh is None:
        raise FieldError(f"{owner}: 'mesh' is missing: the path of a mesh file")
    if entry.size is not None and entry.scale is not None:
        raise FieldError(f"{owner}: give either 'scale' or 'size', not both", "scale")
    with within("mesh"):
        own, bundled = beside(file.parent, entry.mesh, "a mesh"), asset("objects", entry.mesh)
        mesh = str(own if own.is_file() or not bundled.is_file() else bundled)
        x, y, z = mesh_extent(mesh)
        scale = 1.0 if entry.scale is None else entry.scale
        scaled = (x * scale, y * scale, z * scale)
        size = entry.size or (scaled, scaled)
        for bound in size:
            check_size(f"{owner} (mesh '{entry.mesh}')", bound)
    return mesh, size


def given_grip(entry: GraspEntry, kind: str, size: SizeRange | None, mesh: str | None) -> GivenGrip:
    """Where an object may be held; its width is measured where none is given.

    Args:
        entry: What somebody says of it.
        kind: The object's kind.
        size: Lowest and highest full size; None for its kind's.
        mesh: The path of its mesh, for the kind ``mesh``.

    Raises:
        FieldError: There is no single size to measure the width from, or fingers meet nothing there.
    """
    width = entry.width
    if width is None:
        low, high = size or size_range(kind, mesh)
        if low != high:
            raise FieldError("'width' is missing, and the object has no single size to measure it from")
        solid = shape(kind, ShapeSize(low, mesh=mesh))
        width = width_at(solid.visual, np.array(entry.point), np.array(entry.closing))
        if width is None:
            raise FieldError(
                f"fingers that close about {list(entry.point)} along {list(entry.closing)} meet nothing"
            )
    return GivenGrip(entry.point, entry.closing, width, entry.approach, entry.firmness)
