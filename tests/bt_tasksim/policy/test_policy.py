"""Policies: the programmed one does what the concept says, a learned one its network; names are found."""

import subprocess
import sys
from statistics import NormalDist
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from draws import successes
from hypothesis import given
from hypothesis import strategies as st
from py_trees.common import Status

from bt_tasksim.concept.leaf import resolve_policy
from bt_tasksim.concept_nodes import Grasp, Pick, Place
from bt_tasksim.core.errors import InputError
from bt_tasksim.execution.runner import Runner
from bt_tasksim.policy.network import Network
from bt_tasksim.policy.policy import (
    TERMINATE,
    Action,
    LearnedPolicy,
    ProgrammedPolicy,
    done_share,
    split_action,
)
from bt_tasksim.report.write import write_run
from bt_tasksim.robot.description import load_robot
from bt_tasksim.trees import sequence
from bt_tasksim.trees.scenarios import pick_and_place
from tests.array_libraries import agree

pytestmark = pytest.mark.physical

PANDA, XARM = load_robot("panda"), load_robot("xarm7_ability")


class Model:
    actions = 2

    def programmed_motion(self, seen, memory):
        return np.stack([seen, memory], axis=-1)

    def done(self, seen, memory):
        return seen == memory

    def features(self, seen, memory):
        return seen.tool

    def decides(self, seen, memory):
        return memory


class Seen:
    def __init__(self, tool):
        self.tool = np.asarray(tool, float)


def _resolved(leaf, robot):
    return resolve_policy(leaf, robot)


def test_the_programmed_policy_is_the_concepts_own():
    action = ProgrammedPolicy().act(Model(), np.array([2.0, 2.0]), np.array([2.0, 1.0]))
    assert isinstance(action, Action)
    assert action.motion.tolist() == [[2.0, 2.0], [2.0, 1.0]] and action.terminate.tolist() == [True, False]


def test_a_learned_policy_clips_its_motion_and_its_last_output_says_done():
    motion, done = split_action(np.array([[3.0, -0.2, 0.6], [0.0, -9.0, 0.4]]))
    assert motion.tolist() == [[1.0, -0.2], [0.0, -1.0]] and done.tolist() == [True, False]


@given(st.lists(st.floats(-0.5, 1.5), min_size=1, max_size=40), st.floats(0.02, 0.5))
def test_decisions_come_to_done_where_noise_would_have_ended_half_of_all_episodes(signals, std):
    goes_on = np.cumprod([NormalDist(s, std).cdf(TERMINATE) for s in signals])
    shares = np.cumsum([float(done_share(np.float64(s), std)) for s in signals])
    assert np.all((shares >= 1.0) | (goes_on > 0.499)), "it is not done later"
    assert np.all((shares < 1.0) | (goes_on < 0.501)), "nor earlier"
    batch = done_share(np.array(signals), std)
    assert np.allclose(np.cumsum(batch), shares) and np.all((batch >= 0.0) & (batch <= 1.0 + 1e-12))


def test_a_signal_over_its_threshold_is_done_at_once_and_without_noise_nothing_else_is():
    for kind in (np.float32, np.float64):
        assert float(done_share(kind(TERMINATE), 0.1)) >= 1.0 <= float(done_share(kind(3.0), 0.1))
    assert bool(done_share(np.float64(0.51), 0.0)) and not bool(done_share(np.float64(0.5), 0.0))
    as_torch = done_share(torch.tensor([0.2, 0.45, 0.6]), 0.1)
    assert np.allclose(as_torch.numpy(), done_share(np.array([0.2, 0.45, 0.6]), 0.1), atol=1e-6)


def test_a_learned_policy_decides_only_where_the_concept_asks():
    net = Network(np.zeros(3), np.ones(3), [(np.eye(3), np.zeros(3))])
    policy = LearnedPolicy(net, "x@1")
    rows = np.array([[0.5, 0.25, 1.0], [0.5, 0.25, 1.0], [0.5, 0.25, 0.0]])
    asked = np.array([True, False, True])
    batch = policy.act(Model(), Seen(rows), asked)
    assert batch.motion.tolist() == [[0.5, 0.25], [0.0, 0.0], [0.5, 0.25]]
    assert batch.terminate.tolist() == [True, False, False]
    for k in range(len(rows)):
        one = policy.act(Model(), Seen(rows[[k]]), asked[[k]])
        assert np.array_equal(one.motion, batch.motion[[k]])
        assert np.array_equal(one.terminate, batch.terminate[[k]])


