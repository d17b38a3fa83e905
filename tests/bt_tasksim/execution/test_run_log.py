"""A run's log holds what happened, in the format of demonstrations."""

import json
import time

import numpy as np
import pytest
from py_trees.common import Status

from bt_tasksim.concept.planner import Planner
from bt_tasksim.concept_nodes import Grasp, Pick, Release
from bt_tasksim.core.errors import InputError, NoWayError
from bt_tasksim.core.outcomes import INTERRUPTED, NO_WAY, TIME_OVER
from bt_tasksim.demos_decomp.decompose import decompose
from bt_tasksim.demos_decomp.log_file import read_log
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.run_log import (
    RunRecorder,
    describe_nodes,
    hand_opening,
    read_text,
    read_texts,
)
from bt_tasksim.execution.runner import Runner
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.scene import Scene
from bt_tasksim.trees import fallback, retry, same_tree, sequence, tree_from_xml
from bt_tasksim.trees.scenarios import pick_and_place
from bt_tasksim.trees.walk import nodes_of

pytestmark = pytest.mark.physical


@pytest.fixture(scope="module")
def log(recorded, tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "run.h5"
    recorded.recorder.write(path, recorded.result)
    return read_log(path)


def test_read_back(recorded, run, log):
    (read,) = log.demonstrations
    assert log.source == "simulation" and log.description == recorded.result.why
    assert read.seed == 3 and read.task == "pick_and_place"
    assert read.notes["robot"] == "panda" and read.notes["perception"] == "state, noise fine"
    assert read.notes["objects_are"] == "true poses"
    np.testing.assert_array_equal(read.time, run.time)
    np.testing.assert_allclose(read.hand_pose, run.hand_pose, atol=1e-6)  # unit quaternions
    assert set(read.extra) == set(run.extra)
    for name, values in run.extra.items():
        np.testing.assert_array_equal(read.extra[name], values, err_msg=name)


def test_decomposed_again(log):
    tasks = decompose(log.demonstrations[0])
    assert [task.concept for task in tasks] == ["grasp", "pick", "bring", "place", "release"]
    assert all(task.parameters["target"] == "target" for task in tasks)


def test_tree_and_world_can_be_built_from_it(recorded, log):
    extra = log.demonstrations[0].extra
    assert same_tree(tree_from_xml(read_text(extra["run/tree"])), pick_and_place.build())
    configuration = ActorConfiguration.from_json(read_text(extra["run/configuration"]))
    assert configuration.to_json() == recorded.result.configuration.to_json()


def test_about(recorded, log):
    about = json.loads(read_text(log.demonstrations[0].extra["run/about"]))
    assert about["status"] == "SUCCESS" and about["success"] is True and about["why"] == recorded.result.why
    assert about["seed"] == 3 and about["scenario"] == "pick_and_place" and about["robot"] == "panda"
    assert about["policies"]["grasp target"] == "programmed"
    assert about["verdict"]["position_error"] < 0.03
    assert {"python", "numpy", "sapien", "machine", "robot file"} <= set(about["versions"])


def test_statuses_follow_one_another(recorded, run):
    status = run.extra["tree/status"]
    assert status.shape == (len(run.time), 6) and status.dtype == np.int8
    assert status[0].tolist() == [1, 1, 0, 0, 0, 0]
    assert status[-1].tolist() == [2, 2, 2, 2, 2, 2]
    running = (status[:, 1:] == 1).sum(axis=1)
    until = recorded.result.control_steps
    assert (running[:until] == 1).all() and (running[until:] == 0).all()


def test_necessary_cost_of_the_active_concept_only(run):
    cost, status = run.extra["tree/necessary_cost"], run.extra["tree/status"]
    assert np.isnan(cost[:, 0]).all()
    assert (np.isfinite(cost) >= ((status == 1) & (np.arange(6) > 0))).all()
    grasp = cost[np.isfinite(cost[:, 1]), 1]
    assert grasp[0] > 0.3 > 0.05 > grasp[-1]


def test_messages(run):
    texts = read_texts(run.extra["messages/text"])
    assert run.extra["messages/node"].tolist() == [1, 2, 3, 4, 5]
    assert all(text.startswith("done after") for text in texts)
    assert (np.diff(run.extra["messages/time"]) > 0).all()


def test_state_is_true_and_observation_estimated(run):
    true, estimated = run.extra["state/objects"], run.extra["observations/objects"]
    np.testing.assert_array_equal(run.objects["target"].pose, true[:, 0])
    gap = np.linalg.norm(true[..., :3] - estimated[..., :3], axis=-1)
    assert 1e-4 < gap.max() < 0.02


def test_opening_closes_on_the_object(run):
    assert run.hand_opening[0] == pytest.approx(0.08, abs=1e-3)
    widths = np.array(run.objects["target"].size[:2])  # of one pair of its sides
    assert np.abs(widths - run.hand_opening.min()).min() < 2e-3


def test_opening_of_a_hand_with_five_fingers():
    robot = load_robot("xarm7_ability")
    tips = np.zeros((2, 5, 3))
    tips[:, 1:, 1] = [[0.1, 0.08, 0.09, 0.2], [0.05, 0.08, 0.09, 0.2]]
    np.testing.assert_allclose(hand_opening(tips, robot), [0.08, 0.05])


def test_a_recorder_records_one_run_after_the_other():
    runner = Runner(pick_and_place.build(), pick_and_place.scene(), EngineOptions(noise="none"))
    recorder = RunRecorder(runner)
    first = recorder.demonstration(runner.run(3, record=recorder))
    second = recorder.demonstration(runner.run(3, record=recorder))
    for name in first.extra:
        if name != "run/about":  # has the seconds that it took
            np.testing.assert_array_equal(first.extra[name], second.extra[name], err_msg=name)


def test_failures_and_retries_are_seen():
    scene = pick_and_place.scene()
    tree = retry(2, fallback("try", Pick("target", distance=0.1), Pick("target", distance=0.2, name="again")))
    runner = Runner(tree, scene)
    recorder = RunRecorder(runner)
    result = runner.run(3, record=recorder)
    assert result.status == Status.FAILURE
    run = recorder.demonstration(result)
    texts = read_texts(run.extra["messages/text"])
    assert sum("cannot start" in text for text in texts) >= 2
    assert any(text.startswith("attempt 1 of 2 failed") for text in texts)


def test_a_run_that_was_stopped_says_why():
    runner = Runner(pick_and_place.build(), pick_and_place.scene(), longest=0.5)
    recorder = RunRecorder(runner)
    run = recorder.demonstration(runner.run(3, record=recorder))
    texts = read_texts(run.extra["messages/text"])
    assert texts == [f"stopped: {TIME_OVER(limit=0.5)}", f"{INTERRUPTED()}"]
    assert run.extra["messages/node"].tolist() == [0, 1]


def test_nodes_in_the_order_of_the_tree():
    tree = sequence("a", sequence("b", Grasp("x"), Pick("x")), Release("x"))
    nodes = nodes_of(tree)
    assert [node.name for node in nodes] == ["a", "b", "grasp x", "pick x", "release x"]
    described = describe_nodes(nodes)
    assert [node["parent"] for node in described] == [-1, 0, 1, 1, 0]
    assert [node["type"] for node in described] == ["Sequence", "Sequence", "Grasp", "Pick", "Release"]


def test_a_scene_without_objects_has_no_log(tmp_path):
    from bt_tasksim.concept_nodes import TimePassed

    runner = Runner(retry(30, TimePassed(0.5)), Scene())
    recorder = RunRecorder(runner)
    result = runner.run(0, record=recorder)
    with pytest.raises(InputError, match="no objects"):
        recorder.write(tmp_path / "run.h5", result)
    assert not (tmp_path / "run.h5").exists()


@pytest.mark.parametrize("fails", [False, True])
def test_what_plans_beside_the_loop_has_no_cost_before_it_begins(monkeypatch, fails):
    """As on a robot; for the second attempt, too, there is nothing but what the first one remembered."""
    begin, asked = Grasp.begin, []

    def slowly(model, seen):
        asked.append(seen)
        time.sleep(0.2)
        if fails and len(asked) > 1:
            raise NoWayError("a wall is there")
        return begin(model, seen)

    tree = retry(2, sequence("twice", Grasp("target", timeout=0.5), Pick("target", distance=0.1)))
    runner, costs = Runner(tree, pick_and_place.scene()), []
    grasp = next(node for node in tree.iterate() if node.name == "grasp target")
    monkeypatch.setattr(Grasp, "begin", slowly)
    runner.context.planner = Planner()
    recorder = RunRecorder(runner, "planned")

    def record(step):
        recorder(step)
        time.sleep(0.01)
        costs.append((grasp.plans, np.array(recorder._costs[-1])))

    result = runner.run(3, record=record)
    runner.context.planner.close()
    assert len(asked) == 2 and result.status == Status.FAILURE
    assert result.outcome.is_a(NO_WAY) == fails
    waiting = [cost for plans, cost in costs if plans]
    assert len(waiting) > 4 and np.isnan(waiting).all()
    assert np.isfinite(next(cost for plans, cost in costs if not plans)).sum() == 1
    last = max(k for k, (plans, _) in enumerate(costs) if plans)
    assert np.isnan(costs[last + 1][1]).all() == fails
