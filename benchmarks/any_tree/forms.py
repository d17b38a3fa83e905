"""Which forms a robot handles where nothing is in its way: each alone on the table, put down elsewhere.

    python -m benchmarks.any_tree.forms --robot so100 --each 5
    python -m benchmarks.any_tree.forms --robot panda --each 1 --only box ring     # quick

What fails among other things mostly fails alone, too, and is found here sooner. Prints each form with its
successes, the worst first, and why the others failed.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import sealed
from benchmarks.any_tree.furniture import in_base
from benchmarks.any_tree.meshes import FORMS
from benchmarks.any_tree.settings import SETTINGS, Setting, setting
from benchmarks.any_tree.tasks import SPOT, TABLE
from benchmarks.any_tree.things import KINDS, Thing, thing_of
from bt_tasksim import EngineOptions, Goal, Runner, Scene, SpotSpec, load_robot
from bt_tasksim.concept_nodes import Bring, Grasp, Pick, Place, Release
from bt_tasksim.core.errors import BtTasksimError, BtTasksimWarning, NoDrawError
from bt_tasksim.execution.pipelines import build_pipeline
from bt_tasksim.training.evaluation import episode
from bt_tasksim.trees import sequence

LONGEST = 90.0
"""Seconds of an episode, at most."""
APART = 0.45
"""Share of the reach aside by which the beginning and the spot are to either side of the middle."""


def main(argv: list[str] | None = None) -> int:
    """Run the measurement; returns the exit status."""
    parser = argparse.ArgumentParser(description="Each form alone.")
    parser.add_argument("--robot", choices=sorted(SETTINGS), default="panda")
    parser.add_argument("--each", type=int, default=5, metavar="N", help="draws of each form")
    parser.add_argument("--only", nargs="+", metavar="FORM", help="these forms alone")
    parser.add_argument("--seed", type=int, default=sealed.DEVELOPMENT, metavar="S", help="the first seed")
    options = parser.parse_args(argv)
    warnings.simplefilter("ignore", BtTasksimWarning)
    forms = options.only or sorted([*KINDS, *FORMS])
    try:
        if unknown := set(forms) - {*KINDS, *FORMS}:
            parser.error(
                f"no form {', '.join(sorted(unknown))}: one of {', '.join(sorted([*KINDS, *FORMS]))}"
            )
        seeds = sealed.choose(None, options.seed, "forms", options.each)
        with tempfile.TemporaryDirectory(prefix="forms_") as folder:
            found = {form: handled(options.robot, form, seeds, Path(folder)) for form in forms}
    except BtTasksimError as error:
        print(f"forms: {error}", file=sys.stderr)
        return 2
    print("\n".join(lines(found)))
    return 0


def handled(robot: str, form: str, seeds: Sequence[int], folder: Path) -> list[str]:
    """Why each draw of a form failed; empty where it succeeded."""
    options = EngineOptions()
    pipeline = build_pipeline(load_robot(robot), options)
    said = []
    for seed in seeds:
        thing = thing_of(1, form, setting(robot), seed, folder)
        runner = Runner(lambda: _tree(thing.name), _scene(robot, thing, seed), options, pipeline, LONGEST)  # noqa: B023
        try:
            outcome: Any = episode(runner, seed)
            said.append("" if outcome.success else f"{outcome.leaf.partition(' ')[0]} {outcome.reason}")
        except NoDrawError:
            said.append("no draw")
    return said


def _tree(name: str) -> Any:
    return sequence(
        "move it", Grasp(name), Pick(name), Bring(name, to="spot"), Place(name, on="spot"), Release(name)
    )


def _scene(robot: str, thing: Thing, seed: int) -> Scene:
    """The thing on one side of what is within reach, and its spot on the other one."""
    world: Setting = setting(robot)
    rng = np.random.default_rng([seed, 78])
    near, far = (np.array([rng.uniform(*world.forward) for _ in range(2)]) + sum(world.forward)) / 3
    side = rng.choice([-1.0, 1.0]) * APART * world.aside
    at, to = (in_base(world, np.array([x, y])) - TABLE for x, y in ((near, side), (far, -side)))
    size = SPOT if world.mesh_scale == 1.0 else (SPOT[0] / 2, SPOT[1] / 2)
    spot = SpotSpec("spot", "table", (float(to[0]), float(to[1])), (0.0, 0.0), size, yaw=np.pi)
    spec = thing.starting(on="table", centre=(float(at[0]), float(at[1])), area=(0.01, 0.01))
    return Scene(
        robot, objects={thing.name: spec}, spots=[spot], goals=[Goal(thing.name, on="spot")], name="forms"
    )


def lines(found: dict[str, list[str]]) -> list[str]:
    """A line for each form, the worst first, and one for all."""
    out = []
    for form, said in sorted(found.items(), key=lambda item: (-sum(map(bool, item[1])), item[0])):
        why = ", ".join(f"{count} x {reason}" for reason, count in Counter(filter(None, said)).most_common())
        out.append(f"{form:15} {said.count(''):3} of {len(said)}   {why}".rstrip())
    every = [reason for said in found.values() for reason in said]
    return [*out, f"{'all':15} {every.count(''):3} of {len(every)}"]


if __name__ == "__main__":
    sys.exit(main())
