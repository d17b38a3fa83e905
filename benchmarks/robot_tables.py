"""Tables about robots, their twin and faults, made from ``benchmarks/results``; see `benchmarks.tables`."""

from __future__ import annotations

import math
import statistics
from typing import Any

from benchmarks.faults import FAULTS, LATEST
from benchmarks.gap import ENGINES, GRASPS, SCENARIOS

NOT_YET = "not measured yet"
NAMES = {"sapien": "SAPIEN", "mujoco": "MuJoCo", "twin": "twin over ROS"}
Results = dict[str, Any]


def gap(results: Results) -> str:
    """The same trees in two simulators and on the twin."""
    heads = " | ".join(f"{NAMES[engines]} (95 % interval)" for engines in ENGINES)
    lines = [f"| scenario | grasp | {heads} |", "|---|---|---|---|---|"]
    for scenario in SCENARIOS:
        for grasp in GRASPS:
            found = [results.get(f"gap-{scenario}-{grasp}-{engines}") for engines in ENGINES]
            cells = " | ".join(_rate(row) for row in found)
            lines.append(f"| `{scenario}` | {grasp} | {cells} |")
    return "\n".join(lines)


def gap_failures(results: Results) -> str:
    """What every failure of these runs was."""
    lines = ["| scenario | grasp | engines | seed | failure |", "|---|---|---|---|---|"]
    for scenario in SCENARIOS:
        for grasp in GRASPS:
            for engines in ENGINES:
                row = results.get(f"gap-{scenario}-{grasp}-{engines}") or {"outcomes": []}
                for outcome in (o for o in row["outcomes"] if not o["success"]):
                    said = outcome["why"].replace("|", "\\|")
                    lines.append(
                        f"| `{scenario}` | {grasp} | {NAMES[engines]} | {outcome['seed']} | {said} |"
                    )
    return "\n".join(lines)


def faults(results: Results) -> str:
    """Every fault, when the arm was held, how far it got, and who held it."""
    lines = [
        "| fault | held after: median, longest | stands after, longest | farthest joint | fresh run | by |",
        "|---|---|---|---|---|---|",
    ]
    found = results.get("faults") or {}
    for fault in FAULTS:
        seen = found.get(fault)
        if not seen:
            lines.append(f"| {fault} | {NOT_YET} | | | | |")
            continue
        held = [1000 * s["held"] for s in seen]
        ways = [s["far"] for s in seen if not math.isnan(s["far"])]
        far = f"{max(ways):.3f} rad" if ways else "not known"
        bad = sum(s["held"] > LATEST or bool(s["running"]) for s in seen)
        lines.append(
            f"| {fault} | {statistics.median(held):.0f}, {max(held):.0f} ms{f' ({bad} late)' if bad else ''} "
            f"| {1000 * max(s['still'] for s in seen):.0f} ms | {far} "
            f"| {sum(s['again'] for s in seen)} of {len(seen)} | {_by(seen)} |"
        )
    return "\n".join(lines)


def messages(results: Results) -> str:
    """One message of each fault, as it was shown."""
    lines = ["| fault | said |", "|---|---|"]
    found = results.get("faults") or {}
    for fault, seen in ((fault, found[fault]) for fault in FAULTS if fault in found):
        said = seen[0]["said"].replace("|", "/").replace(" []", "").replace("bt-tasksim ", "")
        lines.append(f"| {fault} | `{said}` |")
    return "\n".join(lines)


def loop(results: Results) -> str:
    """How well 50 Hz were kept over ROS."""
    found = results.get("loop")
    rows = (
        ("ticks", lambda f: f"{f['ticks']} at {1.0 / f['period']:.0f} Hz, {f['minutes']:g} minutes"),
        ("within 2 ms of their time", lambda f: f"{100 * f['punctual']:.2f} %"),
        (
            "late: median, 99 %, worst",
            lambda f: ", ".join(f"{1000 * f[k]:.2f}" for k in ("median", "p99", "worst")) + " ms",
        ),
        ("overruns, periods left out", lambda f: f"{f['overruns']}, {f['skipped']}"),
        (
            "from a state's stamp to the command: median, 99 %",
            lambda f: f"{1000 * f['latency_median']:.1f}, {1000 * f['latency_p99']:.1f} ms",
        ),
        ("of which the way of a state through the bridge", lambda f: f"{1000 * f['shortest_way']:.1f} ms"),
    )
    lines = ["| loop over ROS | |", "|---|---|"]
    lines += [f"| {label} | {value(found) if found else NOT_YET} |" for label, value in rows]
    return "\n".join(lines)


def _rate(row: Any) -> str:
    if not row:
        return NOT_YET
    low, high = (100 * bound for bound in row["confidence_interval"])
    return f"{row['successes']} of {row['episodes']} ({low:.1f} to {high:.1f} %)"


def _by(seen: list[dict[str, Any]]) -> str:
    """What held the arm, the most frequent first, without numbers."""
    counts: dict[str, int] = {}
    for s in seen:
        reason = s["by"].split(": ")[0] if s["by"].startswith(("stale", "watchdog")) else s["by"]
        counts[reason] = counts.get(reason, 0) + 1
    return ", ".join(sorted(counts, key=lambda k: -counts[k])) or "nothing"


TABLES = {
    "gap": gap,
    "gap_failures": gap_failures,
    "faults": faults,
    "fault_messages": messages,
    "loop": loop,
}
