"""A command from outside: count the leaves of a tree."""

from typing import Annotated

import typer

from bt_tasksim.cli.options.tree import TreeOptions
from bt_tasksim.core.registry import register


@register("command", "count-leaves")
def count_leaves(
    tree: TreeOptions, least: Annotated[int, typer.Option(metavar="N", help="Fail below this count.")] = 0
) -> int:
    """Count the leaves of a tree."""
    count = sum(not node.children for node in tree.load().build().iterate())
    print(f"{count} leaves")
    return 0 if count >= least else 1
