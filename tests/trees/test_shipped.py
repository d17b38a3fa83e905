"""Every ready-made scenario, and so every concept, in every tool, without being told of it.

A run of each to success, which is what the physics says; the run's page, its log and the first seconds of its
replay; a person's demonstration made of it; its tree as XML and back.
"""

from __future__ import annotations

import importlib

import numpy as np
import pytest
from draws import successes
from py_trees.common import Status

from bt_tasksim import Runner, trees
from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.core.registry import parts
from bt_tasksim.demos_decomp.synthetic_runs import as_person
from bt_tasksim.execution.replay import replay
from bt_tasksim.execution.run_log import RunRecorder
from bt_tasksim.policy.policy import concept_name
from bt_tasksim.report.report import report_page
from bt_tasksim.trees.load import load_source, scenarios
from bt_tasksim.trees.walk import nodes_of

OFTEN = {"pick_and_place": 3, "shelf_to_shelf": 3, "pick_and_throw": 3, "pick_and_place_recovering": 2}
"""How many successes are asked for; one of all others, how often they succeed is a benchmark's to say."""
WHOLE = ("open_drawer", "pick_and_throw", "push")
"""Runs of which all is replayed; of others the first seconds, which tell whether a log holds the world."""
FIRST = 3.0
"""Those seconds."""


@pytest.mark.parametrize("name", scenarios())
def test_what_should_stand_should_stand_upright(name):
    stand = [goal for goal in load_source(name).scene.goals if goal.relation in ("on", "anywhere", "beside")]
    assert all(goal.angle_tolerance < 1.0 for goal in stand)  # of any heading says `anywhere`


@pytest.mark.physical
@pytest.mark.parametrize("name", scenarios())
def test_it_succeeds_and_is_recorded_shown_replayed_and_demonstrated(name, tmp_path):
    source = load_source(name)
    runner = Runner(source.build(), source.scene)
    recorder = RunRecorder(runner, name)
    results = successes(lambda seed: runner.run(seed, record=recorder), range(7, 12), n=OFTEN.get(name, 1))
    for result in results:
        assert result.status == Status.SUCCESS
        assert result.verdict.penetration < 0.002
        if result.configuration.goal.relation == "stands":
            assert result.verdict.position_error < 0.03
            assert result.verdict.angle_error < np.deg2rad(10)
    errors = [result.verdict.position_error for result in results]
    assert len(set(errors)) == len(errors)

    run, leaves = recorder.demonstration(result), [n for n in recorder.nodes if isinstance(n, ConceptNode)]
    page = report_page(run, runner.tree)
    assert all(leaf.name in page for leaf in leaves)
    shown, labels = as_person(run, recorder.nodes, seed=1)
    done = {label.concept for label in labels}
    assert len(shown.time) > 20 and done <= {concept_name(type(leaf.model)) for leaf in leaves}
    assert done, "something took its time and succeeded"

    recorder.write(tmp_path / "run.h5", result)
    again = replay(tmp_path / "run.h5", until=None if name in WHOLE else FIRST)
    assert again.identical, again.why


@pytest.mark.parametrize("name", scenarios())
def test_it_is_saved_to_xml_and_loaded_back_equal(name, tmp_path):
    tree = importlib.import_module(f"bt_tasksim.trees.scenarios.{name}").build()
    trees.save_tree(tree, tmp_path / "tree.xml", scene=name)
    assert trees.same_tree(trees.load_tree(tmp_path / "tree.xml"), tree)
    assert load_source(str(tmp_path / "tree.xml")).scene.name == load_source(name).scene.name


def test_every_concept_has_a_scenario():
    leaves = [leaf for name in scenarios() for leaf in nodes_of(load_source(name).build())]
    shown = {type(leaf.model) for leaf in leaves if isinstance(leaf, ConceptNode)}
    assert {kind for kind in parts("concept").values() if not issubclass(kind, Condition)} <= shown
