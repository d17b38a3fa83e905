"""The life of a leaf: it acts, it completes, it fails with a reason, it is interrupted."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from bt_tasksim.concept.activation import LOST_TICKS
from bt_tasksim.concept.condition import Condition, ConditionNode
from bt_tasksim.concept.leaf import ONE, ConceptNode
from bt_tasksim.concept.limit import Limit
from bt_tasksim.concept.model import ConceptModel
from bt_tasksim.concept.parameters import Metres, ObjectName
from bt_tasksim.concept_nodes import Bring, Grasp, TimePassed, catalogue
from bt_tasksim.core.errors import InputError, LeafError
from bt_tasksim.core.outcomes import (
    CANNOT_START,
    DONE,
    GOAL_LOST,
    INTERRUPTED,
    LIMIT_VIOLATED,
    TIMED_OUT,
    Form,
    register_reason,
)
from bt_tasksim.core.units import METRES, SECONDS
from bt_tasksim.core.world import Command
from bt_tasksim.policy.policy import Action
from bt_tasksim.trees import force_success, reactive_fallback, repeat, retry, sequence


def test_success_writes_nothing_and_the_next_sibling_acts_in_the_same_tick(toy, act):
    first, second = act("first", ticks=2, height=0.5), act("second", height=0.3)
    stage = toy(sequence("root", first, second))
    stage.tick(2)
    assert first.status == Status.RUNNING and second.status == Status.INVALID
    stage.runner.tick()
    assert first.status == Status.SUCCESS and second.status == Status.RUNNING
    assert stage.context.command.tool[2] == 0.3
    assert first.outcome == DONE(elapsed=0.1)


def test_the_last_success_leaves_no_command(toy, act):
    stage = toy(act("only", ticks=1))
    stage.tick(1)
    stage.runner.tick()
    assert stage.tree.status == Status.SUCCESS and stage.context.command == Command()


def test_time_out_counts_episode_time(toy, act):
    leaf = act("slow", ticks=10**6, timeout=0.32)
    stage = toy(leaf)
    assert stage.tick(1000) == Status.FAILURE
    assert stage.context.now == pytest.approx(0.35)
    assert leaf.outcome == TIMED_OUT(limit=0.32)
    stage.runner.begin(0)
    assert stage.tick(6) == Status.RUNNING, "a second episode begins to count anew"


def test_each_activation_counts_from_its_own_begin(toy, act):
    leaf = act("again", ticks=4, timeout=0.3)
    stage = toy(repeat(3, leaf))
    assert stage.tick(100) == Status.SUCCESS
    assert leaf.activations == 3 and stage.context.now > 0.5


class BitByBit:
    """Each decision brings the task a third nearer to done."""

    name, source = "bit by bit", ""

    def act(self, model, seen, memory):
        return Action(model.programmed_motion(seen, memory), np.full(len(seen.tool), 1.0 / 3.0 + 1e-12))


def test_shares_of_done_add_up_within_an_activation_and_no_further(toy, act):
    leaf = act("nearer", ticks=1000)
    stage = toy(repeat(2, leaf))
    leaf.use(BitByBit())
    stage.tick(2)
    assert leaf.activations == 1 and leaf.status == Status.RUNNING
    stage.tick(2)
    assert leaf.activations == 2 and leaf.status == Status.RUNNING, "done at the third, and begun anew"
    assert stage.tick(2) == Status.SUCCESS


TOO_LOW = register_reason("test_too_low", "{what} lower than {value}: {limit}", value=METRES, limit=METRES)
TOO_HIGH = register_reason("test_too_high", "the tool is {value} high", value=METRES)
GONE = Form("{time:.2f} gone", {"time": SECONDS})
TOO_LATE = register_reason("test_too_late", "{value} are more than {limit}", value=SECONDS, limit=SECONDS)


class Careful(ConceptModel):
    """Maintains that something is held, and has a limit and a precondition."""

    target: ObjectName
    limit: Metres = 1.0
    maintains = ("holding",)
    held = True

    def initial_state(self, seen):
        height = seen.tool[:, 2]
        return TOO_HIGH.where(height >= 0.6, value=height)

    def command(self, action, seen, memory):
        return Command(tool=seen.tool)

    def done(self, seen, memory):
        return np.zeros(len(seen.tool), bool)

    def violated(self, seen, memory):
        return seen.elapsed > self.limit

    def maintained(self, goal, seen, memory):
        return np.full(len(seen.tool), type(self).held)

    def explain(self, seen, memory):
        return GONE(time=seen.elapsed)


@pytest.fixture
def careful(monkeypatch):
    monkeypatch.setattr(Careful, "held", True)
    return Careful("cup")


asked: list[str] = []


class Both(Careful):
    def carry_out(self, action, seen, memory):
        asked.append("both")
        return Careful.command(self, action, seen, memory), memory


def test_an_unmet_precondition_is_a_failure_without_a_command(toy, careful):
    stage = toy(careful)
    stage.world.put(tool_pose=stage.world.now.tool_pose + np.array([0, 0, 0.3, 0, 0, 0, 0]))
    stage.look()
    assert stage.tick() == Status.FAILURE
    assert careful.outcome == CANNOT_START(TOO_HIGH(value=stage.world.now.tool_pose[2]))
    assert careful.feedback_message == careful.outcome.sentence == "cannot start: the tool is 650 mm high"
    assert stage.context.command == Command()


def test_a_violated_limit_is_a_failure_with_numbers(toy):
    leaf = Careful("cup", limit=0.12)
    assert toy(leaf).tick(100) == Status.FAILURE
    assert leaf.outcome.is_a(LIMIT_VIOLATED) and leaf.outcome.detail.form is GONE
    assert leaf.outcome.detail.numbers == pytest.approx({"time": 0.15})


class Heights(Careful):
    """Two limits, as data."""

    def limits(self, seen, memory):
        return (
            Limit(TOO_LOW, np.full(len(seen.tool), 0.1), seen.tool[:, 2], {"what": "tool"}),
            Limit(TOO_LATE, seen.elapsed, self.limit, counts=seen.tool[:, 2] > 0.0),
        )

    def violated(self, seen, memory):
        return ConceptModel.violated(self, seen, memory)


def test_a_limit_that_is_data_is_the_cause_with_its_numbers_and_units(toy):
    leaf = Heights("cup", limit=0.12)
    assert toy(leaf).tick(100) == Status.FAILURE
    cause = leaf.outcome.cause
    assert leaf.outcome.is_a(LIMIT_VIOLATED) and cause.reason == TOO_LATE
    assert cause.numbers == pytest.approx({"value": 0.15, "limit": 0.12})
    assert cause.to_data()["units"] == {"value": "s", "limit": "s"}
    assert cause.detail.form is GONE and cause.detail.numbers == pytest.approx({"time": 0.15}), (
        "where things stood is kept"
    )


def test_limits_are_batched(toy):
    model, tool = Heights.value("cup", limit=0.12), np.zeros((6, 7))
    tool[:, 2] = [0.05, 0.2, 0.3, 0.4, 0.0, 0.6]
    elapsed = np.array([0.0, 0.0, 0.2, 0.1, 0.2, 0.3])
    seen = SimpleNamespace(tool=tool, elapsed=elapsed)
    assert np.array_equal(model.violated(seen, None), [True, False, True, False, True, True])
    low, late = model.limits(seen, None)
    assert low.applies.tolist() == [True, False, False, False, True, False]
    assert low.at(0) == TOO_LOW(value=0.1, limit=0.05, what="tool")
    assert late.at(5) == TOO_LATE(value=0.3, limit=0.12)


def test_a_goal_that_flickers_is_not_lost_and_one_that_stays_away_is(toy, careful):
    stage = toy(careful)
    stage.context.reach("holding", "cup", ONE)
    stage.tick(2)
    for _ in range(4):
        Careful.held = False
        assert stage.tick(LOST_TICKS - 1) == Status.RUNNING
        Careful.held = True
        assert stage.tick(1) == Status.RUNNING
    Careful.held = False
    assert stage.tick(LOST_TICKS - 1) == Status.RUNNING
    assert stage.tick(1) == Status.FAILURE
    assert careful.outcome.is_a(GOAL_LOST)
    assert careful.outcome.names == {"object": "cup", "goal": "holding"}
    assert not stage.context.reached("holding", "cup", ONE)


def test_ticks_without_a_goal_are_counted_anew_at_each_activation(toy, careful):
    stage = toy(careful)
    for _ in range(2):
        stage.context.reach("holding", "cup", ONE)
        Careful.held = False
        assert stage.tick(LOST_TICKS - 1) == Status.RUNNING
        stage.runner.begin(0)


def test_a_goal_that_nobody_reached_is_not_maintained(toy, careful):
    Careful.held = False
    stage = toy(careful)
    stage.context.reach("holding", "box", ONE)
    assert stage.tick(10) == Status.RUNNING


def test_success_reaches_and_ends_goals(toy, act):
    class Take(act):
        target: ObjectName = "cup"
        reaches = ("holding",)

    class Drop(act):
        target: ObjectName = "cup"
        ends = ("holding",)

    stage = toy(sequence("root", Take("take", ticks=1), Drop("drop", ticks=2)))
    stage.tick(1)
    assert not stage.context.reached("holding", "cup", ONE)
    stage.tick(1)
    assert stage.context.reached("holding", "cup", ONE)
    stage.tick(5)
    assert not stage.context.reached("holding", "cup", ONE)


def test_an_interrupted_leaf_is_ended_and_begins_anew(toy, act):
    leaf = act("leaf", ticks=50)
    stage = toy(sequence("root", reactive_fallback("until", TimePassed(0.1), leaf), act("then", ticks=50)))
    stage.tick(3)
    assert leaf.status == Status.INVALID and leaf.outcome.is_a(INTERRUPTED)
    assert leaf.ended[-1] == Status.INVALID and leaf.memory.tolist() == [2]
    leaf.activation.memory = np.array([50])
    stage.runner.begin(0)
    stage.tick(1)
    assert leaf.memory.tolist() == [1] and leaf.activations == 2


def test_a_retried_leaf_begins_anew(toy, act):
    leaf = act("leaf", ticks=10, timeout=0.2)
    assert toy(retry(3, leaf)).tick(100) == Status.FAILURE
    assert leaf.activations == 3 and leaf.ended.count(Status.FAILURE) == 3


# ---- declarations -----------------------------------------------------------------------------------------


def test_a_concept_must_say_what_it_commands_and_when_it_is_done():
    class Half(ConceptModel):
        def done(self, seen, memory):
            return seen.elapsed > 0.0

    with pytest.raises(TypeError, match="command"):
        Half()

    class Mute(Condition):
        pass

    with pytest.raises(TypeError, match="holds"):
        Mute()


def test_unknown_policies_are_refused_when_the_tree_is_set_up(toy):
    with pytest.raises(InputError, match=r"leaf 'grasp cup': no policy 'clever'; known: .*programmed"):
        toy(Grasp("cup", policy="clever"))


def test_every_concept_declares_what_the_design_asks_for():
    concepts = [c for c in catalogue().values() if issubclass(c, ConceptModel)]
    assert {"Grasp", "Pick", "Bring", "Place", "Release"} <= {c.__name__ for c in concepts}
    for concept in concepts:
        assert concept.__doc__ and concept.default_timeout > 0 and concept.default_tolerance > 0
        for name in ("maintains", "reaches", "ends"):
            assert isinstance(getattr(concept, name), tuple), f"{concept.__name__}.{name}"


def test_what_an_earlier_concept_reaches_later_ones_maintain_until_one_ends_it():
    leaves = catalogue()
    assert leaves["Grasp"].reaches == ("holding",)
    assert all(leaves[n].maintains == ("holding",) for n in ("Pick", "Bring", "Place"))
    assert leaves["Release"].ends == ("holding",)


def test_defaults_of_the_pure_functions_have_the_batchs_shape():
    torch = pytest.importorskip("torch")

    class Plain(ConceptModel):
        actions = 2

        def command(self, action, seen, memory):
            return Command()

        def done(self, seen, memory):
            return seen.tool[:, 0] > 0.0

    model = Plain.value()
    for tool in (np.zeros((1, 7)), np.zeros((4, 7)), torch.zeros((4, 7))):
        seen, worlds = SimpleNamespace(tool=tool), len(tool)
        known = SimpleNamespace(hidden=SimpleNamespace(tool_pose=tool))
        answers = {
            "programmed_motion": model.programmed_motion(seen, None),
            "necessary_cost": model.necessary_cost(seen, None),
            "sufficient_cost": model.sufficient_cost(known, None),
            "decides": model.decides(seen, None),
            "violated": model.violated(seen, None),
            "maintained": model.maintained("holding", seen, None),
        }
        for name, answer in answers.items():
            shape = (worlds, 2) if name == "programmed_motion" else (worlds,)
            assert tuple(answer.shape) == shape and type(answer) is type(tool), name


class Closing(Careful):
    """Commands the hand."""

    hand: Any = np.array([1.0])

    def command(self, action, seen, memory):
        return Command(hand=type(self).hand)


def test_a_hand_target_that_is_no_row_of_numbers_is_said_with_its_line(toy, monkeypatch):
    monkeypatch.setattr(Closing, "violated", ConceptModel.violated)
    with pytest.raises(
        LeafError, match=r"'closing cup' \(test_model.py:\d+\) commands hand=array\(\[1\.\]\): "
    ):
        toy(Closing("cup")).tick()
    monkeypatch.setattr(Closing, "hand", [[0.5]])
    assert toy(Closing("cup")).runner.tick().hand.tolist() == [0.5], "a list will do"


# ---- models as values -------------------------------------------------------------------------------------


def test_a_call_makes_a_leaf_and_value_makes_the_model_alone():
    leaf, model = Careful("cup", name="mine", timeout=3), Careful.value("cup", timeout=3)
    assert isinstance(leaf, Behaviour) and isinstance(leaf, ConceptNode) and not isinstance(leaf, Careful)
    assert isinstance(model, Careful) and not isinstance(model, Behaviour)
    assert type(leaf.model) is Careful and leaf.model == model and leaf.name == "mine"
    assert (type(leaf).__name__, type(leaf).__doc__) == ("Careful", Careful.__doc__)
    assert type(leaf) is Careful.leaf_class is type(Careful("box"))
    assert type(Heights("cup")) is not type(leaf) and Heights.leaf_class.model_class is Heights


def test_a_condition_is_a_value_and_its_call_a_leaf():
    leaf = TimePassed(2.0, name="later")
    assert isinstance(leaf, ConditionNode) and not isinstance(leaf, ConceptNode)
    assert isinstance(leaf.model, TimePassed) and leaf.model == TimePassed.value(duration=2.0)
    assert (
        leaf.arguments() == {"duration": 2.0, "name": "later"}
        and TimePassed(**leaf.arguments()).name == "later"
    )


def test_models_are_equal_by_class_and_values_and_so_are_their_hashes():
    one, same = Careful.value("cup", limit=0.5), Careful.value(limit=0.5, target="cup")
    assert one == same and hash(one) == hash(same) and len({one, same}) == 1
    assert one == Careful.value("cup", limit=0.5, timeout=None)
    for other in (
        Careful.value("box", limit=0.5), Careful.value("cup"), Careful.value("cup", limit=0.5, timeout=3),
        Careful.value("cup", limit=0.5, tolerance=0.1), Heights.value("cup", limit=0.5),
        Careful.value("cup", limit=0.5, uncertainty={"limit": 0.01}), Careful("cup", limit=0.5), "cup", None,
    ):  # fmt: skip
        assert one != other
    assert Careful("cup") != Careful("cup"), "leaves are nodes of a tree, and no values"
    assert Careful("cup").model == Careful("cup").model


def test_arguments_make_an_equal_model_and_are_as_few_as_will_do():
    model = Careful.value("cup", limit=1, timeout=3, uncertainty={"limit": 0.01})
    assert model.arguments() == {"target": "cup", "timeout": 3, "uncertainty": {"limit": 0.01}}
    assert Careful.value(**model.arguments()) == model and Careful.value("cup").arguments() == {
        "target": "cup"
    }
    assert repr(Careful.value("cup", limit=0.5)) == "Careful(target='cup', limit=0.5)"
    leaf = Careful("cup", policy="programmed")
    assert leaf.arguments() == {"target": "cup", "policy": "programmed"}
    assert Careful(**leaf.arguments()).model == leaf.model


def test_a_default_that_is_named_changes_nothing():
    plain = Grasp.value("cup")
    named = Grasp.value("cup", timeout=plain.timeout, speed=plain.speed)
    assert named == plain and hash(named) == hash(plain)
    assert Grasp.value("cup", timeout=plain.timeout + 1.0) != plain


def test_parameters_cannot_be_changed():
    """Files and hashes would tell of another model than the one that runs."""
    model = Grasp.value("cup")
    with pytest.raises(AttributeError, match=r"speed of a Grasp cannot be changed: .*make another"):
        model.speed = 9.0
    assert model == Grasp.value("cup")


def test_a_command_of_ones_own_is_carried_out_below_a_class_that_computes_both_at_once(toy):
    class Hasty(Both):
        def command(self, action, seen, memory):
            asked.append("command")
            return super().command(action, seen, memory)

    class Other(Hasty):
        timeout_s = 1.0

    class Mixin:
        def command(self, action, seen, memory):
            asked.append("command")
            return Command(tool=seen.tool)

    class Mixed(Mixin, Both):
        pass

    class Same(Both):
        pass

    for kind in (Both, Same, Hasty, Other, Mixed):
        asked.clear()
        toy(kind("cup")).tick(1)
        assert asked == (["both"] if kind in (Both, Same) else ["command"])


def test_neither_a_name_nor_a_policy_is_the_models():
    for wrong in ({"name": "mine"}, {"policy": "programmed"}):
        with pytest.raises(InputError, match=f"careful has no parameter '{next(iter(wrong))}'"):
            Careful.value("cup", **wrong)


@pytest.mark.parametrize("make", [ConceptModel, ConceptModel.value, Condition, Condition.value])
def test_abstract_models_are_refused(make):
    with pytest.raises(TypeError, match="abstract"):
        make()


def test_a_contradiction_is_refused_when_the_value_is_made():
    for make in (Bring, Bring.value):
        with pytest.raises(InputError, match="bring: give either 'to', 'position' or 'beside'"):
            make("cup")


def test_one_model_in_several_leaves_runs_apart(toy):
    """A model holds nothing of a run: what changes is the leaf's."""
    first, second = Careful("cup", name="first", timeout=0.2), Careful("cup", name="second")
    second._model = first.model
    before = dict(vars(first.model))
    stage = toy(sequence("root", force_success(first), second))
    assert stage.tick(8) == Status.RUNNING
    assert (first.activations, second.activations) == (1, 1) and first.outcome.is_a(TIMED_OUT)
    assert vars(first.model) == before
