"""What functions of models have to give, and who is named where they give something else."""

import gc
import weakref
from types import SimpleNamespace

import numpy as np
import pytest

from bt_tasksim.concept.batch_leaves import ConditionInBatch
from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.context import Context
from bt_tasksim.concept.contract import Contract
from bt_tasksim.core.errors import LeafError
from bt_tasksim.core.outcomes import Form
from bt_tasksim.core.units import METRES
from bt_tasksim.core.world import Command, ObjectModel, WorldModel
from bt_tasksim.robot.description import load_robot

HIGH = Form("{height:.3f} high", {"height": METRES})


class High(Condition):
    """The tool is high."""

    wrong = ""

    def holds(self, seen):
        return 1.0 if self.wrong == "holds" else seen.tool[:, 2] > 0.1

    def explain(self, seen):
        return HIGH(height=np.zeros((2, 3)) if self.wrong == "explain" else seen.tool[:, 2])


class Observed(SimpleNamespace):
    """An observation; other than its base, it can be watched."""


@pytest.fixture
def asked():
    """A condition in three worlds, and the context, at their first tick."""
    context = Context(load_robot("panda"), 3)
    cup = ObjectModel("cup", "cup", (0.1, 0.1, 0.1), 0, ((0.0, 1, 0),), (0.05,))
    context.begin([WorldModel((cup,), {}, ("l", "r"), 0.08, 0.05)] * 3)
    context.advance(observed())
    leaf = High(name="up")
    leaf.setup(context=context)
    return ConditionInBatch(leaf, context), context


def observed():
    tool = np.zeros((3, 7))
    tool[:, 2] = 0.05, 0.15, 0.25
    return Observed(time=np.zeros(3), tool_pose=tool, objects=np.zeros((3, 1, 7)))


def test_a_condition_says_why_by_world_and_keeps_nothing_that_it_saw(asked):
    leaf, context = asked
    leaf.tick(np.arange(3), np.full(3, True))
    seen = weakref.ref(context.observation)
    context.advance(observed())
    leaf.tick(np.array([1]), np.array([True]))
    gc.collect()
    assert seen() is None
    assert [leaf.outcome(row).detail.numbers["height"] for row in range(3)] == [0.05, 0.15, 0.25]


@pytest.mark.parametrize("wrong", ["holds", "explain"])
def test_a_condition_that_answers_wrong_is_told_with_its_line(asked, monkeypatch, wrong):
    leaf, _ = asked
    monkeypatch.setattr(High, "wrong", wrong)
    with pytest.raises(LeafError, match=rf"^leaf 'up': High.{wrong} \(test_contract.py:\d+\) gives "):
        leaf.tick(np.arange(3), np.full(3, True))


@pytest.mark.parametrize("library", ["numpy", "torch", "array_api_strict"])
def test_it_holds_in_every_library(library):
    xp = pytest.importorskip(library)
    contract = Contract(High(name="up"), High.value())
    yes, reals, whole = xp.zeros(2, dtype=xp.bool), xp.zeros((2, 3)), xp.zeros(2, dtype=xp.int64)
    contract.answers(yes, 2, "holds")
    contract.shares(yes, 2, "holds")
    contract.shares(reals[:, 0], 2, "holds")
    contract.motion(reals, 2, 3, "holds")
    contract.words(HIGH(height=reals[:, 0]), 2)
    assert contract.carried((Command(), None)) == (Command(), None)
    for wrong in (
        lambda: contract.answers(whole, 2, "holds"),
        lambda: contract.answers(yes, 3, "holds"),
        lambda: contract.shares(xp.zeros(2, dtype=xp.complex128), 2, "holds"),
        lambda: contract.motion(reals, 2, 2, "holds"),
        lambda: contract.words(HIGH(height=reals), 2, "holds"),
    ):
        with pytest.raises(LeafError, match=r"High.holds .* gives (an array|Statement)"):
            wrong()