def test_every_library_and_device_decides_the_same():
    rng = np.random.default_rng(0)
    net = Network(np.zeros(3), np.ones(3), [(np.eye(3), np.zeros(3))], 0.2)
    asked = rng.random(65) < 0.5

    def decided(rows, asked):
        return LearnedPolicy(net, "x@1").act(Model(), SimpleNamespace(tool=rows), asked)

    found = agree(decided, rng.normal(size=(65, 3)), asked, close=1e-5, single_close=1e-5)
    assert (found.motion == 0.0).all(axis=1).tolist() == (~asked).tolist()
    agree(decided, rng.normal(size=(65, 3)), asked & False)
    agree(lambda out: split_action(out), rng.normal(size=(65, 3)))


# ---- names ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [None, "", "programmed"])
@pytest.mark.parametrize("concept", [Grasp, Pick])
@pytest.mark.parametrize("pins", [None, {"grasp": {"panda": "programmed"}}])
def test_where_no_other_is_pinned_the_programmed_policy_decides(shipped, pins, name, concept):
    shipped("one", pins=pins)
    policy = _resolved(concept("cup", policy=name), PANDA)
    assert isinstance(policy, ProgrammedPolicy) and policy.name == policy.source == "programmed"


def test_a_policy_is_named_by_its_folder(policy, shipped, monkeypatch):
    folder = policy("mine")
    found = _resolved(Grasp("cup", policy=str(folder)), PANDA)
    assert isinstance(found, LearnedPolicy) and found.source == str(folder)
    name, hash = found.name.split("@")
    assert name == "mine" and len(hash) == 12
    monkeypatch.chdir(folder)
    assert _resolved(Grasp("cup", policy="."), PANDA).name == found.name
    assert _resolved(Grasp("cup", policy="../mine/"), PANDA).source == str(folder)


def test_a_pinned_policy_is_taken_on_its_robot_alone(shipped):
    shipped("grasp-one", pins={"grasp": {"panda": "grasp-one"}})
    found = _resolved(Grasp("cup"), PANDA)
    assert found.name.startswith("grasp-one@") and found.source == "grasp-one"
    assert _resolved(Grasp("cup", policy="grasp-one"), PANDA).name == found.name
    for leaf, robot in (
        (Grasp("cup"), XARM),
        (Pick("cup"), PANDA),
        (Grasp("cup", policy="programmed"), PANDA),
    ):
        assert _resolved(leaf, robot).name == "programmed"


def test_a_shipped_name_comes_before_a_folder(shipped, policy, monkeypatch, tmp_path):
    shipped("same", steps=1)
    local = policy("same", steps=2)
    monkeypatch.chdir(tmp_path)
    assert _resolved(Grasp("cup", policy="same"), PANDA).source == "same"
    assert _resolved(Grasp("cup", policy="./same"), PANDA).source == str(local)


@pytest.mark.parametrize(
    ("name", "sentence"),
    [
        ("programed", r"leaf 'grasp cup': no policy 'programed'; did you mean 'programmed'\?"),
        ("grasp-two", r"no policy 'grasp-two'; did you mean 'grasp-one'\?"),
        ("runs/by-hnd", "there is no policy folder 'runs/by-hnd'; none is known"),
        ("{tmp}/by-hnd", "there is no policy folder '.*/by-hnd'; did you mean 'by-hand'"),
        ("{tmp}/by-hand/card.json", "card.json' is a file; a policy is a folder"),
        ("{tmp}", "has no card.json"),
    ],
)
def test_an_unknown_policy_is_one_sentence(shipped, policy, tmp_path, name, sentence):
    shipped("grasp-one")
    policy("by-hand")
    with pytest.raises(InputError, match=sentence):
        _resolved(Grasp("cup", policy=name.format(tmp=tmp_path)), PANDA)


