"""What a training or an evaluation is of, as hashes by name: whether one may go on from another's file."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from py_trees.behaviour import Behaviour

from bt_tasksim.core.own_code import code_hash, is_own, is_own_file, own_modules
from bt_tasksim.core.plugins import load_plugin
from bt_tasksim.core.renamed import former_names
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.run_log import tree_text
from bt_tasksim.robot.description import load_robot
from bt_tasksim.robot.urdf_visuals import mesh_files
from bt_tasksim.scene.fixtures import load_fixture
from bt_tasksim.scene.goal_functions import GoalFunction
from bt_tasksim.scene.scene import Scene, WorldSource
from bt_tasksim.scene.specs import ObjectSpec
from bt_tasksim.trees.load import tree_module
from bt_tasksim.trees.walk import nodes_of


def training_subject(
    tree: Behaviour,
    scene: WorldSource,
    layouts: Mapping[str, Any],
    node: str,
    options: EngineOptions,
    code: Mapping[str, str],
) -> dict[str, str]:
    """What a training is of, as hashes by name.

    Args:
        tree: The tree.
        scene: The scene.
        layouts: What the leaves under training see and decide, in plain data.
        node: Name of the node that is trained.
        options: Which engines.
        code: Hashes of code that takes part, see `own_code`.
    """
    return {
        "tree": _hash([_tree(tree), node]),
        **_world(scene),
        "layout of features and actions": _hash(layouts),
        "choice of engines": _engines(options),
        **code,
    }


def evaluation_subject(
    tree: Behaviour,
    scene: WorldSource,
    options: EngineOptions,
    policies: Mapping[str, str],
    code: Mapping[str, str],
    stream: str,
) -> dict[str, str]:
    """What an evaluation is of, as hashes by name.

    Args:
        tree: The tree.
        scene: The scene.
        options: Which engines.
        policies: Names of the policies in use, with their cards' hashes, by leaf.
        code: Hashes of code that takes part, see `own_code`.
        stream: Stream of draws.
    """
    return {
        "tree": _hash(_tree(tree)),
        **_world(scene),
        "choice of engines": _engines(options),
        "choice of policies": _hash(policies),
        "stream of draws": stream,
        **code,
    }


def own_code(
    tree: Behaviour, name: str = "", plugins: Iterable[str] = (), scene: WorldSource | None = None
) -> dict[str, str]:
    """Hashes of the code of people's own that takes part: the tree's file, plugins, and what these import.

    Comments and layout do not count, see `bt_tasksim.core.own_code`; nor does a script that is the process.

    Args:
        tree: The tree; the modules of its behaviours and models count.
        name: Name or file of the tree, which was loaded last; empty, or never loaded, where it came
            otherwise: somebody in this process has built it, and others will by this name.
        plugins: Plugins, loaded.
        scene: The scene; the modules of its goals that are functions count.

    Returns:
        Hashes by ``file NAME`` or ``module NAME``.
    """
    roots = [load_plugin(plugin) for plugin in plugins]
    if name.endswith(".py") and tree_module(name) in sys.modules:
        roots.append(sys.modules[tree_module(name)])
    parts = {type(part) for node in nodes_of(tree) for part in (node, getattr(node, "model", None))}
    goals = {goal.module for goal in getattr(scene, "goals", ()) if isinstance(goal, GoalFunction)}
    for module in ({part.__module__ for part in parts} | goals) - {"", "__main__", "__mp_main__"}:
        found = sys.modules.get(module)
        if found is not None and is_own(module, getattr(found, "__file__", None) or "<frozen"):
            roots.append(found)
    hashes: dict[str, list[str]] = {}
    for module, file in own_modules(roots).items():
        named_by_file = module.startswith(("_tree_", "_plugin_", "_scene_"))
        key = f"file {file.name}" if named_by_file else f"module {module}"
        hashes.setdefault(key, []).append(code_hash(file))
    return {key: of[0] if len(of) == 1 else _hash(sorted(of)) for key, of in hashes.items()}


def _tree(tree: Behaviour) -> Any:
    return tree_text(tree) or [[type(n).__qualname__, n.name, len(n.children)] for n in nodes_of(tree)]


def _world(scene: WorldSource) -> dict[str, str]:
    """Scene and robot, and the files that these name and that no package brings."""
    robot = load_robot(scene.robot)
    files = {robot.urdf, *mesh_files(robot.urdf)}
    world: Any
    if isinstance(scene, Scene):
        world = {
            "scene": _plain(dataclasses.replace(scene, robot="", name="")),
            "fixtures": [_plain(load_fixture(name)) for name in scene.fixtures],
        }
        files |= {Path(mesh) for mesh in _meshes(scene)}
    else:
        names = [*sorted(scene.object_names), *sorted(scene.place_names)]
        world = {"source": scene.name, "names": names}
        if hasattr(scene, "content"):
            world["content"] = scene.content()
    hashes: dict[str, list[str]] = {}
    for file in sorted(filter(is_own_file, files)):
        hashes.setdefault(f"file {file.name}", []).append(hashlib.sha256(file.read_bytes()).hexdigest())
    return {
        "scene": _hash(world),
        "robot": hashlib.sha256(robot.source.read_bytes()).hexdigest(),
        **{key: of[0] if len(of) == 1 else _hash(of) for key, of in hashes.items()},
    }


def _meshes(scene: Scene) -> set[str]:
    """Files of objects' meshes."""
    specs = [*scene.objects.values(), *(spec for stage in scene.stages for spec in stage.objects.values())]
    inner = {mesh for stage in scene.stages for other in stage.scenes for mesh in _meshes(other)}
    return inner | {spec.mesh for spec in specs if isinstance(spec, ObjectSpec) and spec.mesh is not None}


def _engines(options: EngineOptions) -> str:
    kept = {k: v for k, v in _plain(options).items() if k not in ("key", "timeout", "connect_timeout")}
    return _hash(kept)


def _plain(value: Any) -> Any:
    """A value as JSON can hold it; fields at their defaults are left out, so that new ones change nothing.

    A renamed field keeps its former name here, so that a hash of earlier versions still fits.
    """
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        first = {present: former for former, present in former_names(type(value)).items()}
        plain = {
            first.get(f.name, f.name): _plain(getattr(value, f.name))
            for f in dataclasses.fields(value)
            if not _is_default(f, getattr(value, f.name))
        }
        if isinstance(value, Scene) and "goals" in plain and len(value.goals) == 1:
            plain["goal"] = plain.pop("goals")[0]
        return plain
    if isinstance(value, Mapping):
        return {str(key): _plain(v) for key, v in value.items()}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, list | tuple | set | frozenset):
        return [_plain(v) for v in value]
    return value if isinstance(value, str | int | float | bool | None) else repr(value)


def _is_default(field: dataclasses.Field[Any], value: Any) -> bool:
    if field.default is not dataclasses.MISSING:
        return bool(np.all(field.default == value))
    return field.default_factory is not dataclasses.MISSING and bool(np.all(field.default_factory() == value))


def _hash(content: Any) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
