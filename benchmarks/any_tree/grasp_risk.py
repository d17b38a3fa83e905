"""What makes grasps of a hand of many fingers go wrong: random ones, and a law fitted to them.

    python -m benchmarks.any_tree.grasp_risk --episodes 300
    python -m benchmarks.any_tree.grasp_risk --episodes 20 --seed 23000      # quick

Single things are taken by random grasps that the hand can come to, lifted and carried. A grasp has gone wrong
where the tree fails, the thing has turned in the hand by more than 10 degrees, or bodies overlapped by more
than 2 mm. `bt_tasksim.concept_nodes.grasp_firmness.RISK` holds such a law.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
import warnings
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from py_trees.common import Status

from benchmarks import sealed
from benchmarks.any_tree.furniture import in_base
from benchmarks.any_tree.settings import setting
from benchmarks.any_tree.things import Thing, draw_things
from bt_tasksim import EngineOptions, ObjectSpec, Runner, Scene, poses
from bt_tasksim.concept_nodes import Bring, Grasp, Pick, grasp, grasp_choice
from bt_tasksim.concept_nodes.grasp_candidates import Candidates
from bt_tasksim.concept_nodes.grasp_firmness import terms
from bt_tasksim.core.errors import BtTasksimError, BtTasksimWarning, InputError
from bt_tasksim.core.poses import Array
from bt_tasksim.scene.success import DEEPEST
from bt_tasksim.trees import sequence

ROBOT = "xarm7_ability"
SPREAD = 0.6
"""Scale in radians of the random numbers that shuffle grasps about their usual order."""
TURNED = math.radians(10.0)
FOLDS = 5
WEAK = 0.025
"""Weight of the sum of squares that keeps the law's numbers small; lengths in decimetres."""
NAMES, SCALES = ("angle", "lever", "narrow"), (1, 10, 10)
"""What is weighed, see `terms`, and how many of its unit in the fit make one of its own."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Collect, fit, and print."""
    parser = argparse.ArgumentParser(prog="benchmarks.any_tree.grasp_risk")
    parser.add_argument("--seed", type=int, default=sealed.DEVELOPMENT, help="first seed")
    parser.add_argument("--episodes", type=int, default=300, metavar="N", help="things, default 300")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also append each grasp to this file")
    options = parser.parse_args(arguments)
    warnings.simplefilter("ignore", BtTasksimWarning)
    found = []
    try:
        seeds = sealed.choose(None, options.seed, "grasp_risk", options.episodes)
        with tempfile.TemporaryDirectory(prefix="grasp_risk_") as folder:
            for seed in seeds:
                taken = random_grasp(seed, Path(folder))
                found += [] if taken is None else [taken]
                if taken is not None and options.json is not None:
                    with options.json.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(taken) + "\n")
    except BtTasksimError as error:
        print(f"grasp_risk: {error}", file=sys.stderr)
        return 2
    print("\n".join(lines(found)))
    return 0


def random_grasp(seed: int, folder: Path) -> dict[str, Any] | None:
    """A random grasp of a thing: its features, and whether it went wrong; None where none was come to."""
    rng = np.random.default_rng([seed, 77])
    world = setting(ROBOT)
    thing = draw_things(1, world, seed, folder, rng)[0]
    middle = sum(world.forward) / 2
    at = in_base(world, np.array([middle, rng.uniform(-0.5, 0.5) * world.aside]))
    away = in_base(world, np.array([middle, -0.3 * world.aside]))
    taken: dict[str, Any] = {}
    with _shuffled(rng, taken), Runner(_tree(thing, away), _scene(thing, at), EngineOptions()) as runner:
        try:
            result = runner.run(seed)
        except InputError:
            return None
        hidden = runner.pipeline.hidden()
    if not taken or hidden is None:
        return None
    grip = np.array(taken.pop("grip"))
    turned = float(poses.angle_between(poses.relative(hidden.tool_pose, hidden.objects[0])[3:], grip[3:]))
    wrong = result.status != Status.SUCCESS or turned > TURNED or bool(hidden.penetration > DEEPEST)
    return {"seed": seed, "form": thing.form, **taken, "turned": turned, "wrong": wrong}


