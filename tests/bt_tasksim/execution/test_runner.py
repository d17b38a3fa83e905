"""The tick loop: an episode from reset to judgement, errors that end everything, independent trees."""

import dataclasses
import math

import numpy as np
import py_trees
import pytest
from defusedxml import ElementTree
from py_trees.behaviour import Behaviour
from py_trees.behaviours import Failure, Running
from py_trees.common import Status
from py_trees.decorators import Inverter

from bt_tasksim.concept.context import one_world
from bt_tasksim.concept.reporting import speaker
from bt_tasksim.concept_nodes import Pick, Wait
from bt_tasksim.core.errors import InputError, LeafError, UnreachableError
from bt_tasksim.core.outcomes import TEXT
from bt_tasksim.core.plugins import load_plugin
from bt_tasksim.core.world import Command
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import NOT_JUDGED, Runner
from bt_tasksim.scene.success import NO_GOAL, Verdict
from bt_tasksim.trees import fallback, parallel, retry, sequence, timeout
from bt_tasksim.trees.load import load_source

pytestmark = pytest.mark.physical


def runner_of(scenario="pick_and_place", **options):
    source = load_source(scenario)
    return Runner(source.build(), source.scene, EngineOptions(**options))


def finished(stage, **settings):
    for key, value in settings.items():
        setattr(stage.runner, key, value)
    return stage.runner.finish(stage.runner.scene.sample(0), stage.world.model)


# ---- one episode ------------------------------------------------------------------------------------------


def test_steps_and_times_of_an_episode(toy, act):
    result = finished(toy(sequence("root", act("a", ticks=4), act("b", ticks=3))))
    assert result.status == Status.SUCCESS and result.success and result.reason == ""
    assert result.control_steps == 7 and result.sim_time == pytest.approx(0.35)
    assert result.verdict is None, "a world without hidden state is not judged"


def test_a_failure_names_its_leaf_and_reason(toy, act):
    result = finished(toy(sequence("root", act("a", ticks=1), act("b", ticks=99, timeout=0.2))))
    assert result.status == Status.FAILURE and not result.success
    assert (result.reason, result.leaf) == ("timed_out", "b")
    assert result.outcome.numbers == {"limit": 0.2} and result.why == f"b: {result.outcome.sentence}"


@pytest.mark.parametrize("where", ["fallback", "retry", "parallel", "timeout"])
def test_the_named_leaf_is_the_one_that_decided_last(toy, act, where):
    first, last = act("first", ticks=99, timeout=0.1), act("last", ticks=99, timeout=0.2)
    tree = {
        "fallback": lambda: fallback("root", first, last),
        "retry": lambda: sequence("root", fallback("try", first, act("rescue")), retry(2, last)),
        "parallel": lambda: sequence("root", parallel("both", act("x", "hand", ticks=99), last)),
        "timeout": lambda: sequence(
            "root", fallback("try", first, act("rescue")), timeout(0.15, last, name="last")
        ),
    }[where]()
    result = finished(toy(tree))
    assert result.status == Status.FAILURE
    assert (result.reason, result.leaf) == ("timed_out", "last")


def test_an_inverted_condition_still_has_a_reason(toy):
    tree = sequence("root", Inverter("not", Failure("never")), Failure("always"))
    stage = toy(tree)
    stage.runner.tick()
    assert speaker(tree).name == "always"


def test_an_episode_has_an_end(toy):
    result = finished(toy(Running("for ever")), longest=1.0)
    assert result.reason == "time_over" and result.leaf == "" and result.outcome.numbers == {"limit": 1.0}
    assert result.control_steps == 20 and result.status == Status.INVALID


def unreachable(stage):
    """A stage whose arm reaches nothing, and holds when nothing is asked of it."""
    step = stage.world.step

    def far(command):
        if command.tool is not None:
            raise UnreachableError("the nearest pose misses by 120.0 mm", 0.12, 0.0)
        return step(command)

    stage.world.step = far
    return stage


def test_out_of_reach_fails_the_leaf_with_the_distance(toy, act):
    stage = unreachable(toy(act("move", ticks=10)))
    result = finished(stage)
    assert (result.reason, result.leaf) == ("out_of_reach", "move")
    assert result.outcome.numbers == {"distance": 0.12, "angle": 0.0}
    assert not result.success and result.status == Status.FAILURE


def test_a_fallback_takes_over_when_a_leaf_is_out_of_reach(toy, act):
    stage = unreachable(toy(fallback("either", act("move", ticks=10), Wait(0.2))))
    result = finished(stage)
    assert result.status == Status.SUCCESS


