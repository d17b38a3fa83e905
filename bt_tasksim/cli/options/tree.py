"""Which tree, in which scene, with which robot."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import typer

from bt_tasksim.cli.options import completion

if TYPE_CHECKING:
    from bt_tasksim.scene.scene import WorldSource
    from bt_tasksim.trees.load import TreeSource


@dataclass(frozen=True)
class TreeOptions:
    """A tree by name, and what it runs in where that is not its own."""

    tree: Annotated[
        str,
        typer.Argument(
            metavar="TREE",
            help="A scenario, a .py file with build(), or an .xml file.",
            autocompletion=completion.trees,
        ),
    ]
    scene: Annotated[
        str | None,
        typer.Option(
            metavar="S",
            help="A scenario's scene, a .yaml file, or a .py file with scene(), if not the tree's own.",
            autocompletion=completion.scenes,
        ),
    ] = None
    robot: Annotated[
        str | None,
        typer.Option(
            metavar="R",
            help="panda, xarm7_ability, ... or a .yaml file.",
            autocompletion=completion.robots,
        ),
    ] = None
    nodes: Annotated[str | None, typer.Option(metavar="F.py", hidden=True, help="As --plugin.")] = None

    def load(self, policies: Iterable[tuple[str, str]] = (), world: WorldSource | None = None) -> TreeSource:
        """The tree and its scene.

        Args:
            policies: Concepts and the policies that their leaves take, whatever the tree says.
            world: The world that the engines bring, which then is the scene.

        Raises:
            InputError: There is no such tree, scene, robot or plugin, or one of them is no good.
        """
        from bt_tasksim.trees.load import load_source

        self.load_nodes()
        return load_source(self.tree, self.robot, self.scene, policies, world)

    def load_nodes(self) -> None:
        """Load the plugin that was named in the old way.

        Raises:
            InputError: There is no such file, or it fails.
        """
        if self.nodes is not None:
            from bt_tasksim.concept.plugins import load_parts

            load_parts(self.nodes)
