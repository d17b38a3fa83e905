"""What a training or an evaluation is of, as hashes by name: whether one may go on from another's file."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from py_trees.behaviour import Behaviour

from bt_tasksim.core.plugins import load_plugin
from bt_tasksim.core.renamed import former_names
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.run_log import tree_text
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.fixtures import load_fixture
from bt_tasksim.scene.scene import Scene, WorldSource
from bt_tasksim.trees.walk import nodes_of


def training_subject(
    tree: Behaviour, scene: WorldSource, layouts: Mapping[str, Any], node: str, options: EngineOptions
) -> dict[str, str]:
    """What a training is of, as hashes by name.

    Args:
        tree: The tree.
        scene: The scene.
        layouts: What the leaves under training see and decide, in plain data.
        node: Name of the node that is trained.
        options: Which engines.
    """
    return {
        "tree": _hash([_tree(tree), node]),
        **_world(scene),
        "layout of features and actions": _hash(layouts),
        "choice of engines": _engines(options),
    }


def evaluation_subject(
    tree: Behaviour,
    scene: WorldSource,
    options: EngineOptions,
    policies: Mapping[str, str],
    files: Mapping[str, str],
    stream: str,
) -> dict[str, str]:
    """What an evaluation is of, as hashes by name.

    Args:
        tree: The tree.
        scene: The scene.
        options: Which engines.
        policies: Names of the policies in use, with their cards' hashes, by leaf.
        files: Files of Python whose code takes part, by what they are.
        stream: Stream of draws.
    """
    code = {what: hashlib.sha256(Path(path).read_bytes()).hexdigest() for what, path in files.items()}
    return {
        "tree": _hash([_tree(tree), code]),
        **_world(scene),
        "choice of engines": _engines(options),
        "choice of policies": _hash(policies),
        "stream of draws": stream,
    }


def code_files(tree: str, plugins: Iterable[str]) -> dict[str, str]:
    """Files of Python whose code takes part, by what they are.

    Args:
        tree: Name or file of the tree.
        plugins: Plugins, loaded.
    """
    files = {plugin: getattr(load_plugin(plugin), "__file__", None) for plugin in plugins}
    code = {f"plugin {Path(plugin).name}": file for plugin, file in files.items() if file is not None}
    return code | ({"tree": tree} if tree.endswith(".py") else {})


def _tree(tree: Behaviour) -> Any:
    return tree_text(tree) or [[type(n).__qualname__, n.name, len(n.children)] for n in nodes_of(tree)]


def _world(scene: WorldSource) -> dict[str, str]:
    if isinstance(scene, Scene):
        world = {
            "scene": _plain(dataclasses.replace(scene, robot="", name="")),
            "fixtures": [_plain(load_fixture(name)) for name in scene.fixtures],
        }
    else:
        world = {"source": scene.name, "names": [*sorted(scene.object_names), *sorted(scene.place_names)]}
    source = load_robot(scene.robot).source
    return {"scene": _hash(world), "robot": hashlib.sha256(source.read_bytes()).hexdigest()}


def _engines(options: EngineOptions) -> str:
    kept = {k: v for k, v in _plain(options).items() if k not in ("key", "timeout", "connect_timeout")}
    return _hash(kept)


def _plain(value: Any) -> Any:
    """A value as JSON can hold it; fields at their defaults are left out, so that new ones change nothing.

    A renamed field keeps its former name here, so that a hash of earlier versions still fits.
    """
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        first = {present: former for former, present in former_names(type(value)).items()}
        return {
            first.get(f.name, f.name): _plain(getattr(value, f.name))
            for f in dataclasses.fields(value)
            if not _is_default(f, getattr(value, f.name))
        }
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
