"""The core alone: a wheel with nothing but its base dependencies, an editable install, a checkout.

Each is tried in an empty folder, and in one that holds ``trees.py``, ``concept_nodes.py`` and ``assets/``.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tomllib
import venv
from importlib import metadata
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ("bt_tasksim", "trees", "concept_nodes", "demos_decomp", "assets")
FILES = ("pyproject.toml", "setup.py", "bt_tasksim.pth", "README.md")
HEAVY = (
    "torch",
    "sapien",
    "mani_skill",
    "mujoco",
    "mujoco_warp",
    "warp",
    "stable_baselines3",
    "gymnasium",
    "zmq",
    "roslibpy",
    "ray",
)
OWN = {
    "trees.py": "MINE = 'trees'\n",
    "concept_nodes.py": "MINE = 'concept_nodes'\n",
    "assets/cup.txt": "mine\n",
}
TREE = '<root BTCPP_format="4"><BehaviorTree ID="a"><Grasp target="cup"/></BehaviorTree></root>'
CONCEPT = """
from bt_tasksim import Condition
from bt_tasksim.core.registry import register


@register("concept")
class Warm(Condition):
    '''Is it warm?'''

    def holds(self, seen):
        '''It is.'''
        return True
"""
SAME = """
import importlib, sys
for name in {order}:
    importlib.import_module(name)
for short in ("trees", "concept_nodes", "demos_decomp"):
    assert importlib.import_module(short) is importlib.import_module(f"bt_tasksim.{{short}}"), short
import trees.load, bt_tasksim.trees.load, concept_nodes.grasp, bt_tasksim.concept_nodes.grasp
assert trees.load is bt_tasksim.trees.load
assert concept_nodes.grasp is bt_tasksim.concept_nodes.grasp
from bt_tasksim.core.registry import module_of, part, parts
assert part("concept", "Grasp") is concept_nodes.Grasp
modules = [module_of(kind, name) for kind in ("concept", "tree node") for name in parts(kind)]
assert modules and all(m.startswith("bt_tasksim.") for m in modules), modules
"""
ORDERS = (["trees", "bt_tasksim.trees"], ["bt_tasksim.trees", "trees"], ["concept_nodes.grasp", "trees.load"])


def packages(*more: str) -> set[str]:
    """Files and folders in this environment that the base dependencies consist of, theirs included."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    waiting, seen, out = [*project["dependencies"], *more], set(), set()
    while waiting:
        requirement = waiting.pop()
        name = re.split(r"[^\w.-]", requirement.strip())[0].lower().replace("_", "-")
        if name in seen or "extra ==" in requirement:
            continue
        seen.add(name)
        try:
            distribution = metadata.distribution(name)
        except metadata.PackageNotFoundError:
            continue  # for another machine or Python
        waiting += distribution.requires or []
        out |= {file.parts[0] for file in distribution.files or () if file.parts[0] != ".."}
    return out


def environment(folder: Path, *more: str) -> Path:
    """A fresh virtual environment with the base dependencies alone, and more; returns its Python."""
    venv.create(folder, with_pip=False, symlinks=True)
    python = folder / "bin" / "python"
    ours = Path(sysconfig.get_paths()["purelib"])
    theirs = next((folder / "lib").glob("python*/site-packages"))
    for name in packages(*more):
        if (ours / name).exists() and name != "__pycache__":
            (theirs / name).symlink_to(ours / name)
    return python


