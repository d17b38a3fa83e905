"""Trees by their names, for processes that build their own."""

from __future__ import annotations

from dataclasses import dataclass, field

from bt_tasksim.concept.plugins import load_all
from bt_tasksim.core.plugins import loaded
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.trees.load import TreeSource, load_source


@dataclass(frozen=True)
class NamedTree:
    """A tree and its scene by their names, from which another process builds them.

    Attributes:
        tree: Name or file of the tree.
        scene: Name or file of the scene, or None for the tree's own.
        robot: Name or file of the robot, or None for the scene's own.
        plugins: Plugins that the process loads first, by default those of this process.
    """

    tree: str
    scene: str | None = None
    robot: str | None = None
    plugins: tuple[str, ...] = field(default_factory=loaded)

    def load(self, options: EngineOptions) -> TreeSource:
        """The tree and its scene.

        Raises:
            InputError: There is no such plugin, tree, scene or robot, or it is no good.
        """
        load_all(self.plugins)
        return load_source(self.tree, self.robot, self.scene, world=options.own_world())
