"""Trees by name: a scenario, a Python file with ``build()``, or an XML file; each with its scene."""

from __future__ import annotations

import functools
import importlib
import importlib.util
import pkgutil
import sys
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from py_trees.behaviour import Behaviour

from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.leaf import ConceptNode, ModelLeaf
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.core.errors import InputError, nearest
from bt_tasksim.core.former import advice
from bt_tasksim.core.own_files import code_of
from bt_tasksim.core.plugins import line_in
from bt_tasksim.policy.policy import concept_name
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.scene import Scene, WorldSource
from bt_tasksim.trees.check import check_tree
from bt_tasksim.trees.named_files import scene_beside

Leaves = dict[str, type[ConceptModel] | type[Condition]]
"""Concepts and conditions by name."""


class NoSceneError(InputError):
    """A tree says nothing of its scene, and none was named."""


@dataclass(frozen=True)
class TreeSource:
    """Where a tree comes from.

    Attributes:
        name: The scenario's name or the file's.
        build: Builds a fresh tree.
        scene: The scene it runs in.
    """

    name: str
    build: Callable[[], Behaviour]
    scene: WorldSource


def scenarios() -> list[str]:
    """Names of the ready-made scenarios."""
    from bt_tasksim.trees import scenarios

    return sorted(m.name for m in pkgutil.iter_modules(scenarios.__path__))


def load_source(
    tree: str,
    robot: str | None = None,
    scene: str | None = None,
    policies: Iterable[tuple[str, str]] = (),
    world: WorldSource | None = None,
) -> TreeSource:
    """The tree and scene that a name stands for.

    Args:
        tree: Name of a scenario, or path of a ``.py`` or ``.xml`` file.
        robot: Name or file of the robot; by default the scene's own.
        scene: Name of a scenario whose scene is taken, or path of a ``.yaml`` file, or of a ``.py`` file with
            ``scene()``; by default the tree's own. The one that an XML tree names is no ``.py`` file.
        policies: Concepts and the policies that their leaves take, see `with_policies`.
        world: The world that the engines bring, which then is the scene.

    Raises:
        InputError: There is no such tree, scene or robot, the file is no good, or its ``scene`` does not
            take the robot that is named, or a scene is named beside the engines' own world.
        NoSceneError: The tree says nothing of its scene, and none is named.
    """
    path, policies = Path(tree), tuple(policies)
    given = frozenset(concept.lower() for concept, _ in policies)
    if robot is not None:
        load_robot(robot)
    if world is not None and scene is not None:
        raise InputError(f"the engines bring a world of their own, '{world.name}': leave --scene away")
    if world is not None and robot is not None:
        world = world.with_robot(robot)
    if path.suffix == ".py":
        module = _module(path)
        build = _function(module, "build", path)
        build = functools.partial(_called, build, path)
        own = getattr(module, "scene", None)
        if world is None:
            if scene or own is None:
                world = _scene(scene, robot)
            else:
                world = _made(_function(module, "scene", path), robot, path)
        source = TreeSource(path.stem, build, world)
    elif path.suffix == ".xml":
        source = _from_xml(path, robot, scene, world, given)
    else:
        source = TreeSource(tree, _scenario(tree).build, world or _scene(scene or tree, robot))
    if path.suffix == ".xml":
        from bt_tasksim.trees.xml_reader import load_tree_with_lines

        root, where = load_tree_with_lines(path, given=given)
        check_names(root, source.scene, where)
    else:
        check_names(_checked(source.build(), tree), source.scene)
    source = replace(source, build=with_policies(source.build, policies))
    source.build()
    return source


def load_root(tree: str, given: Collection[str] = frozenset()) -> Behaviour:
    """The tree that a name stands for, whatever its scene.

    Args:
        tree: Name of a scenario, or path of a ``.py`` or ``.xml`` file.
        given: Concepts, in lower case, whose policies the caller gives, see `load_tree`.

    Raises:
        InputError: There is no such tree, or the file is no good.
    """
    from bt_tasksim.trees.xml_reader import load_tree

    path = Path(tree)
    if path.suffix == ".xml":
        return load_tree(path, given=given)
    if path.suffix == ".py":
        root = _called(_function(_module(path), "build", path), path)
    else:
        root = _scenario(tree).build()
    return _checked(root, tree)


def with_policies(
    build: Callable[[], Behaviour], policies: Iterable[tuple[str, str]]
) -> Callable[[], Behaviour]:
    """A tree's ``build`` whose trees have other policies.

    Args:
        build: Builds a fresh tree.
        policies: Pairs of a concept's name, such as ``grasp``, and the policy that every leaf of this concept
            takes, whatever the tree itself says: ``programmed``, or a policy's name or folder.

    Raises:
        InputError: A concept is named twice, or (when the tree is built) has no leaf in the tree.
    """
    wanted: dict[str, str] = {}
    for concept, policy in policies:
        if concept.lower() in wanted:
            raise InputError(f"the policy of '{concept}' is given twice: give one")
        wanted[concept.lower()] = policy
    return functools.partial(_built_with, build, wanted) if wanted else build


