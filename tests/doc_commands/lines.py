"""Every command that README and docs name: in which quick form it runs, or why it does not.

A command that none of the tables below knows fails: say here how it is made quick, or why it is only parsed.
"""

from __future__ import annotations

import functools
import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from bt_tasksim.cli.main import main

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *ROOT.glob("CONTRIBUTING.md"), *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"^( *)```(\w*)\n(.*?)\n *```", re.S | re.M)
FILE = re.compile(r"<!-- file: (\S+) -->\n```python\n(.*?)\n```", re.S)
START = r"(?:\.venv/bin/)?((?:bt-tasksim|make|python -m)\b[^#\n]*?)"
IN_BLOCK = re.compile(rf"^ *(?:\$ )?{START} *(?:#.*)?$", re.M)
IN_PROSE = re.compile(rf"`{START}`|^ {{4}}{START} *(?:#.*)?$", re.M)

PARSED = {
    r"benchmarks\.compare|sealed open": "measures for hours, or opens a block for good",
    r"benchmarks\.cluster": "starts a cluster; tests of evaluations on a cluster run it on theirs",
    r"train .*--cluster": "starts a cluster; tests of trainings on a cluster train on one",
    r"tools\.": "writes into the repository; tests of its own compare",
    r"ros:|\btwin\b|my_topics|benchmarks\.(faults|loop)": "needs a robot or ROS; tests of the twin run it",
    r"remote:|serve-engine": "needs a server or is one; tests of remote engines run it",
    r"camera|--frames": "draws pictures; tests of perception and rendering run it",
    r"--device cuda": "needs a GPU; tests and the CPU device run the same code",
    r"--real-time": "takes as long as it says",
    r"\b[A-Z]{2,}(_[A-Z]+)*\b": "has a placeholder",
    r"--urdf|my_robot\.yaml|so100\.yaml|--plugin|wipe\.xml": "needs a file that its reader writes",
    r"nudge=policies/nudge": "needs a policy that its reader trains",
    r"tables --decomposition": "writes into the documentation; benchmarks.decomposition measures the same",
    r"experiments . --train|experiments [AB]$|experiments B --quick": "takes minutes even when quick",
}
"""Commands that are only parsed, and why."""

QUICK = {
    "benchmarks.any_tree": "--only 900009 --robot so100 --oracle 0 --episodes 1",
    "benchmarks.any_tree.five": "--episodes 1 --only tower",
    "benchmarks.any_tree.forms": "--each 1 --only box ring",
    "benchmarks.any_tree.grasp_risk": "--episodes 2 --seed 23000",
    "benchmarks.planning": "--quick",
    "benchmarks.batch": "--quick --worlds 2 --episodes 2 --trees 20 --longest 1",
    "benchmarks.chores": "--episodes 1 --seed 910000 --kinds carry --oracle 0",
    "benchmarks.concepts": "--only grasp_then_pick --robots panda --engines sapien --episodes 1 --workers 1 "
    "--seed 910000",
    "benchmarks.decomposition": "--seeds 1",
    "benchmarks.experiments": "--pictures pictures",
    "benchmarks.gap": "--episodes 1 --scenarios shelf_to_shelf --grasps programmed --engines sapien",
    "benchmarks.grasp": "--draws 2 --workers 1 --only programmed --noise original",
    "benchmarks.learning": "--quick --only inference --json learning.json",
    "benchmarks.maniskill_world": "--episodes 1 --longest 1",
    "benchmarks.oracle": "--draws 1 --workers 1 --robot panda",
    "benchmarks.remote": "--quick",
    "benchmarks.sealed": "",
    "benchmarks.success": "--episodes 1 --workers 1 --seed 1010000",
    "benchmarks.tables": "--check",
    "benchmarks.taxonomy": "--sets 200",
    "bt_tasksim.execution.performed": "--episodes 1 --seed 500003",
    "demos_decomp.synthetic": "--out demonstrations",
}
"""What makes a module's measurement quick; it overrides what the documentation says."""

APART = r"benchmarks\.(batch (device|episodes|executor|laws)|learning|maniskill_world|remote)\b|bench\b"
"""Forms that start processes or have one of their own, since what they do to renderers or torch lasts."""

TARGETS = {"demo", "docs", "lint", "format", "style", "types", "imports", "setup", "test", "twin", "bench"}
"""Targets of make; of these only the recipes are looked at."""

ALWAYS_ZERO = {"bench", "check", "decompose", "evaluate", "new", "new-key", "policies", "show", "train"}
"""Commands that end with 0; a run may fail, as one draw may."""

TRAINING = {
    "steps": 128, "n_envs": 2, "n_steps": 32, "epochs": 1, "minibatch": 32, "evaluate_every": 1,
    "evaluation_draws": 2, "checkpoint_every": 1,
}  # fmt: skip