def pip(*words: object) -> None:
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", "-q", *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def call(folder: Path, *words: object, path: Path | None = None) -> str:
    """What a command prints that has to succeed, run in a folder without this process's surroundings."""
    surroundings = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
    if path is not None:
        surroundings["PYTHONPATH"] = str(path)
    done = subprocess.run(
        list(map(str, words)), cwd=folder, env=surroundings, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def sources(tmp_path_factory) -> Path:
    """A copy of the sources, links and all: building leaves traces."""
    home = tmp_path_factory.mktemp("sources")
    for name in SOURCES:
        shutil.copytree(ROOT / name, home / name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
    for name in FILES:
        shutil.copy(ROOT / name, home / name)
    return home


@pytest.fixture
def empty(tmp_path) -> Path:
    return tmp_path


@pytest.fixture
def users(tmp_path) -> Path:
    """A folder with a user's own files of our names."""
    home = tmp_path / "users"
    for name, text in OWN.items():
        (home / name).parent.mkdir(parents=True, exist_ok=True)
        (home / name).write_text(text)
    return home


def work_with_the_core(folder: Path, python: Path) -> None:
    """Load, show and check trees and concepts, and decompose a log; the script is the same program.

    One process does most of it: a command's start takes longer than the command.
    """
    (folder / "grasp.xml").write_text(TREE)
    (folder / "bad.xml").write_text(TREE.replace("Grasp", "Grap"))
    (folder / "warm.py").write_text(CONCEPT)
    for command in ([python, "-m", "bt_tasksim.cli"], [python.parent / "bt-tasksim"]):
        assert "Grasp cup" in call(folder, *command, "show", "grasp.xml")
    checked = (
        "import contextlib, io\n"
        "from bt_tasksim.cli.main import main\n"
        "from bt_tasksim.core.resources import asset\n"
        "def said(*words):\n"
        "    with contextlib.redirect_stdout(io.StringIO()) as out:\n"
        "        assert main([str(word) for word in words]) == 0, words\n"
        "    return out.getvalue()\n"
        "assert 'Place' in said('show', 'shelf_to_shelf', '--picture', 't.svg', '--xml', 't.xml')\n"
        "assert said('show', 't.xml') and said('policies')\n"
        "assert 'show' in said('--plugin', 'warm.py', '--help')\n"
        "log = asset('demonstrations') / 'pick_and_place' / '00.h5'\n"
        "assert 'release' in said('decompose', log, '--xml', 'from_log.xml')\n"
        "from bt_tasksim.trees.xml_reader import load_tree\n"
        "from bt_tasksim.trees import check_tree\n"
        "from bt_tasksim import InputError\n"
        "check_tree(load_tree('from_log.xml'))\n"
        "try:\n    load_tree('bad.xml')\nexcept InputError as error:\n    assert 'Grasp' in str(error)\n"
        "else:\n    raise AssertionError\n"
        f"import sys\nassert not set({HEAVY!r}) & set(sys.modules)\n"
    )
    call(folder, python, "-c", checked)


def test_a_wheel_of_the_core_alone_loads_shows_and_checks(sources, empty, users, tmp_path):
    pip("wheel", "--no-deps", "--no-build-isolation", "-w", tmp_path / "wheels", sources)
    python = environment(tmp_path / "env")
    (wheel,) = (tmp_path / "wheels").iterdir()
    pip("--python", python, "install", "--no-deps", wheel)
    there = f"import importlib.util as u; print([name for name in {HEAVY!r} if u.find_spec(name)])"
    assert call(empty, python, "-c", there).strip() == "[]"
    for order in ORDERS:
        call(empty, python, "-c", SAME.format(order=order))
    work_with_the_core(empty, python)
    call(users, python, "-c", "import trees, concept_nodes; assert (trees.MINE, concept_nodes.MINE)")
    work_with_the_core(users, python)
    assert (users / "assets").is_dir() and [p.name for p in (users / "assets").iterdir()] == ["cup.txt"]


def test_short_names_are_the_same_modules_in_an_editable_install(sources, empty, users, tmp_path):
    python = environment(tmp_path / "env", "setuptools")
    pip("--python", python, "install", "--no-deps", "--no-build-isolation", "-e", sources)
    for order in ORDERS:
        call(empty, python, "-c", SAME.format(order=order))
    call(users, python, "-c", "import bt_tasksim.trees, trees; assert trees.MINE == 'trees'")


def test_short_names_are_the_same_modules_in_a_checkout(sources, users):
    python = Path(sys.executable)
    for order in ORDERS:
        call(sources, python, "-c", SAME.format(order=order), path=sources)
    call(users, python, "-c", "import bt_tasksim.trees, trees; assert trees.MINE == 'trees'", path=ROOT)


def test_a_tree_runs_beside_a_users_own_files_of_these_names(users):
    words = (sys.executable, "-m", "bt_tasksim.cli", "run", "pick_and_throw", "--seed", 5, "--out", "here")
    assert call(users, *words, path=ROOT).startswith("SUCCESS")
    assert call(users, sys.executable, "-m", "bt_tasksim.cli", "replay", "here", path=ROOT)
