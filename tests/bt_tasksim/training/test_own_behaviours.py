"""Behaviours of one's own in an evaluation: what they remember, and what they do wrong."""

import dataclasses

import pytest

from bt_tasksim.core.errors import InputError
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import Runner
from bt_tasksim.training.evaluation import Job, evaluate
from bt_tasksim.trees.load import load_source

pytestmark = pytest.mark.physical

TREE = """
import random
import py_trees
from py_trees.common import Status
from bt_tasksim.trees import sequence
from bt_tasksim.trees.scenarios import grasp_then_pick
from bt_tasksim.concept_nodes import Grasp

class Own(py_trees.behaviour.Behaviour):
    def __init__(self, name):
        super().__init__(name)
        self.random, self.ticks = random.Random(1), 0
    {setup}
    def update(self):
        self.ticks += 1
        if self.ticks > 3:
            return {status}
        return Status.RUNNING

def build():
    return sequence("root", py_trees.decorators.OneShot("once", Own("own"),
        policy=py_trees.common.OneShotPolicy.ON_COMPLETION), Grasp("target"))

scene = grasp_then_pick.scene
"""
FLAKY = "Status.SUCCESS if self.random.random() < 0.5 else Status.FAILURE"


def written(tmp_path, status=FLAKY, setup="pass"):
    path = tmp_path / "own.py"
    path.write_text(TREE.replace("{status}", status).replace("{setup}", setup))
    return str(path)


def test_what_a_node_remembers_ends_with_its_episode(tmp_path):
    job = Job(written(tmp_path), options=EngineOptions(noise="none"))
    found = [
        [
            dataclasses.replace(o, wall_time=0.0)
            for o in evaluate(dataclasses.replace(job, batch=n), range(6)).outcomes
        ]
        for n in (1, 2, 4)
    ]
    assert found[0] == found[1] == found[2]
    source = load_source(job.tree)
    runner = Runner(source.build(), source.scene, job.options)
    alone = runner.run(3)
    assert (alone.status.name, alone.control_steps) == (found[0][3].status, found[0][3].control_steps)
    assert all(o.control_steps > 5 for o in found[0]), "the one before has not ended it at once"


@pytest.mark.parametrize("batch", [1, 2])
def test_a_leaf_that_returns_no_status_is_named(tmp_path, batch):
    found = evaluate(Job(written(tmp_path, "'yes'"), batch=batch), range(2))
    assert all("'own'" in o.why and "no status" in o.why for o in found.outcomes), found.outcomes


@pytest.mark.parametrize("batch", [1, 2])
def test_a_setup_that_takes_nothing_is_named(tmp_path, batch):
    path = written(tmp_path, setup="def setup(self):\n        pass")
    with pytest.raises(InputError, match=r"'own' cannot be set up: TypeError.*setup"):
        evaluate(Job(path, batch=batch), range(2))
