"""Episodes in batches: what becomes of a seed is, to the last bit, what a runner of one world makes of it."""

import dataclasses
import os
import signal
from functools import cache

import numpy as np
import pytest
from py_trees.behaviour import Behaviour
from py_trees.behaviours import Success
from py_trees.common import Status
from py_trees.decorators import Decorator

from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import ObjectName
from bt_tasksim.concept_nodes import Bring, Grasp, Pick, Wait
from bt_tasksim.core.errors import BtTasksimError, InputError, LeafError
from bt_tasksim.core.outcomes import register_reason
from bt_tasksim.core.world import Command
from bt_tasksim.execution.batch_runner import BatchRunner
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import Runner
from bt_tasksim.execution.worlds import most_worlds, why_alone
from bt_tasksim.trees import force_failure, parallel, retry, sequence, timeout
from bt_tasksim.trees.load import load_source
from tests.unlike_worlds import holding, mixed

SCENARIO = "pick_and_place_recovering"  # retries, disturbances, and several ways for it to end


def facts(found):
    if isinstance(found, BtTasksimError):
        return type(found), str(found)
    verdict = found.verdict
    errors = (verdict.position_error, verdict.angle_error, verdict.penetration)
    ends = (found.status, found.success, found.leaf, found.why, found.control_steps, found.sim_time)
    return (*ends, *(None if np.isnan(error) else error for error in errors))


def in_batch(build, scene, seeds, worlds, threads=1, **options):
    with BatchRunner(build, scene, EngineOptions(**options), worlds, threads) as runner:
        return {seed: facts(found) for seed, found in runner.run(seeds)}


def one_by_one(build, scene, seeds, **options):
    runner = Runner(build(), scene, EngineOptions(**options))
    out = {}
    for seed in seeds:
        try:
            out[seed] = facts(runner.run(seed))
        except BtTasksimError as error:
            out[seed] = facts(error)
    return out


@cache
def expected(scenario, seeds, engines="sapien"):
    source = load_source(scenario)
    return one_by_one(source.build, source.scene, seeds, engines=engines)


@pytest.mark.parametrize(("worlds", "threads"), [(1, 1), (2, 2), (7, 2)])
def test_a_seed_comes_to_the_same_in_any_batch(worlds, threads):
    source, seeds = load_source(SCENARIO), (0, 1, 2, 3, 4)
    assert in_batch(source.build, source.scene, seeds, worlds, threads) == expected(SCENARIO, seeds)


def test_the_order_of_seeds_does_not_matter():
    source = load_source(SCENARIO)
    assert in_batch(source.build, source.scene, (4, 2, 0), 2) == {
        seed: expected(SCENARIO, (0, 1, 2, 3, 4))[seed] for seed in (4, 2, 0)
    }


def test_a_seed_comes_to_the_same_in_mujoco():
    source, seeds = load_source("pick_and_place"), (0, 1)
    alone = expected("pick_and_place", seeds, "mujoco")
    assert in_batch(source.build, source.scene, seeds, 2, 2, engines="mujoco") == alone


@pytest.mark.physical
def test_failures_are_told_as_one_world_tells_them():
    scene = load_source("pick_and_place").scene

    def build():
        far = Bring("target", position=(0.3, 5.0, 0.4))
        late = timeout(0.5, Wait(3.0))
        return retry(2, sequence("root", Grasp("target"), Pick("target"), late, far))

    alone = one_by_one(build, scene, (0, 1))
    assert {found[0] for found in alone.values()} == {Status.FAILURE}
    assert in_batch(build, scene, (0, 1), 2) == alone


@pytest.mark.physical
def test_what_is_out_of_reach_fails_its_leaf():
    scene = load_source("pick_and_place").scene

    def build():
        return sequence("root", Grasp("target"), Pick("target"), Bring("target", position=(0.3, 5.0, 0.4)))

    alone = one_by_one(build, scene, (0, 1))
    assert {found[2] for found in alone.values()} == {"bring target"}
    assert in_batch(build, scene, (0, 1), 2) == alone


