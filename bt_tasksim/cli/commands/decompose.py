"""``bt-tasksim decompose``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bt_tasksim.cli.arguments import picture as svg
from bt_tasksim.cli.progress import progress
from bt_tasksim.cli.streams import say
from bt_tasksim.core.registry import register

if TYPE_CHECKING:
    from bt_tasksim.demos_decomp.log import Log


@register("command", "decompose")
def decompose(
    logs: Annotated[
        list[str],
        typer.Argument(
            metavar="LOG...",
            help="HDF5 logs, ManiSkill trajectories, or logs of runs; several are merged, as one activity.",
        ),
    ],
    episode: Annotated[
        str | None, typer.Option(metavar="K", help="One demonstration of each log, by number or name.")
    ] = None,
    json_: Annotated[
        Path | None, typer.Option("--json", metavar="F", help="Write tasks and graph as JSON.")
    ] = None,
    xml: Annotated[Path | None, typer.Option(metavar="F", help="Write the tree.")] = None,
    picture: Annotated[
        Path | None, typer.Option(metavar="F.svg", help="Write the graph as a picture.")
    ] = None,
) -> None:
    """Turn demonstration logs into tasks, a graph and a tree.

    A line a task: seconds, concept, object, what it does, confidence; of several demonstrations, in how many
    it was seen. Motion that no task explains is said below.
    """
    from bt_tasksim.core.files import check_targets, write_texts
    from bt_tasksim.demos_decomp import decompose_log
    from bt_tasksim.demos_decomp.picture import picture as picture_of
    from bt_tasksim.trees.from_graph import tree_from_graph
    from bt_tasksim.trees.xml_writer import tree_to_xml

    if picture is not None:
        svg(picture)
    check_targets((json_, xml, picture), logs)
    opened = [_opened(log) for log in logs]
    with progress("decomposing", None):
        found = decompose_log(opened[0] if len(opened) == 1 else opened, episode)
    named = ", ".join(f"'{log}'" for log in logs)
    say(found.table() or f"no task was recognised in {named}")
    for sentence in found.not_understood():
        say(f"not understood: {sentence}")
    scene, contents = _scene(opened), dict[str | Path, str]()
    if json_ is not None:
        contents[json_] = json.dumps(found.to_json(), indent=2) + "\n"
    if xml is not None:
        tree = tree_from_graph(found.graph, scene or Path(logs[0]).stem)
        contents[xml] = tree_to_xml(tree, scene=scene, file=xml)
    if picture is not None:
        contents[picture] = picture_of(found.graph)
    write_texts(contents)
    if contents:
        say("wrote " + ", ".join(map(str, contents)))


def _opened(log: str) -> Log:
    from bt_tasksim.demos_decomp import open_log

    logged = Path(log) / "run.h5"
    return open_log(logged if logged.is_file() else log)


def _scene(logs: Sequence[Log]) -> str | None:
    """The scenario whose name the demonstrations carry as their task, if there is one."""
    from bt_tasksim.trees.load import scenarios

    tasks = {d.task for log in logs for d in log.demonstrations}
    name = next(iter(tasks)) if len(tasks) == 1 else ""
    return name if name in scenarios() else None
