"""What results of many draws say: rates with their intervals, and failures by leaf and reason."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from bt_tasksim.core.outcomes import NOT_TOLD_APART
from bt_tasksim.training.evaluation_outcomes import wilson

Draw = Mapping[str, Any]
SHOWN = 6
"""Seeds that a line names."""


def impossible(draw: Draw) -> bool:
    """The oracle was asked about a draw, and found no way."""
    found = draw.get("oracle")
    return found is not None and not found["possible"]


def summary(draws: Sequence[Draw]) -> dict[str, Any]:
    """Counts and rates: of all draws, and of those that are possible."""
    successes = sum(bool(draw["success"]) for draw in draws)
    possible = [draw for draw in draws if not impossible(draw)]
    groups = grouped([draw for draw in possible if not draw["success"]])
    return {
        "episodes": len(draws),
        "successes": successes,
        "possible": len(possible),
        "success_rate": _rate(successes, len(draws)),
        "possible_rate": _rate(successes, len(possible)),
        "confidence_interval": list(wilson(successes, len(possible))) if possible else None,
        "lies": sum(bool(draw.get("lie")) for draw in draws),
        "lying_seeds": [draw["seed"] for draw in draws if draw.get("lie")],
        "overlaps": sum(bool(draw.get("overlap")) for draw in draws),
        "refused": [draw["seed"] for draw in draws if draw["reason"] == NOT_TOLD_APART.name],
        "asked_oracle": sum("oracle" in draw for draw in draws),
        "impossible": dict(Counter(draw["oracle"]["reason"] for draw in draws if impossible(draw))),
        "unended": sum(impossible(draw) and not draw["oracle"].get("exhausted") for draw in draws),
        "failures": [
            {"concept": concept, "reason": reason, "count": len(group), "seeds": [d["seed"] for d in group]}
            for (concept, reason), group in groups
        ],
    }


def _rate(count: int, of: int) -> float | None:
    return count / of if of else None


def grouped(draws: Sequence[Draw]) -> list[tuple[tuple[str, str], list[Draw]]]:
    """Draws by concept and reason, the most frequent first."""
    groups: dict[tuple[str, str], list[Draw]] = {}
    for draw in draws:
        concept = (
            draw["concept"]
            or draw["leaf"]
            or ("judged at the end" if draw.get("status") == "SUCCESS" else "no leaf")
        )
        groups.setdefault((concept, draw["reason"]), []).append(draw)
    return sorted(groups.items(), key=lambda item: (-len(item[1]), item[0]))


def lines(draws: Sequence[Draw], title: str) -> list[str]:
    """What people read."""
    if not draws:
        return [f"{title}: no draw has ended"]
    said = summary(draws)
    out = [f"{title}: {said['successes']} of {said['episodes']} ({100 * said['success_rate']:.1f} %)"]
    if said["asked_oracle"] and said["possible"]:
        low, high = said["confidence_interval"]
        out.append(
            f"  of those that are possible {said['successes']} of {said['possible']} "
            f"({100 * said['possible_rate']:.1f} %, 95 % interval {100 * low:.1f} to {100 * high:.1f})"
        )
        out += [f"  {count:4d} impossible: {reason}" for reason, count in said["impossible"].items()]
        if said["unended"]:
            out.append(
                f"  {said['unended']} of these because the oracle's time was over before its samples were"
            )
    out.append(
        f"  {said['lies']} said SUCCESS while goals were missed, and {said['overlaps']} more in which "
        f"all goals were reached and bodies overlapped"
    )
    if said["refused"]:
        out.append(f"  {len(said['refused'])} refused by name: objects that cameras cannot tell apart")
    for (concept, reason), group in grouped([d for d in draws if not d["success"] and not impossible(d)]):
        seeds = " ".join(str(draw["seed"]) for draw in group[:SHOWN])
        out.append(f"  {len(group):4d} x {concept}: {reason}, seeds {seeds}: {group[0]['why']}")
    for key in ("arrangement", "moved"):
        counts = Counter(str(draw.get(key)) for draw in draws)
        good = Counter(str(draw.get(key)) for draw in draws if draw["success"])
        out.append(f"  by {key}: " + ", ".join(f"{k} {good[k]}/{n}" for k, n in sorted(counts.items())))
    return out
