"""``bt-tasksim show``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bt_tasksim.cli.arguments import picture as svg
from bt_tasksim.cli.options.tree import TreeOptions
from bt_tasksim.cli.streams import say
from bt_tasksim.core.registry import register


@register("command", "show")
def show(
    tree: TreeOptions,
    picture: Annotated[Path | None, typer.Option(metavar="F.svg", help="Write a picture.")] = None,
    xml: Annotated[Path | None, typer.Option(metavar="F", help="Write the tree as XML.")] = None,
) -> None:
    """Print a tree, or write its picture."""
    from bt_tasksim.core.files import check_targets, write_texts
    from bt_tasksim.report.tree_picture import tree_svg, tree_text
    from bt_tasksim.trees.load import NoSceneError, load_root, scenarios
    from bt_tasksim.trees.xml_writer import tree_to_xml

    if picture is not None:
        svg(picture)
    check_targets((picture, xml), (tree.tree, tree.scene, tree.robot))
    try:
        source = tree.load()
        root, scene = source.build(), source.scene.name
    except NoSceneError:  # a tree can be looked at without one
        root, scene = load_root(tree.tree), ""
    say(tree_text(root))
    contents: dict[str | Path, str] = {}
    if picture is not None:
        contents[picture] = tree_svg(root)
    if xml is not None:
        named = tree.scene or (scene if scene in scenarios() else None)
        contents[xml] = tree_to_xml(root, scene=named, file=xml)
    write_texts(contents)
    for path in contents:
        say(f"wrote {path}")
