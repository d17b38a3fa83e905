"""Contact sheets: a few moments of runs, drawn by the simulator, side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from py_trees.common import Status

from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.concept_nodes import Grasp
from bt_tasksim.core.poses import Array
from bt_tasksim.execution.runner import Runner, Step
from bt_tasksim.training.evaluation import Job, Player

CAMERA = "scene"
CLOSE = (170, 100, 470, 400)
"""Left, top, right and bottom of the part of a picture around an object on the table."""
WHOLE = (80, 0, 560, 480)
SIDE, CAPTION = 190, 16
MOST_COLOURS = 256


@dataclass(frozen=True)
class Strip:
    """One run: what is written beside it, and its pictures ``(height, width, 3)``."""

    caption: str
    pictures: tuple[Array, ...]


def film(job: Job, seed: int, caption: str, count: int = 4, part: tuple[int, int, int, int] = CLOSE) -> Strip:
    """Run a draw twice: once to see when things happen, once to draw these moments.

    Args:
        job: What is run.
        seed: Seed of the draw.
        caption: What is written beside it.
        count: Moments: the hand before it closes, the grasp's end, and others evenly up to the tree's end.
        part: Part of the picture that is kept.
    """
    moments = _moments(Player(job).runner, seed, count)
    runner = Player(replace(job, options=replace(job.options, rendering=True))).runner
    tick, pictures = 0, []

    def draw(step: Step) -> None:
        nonlocal tick
        if tick in moments:
            pictures.append(step.pipeline.render(CAMERA).colour)
        tick += 1

    try:
        runner.run(seed, record=draw)
    finally:
        runner.close()
    return Strip(caption, tuple(_cropped(p, part) for p in pictures))


def _moments(runner: Runner, seed: int, count: int) -> list[int]:
    """Numbers of the ticks that are drawn."""
    grasp = next(
        leaf
        for leaf in runner.tree.iterate()
        if isinstance(leaf, ConceptNode) and isinstance(leaf.model, Grasp)
    )
    closing: int | None = None
    held: int | None = None
    ended: int | None = None
    tick = 0

    def watch(step: Step) -> None:
        nonlocal closing, held, ended, tick
        if closing is None and grasp.memory is not None and float(grasp.memory.closing[0]) >= 0.0:
            closing = tick
        if held is None and grasp.status != Status.RUNNING and tick > 0:
            held = tick
        if ended is None and step.tree_status != Status.RUNNING:
            ended = tick
        tick += 1

    runner.run(seed, record=watch)
    last = ended if ended is not None else tick - 1
    first = max(0, (closing if closing is not None else last // 2) - 1)
    done = min(held if held is not None else last, last)
    rest = (
        np.linspace(done, tick - 1 if last - done < count else last, count - 1).round().astype(int).tolist()
    )
    return sorted({first, *rest})


def _cropped(picture: Array, part: tuple[int, int, int, int]) -> Array:
    """A part of a picture, small."""
    from PIL import Image

    image = Image.fromarray(picture).crop(part)
    small: Array = np.asarray(image.resize((SIDE, SIDE), Image.Resampling.LANCZOS))
    return small


def sheet(path: Path, strips: Sequence[Strip], columns: int = 1) -> None:
    """A PNG with a strip in each row, and its caption above it.

    Args:
        path: The file.
        strips: The strips.
        columns: Strips beside each other.
    """
    from PIL import Image, ImageDraw

    if not strips:
        return
    most = max(len(s.pictures) for s in strips)
    rows = -(-len(strips) // columns)
    gap = 8
    wide, high = most * SIDE + gap, SIDE + CAPTION
    board = Image.new("RGB", (columns * wide - gap, rows * high), "white")
    pen: Any = ImageDraw.Draw(board)
    for k, strip in enumerate(strips):
        x, y = (k % columns) * wide, (k // columns) * high
        pen.text((x + 2, y + 2), strip.caption, fill="black")
        for n, picture in enumerate(strip.pictures):
            board.paste(Image.fromarray(picture), (x + n * SIDE, y + CAPTION))
    path.parent.mkdir(parents=True, exist_ok=True)
    # An octree keeps the colours of small objects, which a median cut gives to the table.
    colours = board.quantize(MOST_COLOURS, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    colours.save(path, optimize=True)
