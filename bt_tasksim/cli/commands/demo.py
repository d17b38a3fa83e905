"""``bt-tasksim demo``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bt_tasksim.cli.streams import say
from bt_tasksim.core.registry import register

LOG = ("demonstrations", "shelf_to_shelf", "00.h5")
SEED = 7


@register("command", "demo")
def demo(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Write the results to this folder.")] = Path(
        "runs/demo"
    ),
) -> int:
    """Turn a bundled demonstration into a tree and run it.

    The demonstration is a bundled one; the run is drawn, where this machine can.
    """
    from bt_tasksim.cli.running import run_into
    from bt_tasksim.core.resources import asset
    from bt_tasksim.demos_decomp import decompose_log, open_log, text_table
    from bt_tasksim.execution.pipelines import EngineOptions
    from bt_tasksim.report.tree_picture import tree_text
    from bt_tasksim.trees.from_graph import tree_from_graph
    from bt_tasksim.trees.load import load_source

    say(f"1. a demonstration (synthetic): {'/'.join(LOG)}")
    found = decompose_log(open_log(asset(*LOG)), None)
    say(text_table(found.tasks))
    tree = tree_from_graph(found.graph, "shelf to shelf")
    say("\n2. the tree it became")
    say(tree_text(tree))
    say("\n3. the tree runs on the Panda in SAPIEN")
    scene = load_source("shelf_to_shelf").scene
    result = run_into(out, tree, scene, SEED, EngineOptions(rendering=True), scene.name)
    return 0 if result.success else 1