def test_an_episode_that_takes_too_long_is_stopped():
    source = load_source("pick_and_place")
    runner = BatchRunner(source.build, source.scene, worlds=2, longest=0.5)
    stopped = dict(runner.run((0, 1, 2)))
    assert {found.reason for found in stopped.values()} == {"time_over"}
    assert {found.control_steps for found in stopped.values()} == {10}


class Raises(ConceptModel):
    """Raises where the object stands to the left."""

    target: ObjectName

    def command(self, action, seen, memory):
        if bool((seen.object(self.target)[:, 1] > -0.14).any()):
            raise ValueError("to the left")
        return Command()

    def done(self, seen, memory):
        return seen.elapsed > 0.2


@pytest.mark.physical
def test_a_leaf_that_raises_in_one_world_leaves_the_others_alone():
    scene, seeds = load_source("pick_and_place").scene, tuple(range(6))
    alone = one_by_one(lambda: sequence("root", Raises("target")), scene, seeds)
    raised = [found for found in alone.values() if found[0] is LeafError]
    assert 0 < len(raised) < len(seeds), "the cup stands on both sides"
    assert in_batch(lambda: sequence("root", Raises("target")), scene, seeds, 3) == alone


class Breaks(ConceptModel):
    """Breaks what a concept has to keep to, in one of its functions."""

    how = ""
    """In which, and how."""

    def _given(self, name, right):
        function, _, what = self.how.partition(" ")
        if name != function:
            return right
        if what.startswith("raise"):
            raise {"raise exit": SystemExit(3), "raise close": GeneratorExit()}[what]
        n = right.shape[0] if hasattr(right, "shape") else 1
        return {
            "none": None, "text": np.array(["much"] * n), "complex": np.ones(n, complex), "plain": True,
            "wide": np.zeros((n, 50), bool), "words": "yes", "objects": np.array([None] * n),
        }[what]  # fmt: skip

    def initial_state(self, seen):
        return HALT.where(self._given("initial_state", seen.elapsed < 0.0))

    def begin(self, seen):
        return self._given("begin", seen.elapsed)

    def advance(self, action, seen, memory):
        if self.how == "advance shape":
            return np.zeros((len(seen.elapsed), int(seen.elapsed[0] > 0.2) + 1))
        return self._given("advance", memory)

    def command(self, action, seen, memory):
        if self.how.startswith("hand"):
            hand = {"text": np.array([["a"]] * len(action)), "wide": np.zeros((len(action), 50))}
            return Command(hand=(hand | {"complex": np.ones((len(action), 1), complex)})[self.how[5:]])
        return self._given("command", Command())

    def violated(self, seen, memory):
        return self._given("violated", seen.elapsed > 99.0)

    def programmed_motion(self, seen, memory):
        return self._given("programmed_motion", np.zeros((len(seen.elapsed), 0)))

    def done(self, seen, memory):
        return self._given("done", seen.elapsed > 0.2)

    def explain(self, seen, memory):
        return self._given("explain", "well")


def broken(how):
    return type("Broken", (Breaks,), {"how": how, "__doc__": "Breaks something."})(name="broken")


HALT = register_reason("halt_in_a_test", "it cannot")


@pytest.mark.parametrize(
    "how",
    [
        "done none", "done text", "done complex", "done plain", "done wide", "done words", "done objects",
        "done raise exit", "done raise close", "begin raise exit", "initial_state plain",
        "initial_state wide", "violated none", "violated plain", "violated complex", "programmed_motion none",
        "programmed_motion plain", "programmed_motion text", "programmed_motion wide", "command none",
        "command words", "explain plain", "hand text", "hand wide", "hand complex",
    ],
)  # fmt: skip
def test_what_a_function_should_not_give_is_told_with_its_line_at_any_batch(how):
    scene, seeds = load_source("pick_and_place").scene, (0, 1, 2)

    def build():
        return sequence("root", Wait(0.1), broken(how))

    alone = one_by_one(build, scene, seeds)
    function = "command" if how.startswith("hand") else how.split()[0]
    for kind, sentence in alone.values():
        assert kind is LeafError and "leaf 'broken'" in sentence and "\n" not in sentence
        assert "test_batch_runner.py:" in sentence
        assert "raise" in how or function in sentence
    assert in_batch(build, scene, seeds, 2) == alone


