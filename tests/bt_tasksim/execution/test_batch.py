"""Many trees at once: tick by tick the same as py_trees and BehaviorTree.CPP, world by world by itself."""

from __future__ import annotations

import gc
import logging
import time

import numpy as np
import py_trees
import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from benchmarks.batch.same_ticks import (
    by_executor,
    by_py_trees,
    cpp_is_there,
    difference,
    difference_to_cpp,
    draw,
    known,
)
from bt_tasksim import trees
from bt_tasksim.core.batch_leaf import FAILURE, INVALID, PENDING, RUNNING, SUCCESS, BatchLeaf
from bt_tasksim.core.errors import InputError, LeafError
from bt_tasksim.execution.batch import BatchTree
from bt_tasksim.execution.world_by_world import WorldByWorld
from bt_tasksim.trees.nodes.train import Train

CODE = {"R": RUNNING, "S": SUCCESS, "F": FAILURE, "P": PENDING}
STATUS = {"R": Status.RUNNING, "S": Status.SUCCESS, "F": Status.FAILURE}


class Scripted(Behaviour):
    """Answers by a script, over and over."""

    def __init__(self, script, name="leaf"):
        super().__init__(name)
        self.script, self.asked, self.setups = script, 0, []

    def setup(self, **kwargs):
        self.setups.append(kwargs)

    def update(self):
        self.asked += 1
        return STATUS[self.script[(self.asked - 1) % len(self.script)]]


class BatchScripted(BatchLeaf):
    """The same in all worlds; P lets the tick stand still before the next answer."""

    def __init__(self, script, worlds):
        self.script, self.asked = [CODE[c] for c in script], np.zeros(worlds, int)
        self.stopped, self.ticked, self.fresh = [], [], []

    def tick(self, rows, fresh):
        self.ticked.append(sorted(rows.tolist()))
        self.fresh.append(sorted(rows[fresh].tolist()))
        return self.resume(rows)

    def resume(self, rows):
        asked = self.asked[rows] % len(self.script)
        self.asked[rows] += 1
        return np.asarray(self.script, np.int8)[asked]

    def stop(self, rows):
        self.stopped += rows.tolist()


def batch(tree, worlds=2, **more):
    leaves = {}

    def leaf(node):
        if isinstance(node, Scripted):
            leaves[node.name] = BatchScripted(node.script, worlds)
            return leaves[node.name]
        return None

    return BatchTree(tree, worlds, leaf, **more), leaves


def rows(*numbers):
    return np.asarray(numbers, int)


@pytest.mark.parametrize("seeds", [range(k, k + 25) for k in range(0, 200, 25)], ids=str)
def test_every_tick_is_that_of_py_trees_and_of_behaviortree_cpp(seeds):
    compared = 0
    for seed in seeds:
        case = draw(seed)
        wanted = by_py_trees(case)
        why = difference(case, wanted, by_executor(case))
        assert why is None, why
        if not case.is_own and cpp_is_there():
            why, ticks = difference_to_cpp(case, wanted)
            assert why is None, why
            compared += ticks
    assert compared or not cpp_is_there()


@pytest.mark.parametrize("standing", [0.2, 0.7])
def test_ticks_that_stand_still_and_go_on_are_the_same(standing):
    for seed in range(1000, 1060):
        case = draw(seed)
        why = difference(case, by_py_trees(case), by_executor(case, standing=standing))
        assert why is None, why


def test_leaves_that_are_not_known_are_the_same(caplog):
    caplog.set_level(logging.ERROR)
    for seed in range(2000, 2040):
        case = draw(seed)
        found = by_executor(case, standing=0.2, know=lambda name, seed=seed: known(seed, name))
        why = difference(case, by_py_trees(case), found)
        assert why is None, why


def test_torch_does_the_same():
    torch = pytest.importorskip("torch")
    for seed in range(3000, 3040):
        case = draw(seed)
        why = difference(case, by_py_trees(case), by_executor(case, xp=torch, standing=0.2))
        assert why is None, why


def test_nothing_is_left_on_another_device():
    torch = pytest.importorskip("torch")
    for seed in range(3100, 3112):
        case = draw(seed)
        with torch.device("meta"):  # where all is that nobody has put on the batch's device
            found = by_executor(
                case, xp=torch, standing=0.2, know=lambda name, seed=seed: known(seed, name), device="cpu"
            )
        why = difference(case, by_py_trees(case), found)
        assert why is None, why


def test_a_world_does_not_feel_its_neighbours():
    for seed in range(4000, 4020):
        case = draw(seed, worlds=5)
        alone = [
            by_executor(
                type(case)(case.shape, case.outcomes[:, [w]], case.anew[[w]], seed)
            )[0]
            for w in range(5)
        ]  # fmt: skip
        assert by_executor(case) == alone


