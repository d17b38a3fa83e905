"""Evaluation: results depend on the seeds alone, and the counts add up."""

import dataclasses
import json
import math
import os
import re

import numpy as np
import pytest

from bt_tasksim.concept_nodes.holding import NOT_HELD
from bt_tasksim.core import plugins
from bt_tasksim.core.errors import (
    InputError,
    LeafError,
    LostEngine,
    MachineError,
    NoDrawError,
    NoWayError,
    Terminated,
)
from bt_tasksim.core.outcomes import CANNOT_START, DONE, TIME_OVER
from bt_tasksim.demos_decomp.log_file import read_log
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import Runner
from bt_tasksim.report.write import write_run
from bt_tasksim.scene.success import HAND_NOT_CLEAR
from bt_tasksim.training.evaluation import (
    EvaluationInterrupted,
    EvaluationTerminated,
    Job,
    Player,
    episode,
    evaluate,
    usual_batch,
    usual_workers,
)
from bt_tasksim.training.evaluation_file import EvaluationFile
from bt_tasksim.training.evaluation_outcomes import EpisodeOutcome, Evaluation, wilson
from bt_tasksim.trees.scenarios import pick_and_place

pytestmark = pytest.mark.physical

FIELDS = {
    "scenario", "robot", "engines", "perception", "policies", "episodes", "successes", "success_rate",
    "confidence_interval", "failures", "failed_seeds", "seconds", "control_steps",
}  # fmt: skip


def timeless(outcomes):
    return [dataclasses.replace(o, wall_time=0.0) for o in outcomes]


@pytest.fixture(scope="module")
def evaluated():
    return evaluate(Job("pick_and_throw"), range(30, 34))


def test_one_and_two_workers_and_another_order_give_the_same_numbers(evaluated):
    seeds = [31, 33, 30, 32]
    two = evaluate(Job("pick_and_throw"), seeds, workers=2)
    assert [o.seed for o in two.outcomes] == seeds
    assert sorted(timeless(two.outcomes), key=lambda o: o.seed) == timeless(evaluated.outcomes)
    assert len({o.position_error for o in two.outcomes}) == 4, "exact floats, and none like another"


def test_a_worker_that_cannot_begin_ends_the_evaluation(tmp_path):
    plugin = tmp_path / "not_in_workers.py"
    plugin.write_text("import multiprocessing\nassert multiprocessing.parent_process() is None\n")
    with plugins.scratch(), pytest.raises(InputError, match="line 2"):
        evaluate(Job("pick_and_throw", plugins=(str(plugin),)), [1, 2], workers=2)


def test_what_is_not_known_is_null_in_json_and_comes_back(evaluated):
    unknown = dataclasses.replace(evaluated.outcomes[0], position_error=math.nan, angle_error=math.nan)
    text = json.dumps(unknown.to_data(), allow_nan=False)
    back = EpisodeOutcome.from_data(json.loads(text))
    assert math.isnan(back.position_error) and math.isnan(back.angle_error)
    assert back.penetration == unknown.penetration


def test_what_is_written_adds_up(evaluated):
    content = json.loads(json.dumps(evaluated.to_json()))
    assert content.keys() >= FIELDS
    assert content["scenario"] == "pick_and_throw" and content["robot"] == "panda"
    assert content["engines"] == "sapien" and content["perception"] == "state, noise fine"
    assert content["policies"]["grasp cup"] == "programmed"
    assert content["episodes"] == 4 == content["successes"] + sum(content["failures"].values())
    assert content["success_rate"] == content["successes"] / 4
    low, high = content["confidence_interval"]
    assert low <= content["success_rate"] <= high
    assert content["control_steps"] == sum(o["control_steps"] for o in content["outcomes"]) > 4 * 80
    assert content["seconds"] > 0


def test_workers_take_the_policies_of_the_job(policy):
    job = Job("pick_and_place", policies=(("grasp", str(policy("mine"))),))
    one, two = evaluate(job, range(3, 5)), evaluate(job, range(3, 5), workers=2)
    assert one.policies == two.policies and one.policies["grasp target"].startswith("mine@")
    assert {v for k, v in one.policies.items() if k != "grasp target"} == {"programmed"}
    # The policy by hand does nothing but say "done", and the grasp's reference motion is enough here.
    assert timeless(one.outcomes) == timeless(two.outcomes)
    assert one.successes >= 1


