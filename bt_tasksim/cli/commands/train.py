"""``bt-tasksim train``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bt_tasksim.cli import arguments
from bt_tasksim.cli.options.tree import TreeOptions
from bt_tasksim.cli.progress import training_progress
from bt_tasksim.cli.streams import say
from bt_tasksim.core.registry import register


@register("command", "train")
def train(
    tree: TreeOptions,
    steps: Annotated[
        int | None,
        typer.Option(
            parser=arguments.steps, metavar="N", help="Decisions for each node.  [default: 1000000]"
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="The policy's folder.  [default: runs/train-...]")
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            parser=arguments.workers,
            metavar="W",
            help="Worker processes, or actors of a cluster.",
            show_default="one for each core; of a cluster of others one for 16 environments",
        ),
    ] = None,
    cluster: Annotated[
        str | None,
        typer.Option(metavar="A", help="Run on a Ray cluster: local, or its address HOST:PORT."),
    ] = None,
    engines: Annotated[
        str | None,
        typer.Option(
            metavar="E", help="Physics: sapien, mujoco, maniskill:ENV or a plugin's.  [default: sapien]"
        ),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(parser=arguments.seed, metavar="S", help="Seed.  [default: 0]")
    ] = None,
    settings: Annotated[
        Path | None, typer.Option(metavar="F", help="Training settings, .json or .yaml.")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue from the last checkpoint.")] = False,
    backward: Annotated[
        bool, typer.Option("--backward", help="Then fine-tune all nodes, the last one first.")
    ] = False,
) -> None:
    """Train the leaves that a tree's Train nodes mark."""
    from bt_tasksim.training import session

    tree.load_nodes()
    request = session.Request(
        tree=tree.tree,
        scene=tree.scene,
        robot=tree.robot,
        engines=engines,
        out=out,
        steps=steps,
        seed=seed,
        workers=workers,
        cluster=cluster,
        settings=settings,
        resume=resume,
        backward=backward,
    )
    with training_progress() as report:
        said = session.run(request, report)
    say(said)
