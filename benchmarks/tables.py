"""Measured numbers into the documentation: ``python -m benchmarks.tables``.

Reads ``benchmarks/results/*.json`` and writes the tables between the marker comments of README.md,
docs/evaluation.md, docs/training.md, docs/experiments.md, docs/remote_engines.md, docs/twin.md,
docs/taxonomy.md and docs/concept_successes.md, so that no number is typed by hand. Results are what the
measurements write:

- ``<scenario>-<robot>[-camera][-fromlogs].json`` by ``python -m benchmarks.success``, in the format of
  ``bt-tasksim evaluate --json``;
- ``oracle-<robot>.json`` by ``python -m benchmarks.oracle``;
- ``grasp-<robot>-<noise>-<learned|programmed>.json`` by ``python -m benchmarks.grasp``;
- ``learning.json`` by ``python -m benchmarks.learning``;
- ``experiment-<letter>.json`` by ``python -m benchmarks.experiments <letter>``;
- ``speed.json`` by ``bt-tasksim bench --json``;
- ``remote.json`` by ``python -m benchmarks.remote``;
- ``planning.json`` by ``python -m benchmarks.planning``, which stands in docs/planning.md;
- ``gap-<scenario>-<grasp>-<engines>.json`` by ``python -m benchmarks.gap``, ``faults.json`` by
  ``python -m benchmarks.faults``, ``loop.json`` by ``python -m benchmarks.loop``;
- ``any_tree-<robot>[-...].json`` by ``python -m benchmarks.any_tree``, ``five-<tree>-<robot>.json`` by
  ``python -m benchmarks.any_tree.five``;
- ``concept-<scenario>-<robot>-<engine>.json`` by ``python -m benchmarks.concepts``, which stand in
  docs/taxonomy.md and docs/concept_successes.md;
- ``decomposition.json`` by ``python -m benchmarks.tables --decomposition``, which measures first.

``--check`` changes nothing and fails when a table is not up to date.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from pathlib import Path
from typing import Any

from benchmarks import any_tree_tables, concept_tables, learned_tables, robot_tables, taxonomy_table
from benchmarks.experiments import pages as experiment_tables
from benchmarks.speed import CASES, described
from benchmarks.success import RESULTS, SCENARIOS
from benchmarks.success import ROWS as MEASURED
from bt_tasksim.core.files import write_text

ROOT = Path(__file__).resolve().parents[1]
PAGES = (
    "README.md",
    "docs/evaluation.md",
    "docs/training.md",
    "docs/experiments.md",
    "docs/remote_engines.md",
    "docs/twin.md",
    "docs/taxonomy.md",
    "docs/concept_successes.md",
)
ROWS = tuple(row.name for row in MEASURED)
"""Rows that are always there, measured or not; others follow as files are found."""
KINDS = ("camera", "fromlogs")
OTHER = ("speed", "decomposition", "learning", "remote", "faults", "loop", "planning", "taxonomy")
APART = (
    *("oracle-", "grasp-", "experiment-", "training-", "gap-", "logs-", "decomposition-"),
    *("any_tree-", "five-", "concept-", "chores-"),
)
"""How results begin whose tables are made in `learned_tables`, `robot_tables`, `any_tree_tables`,
`concept_tables` and `experiments.pages`."""
NOT_YET = "not measured yet"
GIVEN_UP = ("B0011",)
"""Blocks that were not measured to their end: no table mixes their rows with those of later ones."""
SPENT = 50_000
"""First seed of results that do not say it: measured again and again, see ``docs/evaluation.md``."""


def load(folder: Path = RESULTS) -> dict[str, dict[str, Any]]:
    """Results by name; those of a later block before those of an earlier one, and of none.

    Those of blocks are there by block and name, too, such as ``B0003/any_tree-panda``; those of blocks that
    were given up only so.
    """
    blocks = sorted(folder.glob("B[0-9][0-9][0-9][0-9]/*.json"))
    found = {p: json.loads(p.read_text(encoding="utf-8")) for p in (*sorted(folder.glob("*.json")), *blocks)}
    alone = {p.stem: found[p] for p in found if p.parent.name not in GIVEN_UP}
    return alone | {f"{p.parent.name}/{p.stem}": found[p] for p in blocks}


def names(results: dict[str, Any]) -> list[str]:
    """Names of the rows, in order."""
    others = (
        n for n in results if n not in ROWS and n not in OTHER and not n.startswith(APART) and "/" not in n
    )
    return [*ROWS, *others]


def parts(name: str) -> tuple[str, str, str]:
    """Scenario, robot and kind of a result's name."""
    scenario, robot, *kind = name.split("-")
    return scenario, robot, next((k for k in kind if k in KINDS), "")


