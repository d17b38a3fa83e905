"""Policies: the programmed one does what the concept says, and names are resolved."""

import numpy as np
import pytest

from bt_tasksim.errors import InputError
from bt_tasksim.policy import Action, ProgrammedPolicy, resolve_policy


class Model:
    def programmed_motion(self, seen, memory):
        return np.array([seen, memory])

    def done(self, seen, memory):
        return seen == memory


def test_the_programmed_policy_is_the_concepts_own():
    action = ProgrammedPolicy().act(Model(), 2.0, 2.0)
    assert isinstance(action, Action)
    assert action.motion.tolist() == [2.0, 2.0] and action.terminate is True
    assert ProgrammedPolicy().act(Model(), 2.0, 1.0).terminate is False


@pytest.mark.parametrize("name", [None, "", "programmed"])
def test_the_programmed_policy_has_a_name(name):
    policy = resolve_policy(name, "grasp", "panda")
    assert isinstance(policy, ProgrammedPolicy) and policy.name == "programmed"


def test_an_unknown_policy_is_one_sentence():
    with pytest.raises(
        InputError, match="concept 'grasp' on robot 'panda': no policy 'x'; known: programmed"
    ):
        resolve_policy("x", "grasp", "panda")


def test_results_name_the_policy_of_each_leaf(toy, act):
    stage = toy(act("move"))
    configuration = stage.runner.scene.sample(0)
    result = stage.runner.finish(configuration, stage.context.world)
    assert result.policies == {"move": "programmed"}
