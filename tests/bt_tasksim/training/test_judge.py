"""What follows judges: by its status and by the hidden state."""

import dataclasses

import numpy as np
import pytest
from py_trees.behaviours import Failure
from toys import DONE, SCENE, Below, Check, Move, Raise, Unprogrammed, activations, honest, play

from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.concept_nodes import Wait
from bt_tasksim.policy.policy import Action
from bt_tasksim.scene.scene import CurriculumStage
from bt_tasksim.trees import fallback, invert, reactive_sequence, repeat, retry, sequence, timeout
from bt_tasksim.trees.nodes.train import Train

HERE = 0.35
"""Where the tool is at first: a leaf that brings it there is done at once."""


def end_of(env, decide=honest):
    _, terminated, truncated, info = play(env, decide)
    assert terminated != truncated
    return info


def paid(info):
    return {part: value for part, value in info["reward"].items() if value and part != "shaping"}


def test_status_and_hidden_state_agree(env_of):
    env = env_of(sequence("s", Train(Raise()), Check()))
    info = end_of(env)
    assert info["is_success"] and info["follower"] == "SUCCESS" and paid(info) == {"success": 1.0}
    assert info["reason"] == "followed"
    info = end_of(env, lambda features: DONE)
    assert not info["is_success"] and info["follower"] == "FAILURE" and paid(info) == {"failure": -1.0}
    assert info["reason"] == "limit_violated"


def test_a_follower_that_succeeds_with_an_empty_hand_has_failed(env_of):
    env = env_of(sequence("s", Train(Raise()), Check(blind=True)))
    env.batch.worlds.pipeline.truth = -0.05
    info = end_of(env)
    assert info["status"] == "SUCCESS" and info["follower"] == "SUCCESS" and not info["is_success"]
    assert paid(info) == {"failure": -1.0}
    assert info["reason"] == "goal_missed"
    env.batch.worlds.pipeline.truth = 0.0
    assert end_of(env)["is_success"], "and the next episode begins anew"


def test_two_bodies_in_one_place_are_no_success(env_of):
    env = env_of(sequence("s", Train(Raise()), Check()))
    env.batch.worlds.pipeline.depth = 0.003
    info = end_of(env)
    assert not info["is_success"] and info["reason"] == "penetration"


def test_a_stage_may_tolerate_more(env_of):
    stages = (CurriculumStage("easy", tolerance=6.0), CurriculumStage("hard", tolerance=4.0))
    scene = dataclasses.replace(SCENE, stages=stages)
    for stage, expected in ((0, True), (1, False), (None, False)):
        env = env_of(sequence("s", Train(Raise()), Check(blind=True)), scene, stage=stage)
        env.batch.worlds.pipeline.truth = -0.05
        assert end_of(env)["is_success"] is expected


def test_without_a_follower_the_own_goal_counts(env_of):
    for tree in (Train(Raise()), fallback("f", Train(Raise()), Check())):
        env = env_of(tree)
        info = end_of(env)
        assert info["is_success"] and info["follower"] == ""
        info = end_of(env, lambda features: DONE)
        assert not info["is_success"] and info["follower"] == "" and paid(info) == {"failure": -1.0}
        assert info["reason"] == "goal_missed"


def test_what_has_no_policy_yet_does_not_judge(env_of):
    env = env_of(sequence("s", Train(Raise()), Unprogrammed(name="later"), Check(height=0.9)))
    info = end_of(env)
    assert info["is_success"] and info["follower"] == ""


def test_it_judges_once_it_has_one(env_of):
    class Up:
        name, source = "up", ""

        def act(self, model, seen, memory):
            return Action(np.ones((1, 1)), seen.tool[:, 2] > 0.6)

    later = Unprogrammed(height=0.61, name="later")
    env = env_of(sequence("s", Train(Raise()), later), policies={"later": Up()})
    info = end_of(env)
    assert info["is_success"] and info["reason"] == "followed" and info["why"] == "later succeeded"
    env.batch.worlds.pipeline.truth = 0.05
    assert not end_of(env)["is_success"]


def test_later_children_of_a_fallback_do_not_judge(env_of):
    env = env_of(sequence("s", fallback("f", Train(Raise()), Check(height=0.9)), Check(name="after")))
    info = end_of(env)
    assert info["is_success"] and info["reason"] == "followed" and info["why"] == "after succeeded"


@pytest.mark.parametrize("first", [HERE, 0.45])
def test_a_follower_several_levels_up_and_what_stands_between(env_of, first):
    inner = sequence("inner", Below(), Train(Raise(height=first)), Below())
    tree = sequence("s", retry(1, fallback("f", inner)), Wait(0.1), Check(height=first))
    env = env_of(tree)
    info = end_of(env)
    assert info["is_success"] and info["reason"] == "followed" and info["why"] == f"check {first} succeeded"
    assert info["seconds"] >= 0.2, "the wait was waited for"


