"""Episodes in many worlds at once: each is what an environment of its own would have had, bit for bit."""

import gymnasium
import numpy as np
import pytest
import toys
from py_trees.behaviours import Failure
from toys import DONE, SCENE, STILL, UP, Below, Check, Even, Move, Raise, Turn, Unprogrammed, honest, play

from bt_tasksim.concept_nodes import Wait
from bt_tasksim.core.errors import InputError, LeafError, MachineError, UnreachableError
from bt_tasksim.training.env import REDRAWS, EpisodeEnv
from bt_tasksim.training.episode_batch import EpisodeBatch
from bt_tasksim.training.reward import Reward
from bt_tasksim.training.rollouts import DrawTask, RolloutTask, collect, in_batch, judge_draw
from bt_tasksim.training.vector_env import EpisodeVectorEnv
from bt_tasksim.trees import (
    fallback,
    force_failure,
    force_success,
    invert,
    parallel,
    reactive_fallback,
    reactive_sequence,
    repeat,
    retry,
    sequence,
    subtree,
    timeout,
)
from bt_tasksim.trees.nodes.train import Train
from test_rollouts import UP as NETWORK

HERE = 0.35


class Late(Raise):
    """Decides after a while only."""

    def decides(self, seen, memory):
        return memory >= 4


def simple(height=0.45, **settings):
    return sequence("s", Train(Raise(height=height, **settings)), Check(height=height))


def several():
    first, second = Raise(height=0.37, name="first"), Raise(height=0.45, name="second")
    inner = sequence("i", Move(0.33), first, fallback("f", Below(0.1), Move(0.41)), second, Wait(0.1))
    return sequence("s", Move(0.3), Train(inner), Check())


def high_then_low():
    return sequence("s", Train(Raise()), Check(blind=True), Move(0.5), Check(name="second"))


TREES = {
    "simple": simple,
    "alone": lambda: Train(Raise()),
    "passed over": lambda: sequence("s", Even(), simple()),
    "a long way before": lambda: sequence("s", Wait(0.3), Even(), Move(0.3), simple()),
    "several leaves": several,
    "two in parallel": lambda: Train(parallel("p", Raise(name="a"), Wait(0.3), success=2)),
    "in a parallel": lambda: sequence("s", parallel("a", Wait(0.1), sequence("b", Train(Raise())), success=2)),
    "tried again": lambda: retry(3, sequence("s", Train(Raise(limit=0.5)), Check())),
    "repeated": lambda: repeat(2, sequence("s", Train(fallback("e", Below(0.4), Raise())), Check(blind=True))),
    "interrupted": lambda: reactive_sequence("r", Below(0.4), simple()),
    "interrupted by a fallback": lambda: reactive_fallback("r", invert(Below(0.4)), simple()),
    "out of time": lambda: timeout(0.3, simple()),
    "the subtree's time": lambda: sequence("s", Train(timeout(0.3, Raise())), Check()),
    "a failing subtree": lambda: sequence("r", Train(sequence("i", Raise(), Below(0.1))), Check()),
    "forced": lambda: sequence("r", force_success(Train(Raise())), Check()),
    "forced to fail": lambda: sequence("r", invert(force_failure(Train(Raise()))), Check()),
    "late": lambda: sequence("s", Train(Late()), Check()),
    "blind follower": lambda: sequence("s", Train(Raise()), Check(blind=True)),
    "two checks": high_then_low,
    "a follower that begins anew": lambda: retry(
        2, sequence("s", Train(Raise()), force_failure(Check(blind=True)), Check())
    ),
    "guarded": lambda: reactive_sequence(
        "g", Below(0.4), sequence("s", Train(Raise(height=HERE)), Move(0.45), Check())
    ),
    "late follower": lambda: sequence("s", Train(Raise(height=HERE)), Check(height=HERE, ticks=1.0)),
    "composite follower": lambda: sequence(
        "s", Train(Raise()), sequence("then", Below(), Check(), Wait(0.1), Check(name="second"))
    ),
    "recovering": lambda: sequence(
        "s", Train(Raise()), fallback("r", Check(height=0.9, name="vain"), Check())
    ),
    "subtree": lambda: subtree("t", sequence("u", Below(2.0), Train(Raise())), ) ,
}  # fmt: skip


def task(number, decisions=40, std=0.3, stage=None):
    return RolloutTask(NETWORK, np.full(2, std, np.float32), (7, number), decisions, stage)


def as_bytes(found):
    return {k: v.tobytes() if isinstance(v, np.ndarray) else v for k, v in vars(found).items()}


def batched(batch, tasks):
    return [as_bytes(found) for _, found in sorted(in_batch(batch, tasks), key=lambda pair: pair[0])]


@pytest.fixture
def batch_of(toy_engines):
    return lambda tree, scene=SCENE, **settings: EpisodeBatch(tree, scene, **settings)


@pytest.fixture
def vector_of(toy_engines):
    return lambda tree, scene=SCENE, **settings: EpisodeVectorEnv(tree, scene, **settings)


# ---- rollouts ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("longest", [30.0, 0.6])
@pytest.mark.parametrize("tree", TREES.values(), ids=list(TREES))
def test_rollouts_are_those_of_an_environment_of_their_own(env_of, batch_of, tree, longest):
    tasks = [task(k) for k in range(4)]
    expected = []
    try:
        expected = [as_bytes(collect(env_of(tree(), longest=longest), t)) for t in tasks]
    except InputError as error:
        with pytest.raises(InputError) as caught:
            batched(batch_of(tree(), worlds=3, longest=longest), tasks)
        assert str(caught.value).startswith(str(error).split("draws")[0])
        return
    for worlds in (1, 3, 5):
        assert batched(batch_of(tree(), worlds=worlds, longest=longest), tasks) == expected
    again = batch_of(tree(), worlds=2, longest=longest)
    assert batched(again, tasks[::-1])[::-1] == expected
    assert batched(again, tasks) == expected, "and the same worlds once more"


@pytest.mark.parametrize("tree", ["simple", "passed over", "several leaves", "blind follower"])
def test_held_apart_draws_too(env_of, batch_of, tree):
    tasks = [DrawTask(NETWORK, k) for k in range(8)]
    env = env_of(TREES[tree]())
    expected = [judge_draw(env, t) for t in tasks]
    found = sorted(in_batch(batch_of(TREES[tree](), worlds=3), tasks))
    assert [result for _, result in found] == expected
