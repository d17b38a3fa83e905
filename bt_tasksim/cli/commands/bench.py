"""``bt-tasksim bench``."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

import bt_tasksim
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.registry import register


@register("command", "bench")
def bench(
    json_: Annotated[
        Path | None, typer.Option("--json", metavar="F", help="Write the numbers as JSON.")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Fewer repetitions, of shorter episodes.")] = False,
) -> int:
    """Measure speed, beside other simulators in the same run."""
    return int(measurement()(quick=quick, json_path=json_))


def measurement() -> Callable[..., int]:
    """What measures: ``benchmarks/speed.py`` of the checkout that this package lies in.

    Raises:
        InputError: It lies in none.
    """
    checkout = Path(bt_tasksim.__file__).resolve().parents[1]
    if not (checkout / "benchmarks" / "speed.py").is_file():
        raise InputError(f"the benchmarks stand in a checkout beside the packages, not in '{checkout}'")
    if str(checkout) not in sys.path:
        sys.path.append(str(checkout))
    found: Callable[..., int] = importlib.import_module("benchmarks.speed").main
    return found
