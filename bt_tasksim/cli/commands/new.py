"""``bt-tasksim new``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from bt_tasksim.cli.streams import say
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.registry import register


@register("command", "new")
def new(
    kind: Annotated[
        Literal["concept", "tree", "scene", "object", "robot"],
        typer.Argument(metavar="KIND", help="What to begin."),
    ],
    name: Annotated[str, typer.Argument(metavar="NAME", help="Its name, such as push or wipe_table.")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Write the files to this folder.")] = Path(),
    like: Annotated[
        str | None,
        typer.Option(
            metavar="EXAMPLE",
            help="Begin a concept with a worked example: push.  [default: a template to fill in]",
        ),
    ] = None,
    urdf: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Fill a robot in from its URDF, which lies in DIR or below.  [default: a Panda]",
        ),
    ] = None,
) -> None:
    """Start a concept, tree, scene, object or robot of your own.

    A concept comes with the tree in which it is trained and its test; a tree with its scene. Every file works
    as it is, and none is written over.
    """
    if like is not None and kind != "concept":
        raise InputError(f"new {kind}: --like is for concepts")
    if urdf is not None and kind != "robot":
        raise InputError(f"new {kind}: --urdf is for robots")
    if kind == "concept":
        from bt_tasksim.checking.new_concept import write_concept

        say(write_concept(name, out, like))
    elif kind == "robot":
        from bt_tasksim.checking.new_robot import write_robot

        say(write_robot(name, out, urdf))
    else:
        from bt_tasksim.checking import new_things

        write = {
            "tree": new_things.write_tree,
            "scene": new_things.write_scene,
            "object": new_things.write_object,
        }[kind]
        say(write(name, out))
