"""``bt-tasksim decompose``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bt_tasksim.cli.arguments import picture as svg
from bt_tasksim.cli.progress import progress
from bt_tasksim.core.registry import register

if TYPE_CHECKING:
    from bt_tasksim.demos_decomp.log import Log


@register("command", "decompose")
def decompose(
    log: Annotated[
        str, typer.Argument(metavar="LOG", help="An HDF5 log, a ManiSkill trajectory, or a run's log.")
    ],
    episode: Annotated[
        str | None, typer.Option(metavar="K", help="One demonstration of the log, by number or name.")
    ] = None,
    json_: Annotated[
        Path | None, typer.Option("--json", metavar="F", help="Write tasks and graph as JSON.")
    ] = None,
    xml: Annotated[Path | None, typer.Option(metavar="F", help="Write the tree.")] = None,
    picture: Annotated[
        Path | None, typer.Option(metavar="F.svg", help="Write the graph as a picture.")
    ] = None,
) -> None:
    """Turn a demonstration log into tasks, a graph and a tree."""
    from bt_tasksim.core.files import write_text
    from bt_tasksim.demos_decomp import decompose_log, open_log, text_table, write_picture
    from bt_tasksim.trees.from_graph import tree_from_graph
    from bt_tasksim.trees.xml_writer import save_tree

    if picture is not None:
        svg(picture)
    logged = Path(log) / "run.h5"
    opened = open_log(logged if logged.is_file() else log)
    with progress("decomposing", None):
        found = decompose_log(opened, episode)
    print(text_table(found.tasks) or f"no task was recognised in '{log}'")
    for name in (name for name, tasks in found.demonstrations.items() if not tasks):
        for remark in found.remarks[name]:
            print(f"{name}: {remark}")
    scene, wrote = _scene(opened), []
    if json_ is not None:
        write_text(json_, json.dumps(found.to_json(), indent=2) + "\n")
        wrote.append(json_)
    if xml is not None:
        save_tree(tree_from_graph(found.graph, scene or Path(log).stem), xml, scene=scene)
        wrote.append(xml)
    if picture is not None:
        write_picture(found.graph, picture)
        wrote.append(picture)
    if wrote:
        print("wrote " + ", ".join(map(str, wrote)))


def _scene(log: Log) -> str | None:
    """The scenario whose name the demonstrations carry as their task, if there is one."""
    from bt_tasksim.trees.load import scenarios

    tasks = {d.task for d in log.demonstrations}
    name = next(iter(tasks)) if len(tasks) == 1 else ""
    return name if name in scenarios() else None
