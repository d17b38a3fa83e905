"""Policies made by hand, for what is done with policies; one recorded run, for what is left of one."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bt_tasksim.concept_nodes import Grasp
from bt_tasksim.core.resources import asset
from bt_tasksim.execution.run_log import RunRecorder, read_text
from bt_tasksim.execution.runner import Runner
from bt_tasksim.policy import library as policy_library
from bt_tasksim.policy.files import PolicyCard, save_policy
from bt_tasksim.policy.network import Network
from bt_tasksim.robot.description import load_robot
from bt_tasksim.trees.scenarios import pick_and_place


def grasp_network(robot: str = "panda", gain: float = 0.6) -> Network:
    """A network that leaves the reference motion as it is and is done when the programmed policy is.

    With a gain of 0 it never is.
    """
    layout = Grasp.layout(load_robot(robot))
    names = list(layout)
    last_of_time = sum(layout[n] for n in names[: names.index("time") + 1]) - 1  # ticks held still, over 3
    weights = np.zeros((Grasp.actions + 1, sum(layout.values())))
    weights[-1, last_of_time] = gain
    n = weights.shape[1]
    return Network(np.zeros(n), np.ones(n), [(weights, np.zeros(len(weights)))])


def grasp_card(robot: str = "panda", **changes: Any) -> PolicyCard:
    """A card for `grasp_network`."""
    fields = {
        "concept": "grasp",
        "robot": robot,
        "features": tuple(Grasp.layout(load_robot(robot)).items()),
        "actions": Grasp.actions,
        "tree": "grasp_then_pick",
        "scene": "grasp_then_pick",
        "noise": "original",
        "algorithm": "by hand",
        "steps": 5000,
        "seeds": (1, 2),
        "wall_seconds": 12.5,
        "configuration": {"learning_rate": 3e-4},
        "measured": (
            {
                "tree": "grasp_then_pick", "perception": "state, noise original", "episodes": 1000,
                "successes": 960, "confidence_interval": [0.946, 0.97], "baseline": 0.8,
            },
        ),
        "remarks": "made by hand",
    }  # fmt: skip
    return PolicyCard(**{**fields, **changes})


@pytest.fixture
def policy(tmp_path):
    """Writes a grasp policy and returns its folder: ``policy(name, robot="panda", gain=0.6, **card)``."""

    def write(name: str = "by-hand", robot: str = "panda", gain: float = 0.6, **changes: Any) -> Path:
        folder = tmp_path / name
        save_policy(folder, grasp_network(robot, gain), grasp_card(robot, **changes))
        return folder

    return write


@pytest.fixture
def shipped(tmp_path, monkeypatch):
    """Stands in for ``assets/policies``: writes a grasp policy there, and pins: ``shipped(name, pins)``."""
    home = tmp_path / "assets" / "policies"
    home.mkdir(parents=True)

    def elsewhere(*parts: str) -> Path:
        return home.joinpath(*parts[1:]) if parts[0] == "policies" else asset(*parts)

    monkeypatch.setattr(policy_library, "asset", elsewhere)

    def write(name: str | None = None, pins: Any = None, **changes: Any) -> Path:
        if name is not None:
            save_policy(home / name, grasp_network(), grasp_card(**changes))
        if pins is not None:
            (home / "pins.json").write_text(json.dumps(pins))
        return home

    return write


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
        nodes = json.loads(read_text(run.extra["run/nodes"]))
        nodes[0]["name"] = name
        extra = {
            **run.extra,
            "run/nodes": np.array(json.dumps(nodes).encode()),
            "messages/text": np.array([text.encode()] * len(run.extra["messages/text"])),
        }
        return dataclasses.replace(run, extra=extra)

    return make
