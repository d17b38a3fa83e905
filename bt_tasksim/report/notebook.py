"""Trees and decomposition graphs as pictures in Jupyter.

``from bt_tasksim import Scene``, or any other name, in a notebook is enough; `Result`, `Outcome` and
`Decomposition` show themselves.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import networkx as nx
    from py_trees.behaviour import Behaviour


def install() -> bool:
    """Have the running IPython show trees and graphs as SVG.

    The classes are named, not imported: nothing is loaded until one of them is shown.

    Returns:
        Whether an IPython runs in this process.
    """
    ipython = sys.modules.get("IPython")
    shell = ipython.get_ipython() if ipython is not None else None
    if shell is None:
        return False
    pictures = shell.display_formatter.formatters["image/svg+xml"]
    pictures.for_type_by_name("py_trees.behaviour", "Behaviour", tree_picture)
    pictures.for_type_by_name("networkx.classes.digraph", "DiGraph", graph_picture)
    return True


def tree_picture(tree: Behaviour) -> str:
    """A tree as SVG, with the statuses that its nodes have now."""
    from bt_tasksim.report.tree_picture import node_ids, tree_svg

    return tree_svg(tree, {name: node.status for name, node in node_ids(tree).items()})


def graph_picture(graph: nx.DiGraph[str]) -> str | None:
    """A decomposition graph as SVG; None for any other graph, which then shows itself as it always did."""
    if not {"demonstrations", "alternatives"} <= graph.graph.keys():
        return None
    from bt_tasksim.demos_decomp.picture import picture

    return picture(graph)