def test_worlds_begin_anew_by_themselves():
    tree, leaves = batch(trees.sequence("root", Scripted("RRS", "a"), Scripted("R", "b")), worlds=3)
    everyone = rows(0, 1, 2)
    for _ in range(3):
        tree.tick(everyone, 0.0)
    assert tree.status.tolist() == [[RUNNING, SUCCESS, RUNNING]] * 3
    tree.reset(rows(1))
    assert leaves["b"].stopped == [1]
    assert tree.status.tolist()[1] == [INVALID] * 3
    assert tree.tick(everyone, 0.0).tolist() == [RUNNING] * 3
    assert leaves["a"].ticked[-1] == leaves["a"].fresh[-1] == [1]
    assert leaves["b"].fresh[-1] == []


def test_a_tick_stands_still_before_a_leaf_while_others_go_on():
    tree, leaves = batch(
        trees.sequence("root", Scripted("S", "a"), Scripted("PS", "b"), Scripted("RS", "c")), worlds=2
    )
    assert tree.tick(rows(0), 0.0).tolist() == [PENDING]
    assert tree.waits_at.tolist() == [2, -1]
    assert tree.status[0].tolist() == [INVALID, SUCCESS, INVALID, INVALID]
    with pytest.raises(ValueError, match="resume"):
        tree.tick(rows(1, 0), 0.0)
    with pytest.raises(ValueError, match="tick it"):
        tree.resume(rows(1))
    assert tree.tick(rows(1), 0.0).tolist() == [PENDING]
    assert tree.resume(rows(0)).tolist() == [RUNNING]
    assert tree.tick(rows(0), 0.0).tolist() == [SUCCESS]
    assert leaves["c"].ticked == [[0], [0]]
    assert tree.resume(rows(1)).tolist() == [RUNNING]
    assert tree.status.tolist()[1] == [RUNNING, SUCCESS, SUCCESS, RUNNING]


def test_a_leaf_may_wait_again_and_a_reset_drops_half_a_tick():
    tree, leaves = batch(trees.parallel("root", Scripted("R", "a"), Scripted("PPS", "b")), worlds=2)
    assert tree.tick(rows(0, 1), 0.0).tolist() == [PENDING] * 2
    assert tree.resume(rows(1, 0)).tolist() == [PENDING] * 2
    tree.reset(rows(1))
    assert (leaves["a"].stopped, leaves["b"].stopped) == ([1], [1])
    assert tree.waits_at.tolist() == [2, -1]
    assert tree.status[1].tolist() == [INVALID] * 3
    assert tree.resume(rows(0)).tolist() == [RUNNING]
    tree.reset(rows(0, 1))
    assert leaves["b"].stopped == [1], "it had ended in world 0"


def test_train_counts_activations():
    def build():
        return trees.reactive_sequence("root", Scripted("SSSF", "ask"), Train(Scripted("RRSR", "act")))

    one = build()
    tree, _ = batch(build(), worlds=3)
    train = tree.compiled[2]
    for _ in range(12):
        one.tick_once()
        tree.tick(rows(0, 2), 0.0)
        alone = one.children[1]
        assert train.activations.tolist() == [alone.activations, 0, alone.activations]


def test_time_is_each_worlds_own():
    tree, leaves = batch(trees.timeout(0.1, Scripted("R", "a")), worlds=2)
    for now in (0.0, 0.05):
        assert tree.tick(rows(0, 1), np.asarray([now, now / 10])).tolist() == [RUNNING] * 2
    assert tree.tick(rows(1, 0), np.asarray([0.01, 0.1])).tolist() == [RUNNING, FAILURE]
    assert leaves["a"].stopped == [0]


def test_a_leaf_that_raises_is_named_and_all_nodes_of_these_worlds_end():
    class Breaks(BatchScripted):
        def tick(self, rows, fresh):
            if 1 in rows:
                raise RuntimeError("no such thing")
            return super().tick(rows, fresh)

    made = {}

    def leaf(node):
        made[node.name] = (Breaks if node.name == "b" else BatchScripted)(node.script, 3)
        return made[node.name]

    tree = BatchTree(trees.parallel("root", Scripted("R", "a"), Scripted("R", "b")), 3, leaf)
    tree.tick(rows(0, 2), 0.0)
    with pytest.raises(LeafError, match=r"'b' raised RuntimeError.*no such thing"):
        tree.tick(rows(1, 2), 0.0)
    assert tree.status.tolist() == [[RUNNING] * 3, [INVALID] * 3, [INVALID] * 3]
    assert sorted(made["a"].stopped) == [1, 2]
    assert sorted(made["b"].stopped) == [1, 2]
    assert tree.tick(rows(0, 2), 0.0).tolist() == [RUNNING] * 2


class Unknown(Behaviour):
    """A user's own behaviour."""

    def __init__(self):
        super().__init__("mine")
        self.count, self.contexts, self.ended = 0, [], 0

    def setup(self, **kwargs):
        self.contexts.append(kwargs.get("context"))

    def update(self):
        self.count += 1
        return Status.RUNNING if self.count < 3 else Status.SUCCESS

    def terminate(self, new_status):
        self.ended += new_status == Status.INVALID