def test_a_result_shows_itself_in_a_line_and_in_a_table(toy, act):
    good, bad = finished(toy(act("a", ticks=2))), finished(toy(act("<b>", ticks=99, timeout=0.2)))
    assert len(repr(good)) < 100 > len(repr(bad)) and "timed_out" in repr(bad)
    assert str(bad).startswith(f"FAILURE: {bad.why} (") and str(bad).count("<b>") == 1
    assert str(good).startswith("SUCCESS: ") and good.outcome.is_a(NOT_JUDGED)
    assert "&lt;b&gt;" in bad._repr_html_() and "<b>" not in bad._repr_html_()


def test_a_table_holds_what_became_of_the_episode(toy, act):
    rows = table(finished(unreachable(toy(act("move", ticks=10)))))
    assert (rows["reason"], rows["leaf"], rows["status"].split()[0]) == ("out_of_reach", "move", "FAILURE")
    assert "distance 120 mm" in rows["measured"]
    assert {"why", "seed", "time", "policies"} <= rows.keys()
    good = table(finished(toy(act("a", ticks=2))))
    assert good["status"] == "SUCCESS" and not {"reason", "leaf"} & good.keys()


def test_the_table_says_that_nothing_was_judged(toy, act):
    good = finished(toy(act("a", ticks=2)))
    assert "judged" not in table(good)
    for reason, said in ((NO_GOAL, True), (NOT_JUDGED, False)):
        verdict = Verdict(True, reason(), math.nan, math.nan, 0.0)
        assert ("judged" in table(dataclasses.replace(good, verdict=verdict))) is said


def table(shown):
    """Text by head, of a table that parses as XML too and sets no colour."""
    html = shown._repr_html_()
    assert "color" not in html and "background" not in html
    return {row[0].text: row[1].text for row in ElementTree.fromstring(html).iter("tr")}


def test_a_leaf_that_was_not_set_up_says_how_to():
    with pytest.raises(RuntimeError, match=r"'wait 1.0' was ticked .* Runner, or call tree.setup\("):
        Wait(1.0).tick_once()


def test_records_hold_every_tick(toy, act):
    stage, steps = toy(act("move", ticks=3)), []
    stage.runner.finish(stage.runner.scene.sample(0), stage.world.model, record=steps.append)
    assert [float(s.observation.time) for s in steps] == pytest.approx([0, 0.05, 0.1, 0.15])
    assert [s.tree_status for s in steps] == [Status.RUNNING] * 3 + [Status.SUCCESS]
    assert steps[0].command.tool is not None and steps[3].command == Command()


def test_a_tree_that_makes_no_sense_is_refused_before_anything_starts(toy):
    with pytest.raises(InputError, match="sequence 'root' has no children"):
        toy(py_trees.composites.Sequence("root", memory=True))


# ---- a leaf that raises -----------------------------------------------------------------------------------


class Raising(Behaviour):
    """Raises in the method and at the tick that it is told."""

    def __init__(self, name, where="update", at=1, error=None):
        super().__init__(name)
        self.where, self.at, self.error = where, at, error or ZeroDivisionError("oh")
        self.ticks, self.ended = 0, []

    def _raise(self, where):
        if where == self.where and self.ticks >= self.at:
            raise self.error

    def initialise(self):
        self._raise("initialise")

    def update(self):
        self.ticks += 1
        self._raise("update")
        return Status.RUNNING

    def terminate(self, new_status):
        self.ended.append(new_status)


def deep(bad, other):
    both = parallel("both", other, Inverter("not", bad))
    return retry(3, fallback("or", timeout(9.0, sequence("and", both))))


NESTS = {
    "alone": lambda bad, other: sequence("root", bad),
    "in a parallel": lambda bad, other: sequence("root", parallel("both", other, bad)),
    "deep": deep,
}


@pytest.mark.parametrize("nest", NESTS)
@pytest.mark.parametrize("at", [1, 3])
def test_every_node_ends_the_command_is_dropped_and_the_leaf_is_named(toy, act, nest, at):
    bad, other = Raising("culprit", at=at), act("other", "tool hand", ticks=99)
    tree = NESTS[nest](bad, other)
    stage = toy(tree)
    with pytest.raises(LeafError, match=r"leaf 'culprit' raised ZeroDivisionError in .*: oh") as error:
        stage.tick(10)
    assert isinstance(error.value.__cause__, ZeroDivisionError)
    assert bad.ended == [Status.INVALID], "terminate() is called on the leaf that raised, once"
    assert nest == "alone" or other.ended == [Status.INVALID]
    assert [n.name for n in tree.iterate() if n.status == Status.RUNNING] == []
    assert stage.context.command == Command() and len(stage.world.steps) == at - 1
    bad.at = 99
    stage.runner.begin(0)
    assert stage.tick(2) == Status.RUNNING, "the tree can be used again"


