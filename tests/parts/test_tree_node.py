"""Control nodes and decorators from outside of the package, in one file: `plugins/tree_node.py`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from py_trees.behaviours import Running, Success
from py_trees.common import Status

from bt_tasksim import Runner, trees
from bt_tasksim.cli.main import main
from bt_tasksim.concept.context import Context
from bt_tasksim.concept_nodes import Wait
from bt_tasksim.core.batch_leaf import INVALID, RUNNING, SUCCESS, BatchLeaf
from bt_tasksim.core.errors import InputError
from bt_tasksim.execution.batch import BatchTree
from bt_tasksim.report.tree_labels import tree_text
from bt_tasksim.report.tree_picture import tree_svg
from bt_tasksim.robot.description import load_robot
from bt_tasksim.trees.load import load_source


def test_a_node_from_outside_is_written_read_drawn_and_listed(plugin, tmp_path):
    outside = plugin("tree_node")
    tree = trees.sequence("later", trees.delay(0.25, Wait(0.1)))
    assert type(tree.children[0]) is outside.Delay
    trees.save_tree(tree, tmp_path / "later.xml")
    assert 'delay_msec="250"' in (tmp_path / "later.xml").read_text()
    assert trees.same_tree(trees.load_tree(tmp_path / "later.xml"), tree)
    assert not trees.same_tree(tree, trees.sequence("later", trees.delay(0.5, Wait(0.1))))
    assert "⧖ delay 0.25 s" in tree_text(tree)
    assert "delay 0.25 s" in tree_svg(tree)


def test_it_runs_as_part_of_a_tree(plugin):
    plugin("tree_node")
    runner = Runner(trees.sequence("later", trees.delay(0.5, Wait(0.2))), load_source("pick_and_place").scene)
    result = runner.run(1)
    assert result.status == Status.SUCCESS
    assert 0.65 < result.sim_time < 0.8


def test_in_many_worlds_it_has_its_own_form_or_is_ticked_world_by_world(plugin, caplog):
    outside = plugin("tree_node")

    class Twice(BatchLeaf):
        def tick(self, rows, fresh):
            return np.where(fresh, np.int8(RUNNING), np.int8(SUCCESS))

    def build():
        ever = outside.KeepRunningUntilFailure("ever", Running("twice"))
        return trees.sequence("later", trees.delay(0.1, Success("now")), ever)

    contexts = [Context(load_robot("panda")) for _ in range(2)]
    tree = BatchTree(build(), 2, lambda leaf: Twice(), build=build, contexts=contexts.__getitem__)
    assert [r.args[0] for r in caplog.records] == ["Delay"]
    found = []
    for tick in range(5):
        contexts[1].times = np.array([0.05 * tick])
        tree.tick(np.arange(2), 0.0)
        found.append(tree.status.tolist())
    first = [RUNNING, RUNNING, INVALID, INVALID, INVALID]
    assert [worlds[0] for worlds in found] == [first] * 5
    assert [worlds[1] for worlds in found] == [
        first,
        first,
        [RUNNING, SUCCESS, SUCCESS, RUNNING, RUNNING],
        [RUNNING, SUCCESS, SUCCESS, RUNNING, SUCCESS],
        [RUNNING, SUCCESS, SUCCESS, RUNNING, RUNNING],
    ]


def test_without_the_plugin_its_file_is_refused_by_line(plugin, tmp_path):
    file = tmp_path / "until.xml"
    file.write_text(
        '<root BTCPP_format="4"><BehaviorTree>\n<KeepRunningUntilFailure>\n<Wait duration="0.1"/>\n'
        "</KeepRunningUntilFailure></BehaviorTree></root>"
    )
    with pytest.raises(InputError, match="line 2"):
        trees.load_tree(file)
    outside = plugin("tree_node")
    assert type(trees.load_tree(file)) is outside.KeepRunningUntilFailure


def test_the_command_line_takes_it(plugin, tmp_path, capsys):
    file = str(Path(__file__).parent / "plugins" / "tree_node.py")
    plugin("tree_node")
    trees.save_tree(trees.sequence("later", trees.delay(0.25, Wait(0.1))), tmp_path / "later.xml")
    assert main(["show", str(tmp_path / "later.xml"), "--scene", "pick_and_place", "--plugin", file]) == 0
    assert "⧖ delay 0.25 s" in capsys.readouterr().out
    out = tmp_path / "run"
    words = ["run", str(tmp_path / "later.xml"), "--scene", "pick_and_place", "--plugin", file]
    assert main([*words, "--out", str(out)]) == 1, "the tree succeeds, and nothing was brought anywhere"
    assert "0.4 s simulated" in capsys.readouterr().out
