"""One call counts successes: the same ones one after the other and at once."""

from __future__ import annotations

import pytest

from bt_tasksim import InputError, Scene, evaluate
from concept_nodes import Grasp, Pick
from trees import sequence
from trees.load import load_source

SCENE = Scene(objects={"box": "on table"})


def build():
    return sequence("grasp and pick", Grasp("box"), Pick("box", distance=0.05))


def test_outcomes_are_the_same_one_by_one_and_at_once():
    seen = []
    at_once = evaluate(build, SCENE, episodes=3, seed=7, progress=seen.append)
    one_by_one = evaluate(build(), SCENE, episodes=3, seed=7)
    assert [o.seed for o in at_once.outcomes] == [7, 8, 9] and len(seen) == 3
    for mine, other in zip(at_once.outcomes, one_by_one.outcomes, strict=True):
        assert (mine.success, mine.control_steps, mine.why) == (
            other.success, other.control_steps, other.why,
        )  # fmt: skip
    assert at_once.complete and repr(at_once).startswith("<Evaluation of grasp and pick on panda: ")
    assert f"{at_once.successes} of 3" in str(at_once) and "of 3" in at_once._repr_html_()


@pytest.mark.parametrize(
    ("said", "wanted"),
    [
        ({"episodes": 0}, "at least one episode"),
        ({"seed": -1}, "a seed is a whole number"),
        ({"enginse": "mujoco"}, "did you mean 'engines'"),
    ],
)
def test_what_makes_no_sense_is_refused(said, wanted):
    with pytest.raises(InputError, match=wanted):
        evaluate(build, SCENE, **said)


def test_an_episode_may_be_stopped_early_at_once_and_one_by_one():
    source = load_source("pick_and_place")
    for tree in (source.build, source.build()):
        found = evaluate(tree, source.scene, 2, longest=0.5)
        assert [outcome.reason for outcome in found.outcomes] == ["time_over"] * 2
    with pytest.raises(InputError, match="policies are names"):
        evaluate(source.build, source.scene, 2, policy="grasp=programmed")
