"""One recorded run for all tests of what is left of it."""

import dataclasses
from types import SimpleNamespace

import pytest

from bt_tasksim.report.run_log import RunRecorder
from bt_tasksim.runner import Runner
from trees.scenarios import pick_and_place


@pytest.fixture(scope="session")
def recorded():
    """A run of pick_and_place: runner, recorder, result."""
    runner = Runner(pick_and_place.build(), pick_and_place.scene())
    recorder = RunRecorder(runner)
    result = runner.run(3, record=recorder)
    statuses = [node.status for node in recorder.nodes]
    return SimpleNamespace(runner=runner, recorder=recorder, result=result, statuses=statuses)


@pytest.fixture(scope="session")
def run(recorded):
    """The same, as a demonstration."""
    return recorded.recorder.demonstration(recorded.result)


@pytest.fixture
def renamed(run):
    """Makes a run whose first node has another name, and says something else."""

    def make(name, text):
        import json

        import numpy as np

        from bt_tasksim.report.run_log import read_text

        nodes = json.loads(read_text(run.extra["run/nodes"]))
        nodes[0]["name"] = name
        extra = {
            **run.extra,
            "run/nodes": np.array(json.dumps(nodes).encode()),
            "messages/text": np.array([text.encode()] * len(run.extra["messages/text"])),
        }
        return dataclasses.replace(run, extra=extra)

    return make