def test_a_policy_that_never_says_done_fails(policy):
    found = evaluate(Job("pick_and_place", policies=(("grasp", str(policy("idle", gain=0.0))),)), [3])
    assert found.successes == 0 and found.outcomes[0].reason == "timed_out"
    assert found.outcomes[0].leaf == "grasp target"


def outcome(seed, how=None, leaf=""):
    return EpisodeOutcome(
        seed, how is None, "SUCCESS", leaf, how or DONE(elapsed=1.0), 10, 0.001, 0.0, 0.0, 0.1
    )


def test_failures_are_counted_by_reason():
    late, far = TIME_OVER(limit=9.0), HAND_NOT_CLEAR(object="cup")
    ends = [(None, ""), (far, "a"), (None, ""), (late, ""), (far, "a")]
    found = Evaluation("s", "r", "e", "p", {}, tuple(outcome(i, *e) for i, e in enumerate(ends)), 2.0)
    content = found.to_json()
    assert content["successes"] == 2 and content["success_rate"] == 0.4
    assert content["failures"] == {"hand_not_clear": 2, "time_over": 1}
    assert content["failed_leaves"] == {"a": 2} and content["failed_seeds"] == [1, 3, 4]
    assert [line.split(", such as")[0].strip() for line in found.failure_lines()] == [
        "2 x a: hand_not_clear",
        "1 x time_over",
    ]


def test_numbers_and_units_of_an_outcome_are_in_the_file():
    content = outcome(3, CANNOT_START(NOT_HELD(object="cup", distance=0.08)), "pick cup").to_data()
    assert (content["reason"], content["leaf"]) == ("not_held", "pick cup")
    cause = content["outcome"]["detail"]
    assert cause["reason"] == "not_held" and cause["names"] == {"object": "cup"}
    assert cause["numbers"] == {"distance": 0.08} and cause["units"] == {"distance": "m"}


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


def test_many_episodes_have_a_process_for_each_core(monkeypatch):
    monkeypatch.setattr("os.cpu_count", lambda: 6)
    assert [usual_workers(EngineOptions(), n) for n in (1, 199, 200)] == [1, 1, 6]
    assert usual_workers(EngineOptions(perception="camera"), 10**6) == 1, "pictures take much memory"


def test_worlds_on_a_gpu_are_one_process(monkeypatch):
    monkeypatch.setattr("os.cpu_count", lambda: 16)
    monkeypatch.setattr("bt_tasksim.execution.worlds.available_memory", lambda: 10**12)
    monkeypatch.setattr("bt_tasksim.engines.physics.mujoco_warp.MujocoWarpPhysics.check_device", str)
    assert usual_workers(EngineOptions(engines="mujoco_warp", device="cuda"), 20_000, 4096) == 1
    assert usual_workers(EngineOptions(engines="mujoco_warp"), 20_000) == 16


def test_laws_on_a_device_are_those_of_every_share(policy):
    """The last shares are of one episode; a batch of one would be computed otherwise."""
    with pytest.raises(InputError, match="--laws torch is for batches of worlds"):
        Job("pick_and_place", options=EngineOptions(laws="torch"), batch=1)
    with Player(Job("pick_and_place", options=EngineOptions(laws="torch"))) as player:
        (found,) = player.play([3], "evaluation")
        assert found[1].success and player._batch is not None
        assert not isinstance(player._batch.context.like, np.ndarray)


def test_processes_count_in_what_memory_has_room_for(monkeypatch):
    """A machine with 2 GB that are free: each process takes 0.35 GB, and 0.7 GB with pictures."""
    monkeypatch.setattr("bt_tasksim.execution.worlds.available_memory", lambda: 2_000_000_000)
    monkeypatch.setattr("os.cpu_count", lambda: 6)
    assert usual_workers(EngineOptions(), 200) == 2
    assert usual_batch(EngineOptions()) == 64 and usual_batch(EngineOptions(), 4) == 16
    job = Job("pick_and_throw", options=EngineOptions(noise="none"))
    with pytest.raises(InputError, match=r"^6 processes do not fit .*350 MB; 4 do$"):
        evaluate(job, range(100), 6)
    with pytest.raises(InputError, match=r"batch of 800 worlds in 4 processes does not fit .*; 66 do"):
        evaluate(dataclasses.replace(job, batch=200), range(100), 4)
    camera = dataclasses.replace(job, options=EngineOptions(perception="camera"))
    with pytest.raises(InputError, match=r"^4 processes do not fit .*700 MB; 2 do$"):
        evaluate(camera, range(100), 4)


