"""Tables of the concepts' scenarios, made from ``benchmarks/results``; see `benchmarks.concepts`."""

from __future__ import annotations

from typing import Any, NamedTuple

from benchmarks.any_tree_tables import NOT_YET
from benchmarks.taxonomy_table import COLUMNS as SIMULATED
from bt_tasksim.training.evaluation_outcomes import wilson
from bt_tasksim.trees.load import scenarios

NOT_DRAWN, TWIN = "no_draw", "panda-twin"
COLUMNS = {**SIMULATED, TWIN: "Panda, twin over ROS"}
"""What results are called behind their scenario, and how a table says it."""
UNITS = {
    "force": ("force at the wrist", 1.0, "N"),
    "jerk": ("jerk", 1.0, "m/s^3"),
    "overlap": ("overlap", 1e3, "mm"),
}
"""What is felt: its name, the factor by which it is shown, its unit."""
CHORES = {
    "chores-panda": "Panda, SAPIEN",
    "chores-panda-mujoco": "Panda, MuJoCo",
}
"""What results of random chores are called, and how a table says it."""
Results = dict[str, Any]


class Within(NamedTuple):
    """Runs within all limits, of how many, and whether there may be more."""

    runs: int
    of: int
    more: str

    def __str__(self) -> str:
        return f"{self.runs} of {self.of}{self.more}"


def concepts(results: Results) -> str:
    """Successes of every scenario, of the draws in which it could begin."""
    lines = [f"| scenario | {' | '.join(COLUMNS.values())} |", f"|---|{'---|' * len(COLUMNS)}"]
    for scenario in scenarios():
        found = {column: results.get(f"concept-{scenario}-{column}") for column in COLUMNS}
        cells = ["" if column == TWIN and not row else _counted(row) for column, row in found.items()]
        lines.append(f"| `{scenario}` | {' | '.join(cells)} |")
    return "\n".join(lines)


def _counted(found: dict[str, Any] | None) -> str:
    """Successes of how many, and the interval."""
    if found is None:
        return NOT_YET
    drawn = found["episodes"] - len(found.get("undrawn_seeds", ()))
    if not drawn:
        return "never drawn"
    low, high = wilson(found["successes"], drawn)
    return f"{found['successes']} of {drawn} ({100 * low:.0f} to {100 * high:.0f} %)"


def failures(results: Results) -> str:
    """Why runs failed: the leaf and its reason, in every row that had failures."""
    lines = ["| scenario | with | failed | leaf: reason, how often |", "|---|---|---|---|"]
    for scenario in scenarios():
        for column, title in COLUMNS.items():
            found = results.get(f"concept-{scenario}-{column}", {})
            reasons = {why: n for why, n in found.get("reasons", {}).items() if NOT_DRAWN not in why}
            if reasons:
                said = ", ".join(f"{why.lstrip(': ')} {n}" for why, n in reasons.items())
                lines.append(f"| `{scenario}` | {title} | {sum(reasons.values())} | {said} |")
    return "\n".join(lines) if len(lines) > 2 else "None."


def chores(results: Results) -> str:
    """Successes of random trees over all concepts, of all draws and of those that an oracle achieves."""
    lines = ["| with | draws | succeeded | of what the oracle achieves | failed |", "|---|---|---|---|---|"]
    for name, title in CHORES.items():
        found = results.get(name)
        if found is None:
            lines.append(f"| {title} | {NOT_YET} | | | |")
            continue
        low, high = wilson(found["successes"], found["possible"])
        share = f"{found['successes']} of {found['possible']} ({100 * low:.0f} to {100 * high:.0f} %)"
        failed = ", ".join(f"{why} {n}" for why, n in found["failures"].items())
        lines.append(f"| {title} | {found['episodes']} | {found['successes']} | {share} | {failed} |")
    return "\n".join(lines)


def gentleness(results: Results) -> str:
    """What 95 % of the runs of each scenario did not exceed with the Panda, in the worse of both engines."""
    titles = [f"{name} ({unit})" for name, _, unit in UNITS.values()]
    lines = [f"| scenario | {' | '.join(titles)} | runs within all limits |", "|---|---|---|---|---|"]
    for scenario in scenarios():
        rows = [results.get(f"concept-{scenario}-{column}") for column in ("panda-sapien", "panda-mujoco")]
        felt = [row for row in rows if row is not None]
        if not felt:
            continue
        cells = []
        for what, (_, factor, _) in UNITS.items():
            having = [row[what] for row in felt if what in row]
            if not having:
                cells.append("not felt")
                continue
            worst = max(factor * found["usual"] for found in having)
            cells.append(f"{worst:.1f} of {factor * having[0]['limit']:.0f}")
        lines.append(f"| `{scenario}` | {' | '.join(cells)} | {min(map(_within, felt))} |")
    return "\n".join(lines) if len(lines) > 2 else NOT_YET.capitalize() + "."


def _within(row: dict[str, Any]) -> Within:
    """How many runs kept all limits; older results say it of each limit alone, from which it follows."""
    having = [row[what] for what in UNITS if what in row]
    if "gentle" in row:
        return Within(row["gentle"], row["episodes"], "")
    left = row["episodes"] - sum(found["of"] - found["within"] for found in having)
    return Within(left, row["episodes"], " at least" if len(having) > 1 else "")


TABLES = {"concepts": concepts, "chores": chores, "concept_failures": failures, "gentleness": gentleness}