@pytest.mark.parametrize("named", ["grasp-mine", "."])
@pytest.mark.parametrize("ended", [False, True])
def test_a_policy_whose_training_was_interrupted(policy, tmp_path, monkeypatch, named, ended):
    """Named by its own folder, or by that of a training of several nodes."""
    monkeypatch.chdir(tmp_path)
    beside = tmp_path / "runs" / "grasp-mine.training"
    beside.mkdir(parents=True)
    (beside / "checkpoint.safetensors").touch()
    if ended:
        policy("runs/grasp-mine")
    name = "runs" if named == "." else f"runs/{named}"
    if ended and named != ".":
        assert _resolved(Grasp("cup", policy=name), PANDA).source == str(tmp_path / name)
        return
    with pytest.raises(InputError) as error:
        _resolved(Grasp("cup", policy=name), PANDA)
    sentence = str(error.value)
    for word in ("interrupted", "grasp-mine.training", "--resume"):
        assert (word in sentence) != ended, sentence


@pytest.mark.parametrize(
    ("leaf", "robot", "sentence"),
    [
        (Pick, PANDA, "leaf 'pick cup': policy '.*' is for the concept 'grasp', not for 'pick'"),
        (Grasp, XARM, "leaf 'grasp cup': policy '.*' is for the robot 'panda', not for 'xarm7_ability'"),
    ],
)
def test_a_policy_for_something_else(policy, leaf, robot, sentence):
    with pytest.raises(InputError, match=sentence):
        _resolved(leaf("cup", policy=str(policy())), robot)


def test_a_policy_of_an_older_layout(policy, monkeypatch):
    folder = policy()
    now = {**Grasp.layout(PANDA), "smell": 1}
    monkeypatch.setattr(Grasp, "layout", classmethod(lambda cls, robot: now))
    with pytest.raises(InputError, match="the concept's feature 'smell' is none of its own; train it again"):
        _resolved(Grasp("cup", policy=str(folder)), PANDA)


# ---- in a tree --------------------------------------------------------------------------------------------


def test_results_name_the_policy_of_each_leaf(toy, act):
    stage = toy(act("move"))
    configuration = stage.runner.scene.sample(0)
    result = stage.runner.finish(configuration, stage.world.model)
    assert result.policies == {"move": "programmed"}


def test_a_wrong_policy_is_refused_before_anything_runs(policy, toy):
    with pytest.raises(InputError, match="leaf 'grasp cup': policy"):
        toy(sequence("t", Grasp("cup"), Grasp("cup", policy=str(policy("xarm", robot="xarm7_ability")))))


def test_a_learned_policy_runs_in_physics_and_is_named(policy, tmp_path):
    def build(name):
        return sequence("s", Grasp("target", policy=name), Pick("target"), Place("target", on="goal"))

    scene, folder = pick_and_place.scene(), policy("mine")

    def run(seed):
        return write_run(tmp_path / f"run {seed}", Runner(build(str(folder)), scene), seed)[0]

    # The network by hand does nothing but say "done", and the grasp's reference motion is enough here.
    learned = successes(run, range(3, 8), wanted=lambda r: r.status == Status.SUCCESS)[0]
    assert learned.policies["grasp target"].startswith("mine@")
    assert learned.policies["pick target"] == "programmed"
    assert learned.verdict is not None and learned.verdict.position_error < 0.03
    assert learned.policies["grasp target"] in (tmp_path / f"run {learned.seed}/report.html").read_text()


def test_a_run_with_a_learned_policy_needs_no_torch(policy, tmp_path):
    code = (
        "import sys\n"
        "class NoTorch:\n"
        "    def find_spec(self, name, *rest):\n"
        "        if name.split('.')[0] in ('torch', 'stable_baselines3', 'gymnasium'):\n"
        "            raise ImportError(name)\n"
        "sys.meta_path.insert(0, NoTorch())\n"
        "from bt_tasksim.robot.description import load_robot\n"
        "from bt_tasksim.concept.context import Context\n"
        "from concept_nodes import Grasp\n"
        f"leaf = Grasp('cup', policy={str(policy())!r})\n"
        "leaf.setup(context=Context(load_robot('panda')))\n"
        "print(leaf.policy_in_use.name.split('@')[0], leaf.policy_in_use.network.inputs)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["by-hand", str(sum(Grasp.layout(PANDA).values()))]
