"""``bt-tasksim check`` of an object: is it as heavy as it looks, does it stand, can a hand hold it?"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from bt_tasksim.checking.report import WARNING, Report
from bt_tasksim.checking.scene_file import check_scene
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import ObjectSpec

LIGHT, HEAVY = 30.0, 9000.0
"""Densities, kg/m^3, of foam and of steel: outside of them a mass or a size is probably mistaken."""
SMALL, LARGE = 0.01, 0.5
"""Metres of a longest side between which a thing is one for a hand."""
MILLIMETRES = 0.001
"""Scale of a file in millimetres."""
PLACE = "table"


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
    alone = replace(spec, on=PLACE, area=(0.0, 0.0), centre=(0.0, 0.0))
    scene = Scene(robot, objects={name: alone}, name=name)
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
    if heavy < LIGHT or light > HEAVY:
        found = (
            f"{heavy:.0f} kg/m3, lighter than foam"
            if heavy < LIGHT
            else f"{light:.0f} kg/m3, denser than steel"
        )
        report.add(WARNING, name, "mass", f"has {found}", "see its mass (kg) and its size (m)")
    check_scene(scene, report)
    report.checked[-1] = f"object {name}, {sides} mm, for {scene.robot}: size, density, grips, reach, rest"
    return report


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
