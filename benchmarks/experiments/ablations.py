"""F. What the completion signal and the reward of what follows are worth: three variants, three seeds each.

``full``: the completion signal is learned, and what follows pays. ``fixed time``: the grasp ends a fixed time
after the hand began to close; the motion alone is learned. ``shaping alone``: what follows pays nothing; only
the necessary cost, limits and the time-out do.
"""

from __future__ import annotations

import functools
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from py_trees.behaviour import Behaviour

from benchmarks.experiments import judged, pictures
from benchmarks.experiments.common import Request, share
from benchmarks.experiments.training import POLICIES, finished, history, learn
from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.concept.parameters import Seconds
from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes import Grasp, Pick
from bt_tasksim.concept_nodes.grasp_memory import GraspMemory
from bt_tasksim.core.files import write_text
from bt_tasksim.core.poses import Array
from bt_tasksim.policy.policy import PROGRAMMED, Action
from bt_tasksim.scene.scene import Scene
from bt_tasksim.training.config import TrainConfig
from bt_tasksim.training.reward import Reward
from bt_tasksim.trees import sequence
from bt_tasksim.trees.nodes.train import Train
from bt_tasksim.trees.scenarios import grasp_then_pick

VARIANTS = ("full", "fixed time", "shaping alone")
SEEDS = (0, 1, 2)
STEPS, DRAWS = 200_000, 200
NOISES = ("original", "hard")
HOLDS = (0.8, 1.2, 1.6, 2.0, 2.4, 2.8)
"""Seconds of closing from which the fixed time is chosen, on training draws."""
HOLD_FILE = "hold.json"
WINDOW = 600
"""Episodes of each stage but the last: the same for all variants, whatever they succeed in."""


class FixedTimeLeaf(ConceptNode):
    """A leaf that says itself when its grasp is done."""

    def amended(self, action: Action, memory: GraspMemory) -> Action:
        """See `ConceptNode.amended`."""
        return Action(action.motion, memory.closing > self.model.values["hold"])


class FixedTimeGrasp(Grasp):
    """A grasp that is done a fixed time after the hand began to close, whatever its policy says.

    Args:
        hold: That time.
    """

    hold: Seconds = 1.2
    leaf_base = FixedTimeLeaf

    def programmed_motion(self, seen: Seen, memory: GraspMemory) -> Array:
        """The middle of a learned action, careful and slow, from which training begins."""
        return np.zeros((len(memory.closing), self.actions))


def tree(variant: str, hold: float = 1.2) -> Behaviour:
    """The tree of a variant; ``grasp_then_pick`` but for the completion signal."""
    if variant != "fixed time":
        return grasp_then_pick.build()
    return sequence(
        "grasp for a fixed time, then pick",
        Train(FixedTimeGrasp("target", hold=hold, timeout=10.0)),
        Pick("target", distance=grasp_then_pick.LIFT, speed=0.5),
    )


def scene() -> Scene:
    """That of ``grasp_then_pick``; its stages end after so many episodes, and not with success."""
    stages = [replace(stage, until=0.01) for stage in grasp_then_pick.stages()]
    return replace(grasp_then_pick.scene("panda"), stages=stages)


def config(variant: str, seed: int, steps: int) -> TrainConfig:
    """A run's settings."""
    return TrainConfig(
        steps=steps,
        seed=seed,
        success_window=WINDOW,
        stage_share=1.0,
        evaluate_every=12,
        evaluation_draws=100,
        reward=Reward(sufficient=variant != "shaping alone"),
    )


def runs(request: Request) -> list[tuple[str, int, Path]]:
    """Variant, seed and policy's folder of each run; seed by seed, so that few runs are comparable too."""
    folder = folder_of(request)
    return [(v, s, folder / f"{v.replace(' ', '-')}-{s}") for s in SEEDS for v in VARIANTS]


def folder_of(request: Request) -> Path:
    """Where the policies of this experiment are."""
    return (request.policies or POLICIES) / "ablations"


