"""A sound concept, situations of it without physics, and what the check says of it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from bt_tasksim.checking.concept_file import check_concept
from bt_tasksim.checking.recording import Recording
from bt_tasksim.checking.situations import RecordedDecision, whole
from bt_tasksim.concept.seen import Seen
from bt_tasksim.core import poses
from bt_tasksim.core.world import Hidden, Observation


def hidden_of(observation, closure=0.0):
    n = observation.objects.shape[1]
    return Hidden(
        time=observation.time,
        objects=observation.objects,
        velocities=np.full((1, n, 6), 0.01),
        hand_force=np.full((1, n), closure),
        hand_distance=np.zeros((1, n)),
        support=np.ones((1, n, n), bool),
        penetration=np.zeros(1),
        tool_pose=observation.tool_pose,
    )


@pytest.fixture
def decisions(toy):
    """What a leaf decides on in a toy world: ``decisions(leaf, n=5)``."""

    def make(leaf, n=5):
        stage = toy(leaf)
        world, rng = stage.context.world, np.random.default_rng(0)
        first, found, memory = whole(Observation, stage.context.observation), [], None
        for k in range(n):
            objects = first.objects.copy()
            objects[..., 0] += 0.01 * k
            observation = dataclasses.replace(
                first,
                time=np.array([0.05 * k]),
                tool_pose=poses.shifted(first.tool_pose, np.full(3, 0.01 * k)),
                tips=rng.normal(size=first.tips.shape),
                closure=np.array([0.1 * k]),
                contacts=rng.random(first.contacts.shape) < 0.5,
                contact_force=rng.normal(size=first.contact_force.shape),
                wrench=rng.normal(size=(1, 6)),
                arm_velocity=rng.normal(size=first.arm_velocity.shape),
                objects=objects,
            )
            seen = Seen(observation, world, stage.runner.robot, np.array([0.05 * k]))
            if k == 0:
                try:
                    memory = leaf.model.begin(seen)
                except Exception:
                    memory = None
            hidden = hidden_of(observation, 0.1 * k)
            found.append(RecordedDecision(leaf, seen, memory, hidden, hidden_of(first), k == 0))
        return found

    return make


@pytest.fixture
def found(decisions):
    """What the check says of a concept, line by line: ``found(Concept)``."""

    def ask(concept, **arguments):
        leaf = concept("cup", **arguments)
        runs = Recording({leaf: decisions(leaf)}, ["it ended"], [])
        case, checked = check_concept(concept, "toy", None, runs)
        assert concept.__name__ in checked
        return [str(f) for f in case.findings]

    return ask
