"""Scenes from data files: a user's own meshes, furniture and arrangement, checked before anything runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from bt_tasksim.core.beside import beside
from bt_tasksim.core.document import located
from bt_tasksim.core.errors import FieldError, within
from bt_tasksim.core.plain import Where
from bt_tasksim.core.resources import FURNITURE, is_file
from bt_tasksim.core.typed_file import load_typed
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.fixtures import load_fixture
from bt_tasksim.scene.object_file import load_object, object_fields, object_file, overridden
from bt_tasksim.scene.overlap import check_configuration
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.scene_schema import (
    FixturePlacement,
    GoalEntry,
    ObjectEntry,
    SceneFile,
    SpotEntry,
)
from bt_tasksim.scene.shapes import KINDS, ShapeSize, shape, shape_kind
from bt_tasksim.scene.specs import STARTS, FixtureSpec, Goal, ObjectSpec, SpotSpec, split_start

DENSEST = 20000.0
_TRIED = 3
FLOATING = 0.02
"""Metres from the nearest box beyond which a place stands on nothing."""


def load_scene(path: str | Path) -> Scene:
    """A scene from a YAML file; docs/scenes.md says what may stand in it.

    Meshes, robots and fixtures lie beside the file or are bundled. Units are SI, angles radians.

    Raises:
        InputError: The file does not describe a scene that can be: one sentence says what and where.
    """
    content, document = load_typed(SceneFile, path, "scene file")
    with located(document):
        scene = _scene(content, Path(path))
        for seed in range(_TRIED):
            check_configuration(scene.sample(seed))
    return scene


def _scene(content: SceneFile, file: Path) -> Scene:
    with within("robot"):
        robot = _named(content.robot, file, "a robot file")
        load_robot(robot)
    fixtures = []
    for i, listed in enumerate(content.fixtures):
        with within("fixtures", i):
            fixtures.append(_fixture(listed, file))
    objects: dict[str, ObjectSpec | str] = {}
    for name, entry in (content.objects or {}).items():
        with within("objects", name):
            objects[name] = _short(entry, file) if isinstance(entry, str) else _object(name, entry, file)
    if content.goal is not None and content.goals:
        raise FieldError(
            "a scene has a 'goal' or 'goals', and both are given: put the one into the list", "goal"
        )
    with within("goal"):
        goals = [_goal(content.goal)] if content.goal is not None else []
    for i, wanted in enumerate(content.goals):
        with within("goals", i):
            goals.append(_goal(wanted))
    scene = Scene(
        robot=robot,
        fixtures=fixtures,
        objects=objects,
        spots=[_spot(entry) for entry in content.spots],
        goals=goals,
        disturbed=content.disturbed,
        name=content.name or file.stem,
    )
    _check_areas(scene)
    _check_supports(scene, fixtures)
    return scene


def _named(name: str, file: Path, what: str, also: tuple[str, ...] = ()) -> str:
    return str(beside(file.parent, name, what)) if is_file(name, also) else name


def _fixture(entry: str | FixturePlacement, file: Path) -> str | FixtureSpec:
    if isinstance(entry, str):
        return _named(entry, file, "a fixture file", FURNITURE)
    at = None if entry.at is None else (entry.at[0], entry.at[1], *entry.at[2:3])
    return FixtureSpec(
        _named(entry.fixture, file, "a fixture file", FURNITURE),
        at,
        entry.yaw,
        entry.name or "",
        entry.area,
        entry.sensed,
        entry.parameters,
    )


def _short(text: str, file: Path) -> str | ObjectSpec:
    """A short entry; an object file that it names lies beside the scene file, or is bundled."""
    found = split_start(text)
    if found is None or not is_file(found[0]):
        return text
    named, word, reference = found
    on, inside, beside = (reference if word == each else "" for each in STARTS)
    return ObjectSpec(on=on, inside=inside, beside=beside, file=str(object_file(named, file.parent)))


def _object(name: str, entry: ObjectEntry, file: Path) -> ObjectSpec:
    source = file
    if entry.object is not None:
        with within("object"):
            named = object_file(entry.object, file.parent)
            source = file if entry.mesh is not None else named
            entry = overridden(load_object(named), entry)
    elif entry.kind is None and entry.mesh is None:
        with within("kind"):
            shape_kind(name)
        entry = entry.model_copy(update={"kind": (name,)})
    told = object_fields(entry, source, f"object '{name}'")
    if not (entry.on or entry.inside or entry.beside):
        raise FieldError(f"'objects.{name}.on' is missing: where it starts, or 'inside' or 'beside' what")
    spec = ObjectSpec(
        on=entry.on or "",
        inside=entry.inside or "",
        beside=entry.beside or "",
        distance=entry.distance,
        gap=entry.gap,
        movable=entry.movable,
        centre=entry.at or (0.0, 0.0),
        area=entry.area or ((0.0, 0.0) if entry.at is not None and not entry.beside else None),
        yaw=entry.heading,
        **told,
    )
    _check_density(name, spec)
    return spec


def _spot(entry: SpotEntry) -> SpotSpec:
    return SpotSpec(entry.name, entry.on, entry.at, entry.area, entry.extent, entry.heading)


def _goal(entry: GoalEntry) -> Goal:
    return Goal(
        entry.object,
        entry.place or "",
        entry.relation,
        entry.position_tolerance,
        entry.angle_tolerance,
        entry.height,
        entry.when,
        entry.distance,
        entry.value,
        entry.axis,
        entry.duration,
        on=entry.on or "",
        inside=entry.inside or "",
        beside=entry.beside or "",
    )


def _drawn(scene: Scene) -> Iterator[tuple[str, ObjectSpec | SpotSpec, Where]]:
    """What is drawn on places: how to call it, its spec, and where it stands in the file."""
    for name, spec in scene.objects.items():
        assert isinstance(spec, ObjectSpec)
        if spec.start[0] == "on" and spec.on not in scene.objects:
            yield f"object '{name}'", spec, ("objects", name, "at")
    for i, spot in enumerate(scene.spots):
        yield f"spot '{spot.name}'", spot, ("spots", i, "at")


def _check_areas(scene: Scene) -> None:
    """The areas in which things are drawn lie on their places."""
    extents = {p.name: (p.extent, p.centre) for f in scene.fixtures for p in load_fixture(f).places}
    extents |= {spot.name: (spot.extent, (0.0, 0.0)) for spot in scene.spots}
    for what, spec, where in _drawn(scene):
        extent, middle = extents[spec.on]
        for axis, letter in enumerate("xy"):
            reach = abs(spec.centre[axis] - middle[axis]) + (spec.area[axis] if spec.area else 0.0)
            if reach > extent[axis] / 2:
                raise FieldError(
                    f"{what} may be drawn {1000 * (reach - extent[axis] / 2):.0f} mm beyond the edge of "
                    f"'{spec.on}' along {letter}: change 'at' or 'area'",
                    *where,
                )


def _check_supports(scene: Scene, named: Sequence[str | FixtureSpec]) -> None:
    """No place of the fixtures ``named`` in the file is in mid-air; it may stand on another fixture."""
    fixtures = [load_fixture(name) for name in scene.fixtures]
    for i, name in enumerate(named):
        for k, place in enumerate(load_fixture(name).place_models()):
            origin = place.pose[:3]
            gap = min(fixture.distance(origin) for fixture in fixtures)
            if gap > FLOATING:
                raise FieldError(
                    f"place '{place.name}' of fixture '{place.fixture}' is in mid-air: its origin, "
                    f"'places[{k}].position' in the fixture's file, is {1000 * gap:.0f} mm from the nearest "
                    f"box of any fixture",
                    "fixtures",
                    i,
                )


def _smallest_exponents(spec: ObjectSpec) -> tuple[float, float]:
    low = spec.exponents[0]
    return low if isinstance(low, tuple) else (low, low)


def _check_density(name: str, spec: ObjectSpec) -> None:
    for kind in spec.kinds:
        small = (spec.size or KINDS[kind].size_range)[0]
        volume = shape(kind, ShapeSize(small, _smallest_exponents(spec), spec.mesh)).volume
        if spec.mass[1] > DENSEST * volume:
            raise FieldError(
                f"object '{name}': {spec.mass[1]:g} kg in {1e6 * volume:.3g} cm3 would be denser than any "
                f"metal: check its mass (kg) and size (m)",
                "mass",
            )