def _built_with(build: Callable[[], Behaviour], wanted: Mapping[str, str]) -> Behaviour:
    root = build()
    leaves = [leaf for leaf in root.iterate() if isinstance(leaf, ConceptNode)]
    concepts = {concept_name(type(leaf.model)) for leaf in leaves}
    for concept in wanted:
        if concept not in concepts:
            raise InputError(
                f"a policy is given for '{concept}', and the tree has no leaf of this concept"
                f"{nearest(concept, concepts)}"
            )
    for leaf in leaves:
        policy = wanted.get(concept_name(type(leaf.model)))
        if policy is not None:
            leaf.policy = policy
    return root


def check_names(
    root: Behaviour, scene: WorldSource, where: Callable[[Behaviour], str] = lambda leaf: ""
) -> None:
    """Check that every object and place that the tree names is in the scene.

    Args:
        root: The tree's root.
        scene: The scene.
        where: Where a leaf stands, for the error's sentence.

    Raises:
        InputError: One is not; says which leaf names it and what there is.
    """
    objects, places = set(scene.object_names), set(scene.place_names)
    for leaf in root.iterate():
        if not isinstance(leaf, ModelLeaf):
            continue
        for key, parameter in leaf.model.parameters().items():
            value = leaf.model.values[key]
            if value is None:
                continue
            if parameter.quantity.kind == "object" and value not in objects:
                raise InputError(
                    f"{where(leaf)}leaf '{leaf.name}': no object '{value}' in the scene '{scene.name}'"
                    f"{nearest(value, objects)}"
                )
            if parameter.quantity.kind == "place" and value not in places | objects:
                raise InputError(
                    f"{where(leaf)}leaf '{leaf.name}': no place '{value}' in the scene '{scene.name}'"
                    f"{nearest(value, places | objects)}"
                )


def has_scene(file: str) -> bool:
    """A Python file has a function ``scene()``.

    Raises:
        InputError: The file is missing or fails.
    """
    return callable(getattr(_module(Path(file)), "scene", None))


def has_tree(file: str) -> bool:
    """A Python file has a function ``build()``.

    Raises:
        InputError: The file is missing or fails.
    """
    return callable(getattr(_module(Path(file)), "build", None))


def load_scene_of(file: str, robot: str | None = None) -> Scene:
    """The scene of a scene file, or of the ``scene()`` of a Python file.

    Args:
        file: The file.
        robot: Name or file of the robot; by default the scene's own.

    Raises:
        InputError: It is no good.
    """
    path = Path(file)
    if path.suffix != ".py":
        return _scene(file, robot)
    return _made(_function(_module(path, "scene"), "scene", path), robot, path)


def own_nodes(file: str, needed: bool = True) -> Leaves:
    """The concepts and conditions that a Python file defines, by name.

    Args:
        file: The file.
        needed: It should define one at least.

    Raises:
        InputError: The file is missing, fails, or defines none though it should.
    """
    module = _module(Path(file))
    found: Leaves = {
        name: value
        for name, value in vars(module).items()
        if isinstance(value, type)
        and issubclass(value, ConceptModel | Condition)
        and value.__module__ == module.__name__
    }
    if needed and not found:
        raise InputError(f"'{file}' defines no concept and no condition")
    return found


def names_in(root: Behaviour) -> tuple[set[str], set[str]]:
    """Objects and places that a tree names."""
    objects: set[str] = set()
    places: set[str] = set()
    for leaf in root.iterate():
        if isinstance(leaf, ModelLeaf):
            for key, parameter in leaf.model.parameters().items():
                if leaf.model.values[key] is not None and parameter.quantity.kind == "object":
                    objects.add(leaf.model.values[key])
                if leaf.model.values[key] is not None and parameter.quantity.kind == "place":
                    places.add(leaf.model.values[key])
    return objects, places


def _scenario(tree: str) -> Any:
    """The module of a ready-made scenario."""
    if Path(tree).suffix in (".h5", ".hdf5"):
        raise InputError(
            f"'{tree}' is a log: make a tree of it with 'bt-tasksim decompose {tree} --xml tree.xml'"
        )
    if tree not in scenarios():
        raise InputError(f"no scenario '{tree}'{nearest(tree, scenarios())} (or give a .py or .xml file)")
    return importlib.import_module(f"bt_tasksim.trees.scenarios.{tree}")