def train(request: Request) -> None:
    """Train what is not trained yet."""
    hold = best_hold(request)
    for variant, seed, out in runs(request):
        print(f"{variant}, seed {seed}", flush=True)
        settings = config(variant, seed, request.steps or STEPS)
        learn(
            functools.partial(tree, variant, hold), scene(), out, settings, request.workers,
            f"grasp_then_pick, {variant}", keep=False,
        )  # fmt: skip


def best_hold(request: Request) -> float:
    """The fixed time with which the middle of a learned action succeeds most often in the last stage."""
    path = folder_of(request) / HOLD_FILE
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        found, last = {}, len(grasp_then_pick.stages()) - 1
        for hold in HOLDS:
            case = judged.Case(functools.partial(tree, "fixed time", hold), scene(), stage=last)
            draws = judged.judge(case, range(request.draws or 200), request.workers, stream="training")
            found[str(hold)] = sum(d.success for d in draws) / len(draws)
            print(f"done {hold:g} s after closing began: {100 * found[str(hold)]:.1f} %", flush=True)
        write_text(path, json.dumps({"success": found, "best": max(found, key=found.__getitem__)}) + "\n")
    return float(json.loads(path.read_text(encoding="utf-8"))["best"])


def measure(request: Request) -> dict[str, Any]:
    """Each trained policy on held-apart draws, and the programmed grasp."""
    hold = best_hold(request)
    seeds = request.seeds(DRAWS)
    out: list[dict[str, Any]] = []
    wanted = [(v, s, str(p), p) for v, s, p in runs(request) if finished(p)]
    for variant, seed, policy, folder in [("programmed", 0, PROGRAMMED, None), *wanted]:
        row: dict[str, Any] = {"variant": variant, "seed": seed}
        for noise in NOISES:
            case = judged.Case(functools.partial(tree, variant, hold), scene(), policy, noise)
            row[noise] = judged.counts(judged.judge(case, seeds, request.workers))
            said = f"{share(row[noise])}   done {row[noise]['done_right']} of {row[noise]['done']}"
            print(f"{variant:16}{seed}  {noise:10}{said}", flush=True)
        curve = history(folder.with_name(f"{folder.name}.json")) if folder is not None else []
        out.append({**row, "curve": slim(curve)})
    return {"hold": hold, "runs": out}


def slim(rows: list[dict[str, Any]]) -> list[list[Any]]:
    """Of each rollout: decisions, share of successes in training, and on held-apart draws or None."""
    held = [row.get("held_apart") for row in rows]
    return [
        [row["steps"], round(row["success"], 3), h["successes"] / h["draws"] if h else None]
        for row, h in zip(rows, held, strict=True)
    ]


def table(found: dict[str, Any]) -> str:
    """By noise, variant and seed."""
    lines = [
        "| noise | variant | seed | succeeded | called done, of which survive the pick | how it fails |",
        "|---|---|---|---|---|---|",
    ]
    order = ["programmed", *VARIANTS]
    for noise in NOISES:
        for run in sorted(found["runs"], key=lambda r: (order.index(r["variant"]), r["seed"])):
            row, learned = run[noise], run["variant"] != "programmed"
            done = {"draws": row["done"], "successes": row["done_right"], "interval": row["done_interval"]}
            ends = ", ".join(f"{n} x {kind}" for kind, n in row["ends"].items()) or "none"
            seed = run["seed"] if learned else ""
            lines.append(f"| `{noise}` | {run['variant']} | {seed} | {share(row)} | {share(done)} | {ends} |")
    return "\n".join(lines)


def draw(found: dict[str, Any], folder: Path) -> None:
    """The learning curves of all runs, with the programmed grasp's line."""
    programmed = [r for r in found["runs"] if r["variant"] == "programmed"][:1]
    pictures.curves(
        folder / "F-learning.svg",
        "Success on held-apart draws",
        {
            f"{r['variant']}, seed {r['seed']}": [(c[0], c[2]) for c in r["curve"] if c[2] is not None]
            for r in found["runs"]
            if r["variant"] != "programmed"
        },
        lines={r["variant"]: r[NOISES[0]]["successes"] / r[NOISES[0]]["draws"] for r in programmed},
        groups=VARIANTS,
    )
