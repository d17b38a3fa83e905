"""D. The learned grasp in longer sequences: ``shelf_to_shelf`` and ``pick_and_throw``, nothing trained anew.

With the pose estimate's noise ``original``, and with a simulated depth camera; programmed beside learned on
the same draws.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from benchmarks.experiments import frames, pictures
from benchmarks.experiments.common import Request, policy_of, read, share, write
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.policy.policy import PROGRAMMED
from bt_tasksim.training.evaluation import Job, evaluate

TREES = ("shelf_to_shelf", "pick_and_throw")
PERCEPTIONS = {
    "pose, noise original": EngineOptions(noise="original"),
    "camera": EngineOptions(perception="camera"),
}
DRAWS = 100
MOST_STRIPS = 6


def measure(request: Request) -> dict[str, Any]:
    """All rows; those that are there already, of the same policy and as many draws, stay."""
    known = (read("D", request.results) or {}).get("rows", [])
    rows: list[dict[str, Any]] = []
    seeds = request.seeds(DRAWS)
    for perceived, options in PERCEPTIONS.items():
        for tree in TREES:
            for who in ("learned", "programmed"):
                policy = str(policy_of(request, "panda")) if who == "learned" else PROGRAMMED
                job = Job(tree, robot="panda", options=options, policies=(("grasp", policy),))
                key = {"tree": tree, "perception": perceived, "who": who, "policy": used(job)}
                old = [
                    r for r in known if r["draws"] == len(seeds) and all(r[k] == v for k, v in key.items())
                ]
                rows.append(old[0] if old else {**key, **_measured(job, seeds, request.workers)})
                write(request, "D", {"rows": rows + [r for r in known if r not in rows]})
                print(f"{tree:16}{perceived:22}{who:12}{share(rows[-1])}", flush=True)
    return {"rows": rows}


def used(job: Job) -> str:
    """Name and hash of the policy that a job's grasp takes."""
    from benchmarks.experiments.judged import load

    return load(dict(job.policies)["grasp"]).name


def _measured(job: Job, seeds: range, workers: int) -> dict[str, Any]:
    found = evaluate(job, seeds, workers).to_json()
    first: dict[str, int] = {}
    why: dict[str, str] = {}
    for outcome in found["outcomes"]:
        kind = "success" if outcome["success"] else outcome["reason"]
        first.setdefault(kind, outcome["seed"])
        why.setdefault(kind, outcome["why"])
    return {
        "draws": found["episodes"],
        "successes": found["successes"],
        "interval": [round(v, 4) for v in found["confidence_interval"]],
        "failures": found["failures"],
        "failed_seeds": found["failed_seeds"],
        "first": first,
        "why": why,
    }


def table(found: dict[str, Any]) -> str:
    """Tree by tree."""
    lines = ["| tree | perception | grasp | succeeded | how it fails |", "|---|---|---|---|---|"]
    for row in found["rows"]:
        failed = ", ".join(f"{n} x {kind}" for kind, n in row["failures"].items()) or "none"
        lines.append(f"| `{row['tree']}` | {row['perception']} | {row['who']} | {share(row)} | {failed} |")
    return "\n".join(lines)


def draw(found: dict[str, Any], folder: Path) -> None:
    """Success of both policies."""
    short = {"pose, noise original": "pose", "camera": "camera"}
    series: dict[str, dict[str, Any]] = {}
    for row in found["rows"]:
        label = f"{row['tree'].replace('_', ' ')},\n{short[row['perception']]}"
        series.setdefault(row["who"], {})[label] = row
    pictures.bars(folder / "D-sequences.svg", "Success in longer sequences", series)


def film(found: dict[str, Any], request: Request) -> None:
    """For each tree, frames of one success and of each kind of failure of the learned grasp."""
    policy = str(policy_of(request, "panda"))
    for tree in TREES:
        strips, shown = [], set()
        for row in found["rows"]:
            if row["tree"] != tree or row["who"] != "learned":
                continue
            job = Job(tree, None, "panda", PERCEPTIONS[row["perception"]], policies=(("grasp", policy),))
            for kind, seed in row["first"].items():
                if kind not in shown and len(strips) < MOST_STRIPS:
                    shown.add(kind)
                    caption = f"{kind}, seed {seed}, {row['perception']}"
                    strips.append(frames.film(job, seed, caption, 6, frames.WHOLE))
        frames.sheet(request.pictures / f"D-{tree}.png", strips)