@pytest.mark.parametrize("how", ["advance shape", "begin plain", "advance plain", "advance wide"])
def test_a_memory_that_is_not_kept_alike_is_told_with_its_leaf_at_any_batch(how):
    scene = load_source("pick_and_place").scene

    def build():
        return sequence("root", broken(how))

    said = []
    for worlds in (1, 3):
        runner = BatchRunner(build, scene, worlds=worlds)
        with pytest.raises(InputError) as error:
            list(runner.run((0, 1, 2)))
        runner.close()
        said.append(str(error.value))
    with pytest.raises(InputError) as error:
        Runner(build(), scene).run(0)
    assert said[0] == str(error.value) and said[1].partition(" for ")[0] == said[0].partition(" for ")[0]
    assert said[0].startswith(f"leaf 'broken': Broken.{how.split()[0]} (test_batch_runner.py:")


class Exits(Behaviour):
    """Ends Python, or goes back as far as Python's own; what a signal's handler asks for is no such thing."""

    def __init__(self, error, early=False):
        super().__init__("exits")
        self.error, self.early = error, early

    def setup(self, **kwargs):
        if self.early:
            raise self.error

    def update(self):
        raise self.error


@pytest.mark.parametrize("error", [SystemExit(3), SystemExit(), GeneratorExit()])
def test_a_leaf_that_would_end_python_is_a_leaf_that_raised(error):
    scene, seeds = load_source("pick_and_place").scene, (0, 1, 2)

    def build():
        return sequence("root", Exits(error))

    alone = one_by_one(build, scene, seeds)
    assert all(kind is LeafError and "leaf 'exits' raised" in said for kind, said in alone.values())
    assert in_batch(build, scene, seeds, 2) == alone
    for runner in (Runner, BatchRunner):
        with pytest.raises(InputError, match=r"'exits' cannot be set up: (System|Gen)\w+ in test_batch"):
            runner(lambda: sequence("root", Exits(error, early=True)), scene)


class RaisesAtTheEnd(Behaviour):
    """Raises as it is ended, in every other activation or whenever it is interrupted."""

    def __init__(self, interrupted):
        super().__init__("raises")
        self.interrupted, self.ended = interrupted, 0

    def update(self):
        return Status.RUNNING if self.interrupted else Status.SUCCESS

    def terminate(self, new_status):
        if self.status == Status.RUNNING or not self.interrupted:
            self.ended += 1
            if self.interrupted or self.ended % 2:
                raise ValueError("no end")


@pytest.mark.parametrize("how", ["update", "timeout", "below"])
def test_a_leaf_that_raises_as_it_is_ended_ends_its_episode_alone(how):
    scene, seeds = load_source("pick_and_place").scene, (0, 1, 2)

    def build():
        raises = RaisesAtTheEnd(interrupted=how != "update")
        under = timeout(0.2, raises) if how != "below" else parallel("both", force_failure(Wait(0.2)), raises)
        return sequence("root", Wait(0.1), under)

    alone = one_by_one(build, scene, seeds)
    assert all(kind is LeafError and "leaf 'raises' raised" in said for kind, said in alone.values())
    assert in_batch(build, scene, seeds, 2) == alone