def test_what_is_not_known_runs_world_by_world_and_that_is_said_once(caplog):
    made = []

    def build():
        made.append(trees.sequence("root", Unknown(), trees.invert(Unknown()), Scripted("R")))
        return made[-1]

    tree, _ = batch(build(), worlds=2, build=build, contexts=lambda world: f"context {world}")
    said = [record.message for record in caplog.records]
    assert len(said) == 1 and "Unknown" in said[0]
    assert len(made) == 3 and isinstance(tree.compiled[1], WorldByWorld)
    for _ in range(2):
        assert tree.tick(rows(1), 0.0).tolist() == [RUNNING]
    assert [m.children[0].count for m in made] == [0, 0, 2]
    assert [m.children[0].contexts for m in made] == [[], ["context 0"], ["context 1"]]
    assert tree.tick(rows(0, 1), 0.0).tolist() == [RUNNING] * 2
    assert tree.status.tolist() == [
        [RUNNING, RUNNING, INVALID, INVALID, INVALID],
        [RUNNING, SUCCESS, RUNNING, RUNNING, INVALID],
    ]
    tree.reset(rows(0, 1))
    assert [m.children[0].status for m in made[1:]] == [Status.INVALID] * 2
    assert made[2].children[0].ended == 1, "py_trees tells it too where it had ended"


def test_a_composite_that_is_not_known_shows_the_statuses_below_it(caplog):
    def build():
        some = py_trees.common.ParallelPolicy.SuccessOnAll(synchronise=True)
        below = [Scripted("RS", "x"), trees.sequence("y", Scripted("S"), Scripted("RRF"))]
        return trees.sequence("root", py_trees.composites.Parallel("theirs", some, below), Scripted("R"))

    tree, _ = batch(build(), worlds=2, build=build)
    one = build()
    for _ in range(5):
        one.tick_once()
        tree.tick(rows(0), 0.0)
        wanted = [n.status for n in trees_in_order(one)]
        names = {
            INVALID: Status.INVALID,
            RUNNING: Status.RUNNING,
            SUCCESS: Status.SUCCESS,
            FAILURE: Status.FAILURE,
        }
        assert [names[code] for code in tree.status[0].tolist()] == wanted


def trees_in_order(root):
    return [root, *(below for child in root.children for below in trees_in_order(child))]


def test_an_invalid_answer_of_a_users_own_leaf_is_what_it_is_in_py_trees():
    class Odd(Unknown):
        def update(self):
            self.count += 1
            return [Status.SUCCESS, Status.INVALID, Status.RUNNING, Status.FAILURE][self.count % 4]

    def build():
        return trees.fallback(
            "root",
            trees.sequence("s", Scripted("S"), trees.parallel("p", Odd(), Scripted("RS"), success=1)),
            trees.retry(2, trees.sequence("t", Scripted("S"), Odd())),
        )

    tree, _ = batch(build(), worlds=1, build=build)
    one = build()
    for _ in range(20):
        one.tick_once()
        tree.tick(rows(0), 0.0)
        assert [CODES[n.status] for n in trees_in_order(one)] == tree.status[0].tolist()


CODES = {Status.INVALID: INVALID, Status.RUNNING: RUNNING, Status.SUCCESS: SUCCESS, Status.FAILURE: FAILURE}


def test_what_cannot_be_compiled_is_said():
    with pytest.raises(InputError, match="build="):
        batch(trees.sequence("root", Unknown()), worlds=2)
    with pytest.raises(InputError, match="another tree"):
        batch(trees.sequence("root", Unknown()), build=Unknown)
    same = trees.sequence("root", Unknown())
    with pytest.raises(InputError, match="same tree"):
        batch(same, build=lambda: same)
    with pytest.raises(InputError, match="no children"):
        batch(trees.sequence("root"))
    with pytest.raises(InputError, match="one world"):
        batch(Scripted("R"), worlds=0)


def test_as_deep_as_a_tree_may_be():
    root = Scripted("RS")
    for _ in range(198):
        root = trees.invert(root)
    tree, _ = batch(trees.sequence("root", root))
    assert tree.tick(rows(0, 1), 0.0).tolist() == [RUNNING] * 2
    assert tree.tick(rows(0, 1), 0.0).tolist() == [SUCCESS] * 2


def test_a_tree_of_many_leaves_compiles_in_time_that_grows_with_it():
    def seconds(leaves):
        tree = trees.sequence(
            "root", *(trees.fallback("f", *(Scripted("S") for _ in range(10))) for _ in range(leaves // 10))
        )
        gc.collect()
        gc.disable()  # it looks at all that other tests have left
        started = time.process_time()
        batch(tree, worlds=1)
        taken = time.process_time() - started
        gc.enable()
        return taken

    seconds(100)
    assert min(seconds(4000) for _ in range(3)) < 30 * min(seconds(400) for _ in range(3))
