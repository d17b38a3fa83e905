"""Tables of any tree, made from ``benchmarks/results``; see `benchmarks.tables` and `benchmarks.any_tree`."""

from __future__ import annotations

from typing import Any

from benchmarks.any_tree.report import impossible
from benchmarks.paired import Paired, mcnemar
from bt_tasksim.training.evaluation_outcomes import wilson

NOT_YET = "not measured yet"
ROWS = {
    "any_tree-panda": "Panda",
    "any_tree-xarm7_ability": "xArm7 with the Ability hand",
    "any_tree-so100": "SO-100",
    "any_tree-panda-camera": "Panda, camera",
    "any_tree-panda-camera-1_colours": "Panda, camera, one colour",
    "any_tree-panda-original": "Panda, noise `original`",
    "any_tree-panda-recovering": "Panda, `recovering`",
    "any_tree-panda-mujoco": "Panda, MuJoCo",
    "any_tree-panda-twin": "Panda, twin over ROS",
}
"""What results are called, and how a row says it."""
BARS = {
    "any_tree-panda": 95,
    "any_tree-xarm7_ability": 95,
    "any_tree-so100": 95,
    "any_tree-panda-camera": 90,
    "any_tree-panda-camera-1_colours": 90,
    "any_tree-panda-original": 92,
}
"""Percent of the possible draws that should succeed at least."""
DRAWS = {
    "any_tree-panda": 500,
    "any_tree-panda-recovering": 500,
    "any_tree-xarm7_ability": 200,
    "any_tree-so100": 200,
    "any_tree-panda-mujoco": 200,
    "any_tree-panda-twin": 40,
}
"""How many draws a row should have, where not 100: a newer block with fewer does not replace an older one."""
PAIRS = ("any_tree-panda-recovering", "any_tree-panda-mujoco", "any_tree-panda-twin")
"""Rows on the draws of the first one, in other circumstances."""
FIVE = {
    "two_spots": "two objects to two spots",
    "three_spots": "three objects to three spots",
    "bin_then_spot": "a can into the bin, then a box onto a spot",
    "shelf": "a cup from the table onto the shelf's lower board",
    "tower": "a tower of three cubes",
}
SHOWN = 4
"""Seeds that a row of failures names."""
Results = dict[str, Any]


def any_tree(results: Results) -> str:
    """Successes of the draws that are possible and not refused, and what trees said that was not so."""
    lines = [
        "| with | block | draws | succeeded | impossible | time was over | refused by name "
        "| of the others (95 % interval) | bar | SUCCESS, goals missed | bodies overlapped |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name, label in _shown(results):
        found = _full(results, name)
        if found is None:
            lines.append(f"| {label} | | {NOT_YET} | | | | | | | | |")
            continue
        refused = _refused(found)
        counted = found["possible"] - refused
        low, high = wilson(found["successes"], counted)
        share = 100 * found["successes"] / counted
        rate = f"{share:.2f} % ({100 * low:.1f} to {100 * high:.1f})"
        bar = f"{BARS[name]} %" if name in BARS else ""
        impossible, block = found["episodes"] - found["possible"], found.get("block") or ""
        lines.append(
            f"| {label} | {block} | {found['episodes']} | {found['successes']} | {impossible} "
            f"| {found['unended']} | {refused} | {rate} | {bar} | {found['lies']} | {found['overlaps']} |"
        )
    return "\n".join(lines)


def any_tree_failures(results: Results) -> str:
    """Leaves and reasons of all that failed and is possible."""
    lines = ["| with | leaf | reason | how often | seeds |", "|---|---|---|---|---|"]
    for name, label in _shown(results):
        for failure in (_full(results, name) or {"failures": []})["failures"]:
            seeds = ", ".join(str(seed) for seed in failure["seeds"][:SHOWN])
            more = ", ..." if failure["count"] > SHOWN else ""
            said = f"{failure['concept']} | {failure['reason']} | {failure['count']} | {seeds}{more}"
            lines.append(f"| {label} | {said} |")
    return "\n".join(lines)


def any_tree_pairs(results: Results) -> str:
    """The same draws in other circumstances, by the Panda's result of the same block."""
    lines = [
        "| with | block | draws | Panda, SAPIEN | this | only SAPIEN | only this | p |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name in PAIRS:
        other = _full(results, name)
        block = (other or {}).get("block") or ""
        usual = results.get(f"{block}/any_tree-panda" if block else "any_tree-panda")
        pair = Paired("any_tree", name, _outcomes(usual), _outcomes(other))
        if not pair.draws:
            lines.append(f"| {ROWS[name]} | | {NOT_YET} | | | | | |")
            continue
        lost, won = len(pair.only_old), len(pair.only_new)
        lines.append(
            f"| {ROWS[name]} | {block} | {pair.draws} | {pair.successes('old')} | {pair.successes('new')} "
            f"| {lost} | {won} | {mcnemar(lost, won):.3g} |"
        )
    return "\n".join(lines)


def five(results: Results) -> str:
    """Five trees that anybody tries first."""
    lines = ["| tree | block | succeeded (95 % interval) | failures |", "|---|---|---|---|"]
    for name, label in FIVE.items():
        found = results.get(f"five-{name}-panda")
        if found is None:
            lines.append(f"| {label} | | {NOT_YET} | |")
            continue
        low, high = found["confidence_interval"]
        said = f"{found['successes']} of {found['episodes']} ({100 * low:.1f} to {100 * high:.1f} %)"
        failures = ", ".join(f"{count} x {reason}" for reason, count in found["failures"].items()) or "none"
        lines.append(f"| {label} | {found.get('block') or ''} | {said} | {failures} |")
    return "\n".join(lines)


def _shown(results: Results) -> list[tuple[str, str]]:
    others = sorted(n for n in results if n.startswith("any_tree-") and n not in ROWS)
    return [*ROWS.items(), *((name, f"`{name.removeprefix('any_tree-')}`") for name in others)]


def _full(results: Results, name: str) -> dict[str, Any] | None:
    """The result of the newest block that has all the draws of a row; else the newest of all."""
    blocks = sorted((key for key in results if key.endswith(f"/{name}")), reverse=True)
    full = (results[key] for key in blocks if results[key]["episodes"] >= DRAWS.get(name, 100))
    return next(full, results.get(name))


def _refused(found: dict[str, Any]) -> int:
    """Draws that are possible, and that were refused by name before anything moved."""
    refused = set(found.get("refused", ()))
    return sum(draw["seed"] in refused and not impossible(draw) for draw in found["draws"])


def _outcomes(found: dict[str, Any] | None) -> dict[str, bool]:
    return {str(draw["seed"]): bool(draw["success"]) for draw in (found or {"draws": []})["draws"]}


TABLES = {
    "any_tree": any_tree,
    "any_tree_failures": any_tree_failures,
    "any_tree_pairs": any_tree_pairs,
    "five": five,
}