def test_a_leaf_that_raises_as_its_episode_is_cleared_away_changes_nothing():
    scene = load_source("pick_and_place").scene

    def build():
        return sequence("root", RaisesAtTheEnd(interrupted=True))

    with BatchRunner(build, scene, worlds=2, longest=0.2) as batch:
        found = dict(batch.run((0, 1, 2)))
    assert [found[seed].reason for seed in (0, 1, 2)] == 3 * ["time_over"]
    with Runner(build, scene, longest=0.2) as runner:
        assert [runner.run(seed).reason for seed in (0, 1)] == 2 * ["time_over"]


def test_a_feedback_message_may_be_anything():
    class Says(Behaviour):
        def update(self):
            self.feedback_message = ("nothing", 3)
            return Status.FAILURE

    scene = load_source("pick_and_place").scene
    alone = one_by_one(lambda: sequence("root", Says("says")), scene, (0,))
    assert "('nothing', 3)" in str(alone[0])
    assert in_batch(lambda: sequence("root", Says("says")), scene, (0,), 1) == alone


def test_an_interrupt_stays_one_and_so_does_the_exit_of_a_signals_handler():
    scene = load_source("pick_and_place").scene

    class Stops(Behaviour):
        def update(self):
            os.kill(os.getpid(), signal.SIGUSR1)
            return Status.RUNNING

    def leave(*_):
        raise SystemExit(5)

    before = signal.signal(signal.SIGUSR1, leave)
    try:
        for end, leaf in ((KeyboardInterrupt, Exits(KeyboardInterrupt())), (SystemExit, Stops("stops"))):
            with pytest.raises(end):
                Runner(sequence("root", leaf), scene).run(0)
    finally:
        signal.signal(signal.SIGUSR1, before)


class Counted(Decorator):
    """A decorator of somebody's own: the leaf below is ticked by py_trees, world by world."""

    def update(self):
        return self.decorated.status


class Counts(Behaviour):
    """A behaviour of somebody's own: done in its third tick."""

    def initialise(self):
        self.ticks = 0

    def update(self):
        self.ticks += 1
        return Status.RUNNING if self.ticks < 3 else Status.SUCCESS


def test_behaviours_of_ones_own_are_ticked_world_by_world(caplog):
    scene = load_source("pick_and_place").scene

    def build():
        return sequence("root", Counts("counts"), Success("yes"), Wait(0.1), Counts("again"))

    alone = one_by_one(build, scene, (0, 1, 2))
    assert in_batch(build, scene, (0, 1, 2), 2) == alone
    assert sum("Counts" in record.message for record in caplog.records) == 1, "it is said once"


def test_no_seeds_are_no_episodes():
    source = load_source("pick_and_place")
    assert in_batch(source.build, source.scene, (), 2) == {}


def test_seeds_that_are_given_up_leave_the_runner_usable():
    source = load_source("pick_and_place")
    runner = BatchRunner(source.build, source.scene, worlds=2)
    next(iter(runner.run((0, 1, 2))))
    assert [seed for seed, _ in runner.run((5,))] == [5]
    runner.close()


@pytest.mark.parametrize(
    ("options", "why"),
    [
        ({"safety": True}, "of one world"),
        ({"real_time": True}, "of one world"),
        ({"engines": "ros:127.0.0.1:9"}, "of one world"),
        ({"perception": "camera"}, "pictures"),
        ({"rendering": True}, "film"),
    ],
)
def test_engines_of_one_world_are_refused(options, why):
    source, chosen = load_source("pick_and_place"), EngineOptions(**options)
    assert why in why_alone(chosen)
    with pytest.raises(InputError, match=why):
        BatchRunner(source.build, source.scene, chosen, 2)


def test_nonsense_is_refused():
    source = load_source("pick_and_place")
    for counts in ({"worlds": 0}, {"threads": 0}, {"worlds": most_worlds() * 2}):
        with pytest.raises(InputError, match=r"one world|does not fit"):
            BatchRunner(source.build, source.scene, **counts)


