"""What ``bt-tasksim check`` is given: a concept, a tree with its scene, a robot, a scene or an object."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from bt_tasksim.checking.report import Report
from bt_tasksim.core.document import read_document
from bt_tasksim.core.errors import InputError, nearest
from bt_tasksim.core.registry import parts

ROBOT = {"urdf", "arm", "hand", "tool", "tips", "base_link"}
"""Fields of which a robot's file has one at least, and no other file."""
SCENE = {"objects", "goal", "goals", "spots", "fixtures", "disturbed"}
"""Likewise of a scene's."""
OBJECT = {"mesh", "kind", "scale", "size", "mass", "grasps", "class"}
"""Likewise of an object's."""
FIXTURE = {"boxes", "places"}
"""Likewise of furniture's."""


def check_file(
    file: str, tree: str | None = None, robot: str | None = None, scene: str | None = None
) -> Report:
    """Check what a file holds.

    See `concept_file.check`, `check_robot`, `check_scene`, `check_object_file` and `check_mesh`.

    Args:
        file: The file, or the name of a robot.
        tree: The tree in which concepts are seen at work.
        robot: Name or file of the robot for a scene or an object; by default the scene's own.
        scene: Name or file of the scene in which a tree is checked; by default the tree's own.

    Raises:
        InputError: There is no such file, it is of no kind that is checked, or it cannot be read.
        MachineError: A library is not installed.
    """
    path = Path(file)
    if scene is not None and path.suffix not in (".xml", ".py"):
        raise InputError(f"--scene is the scene of a tree, and '{file}' is none: give an .xml or a .py file")
    if not path.suffix:
        if file not in parts("robot"):
            raise InputError(f"there is no robot '{file}'{nearest(file, parts('robot'))}; or name a file")
        return _robot(file)
    if not path.is_file():
        raise InputError(f"there is no file '{file}'")
    if path.suffix == ".xml" or (path.suffix == ".py" and scene is not None):
        return _tree(file, robot, scene)
    if path.suffix == ".py":
        return _code(file, tree, robot)
    from bt_tasksim.scene.mesh_file import FORMATS

    if path.suffix.lower().removeprefix(".") in FORMATS:
        from bt_tasksim.checking.object_check import check_mesh

        return check_mesh(file, **({} if robot is None else {"robot": robot}))
    content = read_document(file, "file").value
    keys = set(content) if isinstance(content, Mapping) else set()
    if keys & ROBOT:
        return _robot(file)
    if keys & SCENE:
        return _scene(file, robot)
    if keys & FIXTURE:
        raise InputError(f"'{file}' is furniture: name it in the 'fixtures' of a scene, and check that")
    if keys & OBJECT:
        from bt_tasksim.checking.object_check import check_object_file

        return check_object_file(file, **({} if robot is None else {"robot": robot}))
    raise InputError(
        f"'{file}' is neither a robot's file (urdf, arm, hand ...) nor a scene's (objects, goal ...) nor an "
        "object's (mesh, kind, grasps ...): give one of these, a mesh, a tree's .xml file, or a Python file "
        "with a concept or a scene()"
    )


def _code(file: str, tree: str | None, robot: str | None) -> Report:
    """The concepts of a Python file; where it has none, its scene."""
    from bt_tasksim.checking import concept_file
    from bt_tasksim.trees.load import has_scene, own_nodes

    if tree is None and not own_nodes(file, needed=False) and has_scene(file):
        return _scene_and_tree(file, robot)
    return concept_file.check(file, tree)


def _scene_and_tree(file: str, robot: str | None) -> Report:
    """The scene of a Python file, and its tree, if it builds one: its names have to be in the scene."""
    from bt_tasksim.trees.load import has_tree

    return _tree(file, robot) if has_tree(file) else _scene(file, robot)


def _tree(file: str, robot: str | None, scene: str | None = None) -> Report:
    """A tree and the scene that it runs in, its own unless another one is named."""
    from bt_tasksim.checking.scene_file import check_scene
    from bt_tasksim.checking.tree_parts import check_parts
    from bt_tasksim.scene.scene import Scene
    from bt_tasksim.trees.load import load_source

    source = load_source(file, robot, scene)
    assert isinstance(source.scene, Scene), "no engine brings a world of its own here"
    report, tree = check_scene(source.scene), source.build()
    check_parts(tree, source.scene, report)
    count = sum(1 for _ in tree.iterate())
    nodes = f"{count} node{'' if count == 1 else 's'}"
    report.done(f"tree {source.name}, {nodes}: shape, memory, names of objects and places, ways of parts")
    return report


def _robot(robot: str) -> Report:
    from bt_tasksim.checking.robot_file import check_robot

    return check_robot(robot)


def _scene(file: str, robot: str | None) -> Report:
    from bt_tasksim.checking.scene_file import check_scene
    from bt_tasksim.trees.load import load_scene_of

    return check_scene(load_scene_of(file, robot))
