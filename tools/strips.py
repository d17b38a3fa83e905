"""Picture strips of what the scenarios do, for docs/gallery.md: ``python -m tools.strips [SCENARIO ...]``.

A tree runs until it succeeds; what it moved says where the camera stands and which moments are shown. Without
names, all scenarios; the page is then written anew with every scenario whose picture is there.
"""

from __future__ import annotations

import argparse
import importlib
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bt_tasksim.core import poses
from bt_tasksim.core.resources import asset
from bt_tasksim.core.world import WorldState
from bt_tasksim.engines.cameras import CameraSpec
from bt_tasksim.engines.rendering.sapien import SapienRendering
from bt_tasksim.execution.result import Result
from bt_tasksim.execution.runner import Runner, Step
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.trees.load import load_source, scenarios

DOCS = asset("fixtures").parents[1] / "docs"
PAGE, PICTURES = DOCS / "gallery.md", DOCS / "pictures" / "strips"
BEGIN, END = "<!-- made by tools/strips.py -->", "<!-- end -->"
SEEDS = range(7, 17)
"""Draws of which the first that succeeds is shown."""
FRAMES, SIZE, QUALITY = 5, (232, 190), 82
"""Pictures in a row, pixels of each, and quality of the JPEG file."""
SIDE = (-0.35, 0.75, 0.55)
"""Where the camera stands from what it looks at: to the robot's left and a little behind."""
OPENING = math.radians(38.0)
MARGIN, LEAST = 0.06, 0.17
"""Metres about what moves that are seen, too, and the least radius of all that."""
TURN = 0.1
"""Metres that a turn by a radian counts as, and a moved thing counts as much more than the moving hand."""
THINGS = 5.0


class Film:
    """Keeps the states of a run; give it to `Runner.run` as ``record``."""

    def __init__(self) -> None:
        self.states: list[WorldState] = []

    def __call__(self, step: Step) -> None:
        """Keep one tick."""
        assert step.pipeline.state is not None
        self.states.append(step.pipeline.state)


def film(name: str, robot: str | None = None) -> tuple[Result, list[WorldState]]:
    """The first run of a scenario that succeeds.

    Args:
        name: The scenario.
        robot: The robot, by default the scenario's own.

    Raises:
        SystemExit: None of the draws succeeds.
    """
    source = load_source(name, robot)
    runner = Runner(source.build(), source.scene)
    try:
        for seed in SEEDS:
            kept = Film()
            result = runner.run(seed, record=kept)
            if result.success:
                return result, kept.states
    finally:
        runner.close()
    raise SystemExit(f"'{name}' succeeded in none of the draws {SEEDS.start} to {SEEDS.stop - 1}")


def moments(states: Sequence[WorldState], count: int = FRAMES) -> list[int]:
    """Indices ``(count,)`` of states to show: the first, the last, and others equally far apart in motion."""
    tool = _moved(np.array([state.tool_pose for state in states])[:, None])
    things = _moved(np.array([state.objects for state in states]))
    way = np.concatenate([[0.0], np.cumsum(tool[:, 0] + THINGS * things.sum(axis=1) + 1e-9)])
    found = np.searchsorted(way, np.linspace(0.0, way[-1], count)).tolist()
    return [min(int(k), len(states) - 1) for k in found]


def _moved(tracks: NDArray[np.float64]) -> NDArray[np.float64]:
    """Metres ``(T - 1, n)`` by which poses ``(T, n, 7)`` move from one tick to the next."""
    gone = np.linalg.norm(np.diff(tracks[..., :3], axis=0), axis=-1)
    turned: NDArray[np.float64] = poses.angle_between(tracks[1:, :, 3:], tracks[:-1, :, 3:])
    return np.asarray(gone + TURN * turned)


