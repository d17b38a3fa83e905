"""``--plugin``: parts from outside, for the process that was started and its workers; never from a file."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import h5py
import pytest

from bt_tasksim.cli.main import main
from bt_tasksim.cli.options.plugins import taken
from bt_tasksim.core import plugins
from bt_tasksim.core.errors import InputError

CONCEPT = """
from bt_tasksim.concept_nodes import Wait


class Pause(Wait):
    '''Waits.'''
"""
XML = """<root BTCPP_format="4" scene="room.yaml"{attribute}>
<BehaviorTree ID="a"><Sequence><Pause duration="0.1"{port}/><Grasp target="cup"/></Sequence></BehaviorTree>
</root>"""

ROOM = "objects: {cup: {kind: cup, on: table}}\n"


@pytest.fixture(autouse=True)
def forgotten():
    with plugins.scratch():
        yield


@pytest.fixture
def own(tmp_path):
    """A plugin and a tree in XML that needs it."""
    (tmp_path / "room.yaml").write_text(ROOM)
    (tmp_path / "pause.py").write_text(CONCEPT)
    (tmp_path / "tree.xml").write_text(XML.format(attribute="", port=""))
    return tmp_path


def start(*words: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "bt_tasksim.cli", *map(str, words)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_plugins_are_taken_off_the_command_line_wherever_they_stand():
    words = ["--plugin", "a.py", "run", "t", "--plugin=b", "--seed", "3", "--", "--plugin", "c"]
    assert taken(words) == (["a.py", "b"], ["run", "t", "--seed", "3", "--", "--plugin", "c"])
    for words in (["run", "--plugin"], ["--plugin=", "run"]):
        with pytest.raises(InputError):
            taken(words)


@pytest.mark.parametrize("option", ["--plugin", "--nodes"])
def test_workers_load_what_their_parent_loaded(own, option):
    words = ("evaluate", "tree.xml", "--episodes", 2, "--workers", 2, "--noise", "none", option, "pause.py")
    done = start(*words)
    assert done.returncode == 0 and re.search(r"[12] of 2", done.stdout), done.stderr


def test_a_run_with_a_concept_of_ones_own_is_replayed_with_its_plugin(own):
    done = start("run", "tree.xml", "--plugin", "pause.py", "--out", "here")
    assert done.returncode in (0, 1) and Path("here/run.h5").exists(), done.stdout + done.stderr
    without = start("replay", "here")
    assert without.returncode == 2 and "'Pause'" in without.stderr and "--plugin" in without.stderr
    found = start("replay", "here", "--plugin", "pause.py")
    assert found.returncode == 0 and found.stdout.startswith("identical"), found.stdout + found.stderr


def test_an_importable_module_is_a_plugin_too(own):
    done = start("show", "tree.xml", "--plugin", "pause")
    assert done.returncode == 0 and "Pause" in done.stdout, done.stderr
    done = start("show", "tree.xml", "--plugin", "no_such_module_of_parts")
    assert done.returncode == 2 and "no_such_module_of_parts" in done.stderr


def test_a_plugin_that_fails_is_one_sentence_with_its_line(own, refused):
    Path("bad.py").write_text("x = 1\ny = x / 0\n")
    assert "bad.py', line 2: ZeroDivisionError" in refused("policies", "--plugin", "bad.py")
    assert "no plugin file 'gone.py'" in refused("--plugin", "gone.py", "policies")


@pytest.mark.parametrize("key", ["plugin", "plugins", "nodes"])
def test_no_file_that_people_exchange_names_a_plugin(own, refused, call, key, policy):
    Path("evil.py").write_text("from pathlib import Path\nPath('ran').touch()\n")
    Path("tree.xml").write_text(XML.format(attribute=f' {key}="evil.py"', port=""))
    assert f"'{key}'" in refused("show", "tree.xml", "--plugin", "pause.py")
    Path("tree.xml").write_text(XML.format(attribute="", port=f' {key}="evil.py"'))
    assert f"'{key}'" in refused("show", "tree.xml", "--plugin", "pause.py")
    Path("room.yaml").write_text(f"{ROOM}{key}: evil.py\n")
    assert f"'{key}'" in refused("show", "pick_and_throw", "--scene", "room.yaml")
    Path("settings.yaml").write_text(f"{key}: evil.py\n")
    assert f"'{key}'" in refused("train", "grasp_then_pick", "--settings", "settings.yaml")
    folder = policy("mine")
    card = json.loads((folder / "card.json").read_text())
    (folder / "card.json").write_text(json.dumps({**card, key: "evil.py"}))
    assert f"'{key}'" in refused("run", "pick_and_throw", "--policy", f"grasp={folder}")
    assert call("run", "pick_and_throw", "--seed", 5, "--out", "here")[0] in (0, 1)
    with h5py.File("here/run.h5", "r+") as file:
        run = next(iter(file["demonstrations"].values()))["run"]
        about = json.loads(run["about"][()])
        del run["about"]
        run["about"] = json.dumps({**about, key: "evil.py"})
    assert f"'{key}'" in refused("replay", "here")
    assert not Path("ran").exists()


SHAPE = """
from bt_tasksim.core.registry import register
from bt_tasksim.scene.shape_kind import ShapeKind


@register("shape", "%s")
class Tube(ShapeKind):
    def shape(self, size):
        return nothing_of_this_name
"""
RANGE = "    size_range = ((0.05, 0.05, 0.05), (0.05, 0.05, 0.05))\n"
READER = """
from demos_decomp.readers import LogReader
from bt_tasksim.core.registry import register


@register("log reader", "notes")
class Notes(LogReader):
    title = "notes"

    def recognises(self, path):
        return path.suffix == ".notes"

    def read(self, path):
        raise ValueError("no number in line 3")
"""


@pytest.fixture
def said(tmp_path, monkeypatch, capsys):
    """What the command line says of a plugin: exit code 2, one sentence."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "room.yaml").write_text("objects: {tube: on table}\n")
    (tmp_path / "a.notes").write_text("a")

    def call(plugin: str, words: str) -> str:
        (tmp_path / "mine.py").write_text(plugin)
        assert main([*words.split(), "--plugin", "mine.py"]) == 2
        sentence = capsys.readouterr().err
        assert sentence.count("\n") == 1 and "Traceback" not in sentence
        return sentence

    return call


@pytest.mark.parametrize(
    ("plugin", "words", "place", "what"),
    [
        (SHAPE % "tube" + RANGE, "run pick_and_place --scene room.yaml", "mine.py:9", "NameError"),
        (SHAPE % "tube", "run pick_and_place --scene room.yaml", "mine.py:", "size_range"),
        (READER, "decompose a.notes", "mine.py:14", "ValueError: no number in line 3"),
    ],
    ids=["raises", "lacks an attribute", "raises as another part"],
)
def test_an_error_in_a_plugins_code_is_one_sentence_with_its_line(said, plugin, words, place, what):
    sentence = said(plugin, words)
    assert place in sentence and what in sentence


def test_a_plugin_that_takes_a_name_of_ours_is_to_blame_and_not_the_scene(said):
    sentence = said(SHAPE % "box" + RANGE, "run pick_and_place --scene room.yaml")
    assert "mine.py'" in sentence and "'box' is there twice" in sentence and "room.yaml" not in sentence


@pytest.mark.parametrize(
    "words", ["run pick_and_place --robot robbie", "run pick_and_place --scene room.yaml"]
)
def test_whatever_is_unknown_may_be_in_a_plugin(said, words):
    assert "--plugin" in said("", words)
