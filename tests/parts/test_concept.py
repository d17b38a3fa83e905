"""A concept from outside of the package, in one file: `plugins/concept.py`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from draws import successes
from py_trees.common import Status

from bt_tasksim import Runner, trees
from bt_tasksim.cli.main import main
from bt_tasksim.concept.plugins import load_parts
from bt_tasksim.concept_nodes import Grasp, Pick, catalogue
from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.resources import asset
from bt_tasksim.demos_decomp import decompose_log, open_log, picture, text_table, write_log
from bt_tasksim.demos_decomp.evidence import spoken_concepts
from bt_tasksim.demos_decomp.log import Log
from bt_tasksim.report.tree_labels import tree_text
from bt_tasksim.trees.from_graph import tree_from_graph
from bt_tasksim.trees.load import load_source

FOLDER = Path(__file__).parent / "plugins"
FILE = str(FOLDER / "concept.py")


@pytest.fixture
def poured(tmp_path):
    """A shipped demonstration in which the object is tilted by 60 degrees, and back, while it is carried."""
    log = open_log(asset("demonstrations", "pick_and_place", "00.h5"))
    shown = log.demonstrations[0]
    (bring,) = [task for task in decompose_log(log).tasks if task.concept == "bring"]
    ((name, track),) = shown.objects.items()
    share = np.clip((shown.time - bring.start) / (bring.end - bring.start), 0.0, 1.0)
    half = np.radians(60.0) / 2 * np.sin(np.pi * share) ** 2
    zero = np.zeros_like(half)
    turn = np.stack([np.cos(half), np.sin(half), zero, zero], axis=1)
    middle = track.pose[:, :3]

    def tilted(pose):
        at = middle + poses.rotate(turn, pose[:, :3] - middle)
        return np.concatenate([at, poses.quat_multiply(turn, pose[:, 3:])], axis=1)

    objects = {name: replace(track, pose=tilted(track.pose))}
    shown = replace(shown, hand_pose=tilted(shown.hand_pose), objects=objects, narration=())
    write_log(tmp_path / "poured.h5", Log("human", (shown,)))
    return tmp_path / "poured.h5"


def test_it_is_listed_written_read_and_shown(plugin, tmp_path):
    decant = plugin("concept").Decant
    assert catalogue()["Decant"] is decant
    tree = trees.sequence("out with it", Grasp("cup"), Pick("cup"), decant("cup", angle=1.2))
    trees.save_tree(tree, tmp_path / "decant.xml")
    assert trees.same_tree(trees.load_tree(tmp_path / "decant.xml"), tree)
    assert "◒ Decant cup  (angle 1.2 rad)" in tree_text(tree)
    assert "by 60 degrees" in decant.describe_task({"angle": np.radians(60.0)})


def test_without_the_plugin_its_tree_is_refused(tmp_path):
    file = tmp_path / "decant.xml"
    file.write_text('<root BTCPP_format="4"><BehaviorTree>\n<Decant target="cup"/></BehaviorTree></root>')
    with pytest.raises(InputError, match="line 2"):
        trees.load_tree(file)


def test_it_runs(plugin):
    decant = plugin("concept").Decant
    scene = load_source("pick_and_place").scene
    tree = trees.sequence("out", Grasp("target"), Pick("target", distance=0.2), decant("target", angle=0.5))
    runner = Runner(tree, scene)
    successes(runner.run, (1, 2, 3), n=2, wanted=lambda result: result.status == Status.SUCCESS)


def test_it_is_recognised_in_a_log_and_becomes_a_leaf(plugin, poured):
    decant = plugin("concept").Decant
    found = decompose_log(open_log(poured))
    assert "decant" in [task.concept for task in found.tasks]
    assert "by 60 degrees" in text_table(found.tasks)
    assert "#2a7f9e" in picture(found.graph)
    assert spoken_concepts("now I decant the cup") == {"decant"}
    (leaf,) = [
        leaf
        for leaf in tree_from_graph(found.graph).iterate()
        if isinstance(getattr(leaf, "model", None), decant)
    ]
    assert leaf.model.angle == pytest.approx(np.radians(60.0), abs=0.1)
    assert abs(leaf.model.axis[0]) == pytest.approx(1.0, abs=0.05)


def test_the_command_line_takes_it(plugin, poured, tmp_path, capsys):
    xml = str(tmp_path / "tree.xml")
    assert main(["decompose", str(poured), "--xml", xml, "--plugin", FILE]) == 0
    assert "decant" in capsys.readouterr().out
    assert main(["show", xml, "--plugin", FILE]) == 0
    assert "◒ Decant" in capsys.readouterr().out


def test_an_old_file_that_announces_nothing_is_announced(plugin, tmp_path):
    old = tmp_path / "old.py"
    text = (
        (FOLDER / "concept.py").read_text().replace('@register("concept")\n', "").replace("Decant", "Spill")
    )
    old.write_text(text)
    load_parts(str(old))
    assert catalogue()["Spill"].__name__ == "Spill"