def rate(found: dict[str, Any]) -> str:
    """Success rate with its confidence interval."""
    low, high = found["confidence_interval"]
    return f"{100 * found['success_rate']:.1f} % ({100 * low:.1f} to {100 * high:.1f})"


def perceived(kind: str, found: dict[str, Any] | None) -> str:
    """How the perception is named."""
    if found is not None:
        return str(found["perception"]).replace("state,", "pose,")
    return "camera" if kind == "camera" else "pose, noise fine"


def short(results: dict[str, Any]) -> str:
    """README's table of successes."""
    lines = [
        "| scenario | robot | tree | perception | succeeded | rate (95 % interval) |",
        "|---|---|---|---|---|---|",
    ]
    for name in names(results):
        scenario, robot, kind = parts(name)
        found = results.get(name)
        tree = "from demonstrations" if kind == "fromlogs" else "authored"
        numbers = f"{found['successes']} of {found['episodes']} | {rate(found)}" if found else f"{NOT_YET} |"
        lines.append(f"| `{scenario}` | `{robot}` | {tree} | {perceived(kind, found)} | {numbers} |")
    return "\n".join(lines)


def full(results: dict[str, Any]) -> str:
    """The table of evaluation.md, with failures and failed seeds."""
    lines = [
        "| row | seeds | succeeded | rate (95 % interval) | failures | failed seeds |",
        "|---|---|---|---|---|---|",
    ]
    for name in names(results):
        found = results.get(name)
        if found is None:
            lines.append(f"| `{name}` | {NOT_YET} | | | | |")
            continue
        failures = ", ".join(f"{count} x {reason}" for reason, count in found["failures"].items()) or "none"
        failed = ", ".join(str(s) for s in found["failed_seeds"])
        first = found.get("first_seed", SPENT)
        lines.append(
            f"| `{name}` | {first} to {first + found['episodes'] - 1} "
            f"| {found['successes']} of {found['episodes']} "
            f"| {rate(found)} | {failures} | {failed} |"
        )
    return "\n".join(lines)


def paired(results: dict[str, Any]) -> str:
    """Trees from demonstrations against authored ones, on the same seeds."""
    lines = [
        "| scenario | seeds | authored | from demonstrations | difference | fail in one only |",
        "|---|---|---|---|---|---|",
    ]
    for scenario in SCENARIOS:
        ours, theirs = (results.get(f"{scenario}-panda{kind}") for kind in ("", "-fromlogs"))
        if ours is None or theirs is None or ours["episodes"] != theirs["episodes"]:
            lines.append(f"| `{scenario}` | {NOT_YET} | | | | |")
            continue
        a, b = (100 * found["success_rate"] for found in (ours, theirs))
        only = [set(x["failed_seeds"]) - set(y["failed_seeds"]) for x, y in ((ours, theirs), (theirs, ours))]
        lines.append(
            f"| `{scenario}` | {ours['episodes']} | {a:.1f} % | {b:.1f} % | {b - a:+.1f} points "
            f"| {len(only[0])} authored, {len(only[1])} from demonstrations |"
        )
    return "\n".join(lines)


def commands(results: dict[str, Any]) -> str:
    """The command that repeats each row, to look at."""
    lines = [
        f"python -m benchmarks.success --only {name} --seed {results.get(name, {}).get('first_seed', SPENT)}"
        for name in names(results)
    ]
    return "```\n" + "\n".join(lines) + "\n```"


def speed(results: dict[str, Any]) -> str:
    """The table of `bt-tasksim bench`."""
    found = results.get("speed") or {}
    lines = [
        "| `pick_and_place`, whole episodes with resets | control steps per second | ManiSkill's | ratio |",
        "|---|---|---|---|",
    ]
    for case in CASES:
        rates = found.get("episodes", {}).get("{}_{}".format(*case), {})
        ours, theirs, ratio = (rates.get(name) for name in ("steps_per_s", "peer_steps_per_s", "ratio"))
        lines.append(
            f"| {described('{}_{}'.format(*case))} | {NOT_YET if ours is None else f'{ours:.0f}'} "
            f"| {'' if theirs is None else f'{theirs:.0f}'} | {'' if ratio is None else f'{ratio:.2f}'} |"
        )
    lines += ["", "| one world, time of a control step | |", "|---|---|"]
    rows = [(f"outside physics: {part}", value) for part, value in found.get("parts_us", {}).items()]
    rows += [("outside physics together", found.get("outside_us")), ("physics", found.get("physics_us"))]
    lines += [f"| {label} | {NOT_YET if value is None else f'{value:.0f} us'} |" for label, value in rows]
    seconds = found.get("help_s")
    return "\n".join(
        [*lines, f"| `bt-tasksim --help` | {NOT_YET if seconds is None else f'{seconds:.3f} s'} |"]
    )


