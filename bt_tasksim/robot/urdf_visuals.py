"""What a URDF's links look like, and what they collide with."""

from __future__ import annotations

import contextlib
import io
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from defusedxml.ElementTree import parse

from bt_tasksim.core import poses
from bt_tasksim.core.bounded_text import read_bytes
from bt_tasksim.core.errors import InputError

LARGEST_URDF = 16 << 20
"""Bytes of a URDF."""

Colour = tuple[float, float, float]


@dataclass(frozen=True)
class LinkVisual:
    """One part of a link, seen or collided with.

    Attributes:
        link: Name of the link.
        pose: Pose ``(7,)`` in the link's frame.
        kind: ``mesh``, ``box``, ``cylinder`` (its axis is z) or ``sphere``.
        size: Scale ``(3,)`` of a mesh, full size ``(3,)`` of a box, radius and length, or radius; metres.
        mesh: Path of the mesh file.
        colour: RGB, 0 to 1; None where the mesh brings its own, and for what is not seen.
    """

    link: str
    pose: tuple[float, ...]
    kind: str
    size: tuple[float, ...]
    mesh: str | None
    colour: Colour | None


@lru_cache(maxsize=32)
def load_visuals(urdf: Path) -> tuple[LinkVisual, ...]:
    """All visible parts of a URDF, link by link.

    Raises:
        InputError: The file is no URDF, or one of its meshes is missing.
    """
    return _parts(urdf, "visual")


@lru_cache(maxsize=32)
def load_collisions(urdf: Path) -> tuple[LinkVisual, ...]:
    """All parts of a URDF that things collide with, link by link.

    Raises:
        InputError: The file is no URDF, or one of its meshes is missing.
    """
    return _parts(urdf, "collision")


def mesh_files(urdf: Path) -> tuple[Path, ...]:
    """All mesh files that a URDF names and that are there.

    Raises:
        InputError: The file cannot be read as XML.
    """
    found = set()
    for form in read_urdf(urdf).iter("mesh"):
        with contextlib.suppress(InputError):
            found.add(_mesh_path(form.get("filename", ""), urdf))
    return tuple(sorted(found))


def read_urdf(urdf: Path) -> ElementTree.Element:
    """The root element of a URDF.

    Raises:
        InputError: The file cannot be read as XML.
    """
    try:
        content = read_bytes(urdf, f"URDF '{urdf}'", LARGEST_URDF)
        root = parse(io.BytesIO(content)).getroot()
        assert root is not None
    except (ElementTree.ParseError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"URDF '{urdf}' cannot be read: {error}") from error
    return root


def origin(element: ElementTree.Element) -> poses.Array:
    """The pose ``(7,)`` that an element's origin says, the identity where it has none."""
    found = element.find("origin")
    if found is None:
        return poses.pose((0.0, 0.0, 0.0))
    xyz, rpy = _floats(found.get("xyz", "0 0 0")), _floats(found.get("rpy", "0 0 0"))
    return poses.pose(xyz, _from_rpy(*rpy))


def _parts(urdf: Path, tag: str) -> tuple[LinkVisual, ...]:
    root = read_urdf(urdf)
    named = {m.get("name", ""): _colour(m) for m in root.findall("material")}
    parts = []
    for link in root.findall("link"):
        for part in link.findall(tag):
            try:
                parts.append(_part(link.get("name", ""), part, named, urdf))
            except (AttributeError, IndexError, TypeError, ValueError) as error:
                if isinstance(error, InputError):
                    raise
                raise InputError(f"URDF '{urdf}': link '{link.get('name')}': bad {tag}: {error}") from error
    return tuple(parts)


def _part(link: str, visual: ElementTree.Element, named: dict[str, Colour | None], urdf: Path) -> LinkVisual:
    geometry = visual.find("geometry")
    if geometry is None or len(geometry) == 0:
        raise ValueError("it has no geometry")
    form = geometry[0]
    kind, mesh = form.tag, None
    size: tuple[float, ...] = (1.0, 1.0, 1.0)
    match kind:
        case "mesh":
            size = _floats(form.get("scale", "1 1 1"))
            mesh = str(_mesh_path(form.get("filename", ""), urdf))
        case "box":
            size = _floats(form.get("size", ""))
        case "cylinder":
            size = (float(form.get("radius", "")), float(form.get("length", "")))
        case "sphere":
            size = (float(form.get("radius", "")),)
        case _:
            raise ValueError(f"unknown geometry '{kind}'")
    material = visual.find("material")
    colour = None
    if material is not None:
        colour = _colour(material) or named.get(material.get("name", ""))
    return LinkVisual(link, tuple(float(v) for v in origin(visual)), kind, size, mesh, colour)


def _from_rpy(roll: float, pitch: float, yaw: float) -> poses.Array:
    """Unit quaternion ``(4,)`` of URDF's roll, pitch and yaw: about fixed x, then y, then z."""
    x, y, z = (poses.from_rotation_vector(v) for v in np.diag([roll, pitch, yaw]))
    return poses.quat_multiply(z, poses.quat_multiply(y, x))


def _mesh_path(filename: str, urdf: Path) -> Path:
    plain = filename.removeprefix("file://")
    if plain.startswith("package://"):
        inside = plain.removeprefix("package://")
        below = inside.partition("/")[2]
        candidates = [folder / name for folder in urdf.parents for name in (inside, below)]
    else:
        candidates = [urdf.parent / plain]
    for candidate in candidates:
        if candidate.is_file():
            return candidate.resolve()
    raise InputError(f"URDF '{urdf}': no mesh file '{filename}'")


def _colour(material: ElementTree.Element) -> Colour | None:
    colour = material.find("color")
    if colour is None:
        return None
    r, g, b = _floats(colour.get("rgba", "1 1 1 1"))[:3]
    return r, g, b


def _floats(text: str) -> tuple[float, ...]:
    return tuple(float(v) for v in text.split())
