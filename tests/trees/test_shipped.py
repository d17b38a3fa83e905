"""Every ready-made scenario can be saved, loaded again, and replayed."""

from __future__ import annotations

import importlib

import pytest

from bt_tasksim import Runner, trees
from bt_tasksim.execution.replay import replay
from bt_tasksim.report.write import write_run
from bt_tasksim.trees.load import load_source, scenarios


@pytest.mark.parametrize("name", scenarios())
def test_a_scenario_is_saved_to_xml_and_loaded_back_equal(name, tmp_path):
    tree = importlib.import_module(f"bt_tasksim.trees.scenarios.{name}").build()
    trees.save_tree(tree, tmp_path / "tree.xml", scene=name)
    assert trees.same_tree(trees.load_tree(tmp_path / "tree.xml"), tree)
    assert load_source(str(tmp_path / "tree.xml")).scene.name == load_source(name).scene.name


@pytest.mark.parametrize("name", scenarios())
def test_a_run_of_a_scenario_is_replayed(name, tmp_path):
    source = load_source(name)
    write_run(tmp_path / "run", Runner(source.build(), source.scene), 3)
    assert replay(tmp_path / "run").identical