def camera(world: ActorConfiguration, states: Sequence[WorldState]) -> CameraSpec:
    """A camera that sees all that moved, with what it had around it."""
    tracks = np.array([state.objects for state in states])
    moved = _moved(tracks).sum(axis=0) > 0.01
    far = np.linalg.norm(tracks[..., :3] - tracks[:1, :, :3], axis=-1).max(axis=0)
    moved |= far > 0.01
    names = {goal.object for goal in world.goals}
    wanted = moved | np.array([actor.name in names for actor in world.objects])
    corners = [_corners(world, int(k), tracks[t, k]) for k in np.flatnonzero(wanted) for t in (0, -1)]
    tracks = tracks[:, wanted] if wanted.any() else np.array([state.tool_pose for state in states])[:, None]
    places = [place.pose for place in world.places if place.name in {goal.place for goal in world.goals}]
    marks = [np.array(pose, float)[None, :3] for pose in places]
    points = np.concatenate([tracks[..., :3].reshape(-1, 3), *corners, *marks])
    low, high = points.min(axis=0), points.max(axis=0)
    middle, radius = (low + high) / 2, max(LEAST, float(np.linalg.norm(high - low)) / 2 + MARGIN)
    side = np.array(SIDE) / np.linalg.norm(SIDE)
    position = middle + side * radius / math.sin(OPENING / 2)
    return CameraSpec(_triple(position), _triple(middle), SIZE, OPENING)


def _corners(world: ActorConfiguration, k: int, pose: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corners ``(8, 3)`` of the box about an object at a pose ``(7,)``."""
    vertices = world.objects[k].shape().visual.vertices
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    grid = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T
    return np.asarray(poses.transform(pose, grid))


def _triple(values: NDArray[np.float64]) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in values)
    return x, y, z


def strip(world: ActorConfiguration, states: Sequence[WorldState], count: int = FRAMES) -> NDArray[Any]:
    """Pictures in a row, RGB ``(height, count * width, 3)``."""
    engine = SapienRendering({"strip": camera(world, states)})
    try:
        engine.reset(world)
        shown = [engine.render(states[k], "strip").colour for k in moments(states, count)]
    finally:
        engine.close()
    for picture in shown[1:]:
        picture[:, :2] = 255
    return np.concatenate(shown, axis=1)


def sentence(name: str) -> str:
    """What a scenario shows, in its own words: the first sentence of its file."""
    told = importlib.import_module(f"bt_tasksim.trees.scenarios.{name}").__doc__ or ""
    return told.strip().splitlines()[0].strip()


def page(folder: Path = PICTURES) -> str:
    """The part of the page that lists the scenarios whose pictures are there."""
    rows = []
    for name in scenarios():
        if (folder / f"{name}.jpg").exists():
            rows += [f"### `{name}`", "", sentence(name), "", f"![{name}](pictures/strips/{name}.jpg)", ""]
    return "\n".join(rows)


def write_page() -> None:
    """Write that part into the page."""
    head, begin, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    PAGE.write_text(f"{head}{begin}\n\n{page()}{END}{rest.partition(END)[2]}", encoding="utf-8")


def main(words: Sequence[str] | None = None) -> None:
    """Make the pictures that are asked for, and write the page."""
    parser = argparse.ArgumentParser(description="Picture strips of scenarios, for docs/gallery.md.")
    parser.add_argument("names", nargs="*", metavar="SCENARIO", help="by default all")
    parser.add_argument("--robot", help="by default the scenario's own")
    parser.add_argument("--frames", type=int, default=FRAMES, metavar="N", help="pictures in a row")
    parser.add_argument("--out", type=Path, default=PICTURES, help="folder of the pictures")
    asked = parser.parse_args(words)
    asked.out.mkdir(parents=True, exist_ok=True)
    for name in asked.names or scenarios():
        result, states = film(name, asked.robot)
        picture = strip(result.configuration, states, asked.frames)
        cv2.imwrite(str(asked.out / f"{name}.jpg"), picture[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
        sys.stdout.write(f"{name}: seed {result.seed}, {states[-1].time:.1f} s\n")
        sys.stdout.flush()
    if asked.out == PICTURES:
        write_page()


if __name__ == "__main__":
    main()