def remote(results: dict[str, Any]) -> str:
    """What engines in other processes cost."""
    found = results.get("remote") or {}
    here = {"mujoco": "MuJoCo", "sapien": "SAPIEN"}.get(found.get("mixed_physics", ""), "physics")
    rows = [
        ("everything in one process", "in_process"),
        ("physics served over loopback TCP", "physics_served"),
        ("physics and kinematics served, two processes", "two_served"),
        (f"{here} and pictures (SAPIEN) in one process", "pictures_in_process"),
        (f"{here} here, pictures (SAPIEN) served", "pictures_served"),
    ]
    lines = ["| engines | control steps per second | over the same in one process |", "|---|---|---|"]
    for label, key in rows:
        rate, ratio = (found.get(f"{key}_{what}") for what in ("steps_per_s", "ratio"))
        shown = f"{rate:.0f}" if rate is not None else NOT_YET
        lines.append(f"| {label} | {shown} | {f'{ratio:.2f}' if ratio is not None else ''} |")
    lines += ["", "| one step of physics, the robot at rest | |", "|---|---|"]
    for label, key in (("in process", "step_us"), ("served over loopback TCP", "served_step_us")):
        lines.append(f"| {label} | {f'{found[key]:.0f} us' if key in found else NOT_YET} |")
    return "\n".join(lines)


def decomposition(results: dict[str, Any]) -> str:
    """How many logs were decomposed rightly."""
    found = results.get("decomposition")
    lines = ["| logs | right task sequence |", "|---|---|"]
    for label, (right, of) in (found or {}).items():
        lines.append(f"| {label} | {right} of {of} |")
    if found:
        right, of = (sum(v[i] for v in found.values()) for i in (0, 1))
        lines.append(f"| together | {right} of {of} |")
    else:
        lines.append(f"| all | {NOT_YET} |")
    return "\n".join(lines)


TABLES = {
    "successes": short,
    "evaluation": full,
    "paired": paired,
    "commands": commands,
    "speed": speed,
    "decomposition": decomposition,
    "remote": remote,
    **learned_tables.TABLES,
    **robot_tables.TABLES,
    **any_tree_tables.TABLES,
    **experiment_tables.TABLES,
    **taxonomy_table.TABLES,
    **concept_tables.TABLES,
}
MARKED = re.compile(r"(<!-- table: (\w+) -->\n).*?(<!-- end of table -->)", re.DOTALL)


def filled(text: str, results: dict[str, Any]) -> str:
    """A page with its tables made anew."""
    return MARKED.sub(lambda m: f"{m[1]}{TABLES[m[2]](results)}\n{m[3]}", text)


def measure_decomposition() -> dict[str, list[int]]:
    """Right sequences and logs, by scenario; the logs that are present on this machine."""
    from benchmarks.decomposition import EXPECTED, logs
    from bt_tasksim.demos_decomp.recognition import recognise

    counts: dict[str, list[int]] = {}
    for scenario, _, shown in logs():
        tasks, _ = recognise(shown)
        count = counts.setdefault(scenario, [0, 0])
        count[0] += tuple(t.concept for t in tasks) == EXPECTED[scenario]
        count[1] += 1
    return counts


def main() -> int:
    """Write the tables, or check them."""
    parser = argparse.ArgumentParser(description="Measured numbers into the documentation.")
    parser.add_argument("--check", action="store_true", help="change nothing, fail when not up to date")
    parser.add_argument("--decomposition", action="store_true", help="measure the decomposition first")
    options = parser.parse_args()
    if options.decomposition:
        text = json.dumps(measure_decomposition(), indent=2) + "\n"
        write_text(RESULTS / "decomposition.json", text)
    results, stale = load(), []
    for page in PAGES:
        path = ROOT / page
        old = path.read_text(encoding="utf-8")
        new = filled(old, results)
        if new != old:
            stale.append(page)
            if not options.check:
                write_text(path, new)
    print(f"{'out of date' if options.check else 'wrote'}: {', '.join(stale)}" if stale else "up to date")
    return 1 if stale and options.check else 0


if __name__ == "__main__":
    sys.exit(main())