def _checked(root: Any, tree: str) -> Behaviour:
    if not isinstance(root, Behaviour):
        raise InputError(f"'{tree}': build() should return a py_trees behaviour, found {type(root).__name__}")
    check_tree(root)
    return root


def _from_xml(
    path: Path, robot: str | None, scene: str | None, world: WorldSource | None, given: Collection[str]
) -> TreeSource:
    from bt_tasksim.trees.xml_reader import load_tree, scene_of_tree

    build = functools.partial(load_tree, path, given=given)
    root = build()
    if world is not None:
        return TreeSource(path.stem, build, world)
    named = scene or scene_of_tree(path)
    if named is None:
        fitting = [name for name in scenarios() if _fits(root, name, robot)]
        if not fitting:
            objects, places = names_in(root)
            raise NoSceneError(
                f"'{path}' does not say in which scene it runs, and no ready-made one has "
                f"{', '.join(sorted(objects | places))}: name one with --scene"
            )
        named = fitting[0]
    elif scene is None:
        if named.endswith(".py"):  # a tree that was handed on opens no code
            raise InputError(
                f"'{path}' names the scene '{named}', and a tree's file runs no Python: if you trust it, "
                f"give --scene {path.parent / named}"
            )
        if named.endswith((".yaml", ".yml")):
            named = scene_beside(named, path)
    return TreeSource(path.stem, build, _scene(named, robot))


def _fits(root: Behaviour, scenario: str, robot: str | None) -> bool:
    """A scenario has what a tree names; not so one that asks the robot for more than is installed here."""
    try:
        check_names(root, _scene(scenario, robot))
    except InputError:
        return False
    return True


def _scene(name: str | None, robot: str | None) -> Scene:
    if name is None:
        raise NoSceneError("the tree's file has no scene() and none was named: add one, or use --scene")
    if name.endswith((".yaml", ".yml")):
        from bt_tasksim.scene.scene_file import load_scene

        scene = load_scene(name)
        return scene if robot is None else scene.with_robot(robot)
    if name.endswith(".py"):
        return load_scene_of(name, robot)
    if Path(name).suffix:
        raise InputError(
            f"'{name}' is no scene: give a scenario's name, a .yaml file, or a .py file with scene()"
        )
    if name not in scenarios():
        raise InputError(f"no scene '{name}'{nearest(name, scenarios())} (or give a .yaml or .py file)")
    module = importlib.import_module(f"bt_tasksim.trees.scenarios.{name}")
    made: Scene = module.scene() if robot is None else module.scene(robot)
    return made


def _made(build: Any, robot: str | None, path: Path) -> Scene:
    made = _called(build, path) if robot is None else _called(build, path, robot)
    if not isinstance(made, Scene):
        raise InputError(f"'{path}': scene() should return a Scene, found {type(made).__name__}")
    if robot is not None and made.robot != made.with_robot(robot).robot:
        raise InputError(
            f"'{path}': scene() gives robot '{made.robot}', though --robot asks for '{robot}': "
            "pass its argument robot on to Scene(robot)"
        )
    return made


def tree_module(tree: str) -> str:
    """Name of the module that a tree's Python file is loaded as."""
    return f"_tree_{Path(tree).stem}"


def _module(path: Path, what: str = "tree") -> Any:
    if not path.is_file():
        raise InputError(f"there is no {what} file '{path}'")
    spec = importlib.util.spec_from_file_location(f"_{what}_{path.stem}", path)
    assert spec is not None and spec.loader is not None
    folder = str(path.resolve().parent)
    if folder not in sys.path:  # as for a script: it may import what stands beside it
        sys.path.append(folder)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    _called(spec.loader.exec_module, path, module)
    return module


def _called(function: Callable[..., Any], path: Path, *arguments: Any) -> Any:
    """What a function of a tree's file returns; whatever it raises is one sentence with the line."""
    try:
        with code_of(path):
            return function(*arguments)
    except InputError as error:
        line = line_in(error, path)
        if not line or path.name in str(error):
            raise
        raise InputError(f"'{path}'{line}: {error}") from error
    except (Exception, SystemExit) as error:
        text = (error.msg if isinstance(error, SyntaxError) else str(error)) or "no reason given"
        where = f"'{path}'{line_in(error, path)}"
        raise InputError(f"{where}: {type(error).__name__}: {text}{advice(error)}") from error


def _function(module: Any, name: str, path: Path) -> Any:
    function = getattr(module, name, None)
    if not callable(function):
        returned = "a Scene" if name == "scene" else "the tree's root"
        found = "" if function is None else f", {name} is {type(function).__name__}"
        raise InputError(f"'{path}' has no function {name}(){found}: define one that returns {returned}")
    return function
