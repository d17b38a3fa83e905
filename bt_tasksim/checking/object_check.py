"""``bt-tasksim check`` of an object: is it as heavy as it looks, does it stand, can a hand hold it?"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from bt_tasksim.checking.report import ERROR, WARNING, Report
from bt_tasksim.checking.scene_file import check_scene
from bt_tasksim.checking.scene_reach import is_reached
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.antipodal import width_at
from bt_tasksim.scene.grips import GivenGrip, fits_between
from bt_tasksim.scene.object_file import load_object, object_fields
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.scene_file import DENSEST
from bt_tasksim.scene.shapes import ShapeSize, shape, size_range
from bt_tasksim.scene.specs import ObjectSpec

LIGHT, HEAVY = 30.0, 9000.0
"""Densities, kg/m^3, of foam and of steel: outside of them a mass or a size is probably mistaken."""
SMALL, LARGE = 0.01, 0.5
"""Metres of a longest side between which a thing is one for a hand."""
MILLIMETRES = 0.001
"""Scale of a file in millimetres."""
ABOUT = 0.003
"""Metres by which the width of a grip may be other than what is measured."""
PLACE = "table"
NEARER = (0.0, -0.1, -0.2, -0.3, -0.35)
"""Metres along x from the middle of the table, where an object may be put for a shorter arm."""


def check_object(name: str, spec: ObjectSpec, robot: str = "panda", report: Report | None = None) -> Report:
    """Check an object by itself, on the table before a robot.

    Args:
        name: Its name.
        spec: What it may be; where it stands and how it is turned count for nothing.
        robot: Name of the robot that is to hold it, or its file.
        report: Where findings go; by default a new one.

    Raises:
        InputError: There can be no such object.
        MachineError: The physics engine is not installed.
    """
    report = Report() if report is None else report
    scene = _alone(name, spec, robot)
    actor = scene.sample(0).objects[0]
    extent, volume = actor.model().extent, actor.shape().volume
    light, heavy = (mass / volume for mass in spec.mass)
    sides = " x ".join(f"{1000 * side:.0f}" for side in extent)
    report.seen.append(
        f"size   {sides} mm, {1e6 * volume:.0f} cm3; with {spec.mass[0]:g} to {spec.mass[1]:g} kg "
        f"{light:.0f} to {heavy:.0f} kg/m3"
    )
    if not SMALL <= max(extent) <= LARGE:
        what = f"is {1000 * max(extent):.0f} mm long"
        report.add(WARNING, name, "size", what, "a file in millimetres wants scale: 0.001")
    if heavy > DENSEST:
        what = f"has {heavy:.0f} kg/m3, denser than any metal"
        report.add(ERROR, name, "mass", what, "see its mass (kg) and its size (m)")
    elif heavy < LIGHT or light > HEAVY:
        found = (
            f"{heavy:.0f} kg/m3, lighter than foam"
            if heavy < LIGHT
            else f"{light:.0f} kg/m3, denser than steel"
        )
        report.add(WARNING, name, "mass", f"has {found}", "see its mass (kg) and its size (m)")
    _check_given(name, spec, load_robot(robot).opening, report)
    check_scene(scene, report)
    report.done_rather(f"object {name}, {sides} mm, for {scene.robot}: size, density, grips, reach, rest")
    return report


def _alone(name: str, spec: ObjectSpec, robot: str) -> Scene:
    """A scene with the object in the middle of the table, or nearer, as far away as the arm reaches it."""

    def at(x: float) -> Scene:
        placed = replace(spec, on=PLACE, area=(0.0, 0.0), centre=(x, 0.0))
        return Scene(robot, objects={name: placed}, name=name)

    made = load_robot(robot)
    return next((scene for x in NEARER if is_reached(made, (scene := at(x)).sample(0), name)), at(0.0))


def _check_given(name: str, spec: ObjectSpec, opening: float, report: Report) -> None:
    """The grips that its file names are as wide as it is there, and none is too wide for the hand."""
    for i, grip in enumerate(spec.grasps):
        where = f"grasps[{i}]"
        if not fits_between(np.array(grip.width), opening):
            what = f"is {1000 * grip.width:.0f} mm wide, and the hand opens to {1000 * opening:.0f} mm"
            report.add(WARNING, name, where, what, "name a narrower one, or take another hand")
        measured = _measured(spec, grip)
        if measured is None:
            what = f"has fingers that close about {list(grip.point)} and meet nothing"
            report.add(ERROR, name, where, what, "see its 'point' and 'closing', in the frame of its middle")
        elif abs(measured - grip.width) > ABOUT:
            what = f"is said to be {1000 * grip.width:.0f} mm wide, and {1000 * measured:.0f} mm is measured"
            report.add(WARNING, name, where, what, "leave its 'width' away: then it is measured")


def _measured(spec: ObjectSpec, grip: GivenGrip) -> float | None:
    """Metres between fingers that close there; None: they meet nothing."""
    low, high = spec.size or size_range(spec.kinds[0], spec.mesh)
    if low != high:
        return grip.width  # it has no single one there
    solid = shape(spec.kinds[0], ShapeSize(low, mesh=spec.mesh))
    return width_at(solid.visual, np.array(grip.point), np.array(grip.closing))


def check_object_file(path: str | Path, robot: str = "panda") -> Report:
    """Check an object's file, see `check_object`.

    Raises:
        InputError: The file does not describe an object that can be.
        MachineError: The physics engine is not installed.
    """
    fields = object_fields(load_object(Path(path)), Path(path))
    return check_object(Path(path).stem, ObjectSpec(on=PLACE, **fields), robot)


def check_mesh(path: str | Path, robot: str = "panda") -> Report:
    """Check a mesh file as an object of kind ``mesh``, see `check_object`.

    Raises:
        InputError: The file is no mesh that can be an object.
        MachineError: The physics engine is not installed.
    """
    from bt_tasksim.scene.mesh_file import LARGEST, mesh_extent

    name, report = Path(path).stem, Report()
    x, y, z = mesh_extent(str(path))
    scale = 1.0
    if max(x, y, z) > LARGEST:
        scale = MILLIMETRES
        what = f"is {max(x, y, z):g} long in the numbers of its file, which looks like millimetres"
        report.add(WARNING, name, "scale", what, f"name it with scale: {scale:g}, as it is checked here")
    size = (x * scale, y * scale, z * scale)
    spec = ObjectSpec(("mesh",), PLACE, size=(size, size), mesh=str(path))
    return check_object(name, spec, robot, report)
