"""B. Shapes that were never seen: one policy on boxes, cups, oval packs, diamonds, cylinders and others.

Learned beside programmed on the same held-apart draws. Where ``python -m benchmarks.grasp`` has measured the
shipped policy, its results are taken; ``benchmarks.oracle`` says what could be grasped at all.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from benchmarks import grasp, oracle
from benchmarks.experiments import frames, pictures
from benchmarks.experiments.common import FIRST_SEED, Request, policy_of, share
from bt_tasksim.core.errors import InputError
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.policy.policy import PROGRAMMED
from bt_tasksim.training.evaluation import Job, evaluate
from bt_tasksim.trees.scenarios import grasp_then_pick

NOISE, DRAWS = "original", 300
WHO = ("learned", "programmed")
ROBOT = "panda"


def measure(request: Request) -> dict[str, Any]:
    """Both policies with the Panda."""
    return measured(request, ROBOT)


def measured(request: Request, robot: str) -> dict[str, Any]:
    """Both policies with a robot: counts by shape, failures, and the draws with their sizes."""
    found = {who: _results(request, robot, who) for who in WHO}
    n = min(f["episodes"] for f in found.values())
    failed = {who: set(f["failed_seeds"]) for who, f in found.items()}
    draws = []
    scene = grasp_then_pick.scene(robot)
    for seed in range(FIRST_SEED, FIRST_SEED + n):
        thing = scene.sample(seed).objects[0]
        size = [round(1000 * v, 1) for v in thing.size]
        draws.append([seed, thing.kind, size[1], size[2], *(int(seed not in failed[who]) for who in WHO)])
    return {
        "robot": robot,
        "policy": str(found["learned"]["policies"][grasp.LEAF]),
        "kinds": {who: f["kinds"] for who, f in found.items()},
        "failures": {who: f["failures"] for who, f in found.items()},
        "completion": {who: f["completion"] for who, f in found.items()},
        "draws": draws,
    }


def _results(request: Request, robot: str, who: str) -> dict[str, Any]:
    """One policy's results: those of `benchmarks.grasp` where nothing else is asked for, or measured now."""
    file = request.results / f"grasp-{robot}-{NOISE}-{who}.json"
    if file.is_file() and request.policy is None and request.draws is None:
        found: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        return found
    seeds = request.seeds(DRAWS)
    policy = str(policy_of(request, robot)) if who == "learned" else PROGRAMMED
    evaluation = grasp.measure(robot, NOISE, policy, seeds, request.workers)
    scene = grasp_then_pick.scene(robot)
    kinds = {seed: scene.sample(seed).objects[0].kind for seed in seeds}
    try:
        known = oracle.load(robot)
        graspable = {seed: bool(known[seed]["graspable"]) for seed in seeds}
    except (InputError, KeyError):
        graspable = {}
    return grasp.summary(evaluation, kinds, graspable)


def table(found: dict[str, Any]) -> str:
    """By shape."""
    kinds = found["kinds"]
    lines = ["| shape | learned | programmed | of graspable, learned | programmed |", "|---|---|---|---|---|"]
    for kind in kinds["learned"]:
        rows = [kinds[who].get(kind) for who in WHO]
        cells = [share(row) if row else "" for row in rows]
        cells += [share(row["graspable"]) if row and "graspable" in row else "" for row in rows]
        lines.append(f"| {kind} | {' | '.join(cells)} |")
    lines += ["", "| grasp | called done, of which survive the pick | how it fails |", "|---|---|---|"]
    lines += [f"| {who} | {done(found, who)} | {fails(found, who)} |" for who in WHO]
    return "\n".join(lines)


def done(found: dict[str, Any], who: str) -> str:
    """How far "done" can be trusted."""
    said = found["completion"][who]
    return share({"draws": said["done"], "successes": said["right"], "interval": said["interval"]})


def fails(found: dict[str, Any], who: str) -> str:
    """Failures by kind."""
    return ", ".join(f"{n} x {kind}" for kind, n in found["failures"][who].items()) or "none"


def draw(found: dict[str, Any], folder: Path) -> None:
    """Success by shape, and by width and height."""
    draw_as(found, folder, "B")


def draw_as(found: dict[str, Any], folder: Path, letter: str) -> None:
    """See `draw`."""
    pictures.bars(folder / f"{letter}-shapes.svg", "Success by shape", found["kinds"])
    panels = {
        who: [(row[2], row[3], bool(row[4 + k])) for row in found["draws"]] for k, who in enumerate(WHO)
    }
    pictures.sizes(folder / f"{letter}-sizes.svg", "Success by size", panels)


def film(found: dict[str, Any], request: Request, letter: str = "B") -> None:
    """Frames of the first success of each shape, and of the first failure of each kind."""
    robot = found["robot"]
    policy = str(policy_of(request, robot))
    job = Job("grasp_then_pick", None, robot, EngineOptions(noise=NOISE), policies=(("grasp", policy),))
    strips = []
    for kind in sorted({row[1] for row in found["draws"]}):
        good = [row[0] for row in found["draws"] if row[1] == kind and row[4]]
        if good:
            strips.append(frames.film(job, good[0], f"{kind}, seed {good[0]}"))
    failed: dict[str, int] = {}
    for outcome in evaluate(job, [row[0] for row in found["draws"] if not row[4]], request.workers).outcomes:
        failed.setdefault(grasp.failure(outcome), outcome.seed)
    strips += [frames.film(job, seed, f"{kind}, seed {seed}") for kind, seed in failed.items()]
    frames.sheet(request.pictures / f"{letter}-frames.png", strips, columns=2)
