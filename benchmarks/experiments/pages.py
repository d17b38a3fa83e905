"""The tables and pictures of docs/experiments.md; see `benchmarks.tables`."""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable
from typing import Any

from benchmarks.experiments.common import EXPERIMENTS, PICTURES

NOT_YET = "Not measured yet: `python -m benchmarks.experiments {letter}`."


def page(letter: str, results: dict[str, dict[str, Any]]) -> str:
    """An experiment's table, and the pictures that there are."""
    found = results.get(f"experiment-{letter}")
    if found is None:
        return NOT_YET.format(letter=letter)
    module = importlib.import_module(f"benchmarks.experiments.{EXPERIMENTS[letter]}")
    return "\n\n".join([module.table(found), *pictures(letter)])


def pictures(letter: str) -> list[str]:
    """Links to an experiment's pictures."""
    files = sorted(p for p in PICTURES.glob(f"{letter}-*") if p.suffix in (".svg", ".png"))
    return [f"![{p.stem[2:].replace('-', ' ')}](images/experiments/{p.name})" for p in files]


TABLES: dict[str, Callable[[dict[str, dict[str, Any]]], str]] = {
    f"experiment_{letter}": functools.partial(page, letter) for letter in EXPERIMENTS
}