def _tree(thing: Thing, away: Array) -> Any:
    name, to = thing.name, (float(away[0]), float(away[1]), 0.2)
    return sequence("take it", Grasp(name, policy="programmed"), Pick(name), Bring(name, position=to))


def _scene(thing: Thing, at: Array) -> Scene:
    spec: ObjectSpec = thing.starting(
        on="table", centre=(float(at[0]) - 0.5, float(at[1])), area=(0.01, 0.01)
    )
    return Scene(ROBOT, objects={thing.name: spec}, name="grasp risk")


def _shuffled(rng: np.random.Generator, taken: dict[str, Any]) -> ExitStack:
    """Within it a chooser takes a random grasp, and notes its features in ``taken``."""
    widths: dict[bytes, float] = {}

    def free(self: Any, found: Candidates) -> Iterator[tuple[Array, Any]]:
        order = np.argsort(found.costs + rng.gumbel(0.0, SPREAD, len(found.costs)))
        for tool, width in zip(found.tools[order], found.widths[order].tolist(), strict=True):
            hand = self._opening(width)
            if hand.free(tool):
                centred = self._firm.centred(tool)
                chosen = centred if hand.free(centred) else tool
                widths[chosen.tobytes()] = width
                yield chosen, hand

    usual_other = grasp_choice.Chooser.other

    def other(self: Any, *arguments: Any) -> grasp_choice.Choice:
        choice = usual_other(self, *arguments)
        angle, lever = self._firm.features(choice.goal)
        grip = poses.relative(choice.goal, self._view.objects[self._target])
        width = widths[choice.goal.tobytes()]
        taken.update(angle=angle, lever=lever, width=width, grip=grip.tolist())
        return choice

    stack = ExitStack()
    for where, name, what in (
        (grasp_choice.Chooser, "usual", lambda self, goal, way: None),
        (grasp_choice.Chooser, "_free", free),
        (grasp_choice.Chooser, "other", other),
        (grasp, "rooms", lambda robot, aside=False: [(1.0, False, False)]),
    ):
        stack.enter_context(mock.patch.object(where, name, what))
    return stack


def lines(found: Sequence[dict[str, Any]]) -> list[str]:
    """The law fitted to grasps, and how well it tells good ones from bad ones that it was not fitted to."""
    wrong = np.array([grasp["wrong"] for grasp in found], bool)
    out = [f"{wrong.sum()} of {len(wrong)} random grasps went wrong"]
    if wrong.sum() < FOLDS or (~wrong).sum() < FOLDS:
        return [*out, "too few of either to fit a law"]
    features = np.array([terms(g["angle"], g["lever"], g["width"]) for g in found]) * SCALES
    law = fitted(features, wrong)
    said = np.zeros(len(wrong))
    for fold in range(FOLDS):
        held_out = np.arange(len(wrong)) % FOLDS == fold
        said[held_out] = _odds(fitted(features[~held_out], wrong[~held_out]), features[held_out])
    pairs = said[wrong][:, None] - said[~wrong][None]
    right = float(np.mean(pairs > 0) + np.mean(pairs == 0) / 2)
    numbers = ", ".join(f"{n} {v:.3g}" for n, v in zip(NAMES, law[1:] * SCALES, strict=True))
    return [
        *out,
        f"log odds: {law[0]:.2f}, {numbers}",
        f"held out: {100 * right:.0f} % of pairs ranked right",
    ]


def fitted(features: Array, wrong: Array) -> Array:
    """Logistic regression: a constant and a weight for each feature ``(1 + f,)``.

    Args:
        features: ``(n, f)``.
        wrong: Booleans ``(n,)``.
    """
    from scipy.optimize import minimize

    def loss(law: Array) -> float:
        odds = _odds(law, features)
        return float(np.sum(np.logaddexp(0.0, odds) - wrong * odds) + WEAK * np.sum(law[1:] ** 2))

    found: Array = minimize(loss, np.zeros(1 + features.shape[1])).x
    return found


def _odds(law: Array, features: Array) -> Array:
    found: Array = law[0] + features @ law[1:]
    return found


if __name__ == "__main__":
    sys.exit(main())
