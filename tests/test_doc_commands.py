"""Every command that README and docs name runs, in a quick form, or is at least parsed.

A command that none of the tables below knows fails: say here how it is made quick, or why it is only parsed.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from bt_tasksim.cli.app import NAME, application
from bt_tasksim.cli.main import main
from bt_tasksim.cli.options.plugins import taken

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *ROOT.glob("CONTRIBUTING.md"), *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"^( *)```(\w*)\n(.*?)\n *```", re.S | re.M)
FILE = re.compile(r"<!-- file: (\S+) -->\n```python\n(.*?)\n```", re.S)
START = r"(?:\.venv/bin/)?((?:bt-tasksim|make|python -m)\b[^#\n]*?)"
IN_BLOCK = re.compile(rf"^ *(?:\$ )?{START} *(?:#.*)?$", re.M)
IN_PROSE = re.compile(rf"`{START}`|^ {{4}}{START} *(?:#.*)?$", re.M)

PARSED = {
    r"benchmarks\.compare|sealed open": "measures for hours, or opens a block for good",
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
    "benchmarks.batch": "--quick --worlds 2 --episodes 2 --trees 20",
    "benchmarks.cluster": "--times 1 --episodes 4",
    "benchmarks.chores": "--episodes 1 --seed 910000 --kinds carry --oracle 0",
    "benchmarks.concepts": "--only grasp_then_pick --robots panda --engines sapien --episodes 1 --workers 1",
    "benchmarks.decomposition": "--seeds 1",
    "benchmarks.experiments": "--pictures pictures",
    "benchmarks.gap": "--episodes 1 --scenarios shelf_to_shelf --grasps programmed --engines sapien",
    "benchmarks.grasp": "--draws 2 --workers 1 --only programmed --noise original",
    "benchmarks.learning": "--quick --only inference --json learning.json",
    "benchmarks.maniskill_world": "--episodes 1",
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
            words = overridden(words, "--episodes 10")  # one for each log
            row += "-fromlogs"
        words = overridden(words, f"--only {row}")
    return words


def runs_already(line: str) -> bool:
    """A line before it is the same in its quick form."""
    before = COMMANDS[: COMMANDS.index(line)]
    others = (other for other in before if other.startswith("python") and not only_parsed(other))
    return any(quick_form(other) == quick_form(line) for other in others)


def parse(line: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Parse a command and do nothing else."""
    words = shlex.split(line)
    if words[0] == "bt-tasksim":
        group, (_, words) = application(), taken(words[1:])
        if words == ["--help"] or len(words) == 1 or words[0].isupper():
            return
        context = group.make_context(NAME, list(words))
        if "--plugin" in line and words[0] not in group.list_commands(context):
            return  # the plugin's own command
        name, command, rest = group.resolve_command(context, words)
        command.make_context(name, rest, parent=context)
        return

    if words[2].startswith("tools."):
        assert (ROOT / words[2].replace(".", "/")).with_suffix(".py").is_file()
        return
    if len(words) == 3:  # a bare name, in running text
        words.append("--help")

    class Parsed(Exception):
        pass

    whole = argparse.ArgumentParser.parse_args

    def only(self, *arguments, **options):
        raise Parsed(whole(self, *arguments, **options))

    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", only)
    monkeypatch.setattr(sys, "argv", words[2:])
    with pytest.raises((Parsed, SystemExit) if "--help" in words else Parsed):
        runpy.run_module(words[2], run_name="__main__")


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    """A folder with what the pages have made before."""
    folder = tmp_path_factory.mktemp("docs")
    for shared in ("assets", "examples"):
        (folder / shared).symlink_to(ROOT / shared)
    for page in PAGES:
        for name, text in FILE.findall(page.read_text(encoding="utf-8")):
            (folder / name).write_text(text, encoding="utf-8")
    (folder / "tiny.json").write_text(json.dumps(TRAINING))
    shutil.copytree(ROOT / "assets" / "policies" / "grasp-panda", folder / "policies" / "grasp-panda")
    log = str(ROOT / "assets" / "demonstrations" / "shelf_to_shelf" / "00.h5")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert main(["decompose", log, "--xml", "kitchen.xml"]) == 0
        assert main(["run", "kitchen.xml", "--seed", "11", "--out", "runs/kitchen"]) in (0, 1)
        assert main(["new", "concept", "nudge"]) == 0
        assert main(["new", "scene", "kitchen"]) == 0
        assert main(["new", "object", "watering_can"]) == 0
        assert main(["new", "tree", "mine"]) == 0
    shutil.copy(folder / "kitchen.xml", folder / "shelf.xml")
    return folder


@pytest.fixture
def workplace(prepared, tmp_path, monkeypatch):
    """A copy of that folder, as the working directory."""
    folder = tmp_path / "docs"
    shutil.copytree(prepared, folder, symlinks=True)
    monkeypatch.chdir(folder)
    monkeypatch.syspath_prepend(ROOT)
    return folder


def run_command(words: list[str]) -> None:
    """One of the command line's own."""
    name = words[0]
    words = [word for word in words if word != "--video"]
    if name == "evaluate":
        words = overridden(words, "--episodes 1 --workers 1")
        if "--resume" in words:
            assert main([word for word in words if word != "--resume"]) == 0
    elif name == "train":
        shutil.rmtree("policies")
        words = overridden([w for w in words if w != "800000"], "--settings tiny.json --workers 1")
        words = [word for word in words if word != "--steps"]
    elif name == "bench":
        words = ["bench", "--quick", "--json", "speed.json"]
    elif name == "new":
        words[2] = "another"
    assert main(words) in ({0} if name in ALWAYS_ZERO else {0, 1})


def run_module(words: list[str]) -> None:
    """A module with a main program, in a process of its own: what it does to renderers and threads lasts."""
    path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    done = subprocess.run(
        [sys.executable, "-m", *words], env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


COMMANDS = commands()


@pytest.mark.parametrize("line", COMMANDS)
def test_it_runs_or_is_parsed(line, workplace, monkeypatch):
    words = shlex.split(line)
    if words[0] == "make":
        assert set(words[1:]) <= TARGETS, "unknown to this test"
        done = subprocess.run(["make", "-n", *words[1:]], cwd=ROOT, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    elif only_parsed(line):
        parse(line, monkeypatch)
    elif words[0] == "python":
        assert words[2] in QUICK, f"say in {Path(__file__).name} how it is made quick"
        if runs_already(line):
            parse(line, monkeypatch)
        else:
            run_module(quick_form(line))
    else:
        run_command(words[1:])


def test_the_pages_name_all_commands_of_the_readme():
    """The extraction finds what it should, and no table has a row too many."""
    found = COMMANDS
    assert {"make demo", "make test", "bt-tasksim run shelf.py --seed 7 --video"} <= set(found)
    assert all(any(re.search(pattern, line) for line in found) for pattern in PARSED)
