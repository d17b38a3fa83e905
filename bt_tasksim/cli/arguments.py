"""What words of the command line may be; a wrong one is one sentence."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from bt_tasksim.core.errors import InputError

MOST_EPISODES = 1_000_000
MOST_WORKERS = 1024
MOST_STEPS = 10**12
MOST_SECONDS = 86_400
SEEDS = 2**64
"""How many seeds there are: logs hold them as 64 bits."""
SHOWN = 40
"""Characters of a wrong word that a sentence repeats."""


def whole(text: str | int, least: int, most: int | None = None) -> int:
    """A whole number within bounds; without ``most`` none above.

    Raises:
        BadParameter: It is none.
    """
    try:
        value = int(text)
    except ValueError:
        raise typer.BadParameter(f"should be a whole number, found {_shown(text)}") from None
    if value < least:
        kind = "a positive whole number" if least == 1 else "zero or a positive whole number"
        raise typer.BadParameter(f"should be {kind}, found {_shown(text)}")
    if most is not None and value > most:
        raise typer.BadParameter(f"should be at most {most}, found {_shown(text)}")
    return value


def seed(text: str | int) -> int:
    """A seed that 64 bits can hold."""
    return whole(text, 0, SEEDS - 1)


def episodes(text: str | int) -> int:
    """How many episodes."""
    return whole(text, 1, MOST_EPISODES)


def workers(text: str | int) -> int:
    """How many processes."""
    return whole(text, 1, MOST_WORKERS)


def batch(text: str | int) -> int:
    """How many worlds at once; what memory has no room for is refused where it is known what runs."""
    return whole(text, 1)


def steps(text: str | int) -> int:
    """How many decisions."""
    return whole(text, 1, MOST_STEPS)


def seconds(text: str | float) -> float:
    """A time that is not too long to be meant.

    Raises:
        BadParameter: It is none.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value <= MOST_SECONDS:
        raise typer.BadParameter(
            f"should be a number of seconds above 0 and at most {MOST_SECONDS}, found {_shown(text)}"
        )
    return value


def port(text: str | int) -> int:
    """A TCP port; 0 for a free one."""
    return whole(text, 0, 65535)


def domain(text: str | int) -> int:
    """A ROS domain."""
    return whole(text, 0, 101)


def picture(path: Path) -> Path:
    """A file for a picture, which is SVG.

    Raises:
        InputError: Its suffix says something else.
    """
    if path.suffix.lower() not in ("", ".svg"):
        raise InputError(f"pictures are SVG: give a name that ends with .svg, found '{path}'")
    return path


def _shown(text: str | float) -> str:
    said = str(text)
    return repr(said if len(said) <= SHOWN else f"{said[:SHOWN]}...")


Seed = Annotated[
    int,
    typer.Option(
        parser=seed, metavar="S", help="Seed of the draw; of the first one, where there are several."
    ),
]
Longest = Annotated[
    float | None,
    typer.Option(
        parser=seconds,
        metavar="SECONDS",
        help="Stop an episode after so much of its own time.",
        show_default="120",
    ),
]
