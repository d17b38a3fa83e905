"""Tables about learning, made from ``benchmarks/results``; see `benchmarks.tables`."""

from __future__ import annotations

from typing import Any

from benchmarks.grasp import NOISES, paired, share

ROBOTS = ("panda", "xarm7_ability")
NOT_YET = "not measured yet"
Results = dict[str, dict[str, Any]]


def oracle(results: Results) -> str:
    """Which of the held-apart draws can be grasped at all."""
    lines = ["| robot | kind | draws | graspable | with the concept's own grasp |", "|---|---|---|---|---|"]
    for robot in ROBOTS:
        found = results.get(f"oracle-{robot}")
        if found is None:
            lines.append(f"| `{robot}` | {NOT_YET} | | | |")
            continue
        for kind, n in found["kinds"].items():
            lines.append(f"| `{robot}` | {kind} | {n['draws']} | {n['graspable']} | {n['own grasp']} |")
    return "\n".join(lines)


def grasp(results: Results) -> str:
    """Learned beside untrained and programmed, on the same graspable draws."""
    lines = [
        "| robot | noise | learned | untrained | programmed | failures, learned and programmed |",
        "|---|---|---|---|---|---|",
    ]
    for robot, noise, learned, programmed in _pairs(results):
        if not learned or not programmed:
            lines.append(f"| `{robot}` | `{noise}` | {NOT_YET} | | | |")
            continue
        middle = results.get(f"grasp-{robot}-{noise}-untrained")
        cells = [
            share(found["kinds"]["all"].get("graspable", found["kinds"]["all"])) if found else NOT_YET
            for found in (learned, middle, programmed)
        ]
        n = paired(learned, programmed)
        ratio = "" if n["failures_ratio"] is None else f", {n['failures_ratio']:.2f}"
        failures = f"{n['learned_fails']} of {n['programmed_fails']}{ratio}"
        lines.append(f"| `{robot}` | `{noise}` | {' | '.join(cells)} | {failures} |")
    return "\n".join(lines)


def kinds(results: Results) -> str:
    """By kind of shape."""
    lines = ["| robot | noise | kind | draws | learned | programmed |", "|---|---|---|---|---|---|"]
    for robot, noise, learned, programmed in _pairs(results):
        if not learned or not programmed:
            lines.append(f"| `{robot}` | `{noise}` | {NOT_YET} | | | |")
            continue
        for kind, row in learned["kinds"].items():
            if kind != "all":
                wins = (row["successes"], programmed["kinds"][kind]["successes"])
                lines.append(f"| `{robot}` | `{noise}` | {kind} | {row['draws']} | {wins[0]} | {wins[1]} |")
    return "\n".join(lines)


def completion(results: Results) -> str:
    """How far "done" can be trusted, and how grasps fail."""
    lines = ["| robot | noise | policy | called done and right | failures |", "|---|---|---|---|---|"]
    for robot, noise, *both in _pairs(results):
        for who, found in zip(("learned", "programmed"), both, strict=True):
            if not found:
                lines.append(f"| `{robot}` | `{noise}` | {who} | {NOT_YET} | |")
                continue
            done = found["completion"]
            said = {"draws": done["done"], "successes": done["right"], "interval": done["interval"]}
            failed = ", ".join(f"{n} x {kind}" for kind, n in found["failures"].items()) or "none"
            lines.append(f"| `{robot}` | `{noise}` | {who} | {share(said)} | {failed} |")
    return "\n".join(lines)


def learning(results: Results) -> str:
    """The table of ``python -m benchmarks.learning``."""
    from benchmarks.learning import ROWS

    found = results.get("learning") or {}
    lines = ["| measured | | bar |", "|---|---|---|"]
    for row in ROWS:
        value = row.text(found[row.key]) if row.key in found else NOT_YET
        lines.append(f"| {row.label} | {value} | {row.bar} |")
    return "\n".join(lines)


def _pairs(results: Results) -> list[tuple[str, str, dict[str, Any], dict[str, Any]]]:
    """Robot, noise, and the results of both policies; empty where one was not measured."""
    return [
        (
            robot,
            noise,
            *(results.get(f"grasp-{robot}-{noise}-{who}", {}) for who in ("learned", "programmed")),
        )
        for robot in ROBOTS
        for noise in NOISES
    ]  # type: ignore[return-value]


TABLES = {
    "oracle": oracle,
    "grasp": grasp,
    "kinds": kinds,
    "completion": completion,
    "learning": learning,
}