def test_raising_while_it_becomes_active(toy):
    bad = Raising("culprit", where="initialise", at=0)
    with pytest.raises(LeafError, match="leaf 'culprit' raised ZeroDivisionError"):
        toy(sequence("root", bad)).tick()
    assert bad.ended == [Status.INVALID]


@pytest.mark.parametrize(
    "method", ["begin", "command", "done", "violated", "advance", "explain", "initial_state"]
)
def test_every_function_of_a_concept_is_covered(toy, act, method):
    def broken(self, *arguments):
        raise KeyError("handle")

    leaf = type("Broken", (act,), {method: broken})("culprit", ticks=2)
    with pytest.raises(LeafError, match=r"leaf 'culprit' raised KeyError in test_runner.py:\d+: 'handle'"):
        toy(sequence("root", leaf)).tick(5)
    assert leaf.ended[-1] == Status.INVALID and leaf.status != Status.RUNNING


def test_an_exception_in_a_users_own_file_is_found_by_file_and_line(toy, tmp_path):
    (tmp_path / "my_concepts.py").write_text(
        "from py_trees.behaviour import Behaviour\n"
        "import json\n\n"
        "class Mine(Behaviour):\n"
        "    def update(self):\n"
        "        return json.loads('{')\n"
    )
    stage = toy(sequence("root", load_plugin(str(tmp_path / "my_concepts.py")).Mine("mine")))
    with pytest.raises(LeafError, match=r"leaf 'mine' raised JSONDecodeError in my_concepts.py:6: "):
        stage.tick()


@pytest.mark.parametrize("error", [KeyboardInterrupt(), InputError("a sentence")])
def test_interrupts_and_own_errors_pass_through_and_end_every_node(toy, act, error):
    bad, other = Raising("culprit", error=error), act("other", ticks=99)
    tree = parallel("both", other, bad)
    with pytest.raises(type(error)):
        toy(tree).tick()
    assert all(n.status != Status.RUNNING for n in tree.iterate()) and bad.ended == [Status.INVALID]


# ---- nothing is shared ------------------------------------------------------------------------------------


def states(runner, seed):
    """An episode as a generator: the state of every tick."""
    runner.begin(seed)
    while True:
        runner.tick()
        yield runner.pipeline.state
        if runner.tree.status != Status.RUNNING:
            return
        runner.context.advance(one_world(runner.pipeline.step(runner.context.command)))


def same(a, b):
    return all(np.array_equal(getattr(a, f), getattr(b, f)) for f in a.__slots__)


def test_two_trees_tick_by_tick_in_one_process_are_as_if_alone():
    alone = [list(states(runner_of(s), seed)) for s, seed in (("pick_and_place", 4), ("pick_and_throw", 5))]
    running = [states(runner_of(s), seed) for s, seed in (("pick_and_place", 4), ("pick_and_throw", 5))]
    together = [[], []]
    while running[0] or running[1]:
        for i, episode in enumerate(running):
            state = next(episode, None) if episode else None
            if state is None:
                running[i] = None
            else:
                together[i].append(state)
    for a, b in zip(alone, together, strict=True):
        assert len(a) == len(b) > 80
        assert all(same(x, y) for x, y in zip(a, b, strict=True))
    assert py_trees.blackboard.Blackboard.storage == {} and py_trees.blackboard.Blackboard.clients == {}


def test_the_tick_loop_resets_what_an_earlier_episode_left(toy, act):
    leaf = act("move", ticks=5)
    stage = toy(sequence("root", leaf))
    stage.tick(2)
    stage.runner.begin(0)
    assert leaf.status == Status.INVALID and stage.tree.status == Status.INVALID
    assert stage.context.now == 0.0 and stage.context.command == Command()
    result = finished(stage)
    assert result.control_steps == 5


def test_what_was_never_seen_is_said(toy):
    stage = toy(Pick("cup"))
    stage.world.unseen = lambda: {"cup": "camera 'scene' shows 3 pixels of it"}
    result = finished(stage)
    assert result.status == Status.FAILURE
    assert result.reason == "not_held"
    assert result.outcome.cause.detail == TEXT(text="camera 'scene' shows 3 pixels of it")
