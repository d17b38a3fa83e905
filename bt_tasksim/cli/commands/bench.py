"""``bt-tasksim bench``."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Annotated

import typer

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.registry import register


@register("command", "bench")
def bench(
    json_: Annotated[
        Path | None, typer.Option("--json", metavar="F", help="Write the numbers as JSON.")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer repetitions.")] = False,
) -> int:
    """Measure speed, beside other simulators in the same run."""
    try:
        measure = importlib.import_module("benchmarks.speed").main
    except ImportError as error:
        raise InputError(f"the benchmarks stand beside the packages in a checkout: {error}") from None
    return int(measure(quick=quick, json_path=json_))
