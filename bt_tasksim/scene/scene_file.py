"""Scenes from data files: a user's own meshes, furniture and arrangement, checked before anything runs."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from bt_tasksim.collision import check_configuration
from bt_tasksim.errors import InputError, nearest
from bt_tasksim.fixtures import load_fixture
from bt_tasksim.mesh_file import check_size, mesh_extent
from bt_tasksim.robot import load_robot
from bt_tasksim.scene import Goal, ObjectSpec, Scene, SpotSpec
from bt_tasksim.shapes import KINDS, ShapeSize, shape

_SCENE = ("name", "robot", "fixtures", "objects", "spots", "goal", "knock")
_OBJECT = (
    "kind", "on", "at", "area", "heading", "size", "mass", "friction", "exponents", "mesh", "scale",
)  # fmt: skip
_SPOT = ("name", "on", "at", "area", "extent", "heading")
_GOAL = ("object", "place", "relation", "position_tolerance", "angle_tolerance", "height")
_RELATIONS = ("stands", "inside", "lifted")
_MASS = (0.001, 20.0)
_FRICTION = (0.01, 2.0)
_DENSEST = 20000.0
_TRIED = 3


class _Loader(yaml.SafeLoader):
    """YAML in which ``on`` is a word, as YAML 1.2 has it, and not the value true."""

    yaml_implicit_resolvers = {
        first: [(tag, form) for tag, form in resolvers if tag != "tag:yaml.org,2002:bool" or first in "tTfF"]
        for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }


def load_scene(path: str | Path) -> Scene:
    """A scene from a YAML file; docs/scenes.md says what may stand in it.

    Meshes, robots and fixtures are looked for beside the file. Units are SI, angles radians.

    Raises:
        InputError: The file does not describe a scene that can be: one sentence says what and where.
    """
    file = Path(path)
    try:
        data = _Loader(file.read_text(encoding="utf-8")).get_single_data()
    except OSError as error:
        raise InputError(f"scene file '{file}' cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"scene file '{file}' is not text") from error
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        where = f", line {mark.line + 1}" if mark else ""
        raise InputError(f"scene file '{file}'{where}: {getattr(error, 'problem', None) or error}") from error
    try:
        scene = _scene(data, file)
        for seed in range(_TRIED):
            check_configuration(scene.sample(seed))
    except InputError as error:
        raise InputError(f"scene file '{file}': {error}") from error
    return scene


def _scene(data: Any, file: Path) -> Scene:
    entries = _mapping(data, "a scene", _SCENE)
    robot = _beside(str(entries.get("robot", "panda")), file)
    load_robot(robot)
    fixtures = [_beside(str(f), file) for f in _list(entries.get("fixtures", []), "fixtures")]
    objects = {
        str(name): _object(str(name), value, file)
        for name, value in _mapping(entries.get("objects") or {}, "objects").items()
    }
    spots = [_spot(value, i) for i, value in enumerate(_list(entries.get("spots", []), "spots"))]
    goal = _goal(entries["goal"]) if entries.get("goal") is not None else None
    knock = entries.get("knock")
    scene = Scene(
        robot=robot,
        fixtures=fixtures,
        objects=objects,
        spots=spots,
        goal=goal,
        knock=None if knock is None else str(knock),
        name=str(entries.get("name", file.stem)),
    )
    _check_areas(scene)
    return scene


def _object(name: str, value: Any, file: Path) -> ObjectSpec | str:
    if isinstance(value, str):
        return value
    what = f"object '{name}'"
    entries = _mapping(value, what, _OBJECT)
    kind = entries.get("kind", "mesh" if "mesh" in entries else name)
    kinds = tuple(str(k) for k in (kind if isinstance(kind, list) else [kind]))
    for k in kinds:
        if k not in KINDS:
            raise InputError(f"{what}: unknown kind '{k}'{nearest(k, KINDS)}")
    if "on" not in entries:
        raise InputError(f"{what}: 'on' is missing: the place where it starts")
    mass = _range(entries.get("mass", [0.08, 0.25]), f"{what}: mass", "kg", _MASS)
    friction = _range(entries.get("friction", [0.4, 0.9]), f"{what}: friction", "", _FRICTION)
    exponents = _range(entries.get("exponents", [0.2, 1.0]), f"{what}: exponents", "", (1e-6, 2.0))
    size = _size(entries["size"], f"{what}: size") if "size" in entries else None
    mesh = None
    if "mesh" in kinds:
        mesh, size = _mesh(entries, what, size, file)
    elif "mesh" in entries or "scale" in entries:
        raise InputError(
            f"{what}: 'mesh' and 'scale' belong to the kind 'mesh', and its kind is '{kinds[0]}'"
        )
    fixed = (0.0, 0.0) if "at" in entries else None
    spec = ObjectSpec(
        kinds=kinds,
        on=str(entries["on"]),
        centre=_vector(entries.get("at", (0.0, 0.0)), 2, f"{what}: at"),
        area=_vector(entries["area"], 2, f"{what}: area") if "area" in entries else fixed,
        yaw=_number(entries.get("heading", math.pi), f"{what}: heading"),
        size=size,
        mass=mass,
        friction=friction,
        exponents=exponents,
        mesh=mesh,
    )
    _check_density(what, spec)
    return spec


def _mesh(entries: Mapping[str, Any], what: str, size: Any, file: Path) -> tuple[str, Any]:
    if "mesh" not in entries:
        raise InputError(f"{what}: 'mesh' is missing: the path of a mesh file")
    if size is not None and "scale" in entries:
        raise InputError(f"{what}: give either 'scale' or 'size', not both")
    mesh = str((file.parent / str(entries["mesh"])).resolve())
    extent = mesh_extent(mesh)
    if size is None:
        scale = _number(entries.get("scale", 1.0), f"{what}: scale")
        if scale <= 0:
            raise InputError(f"{what}: scale should be above 0, found {scale:g}")
        scaled = (extent[0] * scale, extent[1] * scale, extent[2] * scale)
        size = (scaled, scaled)
    for bound in size:
        check_size(f"{what} (mesh '{mesh}')", bound)
    return mesh, size


def _spot(value: Any, index: int) -> SpotSpec:
    what = f"spot {index + 1}"
    entries = _mapping(value, what, _SPOT)
    for key in ("name", "on"):
        if key not in entries:
            raise InputError(f"{what}: '{key}' is missing")
    what = f"spot '{entries['name']}'"
    extent = _vector(entries.get("extent", (0.12, 0.12)), 2, f"{what}: extent")
    if min(extent) <= 0:
        raise InputError(f"{what}: extent should be above 0, found {extent}")
    return SpotSpec(
        name=str(entries["name"]),
        on=str(entries["on"]),
        centre=_vector(entries.get("at", (0.0, 0.0)), 2, f"{what}: at"),
        area=_vector(entries.get("area", (0.0, 0.0)), 2, f"{what}: area"),
        extent=extent,
        yaw=_number(entries.get("heading", 0.0), f"{what}: heading"),
    )


def _goal(value: Any) -> Goal:
    entries = _mapping(value, "goal", _GOAL)
    for key in ("object", "place"):
        if key not in entries:
            raise InputError(f"goal: '{key}' is missing")
    goal = Goal(str(entries["object"]), str(entries["place"]))
    relation = str(entries.get("relation", goal.relation))
    if relation not in _RELATIONS:
        raise InputError(f"goal: unknown relation '{relation}'{nearest(relation, _RELATIONS)}")
    return dataclasses.replace(
        goal,
        relation=relation,
        position_tolerance=_number(entries.get("position_tolerance", goal.position_tolerance), "goal"),
        angle_tolerance=_number(entries.get("angle_tolerance", goal.angle_tolerance), "goal"),
    )


def _check_areas(scene: Scene) -> None:
    """The areas in which things are drawn lie on their places."""
    extents = {p.name: (p.extent, p.centre) for f in scene.fixtures for p in load_fixture(f).places}
    extents |= {spot.name: (spot.extent, (0.0, 0.0)) for spot in scene.spots}
    drawn = [(f"object '{name}'", spec) for name, spec in scene.objects.items()]
    for what, spec in [*drawn, *((f"spot '{spot.name}'", spot) for spot in scene.spots)]:
        assert isinstance(spec, (ObjectSpec, SpotSpec))
        extent, middle = extents[spec.on]
        for axis, letter in enumerate("xy"):
            reach = abs(spec.centre[axis] - middle[axis]) + (spec.area[axis] if spec.area else 0.0)
            if reach > extent[axis] / 2:
                raise InputError(
                    f"{what} may be drawn {1000 * (reach - extent[axis] / 2):.0f} mm beyond the edge of "
                    f"'{spec.on}' along {letter}: change 'at' or 'area'"
                )


def _smallest_exponents(spec: ObjectSpec) -> tuple[float, float]:
    low = spec.exponents[0]
    return low if isinstance(low, tuple) else (low, low)


def _check_density(what: str, spec: ObjectSpec) -> None:
    for kind in spec.kinds:
        small = (spec.size or KINDS[kind].size_range)[0]
        volume = shape(kind, ShapeSize(small, _smallest_exponents(spec), spec.mesh)).volume
        if spec.mass[1] > _DENSEST * volume:
            raise InputError(
                f"{what}: {spec.mass[1]:g} kg in {1e6 * volume:.3g} cm3 would be denser than any metal: "
                f"check its mass (kg) and size (m)"
            )


def _mapping(value: Any, what: str, known: tuple[str, ...] | None = None) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise InputError(f"{what} should be entries 'name: value', found {_short(value)}")
    for key in value:
        if known is not None and key not in known:
            raise InputError(f"{what}: unknown entry '{key}'{nearest(str(key), known)}")
    return value


def _list(value: Any, what: str) -> list[Any]:
    if not isinstance(value, list):
        raise InputError(f"{what} should be a list, found {_short(value)}")
    return value


def _number(value: Any, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise InputError(f"{what} should be a number, found {_short(value)}")
    return float(value)


def _vector(value: Any, n: int, what: str) -> Any:
    if not isinstance(value, (list, tuple)) or len(value) != n:
        raise InputError(f"{what} should be {n} numbers, found {_short(value)}")
    return tuple(_number(v, what) for v in value)


def _range(value: Any, what: str, unit: str, bounds: tuple[float, float]) -> tuple[float, float]:
    low, high = _vector(value, 2, what) if isinstance(value, list) else (_number(value, what),) * 2
    if not bounds[0] <= low <= high <= bounds[1]:
        space = f" {unit}" if unit else ""
        raise InputError(
            f"{what} should be between {bounds[0]:g} and {bounds[1]:g}{space}, the lower one first, "
            f"found {_short(value)}"
        )
    return low, high


def _size(value: Any, what: str) -> Any:
    ranged = isinstance(value, list) and len(value) == 2 and isinstance(value[0], list)
    low, high = (_vector(v, 3, what) for v in (value if ranged else (value, value)))
    if min(low) <= 0 or any(a > b for a, b in zip(low, high, strict=True)):
        raise InputError(f"{what} should be positive, the smaller one first, found {_short(value)}")
    for bound in (low, high):
        check_size(what, bound)
    return low, high


def _beside(name: str, file: Path) -> str:
    if name.endswith((".yaml", ".yml")):
        return str((file.parent / name).resolve())
    return name


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
