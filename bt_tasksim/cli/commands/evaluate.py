"""``bt-tasksim evaluate``."""

from __future__ import annotations

import contextlib
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bt_tasksim.cli import arguments
from bt_tasksim.cli.arguments import Longest, Seed
from bt_tasksim.cli.options.engines import EngineFlags, policies
from bt_tasksim.cli.options.tree import TreeOptions
from bt_tasksim.cli.progress import progress
from bt_tasksim.cli.streams import say
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.plain import printable
from bt_tasksim.core.registry import register

if TYPE_CHECKING:
    from bt_tasksim.training.evaluation_outcomes import Evaluation


@register("command", "evaluate")
def evaluate(
    tree: TreeOptions,
    engines: EngineFlags,
    seed: Seed = 0,
    episodes: Annotated[
        int, typer.Option(parser=arguments.episodes, metavar="N", help="Number of draws.")
    ] = 100,
    workers: Annotated[
        int | None,
        typer.Option(
            parser=arguments.workers,
            metavar="W",
            help="Worker processes, or the most actors of a cluster.",
            show_default="1, from 200 episodes on one for each core; of a cluster what it has room for",
        ),
    ] = None,
    batch: Annotated[
        int | None,
        typer.Option(
            parser=arguments.batch,
            metavar="N",
            help="Worlds that run at once in each process.",
            show_default="64, or what memory has room for",
        ),
    ] = None,
    cluster: Annotated[
        str | None,
        typer.Option(metavar="A", help="Run on a Ray cluster: local, or its address HOST:PORT."),
    ] = None,
    json_: Annotated[
        Path | None, typer.Option("--json", metavar="F", help="Write every episode as JSON.")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on from the file of --json, after an interrupt or a kill.")
    ] = False,
    longest: Longest = None,
) -> None:
    """Run a tree on many seeded draws and count successes."""
    from bt_tasksim.core.files import alone, check_targets
    from bt_tasksim.core.identity import identity
    from bt_tasksim.execution.runner import LONGEST
    from bt_tasksim.training import evaluation
    from bt_tasksim.training.evaluation_file import EvaluationFile, check_ended, read_kept

    if resume and json_ is None:
        raise InputError("evaluate: --resume goes on from the file of --json: name it")
    if seed + episodes > arguments.SEEDS:
        raise InputError(f"evaluate: the last seed would be {seed + episodes - 1}, beyond 64 bits")
    check_targets([json_], (tree.tree, tree.scene, tree.robot))
    tree.load_nodes()
    chosen = policies(engines.policy)
    options = engines.options()
    if cluster is None and workers is None:
        workers = evaluation.usual_workers(options, episodes, batch)
    alone_here = cluster is None and workers == 1
    job = evaluation.Job(
        tree.tree,
        tree.scene,
        tree.robot,
        options,
        chosen,
        batch=batch,
        threads=os.cpu_count() or 1 if alone_here else 1,
        longest=longest or LONGEST,
    )
    keep = None if json_ is None else EvaluationFile(json_)

    def tell(found: Evaluation) -> None:
        say(*map(printable, found.lines()))

    only = contextlib.nullcontext() if json_ is None else alone(json_)
    try:
        with only, progress("episodes", episodes) as advance:
            if json_ is not None and not resume:
                check_ended(json_)
            kept = read_kept(json_, identity()) if resume and json_ is not None else None
            if kept is not None:
                say(kept.line)
            found = evaluation.evaluate(
                job,
                range(seed, seed + episodes),
                workers,
                lambda outcome: advance(outcome.success),
                keep=keep,
                stopped=tell,
                kept=kept,
                cluster=cluster,
            )
    except evaluation.EvaluationInterrupted as stop:
        tell(stop.evaluation)
        raise
    tell(found)
    if not found.successes and (own := _own_concepts(tree.tree)):
        say(f"  none succeeded: 'bt-tasksim check {own}' tries the concepts in it, and says what to mend")
    if json_ is not None:
        say(f"wrote {json_}")


def _own_concepts(tree: str) -> str:
    """The file of a tree, or else of a plugin, that defines concepts of its own; empty where none does."""
    from bt_tasksim.concept.model import ConceptModel
    from bt_tasksim.core.plugins import load_plugin, loaded
    from bt_tasksim.trees.load import tree_module

    files = {plugin: load_plugin(plugin) for plugin in loaded() if plugin.endswith(".py")}
    if tree.endswith(".py"):
        files = {tree: sys.modules[tree_module(tree)], **files}
    for file, module in files.items():
        for part in vars(module).values():
            own = isinstance(part, type) and part.__module__ == module.__name__
            if own and issubclass(part, ConceptModel):
                return file
    return ""
