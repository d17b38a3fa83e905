"""``bt-tasksim check``."""

from __future__ import annotations

from typing import Annotated

import typer

from bt_tasksim.cli.options import completion
from bt_tasksim.cli.progress import progress
from bt_tasksim.cli.streams import say
from bt_tasksim.core.registry import register


@register("command", "check")
def check(
    file: Annotated[
        str,
        typer.Argument(
            metavar="FILE",
            help="A Python file with a concept or a scene(), a tree's .xml file, the YAML file of a robot, a "
            "scene or an object, a mesh, or the name of a robot.",
        ),
    ],
    tree: Annotated[
        str | None,
        typer.Option(
            metavar="TREE",
            help="The tree to try a concept in.  [default: the one in FILE or train_FILE, or a scenario]",
        ),
    ] = None,
    robot: Annotated[
        str | None,
        typer.Option(metavar="ROBOT", help="The robot for a scene or an object.  [default: the scene's own]"),
    ] = None,
    scene: Annotated[
        str | None,
        typer.Option(
            metavar="SCENE",
            help="The scene to check a tree in: a scenario's, a .yaml file, or a .py file with scene().  "
            "[default: the tree's own]",
            autocompletion=completion.scenes,
        ),
    ] = None,
) -> int:
    """Check a concept, tree, robot, scene or object of your own.

    Says what is wrong with it and what to do; with an error it ends with 2. A mesh is checked as an object.
    """
    from bt_tasksim.checking.kinds import check_file

    with progress("checking", None):
        report = check_file(file, tree, robot, scene)
    say(*report.lines())
    return 2 if report.errors else 0