def commands() -> list[str]:
    """All commands of all pages, each once."""
    found: dict[str, None] = {}
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for _, kind, block in BLOCK.findall(text):
            if kind in ("", "bash", "sh", "console", "shell"):
                found |= dict.fromkeys(IN_BLOCK.findall(re.sub(r"\\\n\s*", " ", block)))
        for pair in IN_PROSE.findall(BLOCK.sub("", text)):
            found |= dict.fromkeys(filter(None, pair))
    return sorted({line.strip().replace("\\", "") for line in found} - {"bt-tasksim", "bt-tasksim log"})


def only_parsed(line: str) -> bool:
    """It is in the table, or the bare name of a command in running text."""
    name_alone = re.fullmatch(r"bt-tasksim (?!policies)[\w-]+", line) is not None
    return name_alone or any(re.search(pattern, line) for pattern in PARSED)


def overridden(words: list[str], quick: str) -> list[str]:
    """Words with some options replaced."""
    options = {option.split()[0] for option in re.findall(r"--[\w-]+", quick)}
    if "--seed" in options:
        options.add("--block")  # either names the draws
    kept: list[str] = []
    dropping = False
    for word in words:
        dropping = word in options or (dropping and not word.startswith("-"))
        if not dropping:
            kept.append(word)
    return [*kept, *quick.split()]


def quick_form(line: str) -> list[str]:
    """The words of a module's command, made quick."""
    words = shlex.split(line)[2:]
    words = overridden(words, QUICK[words[0]])
    if words[0] == "benchmarks.success":
        row = "shelf_to_shelf-panda"
        if any(word.endswith("-fromlogs") for word in words):
            words = overridden(words, "--episodes 2")  # one for each of two logs
            row += "-fromlogs"
        words = overridden(words, f"--only {row}")
    return words


def command_form(line: str) -> list[str]:
    """The words of one of the command line's own, made quick."""
    words = [word for word in shlex.split(line)[1:] if word != "--video"]
    if words[0] == "evaluate":
        return overridden(words, "--episodes 1 --workers 1")
    if words[0] == "train":
        words = overridden([w for w in words if w != "800000"], "--settings tiny.json --workers 1")
        return [word for word in words if word != "--steps"]
    if words[0] == "bench":
        return ["bench", "--quick", "--json", "speed.json"]
    if words[0] == "new":
        words[2] = "another"
    return words


@functools.cache
def form(line: str) -> tuple[str, ...]:
    """What is run of a line."""
    return tuple(quick_form(line) if line.startswith("python") else command_form(line))


def apart(line: str) -> bool:
    """Whether it has a process of its own."""
    return re.match(APART, " ".join(form(line))) is not None


def runs_already(line: str) -> bool:
    """A line before it is the same in its quick form, or one runs it before it goes on with ``--resume``."""
    before = RUNNING[: RUNNING.index(line)]
    resumed = (form(other) for other in RUNNING if "--resume" in form(other))
    return form(line) in (
        *(form(other) for other in before),
        *(tuple(word for word in words if word != "--resume") for words in resumed),
    )


def run_command(line: str) -> None:
    """One of the command line's own."""
    words = command_form(line)
    if "--resume" in words:
        assert main([word for word in words if word != "--resume"]) == 0
    if words[0] == "train":
        shutil.rmtree("policies")
    assert main(words) in ({0} if words[0] in ALWAYS_ZERO else {0, 1})


def run_module(line: str) -> None:
    """A module with a main program; it imports the benchmarks anew, as in a process of its own."""
    words = quick_form(line)
    if apart(line):
        path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
        environment = {**os.environ, "PYTHONPATH": path}
        done = subprocess.run([sys.executable, "-m", *words], env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        return
    with pytest.MonkeyPatch.context() as patch, imported_anew("benchmarks"):
        patch.setattr(sys, "argv", words)
        try:
            runpy.run_module(words[0], run_name="__main__", alter_sys=True)
        except SystemExit as ended:
            assert not ended.code


@contextmanager
def imported_anew(package: str) -> Iterator[None]:
    """A package and its modules are imported anew, and afterwards are those that were there before."""

    def out() -> dict[str, object]:
        names = [name for name in sys.modules if name == package or name.startswith(f"{package}.")]
        return {name: sys.modules.pop(name) for name in names}

    before = out()
    try:
        yield
    finally:
        out()
        sys.modules.update(before)  # type: ignore[arg-type]


COMMANDS = commands()
NAMED = [line for line in COMMANDS if not (line.startswith("make") or only_parsed(line))]
UNKNOWN = [line for line in NAMED if line.startswith("python") and shlex.split(line)[2] not in QUICK]
"""Modules of which nothing is said above."""
RUNNING = [line for line in NAMED if line not in UNKNOWN]
RUN = [line for line in RUNNING if not runs_already(line)]
OWN = [line for line in RUN if line.startswith("bt-tasksim") and not apart(line)]
"""The command line's own."""
HERE = [line for line in RUN if line.startswith("python") and not apart(line)]
"""Modules that run in this process."""
ELSEWHERE = [line for line in RUN if apart(line)]
"""What starts processes."""
