"""E. Another follower, another policy: the same grasp concept, trained before two different picks.

A gentle pick of light things that may not be squeezed (``grasp_gentle_lift``), and a fast one of heavy,
slippery things (``grasp_fast_heavy``). Nothing tells the grasp what comes; only what follows pays.
"""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

import numpy as np
from py_trees.behaviour import Behaviour

from benchmarks.experiments import judged, pictures
from benchmarks.experiments.common import Request, policy_of, share
from benchmarks.experiments.training import POLICIES, learn
from bt_tasksim.policy.policy import PROGRAMMED
from bt_tasksim.training.config import TrainConfig
from bt_tasksim.trees.scenarios import grasp_fast_heavy, grasp_gentle_lift

FOLLOWERS = {"gentle": grasp_gentle_lift, "fast": grasp_fast_heavy}
STEPS, DRAWS = 250_000, 300
LESS = 0.7
"""A weaker grip for the programmed grasp."""


def tree(follower: str, grip: float) -> Behaviour:
    """A follower's tree, with a grasp that closes to ``grip``."""
    return FOLLOWERS[follower].build(grip)


def train(request: Request) -> None:
    """Train both policies."""
    for follower, module in FOLLOWERS.items():
        out = (request.policies or POLICIES) / f"grasp-{follower}"
        config = TrainConfig(steps=request.steps or STEPS)
        name = module.__name__.rsplit(".", 1)[-1]
        learn(module.build, module.scene(), out, config, request.workers, name)


def rows(request: Request) -> list[tuple[str, str, float]]:
    """Who is asked: label, policy and grip."""
    folder = request.policies or POLICIES
    own = [(f"learned before the {f} pick", folder / f"grasp-{f}") for f in FOLLOWERS]
    out = [(label, str(p), 1.0) for label, p in own if p.is_dir()]
    out.append(("learned in grasp_then_pick", str(policy_of(request, "panda")), 1.0))
    programmed = [
        ("programmed, full grip", PROGRAMMED, 1.0),
        (f"programmed, grip {LESS:g}", PROGRAMMED, LESS),
    ]
    return [*out, *programmed]


def measure(request: Request) -> dict[str, Any]:
    """The cross table."""
    cells: list[dict[str, Any]] = []
    seeds = request.seeds(DRAWS)
    for label, policy, grip in rows(request):
        for follower, module in FOLLOWERS.items():
            case = judged.Case(functools.partial(tree, follower, grip), module.scene(), policy)
            draws = judged.judge(case, seeds, request.workers)
            forces = [d.force for d in draws if d.done and d.force > 0.0]
            found = judged.counts(draws)
            found["force"] = (
                [round(float(v), 1) for v in np.percentile(forces, (10, 50, 90))] if forces else []
            )
            cells.append({"who": label, "policy": Path(policy).name, "follower": follower, **found})
            print(f"{label:32}{follower:8}{share(found)}  force {found['force']} N", flush=True)
    return {"cells": cells, "squeeze": grasp_gentle_lift.SQUEEZE}


def table(found: dict[str, Any]) -> str:
    """The cross table."""
    lines = [
        "| grasp | before the gentle pick | force, N (10, 50, 90 %) | before the fast pick | force, N |",
        "|---|---|---|---|---|",
    ]
    for who in dict.fromkeys(cell["who"] for cell in found["cells"]):
        mine = {cell["follower"]: cell for cell in found["cells"] if cell["who"] == who}
        parts = [
            f"{share(mine[f])} | {', '.join(f'{v:g}' for v in mine[f]['force']) or '-'}" for f in FOLLOWERS
        ]
        lines.append(f"| {who} | {' | '.join(parts)} |")
    return "\n".join(lines)


def draw(found: dict[str, Any], folder: Path) -> None:
    """Success of each policy under both followers."""
    pictures.bars(
        folder / "E-cross-table.svg",
        "Success before each pick",
        {
            who: {f"{cell['follower']} pick": cell for cell in found["cells"] if cell["who"] == who}
            for who in dict.fromkeys(cell["who"] for cell in found["cells"])
        },
    )