def test_progress_is_told_of_every_episode():
    seen = []
    evaluate(Job("pick_and_throw", options=EngineOptions(noise="none")), [1, 2], progress=seen.append)
    assert sorted(o.seed for o in seen) == [1, 2]


def test_an_error_in_an_episode_is_one_failure_and_not_the_end():
    class Broken:
        def run(self, seed, stream):
            raise LeafError("leaf 'x' raised KeyError: 'y'") if seed else NoWayError("no way")

    assert [(o.success, o.reason, o.why) for o in (episode(Broken(), s) for s in (1, 0))] == [
        (False, "leaf_raised", "leaf 'x' raised KeyError: 'y'"),
        (False, "no_way", "no way"),
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
        assert (outcome.success, outcome.reason, outcome.why) == (False, "machine_failed", str(error))


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


def test_what_is_done_is_kept_as_it_comes(tmp_path, monkeypatch):
    monkeypatch.setattr(EvaluationFile, "EVERY", 0.0)
    monkeypatch.setattr(EvaluationFile, "SHARE", math.inf)
    path, seen = tmp_path / "e.json", []

    def look(outcome):
        seen.append(json.loads(path.read_text())["episodes"] if path.exists() else 0)

    found = evaluate(Job("pick_and_throw"), [1, 2, 3], progress=look, keep=EvaluationFile(path))
    assert seen == [0, 1, 2]
    content = json.loads(path.read_text())
    assert content["complete"] and content["episodes"] == 3 and found.complete


@pytest.mark.parametrize(
    ("kind", "raised"), [(KeyboardInterrupt, EvaluationInterrupted), (Terminated, EvaluationTerminated)]
)
def test_an_interrupted_evaluation_keeps_and_tells_its_counts(tmp_path, kind, raised):
    seen = []

    def stop(outcome):
        seen.append(outcome.seed)
        if len(seen) == 2:
            raise kind

    path = tmp_path / "e.json"
    with pytest.raises(raised, match="2 of 9 episodes had ended") as caught:
        evaluate(Job("pick_and_throw"), range(1, 10), progress=stop, keep=EvaluationFile(path))
    assert isinstance(caught.value, kind)
    assert caught.value.evaluation.lines()[0].startswith("pick_and_throw on panda (sapien, ")
    content = json.loads(path.read_text())
    assert content["episodes"] == 2 and not content["complete"]
    assert [outcome["seed"] for outcome in content["outcomes"]] == sorted(seen)


@pytest.mark.parametrize("full", [1, 9])
def test_a_full_disk_loses_no_episode(tmp_path, monkeypatch, full):
    """Where there is room again at the end nothing is lost; where there is none, the counts are told."""
    monkeypatch.setattr(EvaluationFile, "EVERY", 0.0)
    keep, told, fsync, times = EvaluationFile(tmp_path / "e.json"), [], os.fsync, []

    def flush(file):
        times.append(file)
        if len(times) <= full:
            raise OSError(28, "No space left on device")
        fsync(file)

    monkeypatch.setattr(os, "fsync", flush)
    if full == 1:
        assert evaluate(Job("pick_and_throw"), [1, 2], keep=keep, stopped=told.append).complete
        assert json.loads((tmp_path / "e.json").read_text())["episodes"] == 2 and not told
    else:
        with pytest.raises(MachineError, match="No space left"):
            evaluate(Job("pick_and_throw"), [1, 2], keep=keep, stopped=told.append)
        assert [len(found.outcomes) for found in told] == [2]


def test_where_it_cannot_be_kept_nothing_is_run(tmp_path):
    (tmp_path / "file").touch()
    for path in (tmp_path, tmp_path / "no" / "e.json", tmp_path / "file" / "e.json"):
        with pytest.raises(InputError):
            EvaluationFile(path)


@pytest.mark.parametrize("seed", [-1, 2**64, 10**30])
def test_a_seed_that_no_log_can_keep_is_refused_before_the_run(seed):
    with pytest.raises(InputError, match="a seed is a whole number from 0 to 18446744073709551615"):
        evaluate(Job("pick_and_throw"), [seed])
    with pytest.raises(InputError, match="a seed is a whole number"):
        pick_and_place.scene().sample(seed)


def test_the_largest_seed_is_kept(tmp_path):
    result, _ = write_run(tmp_path / "one", Runner(pick_and_place.build(), pick_and_place.scene()), 2**64 - 1)
    assert read_log(tmp_path / "one" / "run.h5").demonstrations[0].seed == result.seed == 2**64 - 1


TWINS = """
from bt_tasksim import ObjectSpec, Scene
from bt_tasksim.concept_nodes import Wait

def scene():
    cube = ObjectSpec("cube", on="table", size=(0.05, 0.05, 0.05), colour=(0.86, 0.16, 0.15))
    return Scene(objects={"a": cube, "b": cube})

def build():
    return Wait(duration=0.1)
"""
CROWD = """
from bt_tasksim import ObjectSpec, Scene
from bt_tasksim.concept_nodes import Wait

def scene():
    box = ObjectSpec("box", on="table", area=({side}, {side}), size=(0.06, 0.06, 0.05), gap=0.01)
    return Scene(objects={{f"box {{i}}": box for i in range(7)}})

def build():
    return Wait(duration=0.1)
"""


@pytest.mark.parametrize("how", [{"batch": 1}, {"batch": 3}, {"batch": 2, "workers": 2}])
def test_a_seed_that_has_no_world_is_counted_and_the_others_are_run(how, tmp_path):
    (tmp_path / "crowd.py").write_text(CROWD.format(side=0.11))
    job = Job(str(tmp_path / "crowd.py"), batch=how["batch"])
    found = evaluate(job, range(8), workers=how.get("workers"))
    assert [outcome.seed for outcome in found.outcomes] == list(range(8)) and found.complete
    without = found.undrawn
    assert 0 < len(without) < 8 and found.successes == 8 - len(without)
    content = found.to_json()
    assert content["undrawn_seeds"] == without and content["failures"] == {"no_draw": len(without)}
    for outcome in found.outcomes:
        if outcome.seed in without:
            assert outcome.reason == "no_draw" and outcome.status == "INVALID"
            assert re.search(r"with seed \d+, object 'box", outcome.why)
    assert f"{len(without)} of 8 seeds could not be drawn" in str(found)


def test_where_no_seed_has_a_world_that_is_an_error_which_names_one(tmp_path):
    (tmp_path / "crowd.py").write_text(CROWD.format(side=0.05))
    with pytest.raises(NoDrawError, match=r"with seed \d+, object 'box .' finds no free spot") as error:
        evaluate(Job(str(tmp_path / "crowd.py"), batch=1), [5, 6])
    assert "\n" not in str(error.value)


def test_a_draw_whose_objects_look_alike_is_a_failure_with_its_own_reason(tmp_path):
    (tmp_path / "twins.py").write_text(TWINS)
    job = Job(str(tmp_path / "twins.py"), options=EngineOptions(perception="camera"), batch=1)
    (found,) = evaluate(job, [5]).outcomes
    assert found.reason == "not_told_apart" and found.status == "INVALID" and not found.success
    assert "'a' and 'b' cannot be told apart" in found.why and found.control_steps == 0


@pytest.mark.parametrize("batch", [1, 2])
def test_bodies_that_overlapped_too_deeply_are_named(batch, monkeypatch):
    monkeypatch.setattr("bt_tasksim.scene.success.DEEPEST", 0.0)  # whatever touches
    (found,) = evaluate(Job("pick_and_throw", batch=batch), [30]).outcomes
    bodies, when = found.outcome.names["bodies"], found.outcome.names["moment"]
    assert found.reason == "penetration" and " and " in bodies and "two bodies" not in bodies
    assert when.startswith(" at ") and found.why.startswith(f"{bodies} overlapped by ")
