"""C. Another robot: the same tree, concept and training with the xArm7 and the five-fingered Ability hand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from benchmarks.experiments import pictures, shapes
from benchmarks.experiments.common import Request, share
from bt_tasksim.core.errors import InputError

ROBOTS = ("panda", "xarm7_ability")


def measure(request: Request) -> dict[str, Any]:
    """Both robots, each with its own policy; ``--policy`` names that of the xArm7."""
    out = {}
    for robot in ROBOTS:
        own = request if robot != "panda" else Request(**{**vars(request), "policy": None})
        try:
            out[robot] = shapes.measured(own, robot)
        except InputError as error:
            print(f"{robot}: {error}")
    if "xarm7_ability" not in out:
        raise InputError("there is no policy for the xArm7 yet: train one, or name it with --policy")
    return {"robots": out}


def table(found: dict[str, Any]) -> str:
    """Robot beside robot."""
    lines = [
        "| robot | grasp | succeeded | called done, of which survive the pick | how it fails |",
        "|---|---|---|---|---|",
    ]
    for robot, one in found["robots"].items():
        for who in shapes.WHO:
            cells = (share(one["kinds"][who]["all"]), shapes.done(one, who), shapes.fails(one, who))
            lines.append(f"| `{robot}` | {who} | {' | '.join(cells)} |")
    kinds = list(found["robots"]["xarm7_ability"]["kinds"]["learned"])
    lines += [
        "",
        "| shape | " + " | ".join(f"`{r}`, {w}" for r in found["robots"] for w in shapes.WHO) + " |",
    ]
    lines.append("|---" * (1 + len(shapes.WHO) * len(found["robots"])) + "|")
    for kind in kinds:
        rows = [one["kinds"][who].get(kind) for one in found["robots"].values() for who in shapes.WHO]
        lines.append(f"| {kind} | {' | '.join(share(row) if row else '' for row in rows)} |")
    return "\n".join(lines)


def draw(found: dict[str, Any], folder: Path) -> None:
    """Success by shape and robot."""
    series = {
        f"{robot}, {who}": one["kinds"][who] for robot, one in found["robots"].items() for who in shapes.WHO
    }
    pictures.bars(folder / "C-shapes.svg", "Success by shape", series)


def film(found: dict[str, Any], request: Request) -> None:
    """Frames of the xArm7's first success of each shape."""
    shapes.film(found["robots"]["xarm7_ability"], request, "C")
