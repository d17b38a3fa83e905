"""py_trees' blackboard: each world and each episode has its own, and the process's one stays as it was."""

import numpy as np
import pytest
from py_trees.behaviour import Behaviour
from py_trees.blackboard import Blackboard
from py_trees.common import Access, Status

from bt_tasksim.concept_nodes import Wait
from bt_tasksim.core.batch_leaf import RUNNING, SUCCESS
from bt_tasksim.core.errors import BtTasksimError, LeafError
from bt_tasksim.execution.batch import BatchTree
from bt_tasksim.execution.batch_runner import BatchRunner
from bt_tasksim.execution.blackboard import WorldBlackboard
from bt_tasksim.execution.runner import Runner
from bt_tasksim.trees import sequence
from bt_tasksim.trees.load import load_source


class Counts(Behaviour):
    """Counts its ticks on the blackboard, on which nobody else may; done at the third."""

    def __init__(self, name="counts", most=3):
        super().__init__(name)
        self.most = most
        self.board = self.attach_blackboard_client(name)
        self.board.register_key("count", Access.EXCLUSIVE_WRITE)

    def setup(self, **kwargs):
        self.board.set("count", 0)

    def update(self):
        self.board.set("count", self.board.get("count") + 1)
        self.feedback_message = f"{self.board.get('count')} of {Blackboard.storage.get('/given')}"
        return Status.RUNNING if self.board.get("count") < self.most else Status.SUCCESS

    def terminate(self, new_status):
        if new_status == Status.INVALID:
            self.board.set("count", 0)


@pytest.fixture(autouse=True)
def untouched():
    """Something of somebody else's, which is there afterwards, and nothing else."""
    Blackboard.set("given", 5)
    before = [dict(part) for part in (Blackboard.storage, Blackboard.metadata, Blackboard.clients)]
    there = Blackboard.storage
    yield
    assert Blackboard.storage is there
    after = [dict(part) for part in (Blackboard.storage, Blackboard.metadata, Blackboard.clients)]
    Blackboard.clear()
    assert after == before


def build():
    return sequence("root", Counts())


def in_batch(worlds):
    return BatchTree(build_on_a_board(), worlds, lambda leaf: None, build=build)


def build_on_a_board():
    with WorldBlackboard():
        return build()


def test_worlds_do_not_feel_each_other_and_begin_anew_with_nothing():
    batch, everyone = in_batch(3), np.arange(3)
    assert batch.tick(everyone[:1], 0.0).tolist() == [RUNNING]
    assert batch.tick(everyone, 0.1).tolist() == [RUNNING] * 3
    assert batch.tick(everyone, 0.2).tolist() == [SUCCESS, RUNNING, RUNNING]
    batch.reset(everyone[1:2])
    batch.renew(everyone[1:2])
    assert batch.tick(everyone[1:], 0.3).tolist() == [RUNNING, SUCCESS]
    assert batch.unknown[1].copies[1].feedback_message == "1 of 5", "what stood there before is there"


class Writes(Behaviour):
    """Fails where an earlier one was here."""

    def update(self):
        self.feedback_message = f"seen {Blackboard.storage.get('/seen')}"
        if Blackboard.storage.get("/seen"):
            return Status.FAILURE
        Blackboard.set("seen", Blackboard.storage.get("/seen", 0) + 1)
        return Status.SUCCESS


@pytest.mark.physical
@pytest.mark.parametrize("worlds", [1, 3])
def test_episodes_in_a_batch_are_those_of_a_runner(worlds):
    scene, seeds = load_source("pick_and_place").scene, range(5)

    def both():
        return sequence("root", Writes("writes"), Wait(0.1), Counts())

    runner, alone = Runner(both, scene), {}
    for seed in seeds:
        found = runner.run(seed)
        alone[seed] = found.status, found.control_steps
    assert set(alone.values()) == {(Status.SUCCESS, alone[0][1])}
    batch = BatchRunner(both, scene, worlds=worlds)
    assert {seed: (found.status, found.control_steps) for seed, found in batch.run(seeds)} == alone
    batch.close()


def test_an_episode_of_a_runner_has_its_own_and_shows_it_afterwards(toy):
    stage = toy(Writes("writes"))
    for _ in range(2):
        configuration, world = stage.runner.begin(0)
        assert stage.runner.finish(configuration, world).status == Status.SUCCESS
        assert stage.runner.blackboard.storage == {"/given": 5, "/seen": 1}
    Blackboard.set("seen", 7)
    assert stage.runner.blackboard.storage["/seen"] == 1, "what an episode has is its own"
    stage.runner.begin(0)
    assert stage.tick() == Status.FAILURE, "what somebody writes in between the next one finds"
    Blackboard.unset("seen")
    Blackboard.metadata.pop("/seen")


class Raises(Behaviour):
    def update(self):
        Blackboard.set("left", 1)
        raise ValueError("no")


def test_after_an_error_the_process_has_its_own_again(toy):
    stage = toy(Raises("raises"))
    with pytest.raises(LeafError):
        stage.tick()
    batch = BatchTree(Raises("raises"), 2, lambda leaf: None, build=lambda: Raises("raises"))
    with pytest.raises(BtTasksimError):
        batch.tick(np.arange(2), 0.0)


def test_boards_within_boards():
    with WorldBlackboard() as outer:
        Blackboard.set("a", 1)
        with WorldBlackboard() as inner:
            Blackboard.set("a", 2)
            Blackboard.storage = {"/b": 3}
        assert Blackboard.get("a") == 1
        with inner:
            assert Blackboard.get("b") == 3
    assert outer.storage["/a"] == 1 and WorldBlackboard(outer).storage == outer.storage
