"""``bt-tasksim evaluate``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bt_tasksim.cli import arguments
from bt_tasksim.cli.arguments import Seed
from bt_tasksim.cli.options.engines import EngineFlags, policies
from bt_tasksim.cli.options.tree import TreeOptions
from bt_tasksim.cli.progress import progress
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.registry import register


@register("command", "evaluate")
def evaluate(
    tree: TreeOptions,
    engines: EngineFlags,
    seed: Seed = 0,
    episodes: Annotated[
        int, typer.Option(parser=arguments.episodes, metavar="N", help="Number of draws.")
    ] = 100,
    workers: Annotated[
        int, typer.Option(parser=arguments.workers, metavar="W", help="Worker processes.")
    ] = 1,
    json_: Annotated[
        Path | None, typer.Option("--json", metavar="F", help="Write every episode as JSON.")
    ] = None,
) -> None:
    """Run a tree on many seeded draws and count successes."""
    from bt_tasksim.training import evaluation

    if seed + episodes > arguments.SEEDS:
        raise InputError(f"evaluate: the last seed would be {seed + episodes - 1}, beyond 64 bits")
    tree.load_nodes()
    chosen = policies(engines.policy)
    job = evaluation.Job(tree.tree, tree.scene, tree.robot, engines.options(), chosen)
    keep = None if json_ is None else evaluation.EvaluationFile(json_)
    try:
        with progress("episodes", episodes) as advance:
            found = evaluation.evaluate(
                job,
                range(seed, seed + episodes),
                workers,
                lambda outcome: advance(outcome.success),
                keep=keep,
            )
    except evaluation.EvaluationInterrupted as stop:
        print("\n".join(stop.evaluation.lines()))
        raise
    print("\n".join(found.lines()))
    if json_ is not None:
        print(f"wrote {json_}")
