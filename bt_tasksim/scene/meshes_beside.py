"""Mesh files that the scene of a Python file names by a path: looked up beside that file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from bt_tasksim.core.errors import InputError
from bt_tasksim.scene.scene import CurriculumStage, Scene
from bt_tasksim.scene.specs import ObjectSpec

_Spec = TypeVar("_Spec", ObjectSpec, ObjectSpec | str)


def with_meshes_beside(scene: Scene, folder: Path) -> Scene:
    """A scene whose objects have the mesh files that lie in a folder, else those of the working folder.

    Args:
        scene: The scene, with paths of meshes as they were written.
        folder: Folder of the file that made it.

    Returns:
        The same scene where nothing in it is named so.

    Raises:
        InputError: A mesh is in neither folder.
    """
    objects, stages = _objects(scene.objects, folder), [_stage(stage, folder) for stage in scene.stages]
    if _alike(objects.values(), scene.objects.values()) and _alike(stages, scene.stages):
        return scene
    return replace(scene, objects=objects, stages=tuple(stages))


def _stage(stage: CurriculumStage, folder: Path) -> CurriculumStage:
    objects = _objects(stage.objects, folder)
    scenes = [with_meshes_beside(scene, folder) for scene in stage.scenes]
    if _alike(objects.values(), stage.objects.values()) and _alike(scenes, stage.scenes):
        return stage
    return replace(stage, objects=objects, scenes=tuple(scenes))


def _objects(specs: Mapping[str, _Spec], folder: Path) -> dict[str, _Spec]:
    return {name: _with_mesh(name, spec, folder) for name, spec in specs.items()}


def _with_mesh(name: str, spec: _Spec, folder: Path) -> _Spec:
    if not isinstance(spec, ObjectSpec) or spec.mesh is None or Path(spec.mesh).is_absolute():
        return spec
    return replace(spec, mesh=_found(name, spec.mesh, folder))


def _alike(these: Iterable[object], those: Iterable[object]) -> bool:
    """The very same things in the same order."""
    return all(one is other for one, other in zip(these, those, strict=True))


def _found(name: str, mesh: str, folder: Path) -> str:
    beside = folder / mesh
    if beside.is_file():
        return str(beside.resolve())
    if Path(mesh).is_file():
        return mesh
    raise InputError(
        f"object '{name}': no mesh file '{mesh}' in {folder}, nor in the working folder {Path.cwd()}"
    )