def test_a_tree_instead_of_what_makes_it_and_a_number_instead_of_seeds_are_refused():
    source = load_source("pick_and_place")
    with pytest.raises(InputError, match=r"what makes one, .* not the tree 'pick and place'"):
        BatchRunner(source.build(), source.scene)
    with BatchRunner(source.build, source.scene, worlds=2) as runner:
        with pytest.raises(InputError, match=r"seeds, such as range\(20\)"):
            runner.run(2)
        for wrong in ("12", [0.5], [-1]):
            with pytest.raises(InputError, match="seed"):
                next(iter(runner.run(wrong)))


def test_unlike_objects_share_a_batch():
    source, seeds = load_source("grasp_then_pick"), (0, 1, 2)
    scene = dataclasses.replace(source.scene, stages=())
    alone = one_by_one(source.build, scene, seeds)
    assert in_batch(source.build, scene, seeds, 3) == alone


@pytest.mark.physical
@pytest.mark.parametrize(
    ("scenes", "worlds"),
    [
        ((holding("target"), holding("box", "target"), holding("tall", "box", "target")), 2),
        ((holding("tall", "target", fixtures=("stand",)), holding("target"), holding("box", "target")), 3),
    ],
)
def test_unlike_objects_orders_and_numbers_share_a_batch(scenes, worlds):
    source, seeds, scene = load_source("pick_and_place"), (0, 1, 2, 3), mixed(*scenes)
    alone = {seed: one_by_one(source.build, scene, (seed,))[seed] for seed in seeds}
    assert any(found[1] for found in alone.values()), "some succeed"
    assert in_batch(source.build, scene, seeds, worlds) == alone


def test_behaviours_of_ones_own_see_their_worlds_objects():
    scene, seeds = mixed(holding("target", "box"), holding("box", "target"), holding("target")), range(4)

    def build():
        return sequence("root", Counted("own", Grasp("target")), Pick("target"))

    alone = {seed: one_by_one(build, scene, (seed,))[seed] for seed in seeds}
    assert in_batch(build, scene, seeds, 3) == alone


class Looks(Behaviour):
    """A behaviour of somebody's own that looks at what only a simulator knows, and at goals."""

    def setup(self, **kwargs):
        self.context = kwargs["context"]

    def update(self):
        hidden = self.context.hidden()
        held = self.context.reached("holding", "target", np.array([0]))
        self.feedback_message = f"holding: {held}, {hidden.objects.tolist()}, {self.context.command}"
        return Status.FAILURE


@pytest.mark.physical
def test_behaviours_of_ones_own_know_what_other_leaves_have_reached():
    scene, seeds = load_source("pick_and_place").scene, (0, 1, 2)

    def build():
        pick = Counted("own", Pick("target"))
        return sequence("root", Counted("own", Grasp("target")), pick, Wait(0.1), Looks("looks"))

    alone = {seed: one_by_one(build, scene, (seed,))[seed] for seed in seeds}
    assert all("holding: [ True]" in found[3] for found in alone.values())
    assert in_batch(build, scene, seeds, 2) == alone


class Drops(Behaviour):
    """Opens the hand, and is never done."""

    def setup(self, **kwargs):
        self.context = kwargs["context"]

    def update(self):
        self.context.write(Command(hand=np.array([[0.0]])), np.array([0]), self)
        return Status.RUNNING if self.context.now < 3.5 else Status.SUCCESS


@pytest.mark.physical
def test_a_goal_that_is_lost_is_said_alike_at_any_batch():
    scene, seeds = load_source("pick_and_place").scene, (0, 1)

    def build():
        both = parallel("both", Bring("target", position=(0.5, 0.0, 0.5)), Counted("own", Drops("drops")))
        return sequence("root", Counted("own", Grasp("target")), Pick("target"), both)

    alone = {seed: one_by_one(build, scene, (seed,))[seed] for seed in seeds}
    assert {found[0] for found in alone.values()} == {Status.FAILURE}
    assert in_batch(build, scene, seeds, 2) == alone
