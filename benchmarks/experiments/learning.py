"""A. Grasp, taught by the pick after it: how success grows with decisions and time.

Reads the history that a training of ``grasp_then_pick`` has left beside its policy, keeps it as
``benchmarks/results/training-<name>.json``, and measures the programmed grasp on the same held-apart draws.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

from benchmarks.experiments import judged, pictures
from benchmarks.experiments.common import Request, policy_of, share
from benchmarks.experiments.training import compact, history
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.files import write_text
from bt_tasksim.policy.files import load_card
from bt_tasksim.trees.scenarios import grasp_then_pick

ROBOTS = ("panda", "xarm7_ability")
DRAWS = 200
"""Of the held-apart draws on which a training judges itself."""
MILESTONES = (0.1, 0.25, 0.5, 0.75, 1.0)
OFTEN = 6
"""Kinds of ends that have a colour of their own."""


def measure(request: Request) -> dict[str, Any]:
    """The histories that are there, and the programmed grasp beside them."""
    runs = []
    robots = (load_card(request.policy).robot,) if request.policy else ROBOTS
    for robot in robots:
        try:
            name, rows = kept(request, robot)
        except InputError as error:
            print(error)
            continue
        case = judged.Case(grasp_then_pick.build, grasp_then_pick.scene(robot))
        draws = judged.judge(case, range(request.draws or DRAWS), request.workers, stream="validation")
        runs.append({"name": name, "robot": robot, "rows": rows, "programmed": judged.counts(draws)})
    if not runs:
        raise InputError("there is no history of a training: name its policy with --policy")
    return {"runs": runs}


def kept(request: Request, robot: str) -> tuple[str, list[dict[str, Any]]]:
    """A policy's name and its training's history, which is written to the results.

    Raises:
        InputError: There is none.
    """
    policy = policy_of(request, robot)
    found = policy.with_name(f"{policy.name}.training") / "history.json"
    file = request.results / f"training-{policy.name}.json"
    if found.is_file():
        request.results.mkdir(parents=True, exist_ok=True)
        write_text(file, compact(history(found)))
    if not file.is_file():
        raise InputError(f"there is neither '{found}' nor '{file}'")
    return policy.name, history(file)


def table(found: dict[str, Any]) -> str:
    """Success over time, and by stage."""
    lines = [
        "| training | decisions | minutes | stage | succeeded while exploring | on held-apart draws |",
        "|---|---|---|---|---|---|",
    ]
    for run in found["runs"]:
        for row in milestones(run["rows"]):
            held = row["held_apart"]
            apart = {"interval": judged.interval(held["successes"], held["draws"]), **held}
            lines.append(
                f"| `{run['name']}` | {row['steps']} | {row['seconds'] / 60:.0f} | {stage_of(row)} "
                f"| {100 * row['success']:.0f} % | {share(apart)} |"
            )
        lines.append(f"| programmed, `{run['robot']}` | | | | | {share(run['programmed'])} |")
    lines += ["", "| training | stage | decisions | episodes | succeeded | how episodes ended |"]
    lines.append("|---|---|---|---|---|---|")
    for run in found["runs"]:
        for stage, rows in stages(run["rows"]).items():
            ends = sum((Counter(row["ends"]) for row in rows), Counter[str]())
            n = sum(ends.values())
            said = ", ".join(
                f"{100 * k / n:.0f} % {kind}" for kind, k in ends.most_common() if kind != "success"
            )
            size = run["rows"][-1]["steps"] // len(run["rows"])
            lines.append(
                f"| `{run['name']}` | {stage} | {size * len(rows)} | {n} "
                f"| {100 * ends['success'] / max(n, 1):.0f} % | {said} |"
            )
    return "\n".join(lines)


def milestones(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The evaluations nearest to some shares of a training."""
    judged_rows = [row for row in rows if row.get("held_apart")]
    out = []
    for part in MILESTONES:
        wanted = part * rows[-1]["steps"]
        row = min(judged_rows, key=lambda r: abs(r["steps"] - wanted), default=None)
        if row is not None and row not in out:
            out.append(row)
    return out


def stage_of(row: dict[str, Any]) -> str:
    """The curriculum stage of a rollout; earlier results call it a lesson."""
    return str(row.get("stage", row.get("lesson", "")))


def stages(rows: list[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """Rollouts by stage, in order."""
    out: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        out.setdefault(stage_of(row), []).append(row)
    return out


def draw(found: dict[str, Any], folder: Path) -> None:
    """For each training: learning curve and ends."""
    for run in found["runs"]:
        rows = run["rows"]
        smooth = _smoothed([row["success"] for row in rows])
        marks = [(mine[0]["steps"], stage) for stage, mine in stages(rows).items()]
        programmed = run["programmed"]
        pictures.curves(
            folder / f"A-{run['name']}.svg",
            f"Learning of {run['name']}",
            {
                "held-apart draws": [
                    (row["steps"], row["held_apart"]["successes"] / row["held_apart"]["draws"])
                    for row in rows
                    if row.get("held_apart")
                ],
                "in training, exploring": list(zip([row["steps"] for row in rows], smooth, strict=True)),
            },
            lines={"programmed, on the same held-apart draws": programmed["successes"] / programmed["draws"]},
            marks=marks,
        )
        total: Counter[str] = sum((Counter(row["ends"]) for row in rows), Counter())
        named = ["success", *(k for k, _ in total.most_common() if k != "success")][:OFTEN]
        pictures.stacked(
            folder / f"A-{run['name']}-ends.svg",
            f"How the episodes of {run['name']} ended",
            [row["steps"] for row in rows],
            {
                kind: _smoothed([row["ends"].get(kind, 0) / max(row["episodes"], 1) for row in rows])
                for kind in named
            },
        )


def _smoothed(values: list[float], width: int = 5) -> list[float]:
    """Means of neighbours."""
    half = width // 2
    windows = [values[max(0, k - half) : k + half + 1] for k in range(len(values))]
    return [sum(w) / len(w) for w in windows]
