"""Five trees that anybody would try first, each on many draws.

    python -m benchmarks.any_tree.five --episodes 100
    python -m benchmarks.any_tree.five --only tower --seed 900000 --episodes 20

Two objects to two spots; three objects to three spots; a can into the bin and then a box onto a spot; a cup
from the table onto the shelf's lower board; a tower of three cubes.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from benchmarks import sealed
from benchmarks.any_tree.goals import Step
from benchmarks.any_tree.trees import TREES, tree_of
from bt_tasksim import EngineOptions, Fixture, Goal, ObjectSpec, Runner, Scene, SpotSpec
from bt_tasksim.core.errors import BtTasksimError, BtTasksimWarning
from bt_tasksim.core.identity import identity
from bt_tasksim.training.evaluation import episode
from bt_tasksim.training.evaluation_outcomes import EpisodeOutcome, Evaluation

FIRST = 900_000
STARTS = (-0.02, 0.20)
"""Middle of the area in which things start, in the table's frame, metres."""
AREA = (0.09, 0.13)
SPOTS = ((-0.06, -0.10), (-0.06, -0.28), (0.08, -0.19))


@dataclass(frozen=True)
class Known:
    """A scene with goals, and what its tree does in order."""

    scene: Scene
    steps: tuple[Step, ...]


def thing(*kinds: str) -> ObjectSpec:
    """An object of one of these kinds on the left half of the table."""
    return ObjectSpec(kinds=kinds, on="table", centre=STARTS, area=AREA, gap=0.03)


def onto(target: str, place: str) -> Step:
    """Put something down."""
    return Step(target, Goal(target, on=place), place)


def spots(count: int) -> list[SpotSpec]:
    """So many spots on the right half of the table, each within 4 cm."""
    return [
        SpotSpec(f"spot_{k}", "table", centre, (0.02, 0.02), yaw=0.5)
        for k, centre in enumerate(SPOTS[:count], 1)
    ]


def two_spots(robot: str) -> Known:
    """Two objects to two spots."""
    objects = {"box": thing("box", "cube"), "can": thing("cylinder", "oval")}
    steps = (onto("box", "spot_1"), onto("can", "spot_2"))
    return _known("two_spots", robot, objects, steps, spots=spots(2))


def three_spots(robot: str) -> Known:
    """Three objects to three spots."""
    objects = {"box": thing("box", "cube"), "can": thing("cylinder", "oval"), "cup": thing("cup", "diamond")}
    steps = (onto("box", "spot_1"), onto("can", "spot_2"), onto("cup", "spot_3"))
    return _known("three_spots", robot, objects, steps, spots=spots(3))


def bin_then_spot(robot: str) -> Known:
    """A can into the bin, and then a box onto a spot."""
    objects = {"can": thing("cylinder"), "box": thing("box")}
    thrown = Step("can", Goal("can", inside="trash_bin"), "trash_bin", drop=True)
    steps = (thrown, onto("box", "spot_1"))
    return _known("bin_then_spot", robot, objects, steps, [Fixture("trash_bin")], spots(1))


def shelf(robot: str) -> Known:
    """A cup from the table onto the shelf's lower board."""
    cup = ObjectSpec(kinds=("cup",), on="table", centre=(-0.12, 0.24), area=(0.05, 0.08))
    return _known("shelf", robot, {"cup": cup}, (onto("cup", "lower_board"),), [Fixture("shelf")])


def tower(robot: str) -> Known:
    """Three cubes on one another."""
    objects = {f"cube_{k}": thing("cube") for k in (1, 2, 3)}
    return _known("tower", robot, objects, (onto("cube_2", "cube_1"), onto("cube_3", "cube_2")))


def _known(
    name: str,
    robot: str,
    objects: Mapping[str, ObjectSpec],
    steps: tuple[Step, ...],
    fixtures: Sequence[Fixture] = (),
    spots: Sequence[SpotSpec] = (),
) -> Known:
    goals = [step.goal for step in steps]
    return Known(Scene(robot, fixtures, objects, spots, goals=goals, name=name), steps)


FIVE: Mapping[str, Callable[[str], Known]] = {
    known.__name__: known for known in (two_spots, three_spots, bin_then_spot, shelf, tower)
}
"""By name."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure."""
    parser = argparse.ArgumentParser(prog="benchmarks.any_tree.five", description=__doc__.partition("\n")[0])
    sealed.add_arguments(parser, FIRST)
    parser.add_argument("--episodes", type=int, default=100, metavar="N", help="draws of each, default 100")
    parser.add_argument("--only", nargs="+", choices=FIVE, default=list(FIVE))
    parser.add_argument("--robot", default="panda")
    parser.add_argument("--tree", default="obvious", choices=TREES)
    parser.add_argument("--engines", default="sapien")
    parser.add_argument("--noise", default="fine")
    parser.add_argument("--perception", default="state")
    options = parser.parse_args(arguments)
    warnings.simplefilter("ignore", BtTasksimWarning)
    kinds = ("tree", "engines", "perception", "noise")
    unusual = [said for kind in kinds if (said := getattr(options, kind)) != parser.get_default(kind)]
    engines = EngineOptions(engines=options.engines, perception=options.perception, noise=options.noise)
    try:
        for name in options.only:
            measure = "-".join([f"five/five-{name}", options.robot, *unusual])
            seeds = sealed.choose(options.block, options.seed, measure, options.episodes)
            found = measured(FIVE[name](options.robot), engines, seeds, options.tree)
            path = sealed.keep(options.block, measure, found.to_json())
            print("\n".join([*found.lines(), f"  wrote {path}"]), flush=True)
    except BtTasksimError as error:
        print(f"five: {error}", file=sys.stderr)
        return 2
    return 0


def measured(known: Known, engines: EngineOptions, seeds: Sequence[int], tree: str) -> Evaluation:
    """What becomes of one of the trees on these draws."""

    def build() -> Any:
        return tree_of(known.steps, known.scene.goals, tree)

    began, outcomes = time.perf_counter(), list[EpisodeOutcome]()
    with Runner(build, known.scene, engines) as runner:
        for seed in seeds:
            runner.plant(build)
            outcomes.append(episode(runner, seed))
    return Evaluation(
        scenario=f"{known.scene.name} ({tree})",
        robot=known.scene.robot,
        engines=engines.engines,
        perception=engines.label,
        policies={},
        outcomes=tuple(outcomes),
        seconds=time.perf_counter() - began,
        asked=len(seeds),
        versions=identity(),
    )


if __name__ == "__main__":
    sys.exit(main())
