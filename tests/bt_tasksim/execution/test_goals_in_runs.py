"""Goals in runs: things that stand on things stay there, goals that hold once, and what results say."""

import json

import numpy as np
import pytest
from py_trees.common import Status

from bt_tasksim.cli.main import main
from bt_tasksim.concept_nodes import Grasp, Pick, Release, Wait
from bt_tasksim.execution.batch_runner import BatchRunner
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.replay import replay
from bt_tasksim.execution.run_log import RunRecorder, about
from bt_tasksim.execution.runner import Runner
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import FixtureSpec, Goal, ObjectSpec
from bt_tasksim.scene.success import NO_GOAL
from bt_tasksim.training.evaluation_outcomes import EpisodeOutcome
from bt_tasksim.trees import sequence

pytestmark = pytest.mark.physical
CUBE = ((0.05,) * 3,) * 2
TREE = '<root BTCPP_format="4"><BehaviorTree ID="a"><Wait duration="0.2"/></BehaviorTree></root>'


def waiting():
    return sequence("wait", Wait(0.4))


def stands_still(final):
    shift = final.pose("pea")[:3] - final.start("pea")[:3]
    return bool(np.linalg.norm(shift) < 0.005), f"pea moved {1000 * np.linalg.norm(shift):.1f} mm"


STACKED = Scene(
    fixtures=["shelf", FixtureSpec("trash_bin", at=(0.35, -0.45)), "tray"],
    objects={
        "red": ObjectSpec(("cube",), on="blue", size=CUBE),
        "blue": ObjectSpec(("cube",), on="table", centre=(-0.05, 0.0), size=CUBE),
        "bowl": ObjectSpec(("cup",), inside="tray", size=((0.12, 0.12, 0.08),) * 2),
        "pea": ObjectSpec(("cube",), inside="bowl", size=((0.03,) * 3,) * 2),
        "near": ObjectSpec(("box",), beside="blue"),
        "can": ObjectSpec(("cylinder",), inside="trash_bin"),
    },
    goals=[
        Goal("red", on="blue"),
        Goal("pea", inside="bowl"),
        Goal("bowl", inside="tray"),
        Goal("near", beside="blue"),
        Goal("blue", on="table", relation="anywhere"),
        Goal("can", inside="trash_bin"),
        stands_still,
    ],
    name="stacked",
)


@pytest.mark.parametrize("engines", ["sapien", "mujoco"])
def test_what_is_drawn_on_in_and_beside_things_stays_there(engines):
    if engines == "mujoco":
        pytest.importorskip("mujoco")
    with Runner(waiting(), STACKED, EngineOptions(engines=engines)) as runner:
        for seed in range(3):
            result = runner.run(seed)
            assert result.success and result.judged, result.why
            assert len(result.verdict.placements) == 7


def lifting():
    return sequence(
        "up and down", Grasp("cube"), Pick("cube", distance=0.06), Wait(0.3), Release("cube"), Wait(0.5)
    )


LIFTED = Scene(
    objects={"cube": ObjectSpec(("cube",), on="table", area=(0.02, 0.02))},
    goals=[
        Goal("cube", relation="lifted", height=0.06, when="once"),
        Goal("cube", on="table", relation="anywhere"),
    ],
)
AT_THE_END = Scene(objects=LIFTED.objects, goals=[Goal("cube", relation="lifted", height=0.06)])


def test_a_goal_that_holds_once_is_seen_in_the_run():
    with Runner(lifting(), LIFTED) as runner:
        result = runner.run(1)
    once, end = result.verdict.placements
    assert result.success, result.why
    assert once.reached and end.reached and 1.0 < once.time < result.sim_time
    with Runner(lifting(), AT_THE_END) as runner:
        assert runner.run(1).reason == "not_lifted"


def test_a_batch_sees_the_same_moments_as_a_run_alone():
    with BatchRunner(lifting, LIFTED, worlds=2) as runner:
        found = {seed: result.verdict.to_data() for seed, result in runner.run(range(3))}
    with Runner(lifting(), LIFTED) as runner:
        assert found == {seed: runner.run(seed).verdict.to_data() for seed in range(3)}


def test_without_goals_results_say_that_nothing_was_judged():
    scene = Scene(objects={"cube": "on table"})
    with Runner(waiting(), scene) as runner:
        result = runner.run(0)
        data = about(result, runner, "")
    assert result.status == Status.SUCCESS and result.success and not result.judged
    assert result.outcome.is_a(NO_GOAL) and "nothing was judged" in str(result)
    assert data["judged"] is False and data["verdict"]["placements"] == []


@pytest.mark.parametrize(
    ("goals", "judged"), [("", False), ("goals: [{object: cup, on: table, relation: anywhere}]", True)]
)
def test_evaluate_says_whether_it_was_judged(capsys, tmp_path, monkeypatch, goals, judged):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tree.xml").write_text(TREE)
    (tmp_path / "room.yaml").write_text(f"objects: {{cup: on table}}\n{goals}\n")
    words = ["evaluate", "tree.xml", "--scene", "room.yaml", "--episodes", "2", "--json", "e.json"]
    assert main(words) == 0
    data = json.loads((tmp_path / "e.json").read_text())
    assert data["judged"] is judged and data["successes"] == 2
    assert ("nothing was judged" in capsys.readouterr().out) is not judged
    for episode in data["outcomes"]:
        assert episode["judged"] is judged
        assert [p["goal"] for p in episode["placements"]] == ["cup anywhere table"] * judged
        assert EpisodeOutcome.from_data(episode).to_data() == episode
        former = {k: v for k, v in episode.items() if k not in ("judged", "placements")}
        assert EpisodeOutcome.from_data(former).judged is judged


def test_a_replay_says_which_goal_it_could_not_judge(tmp_path):
    with Runner(waiting(), STACKED) as runner:
        recorder = RunRecorder(runner)
        result = runner.run(0, record=recorder)
        recorder.write(tmp_path / "run.h5", result)
    again = replay(tmp_path / "run.h5")
    assert again.identical and result.judged and not again.result.judged
    assert [p.reached for p in again.result.verdict.placements] == [True] * 6 + [None]
    assert "the goal 'stands_still' was not judged" in again.result.why
