"""Evaluation: results depend on the seeds alone, and the counts add up."""

import dataclasses
import json
import math

import pytest

from bt_tasksim.engines.registry import EngineOptions
from bt_tasksim.errors import InputError, LeafError, LostEngine, MachineError, NoWayError
from bt_tasksim.training.evaluation import Evaluation, Job, Outcome, episode, evaluate, wilson

FIELDS = {
    "scenario", "robot", "engines", "perception", "policies", "episodes", "successes", "success_rate",
    "confidence_interval", "failures", "failed_seeds", "seconds", "control_steps",
}  # fmt: skip


def timeless(outcomes):
    return [dataclasses.replace(o, wall_time=0.0) for o in outcomes]


@pytest.fixture(scope="module")
def evaluated():
    return evaluate(Job("pick_and_throw"), range(30, 36))


def test_one_and_two_workers_and_another_order_give_the_same_numbers(evaluated):
    seeds = [35, 31, 33, 30, 34, 32]
    two = evaluate(Job("pick_and_throw"), seeds, workers=2)
    assert [o.seed for o in two.outcomes] == seeds
    assert sorted(timeless(two.outcomes), key=lambda o: o.seed) == timeless(evaluated.outcomes)
    assert len({o.position_error for o in two.outcomes}) == 6, "exact floats, and none like another"


def test_what_is_written_adds_up(evaluated):
    content = json.loads(json.dumps(evaluated.to_json()))
    assert content.keys() >= FIELDS
    assert content["scenario"] == "pick_and_throw" and content["robot"] == "panda"
    assert content["engines"] == "sapien" and content["perception"] == "state, noise fine"
    assert content["policies"]["grasp cup"] == "programmed"
    assert content["episodes"] == 6 == content["successes"] + sum(content["failures"].values())
    assert content["success_rate"] == content["successes"] / 6
    low, high = content["confidence_interval"]
    assert low <= content["success_rate"] <= high
    assert content["control_steps"] == sum(o["control_steps"] for o in content["outcomes"]) > 6 * 80
    assert content["seconds"] > 0


def test_workers_take_the_policies_of_the_job(policy):
    programmed = evaluate(Job("pick_and_place"), [3, 4])
    job = Job("pick_and_place", policies=(("grasp", str(policy("mine"))),))
    one, two = evaluate(job, [3, 4]), evaluate(job, [3, 4], workers=2)
    assert one.policies == two.policies and one.policies["grasp target"].startswith("mine@")
    assert {v for k, v in one.policies.items() if k != "grasp target"} == {"programmed"}
    # The policy by hand does nothing but say "done", and the grasp's reference motion is enough here.
    assert timeless(one.outcomes) == timeless(two.outcomes)
    assert one.successes == programmed.successes == 2


def test_a_policy_that_never_says_done_fails(policy):
    found = evaluate(Job("pick_and_place", policies=(("grasp", str(policy("idle", gain=0.0))),)), [3])
    assert found.successes == 0 and found.outcomes[0].reason == "grasp target failed"
    assert "not done within" in found.outcomes[0].why


def outcome(seed, reason=""):
    return Outcome(seed, not reason, "SUCCESS", reason, "why", 10, 0.001, 0.0, 0.0, 0.1)


def test_failures_are_counted_by_reason():
    reasons = ["", "not in place", "", "time over", "not in place"]
    found = Evaluation("s", "r", "e", "p", {}, tuple(outcome(i, r) for i, r in enumerate(reasons)), 2.0)
    content = found.to_json()
    assert content["successes"] == 2 and content["success_rate"] == 0.4
    assert content["failures"] == {"not in place": 2, "time over": 1}
    assert content["failed_seeds"] == [1, 3, 4]


@pytest.mark.parametrize(
    ("successes", "n", "low", "high"),
    # E. B. Wilson's formula, by hand with z = 1.95996.
    [(95, 100, 0.8882, 0.9785), (0, 10, 0.0, 0.2775), (10, 10, 0.7225, 1.0)],
)
def test_confidence_interval(successes, n, low, high):
    assert wilson(successes, n) == pytest.approx((low, high), abs=2e-4)
    z, p = 1.959964, successes / n
    middle, half = (p + z * z / 2 / n), z * math.sqrt(p * (1 - p) / n + z * z / 4 / n / n)
    assert wilson(successes, n)[1] == pytest.approx(min(1.0, (middle + half) / (1 + z * z / n)), abs=1e-6)


def test_progress_is_told_of_every_episode():
    seen = []
    evaluate(Job("pick_and_throw", options=EngineOptions(noise="none")), [1, 2], progress=seen.append)
    assert [o.seed for o in seen] == [1, 2]


def test_an_error_in_an_episode_is_one_failure_and_not_the_end():
    class Broken:
        def run(self, seed, stream):
            raise LeafError("leaf 'x' raised KeyError: 'y'") if seed else NoWayError("no way")

    assert [(o.success, o.reason, o.why) for o in (episode(Broken(), s) for s in (1, 0))] == [
        (False, "LeafError", "leaf 'x' raised KeyError: 'y'"),
        (False, "NoWayError", "no way"),
    ]


@pytest.mark.parametrize(
    ("error", "engines", "ends"),
    [
        (MachineError("the joint target is not finite"), "remote:127.0.0.1:5599", False),
        (LostEngine("has gone away"), "remote:127.0.0.1:5599", True),
        (MachineError("no bridge"), "ros:127.0.0.1:9090", True),
        (MachineError("the joint target is not finite"), "mujoco", False),
    ],
)
def test_only_an_engine_that_is_lost_ends_an_evaluation(error, engines, ends):
    """What a living server says of its engine is counted as if the engine were here."""

    class Broken:
        options = EngineOptions(engines=engines)

        def run(self, seed, stream):
            raise error

    if ends:
        with pytest.raises(MachineError, match=str(error)):
            episode(Broken(), 1)
    else:
        outcome = episode(Broken(), 1)
        assert (outcome.success, outcome.reason, outcome.why) == (False, "MachineError", str(error))


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ((Job("pick_and_throw"), []), "at least one episode"),
        ((Job("pick_and_throw"), [1], 0), "at least one worker, found 0"),
        ((Job("pick_and_thro"), [1]), "no scenario 'pick_and_thro'; did you mean 'pick_and_throw'"),
        ((Job("pick_and_throw", robot="pandar"), [1]), "'pandar'.*did you mean 'panda'"),
        ((Job("pick_and_throw", scene="shelf_to_shelf"), [1], 2), "no place 'trash_bin' in the scene"),
        ((Job("pick_and_throw", policies=(("wipe", "x"),)), [1], 2), "given for 'wipe'.*no leaf.*known: "),
        (
            (Job("pick_and_throw", policies=(("grasp", "x/y"),)), [1], 2),
            "'grasp cup': there is no policy folder",
        ),
    ],
)
def test_bad_input_is_refused_before_any_process_starts(arguments, sentence):
    with pytest.raises(InputError, match=sentence):
        evaluate(*arguments)