@pytest.mark.parametrize("first", [HERE, 0.45])
def test_a_condition_between_that_fails_is_a_failure(env_of, first):
    env = env_of(sequence("s", Train(Raise(height=first)), Wait(0.1), Below(0.2), Check(height=first)))
    info = end_of(env)
    assert not info["is_success"] and paid(info) == {"failure": -1.0} and not info["discarded"]
    assert info["reason"] == "condition_does_not_hold" and info["why"].startswith("below 0.2: ")


@pytest.mark.parametrize("first", [HERE, 0.45])
def test_a_composite_is_judged_as_a_whole(env_of, first):
    def follower(second):
        return sequence("then", Below(), Check(height=first), Wait(0.1), second)

    env = env_of(sequence("s", Train(Raise(height=first)), follower(Check(height=first, name="second"))))
    assert end_of(env)["why"] == "then succeeded"
    env = env_of(sequence("s", Train(Raise(height=first)), follower(Check(height=0.9, name="second"))))
    info = end_of(env)
    assert (
        not info["is_success"] and info["reason"] == "limit_violated" and info["why"].startswith("second: ")
    )
    env = env_of(sequence("s", Train(Raise(height=first)), follower(Below(0.2))))
    assert not end_of(env)["is_success"]


@pytest.mark.parametrize("first", [HERE, 0.45])
def test_a_follower_that_tries_again_is_judged_at_its_end(env_of, first):
    then = sequence("then", Check(height=first), invert(Below(0.5)))
    info = end_of(env_of(sequence("s", Train(Raise(height=first)), retry(3, then))))
    assert not info["is_success"] and info["follower"] == "FAILURE"
    recovering = fallback("recovering", Check(height=0.9, name="vain"), Check(height=first))
    info = end_of(env_of(sequence("s", Train(Raise(height=first)), recovering)))
    assert info["is_success"] and info["reason"] == "followed" and info["why"] == "recovering succeeded"


@pytest.mark.parametrize("first", [HERE, 0.45])
@pytest.mark.parametrize(
    "follower", [lambda: sequence("then", Below(0.2), Check()), lambda: Check(height=0.9)]
)
def test_a_failure_that_is_tried_again_from_the_start_ends_the_episode(env_of, first, follower):
    leaf = Raise(height=first)
    env = env_of(retry(5, sequence("s", Train(leaf), follower())))
    info = end_of(env)
    assert not info["is_success"] and paid(info) == {"failure": -1.0}
    assert activations(env, leaf) == 1, "the next attempt is not part of it"


def test_something_else_that_ends_the_sequence_is_a_failure(env_of):
    guarded = reactive_sequence(
        "guarded", Below(0.4), sequence("s", Train(Raise(height=HERE)), Move(0.45), Check())
    )
    info = end_of(env_of(guarded))
    assert not info["is_success"] and paid(info) == {"failure": -1.0}
    info = end_of(
        env_of(timeout(0.2, sequence("s", Train(Raise(height=HERE)), Check(height=HERE, ticks=1.0))))
    )
    assert not info["is_success"] and info["reason"] == "follower_not_reached"
    info = end_of(env_of(sequence("s", Train(Raise(height=HERE)), Failure("no"), Check())))
    assert not info["is_success"] and info["follower"] == "INVALID"


def test_it_is_known_how_things_were_when_the_follower_began(env_of):
    class Higher(Move):
        """Is there when the tool is 0.1 m above where it was."""

        def sufficient_cost(self, known, memory):
            rise = known.hidden.tool_pose[:, 2] - known.began.tool_pose[:, 2]
            return np.abs(rise - 0.1) / 0.01

    env = env_of(sequence("s", Train(Raise()), Higher(0.55)))
    assert end_of(env)["is_success"]
    assert not end_of(env, lambda f: [1.0, 0.0] if f[0] > 0.2 else DONE)["is_success"]
    assert end_of(env)["is_success"]


class MoodyLeaf(ConceptNode):
    def __init__(self, *args, **kwargs):
        super().__init__(*args, **kwargs)
        self.model.costs = iter([5.0])


class Moody(Move):
    """Misses its goal the first time."""

    leaf_base = MoodyLeaf

    def sufficient_cost(self, known, memory):
        return np.array([next(self.costs, 0.0)])


def test_a_round_in_which_nothing_was_decided_is_not_judged(env_of):
    """In the first round the learner is passed by, and what follows goes wrong by itself."""
    either = fallback("either", Below(0.4), Raise())
    env = env_of(repeat(2, sequence("s", Train(either), Moody(0.42, name="moody"))))
    info = end_of(env)
    assert info["is_success"] and info["reason"] == "followed" and info["why"] == "moody succeeded"
    either = fallback("either", sequence("by itself", Below(0.4), Moody(0.42)), Raise())
    info = end_of(env_of(repeat(2, Train(either))))
    assert info["is_success"] and info["reason"] == "followed" and info["why"] == "train either succeeded"
