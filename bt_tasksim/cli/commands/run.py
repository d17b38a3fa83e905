"""``bt-tasksim run``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bt_tasksim.cli.arguments import Longest, Seed
from bt_tasksim.cli.options.engines import EngineFlags, policies
from bt_tasksim.cli.options.film import FilmFlags
from bt_tasksim.cli.options.tree import TreeOptions
from bt_tasksim.cli.streams import say
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.registry import register


@register("command", "run")
def run(
    tree: TreeOptions,
    engines: EngineFlags,
    film: FilmFlags,
    seed: Seed = 0,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write result, log, pictures and report to this folder."),
    ] = None,
    real_time: Annotated[
        bool, typer.Option("--real-time", help="Keep the control rate in simulation, too.")
    ] = False,
    longest: Longest = None,
) -> int:
    """Run a tree once."""
    from bt_tasksim.cli.running import run_into

    tree.load_nodes()
    options = engines.options(rendering=film.video, real_time=real_time)
    if options.laws == "torch":
        raise InputError("run: --laws torch is for batches of worlds, see 'evaluate'; a single run has NumPy")
    source = tree.load(policies(engines.policy), options.own_world())
    parts = [source.name, Path(source.scene.robot).stem, str(seed)]
    if options.perception != "state":
        parts.insert(2, options.perception.partition(":")[0])
    folder = out or Path("runs") / "-".join(parts)
    result = run_into(folder, source.build(), source.scene, seed, options, source.name, film.film(), longest)
    if result.timing is not None:
        say(result.timing)
    return 0 if result.success else 1
