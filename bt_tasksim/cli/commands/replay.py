"""``bt-tasksim replay``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bt_tasksim.cli.options import completion
from bt_tasksim.cli.options.engines import Policy, policies
from bt_tasksim.cli.progress import progress
from bt_tasksim.cli.streams import say
from bt_tasksim.core.registry import register


@register("command", "replay")
def replay(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A run's folder or its run.h5.")],
    tree: Annotated[
        str | None,
        typer.Option(
            metavar="TREE",
            help="The run's tree, where the log cannot hold it: a scenario, a .py file with build(), or an "
            ".xml file.",
            autocompletion=completion.trees,
        ),
    ] = None,
    robot: Annotated[
        str | None,
        typer.Option(
            metavar="R",
            help="The run's robot, if it is not a bundled one.",
            autocompletion=completion.robots,
        ),
    ] = None,
    policy: Policy = [],  # noqa: B006  # Typer's way
    objects: Annotated[
        Path | None, typer.Option(metavar="DIR", help="The run's mesh files, if they are not bundled ones.")
    ] = None,
) -> int:
    """Repeat a logged run and compare it state by state.

    A log is believed in numbers and names only: whatever else it needs is named here.
    """
    from bt_tasksim.execution import replay
    from bt_tasksim.trees.load import load_root

    named = policies(policy)
    root = None if tree is None else load_root(tree, {concept.lower() for concept, _ in named})
    with progress("replaying", None):
        found = replay.replay(run, root, robot=robot, policies=named, objects=objects)
    say(found.why)
    return 0 if found.identical else 1
