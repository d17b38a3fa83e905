"""Training from the tree to the policy on disk: it learns, and it can be killed at any time."""

import dataclasses
import errno
import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import py_trees
import pytest
import torch
import toys
from safetensors import safe_open
from safetensors.numpy import save_file
from toys import SCENE, Check, Raise, Unprogrammed

from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.core.locks import LockedError
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.policy.files import CHECKPOINT, load_policy
from bt_tasksim.scene.scene import CurriculumStage
from bt_tasksim.training import subject
from bt_tasksim.training.checkpoint import read_checkpoint, write_checkpoint
from bt_tasksim.training.config import TrainConfig
from bt_tasksim.training.node_training import NodeTraining
from bt_tasksim.training.ppo import train
from bt_tasksim.training.record import HISTORY
from bt_tasksim.trees import sequence
from bt_tasksim.trees.nodes.train import Train

TINY = TrainConfig(
    steps=256, n_envs=2, n_steps=32, epochs=2, minibatch=32, hidden=(8,), evaluate_every=2,
    evaluation_draws=4, checkpoint_every=1, seed=3,
)  # fmt: skip


def tree():
    return sequence("toy tree", Train(Raise()), Check())


def learn(out, config=TINY, workers=1, **settings):
    return train(tree(), SCENE, out=out, config=config, workers=workers, **settings)


def weights(policy):
    return (policy / "policy.safetensors").read_bytes()


def checkpoint(out):
    """What a checkpoint says, and its numbers."""
    path = out.with_name(f"{out.name}.training") / CHECKPOINT
    with safe_open(path, framework="np") as file:
        return json.loads(file.metadata()["facts"]), {k: file.get_tensor(k).tobytes() for k in file.keys()}  # noqa: SIM118


class Stop(Exception):
    """Ends a training from its report."""


def stopped_after(rollouts):
    seen = []

    def report(progress):
        seen.append(progress)
        if len(seen) == rollouts:
            raise Stop

    return report


@pytest.fixture(autouse=True)
def in_toy_worlds(toy_engines):
    """Every training here is without physics; workers are forked and have it too."""


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """A whole training."""
    out = tmp_path_factory.mktemp("undisturbed") / "policy"
    with pytest.MonkeyPatch.context() as patch:
        import toys

        toys.instead_of_engines(patch.setattr)
        seen = []
        learn(out, report=seen.append)
    return out, seen


def test_what_is_left_on_disk(undisturbed):
    out, seen = undisturbed
    network, card = load_policy(out)
    assert (network.inputs, network.outputs) == (3, 2)
    assert card.concept == "raise" and card.features == (("missing", 1), ("cup", 2)) and card.actions == 1
    assert card.tree == "toy tree" and card.scene == "toy" and card.steps == 256 and card.seeds == (3,)
    assert TrainConfig.from_dict(card.configuration["training"]) == TINY
    beside = out.with_name("policy.training")
    history = json.loads((beside / HISTORY).read_text())
    assert [row["steps"] for row in history] == [64, 128, 192, 256]
    assert ["held_apart" in row for row in history] == [False, True, False, True]
    assert list(beside.glob("events.out.tfevents.*"))
    assert [p.steps for p in seen] == [(64, 256), (128, 256), (192, 256), (256, 256)]
    assert seen[-1].train == "train raise 0.45" and seen[-1].held_apart[1] == 4 and seen[-1].seconds_left == 0


def test_workers_change_nothing_and_global_state_is_left_alone(undisturbed, tmp_path):
    torch.manual_seed(1)
    np.random.seed(1)  # noqa: NPY002
    before = torch.random.get_rng_state().tolist(), np.random.get_state()[1].tolist()  # noqa: NPY002
    policy = learn(tmp_path / "p", workers=2)
    assert weights(tmp_path / "p") == weights(undisturbed[0])
    assert policy.name.startswith("p@")
    assert (torch.random.get_rng_state().tolist(), np.random.get_state()[1].tolist()) == before  # noqa: NPY002


@pytest.mark.parametrize("rollouts", [1, 2, 3])
def test_a_stopped_training_goes_on_bit_for_bit(undisturbed, tmp_path, rollouts):
    out = tmp_path / "p"
    with pytest.raises(Stop):
        learn(out, report=stopped_after(rollouts))
    assert not out.exists() and checkpoint(out)[0]["iteration"] == rollouts
    learn(out, resume=True)
    assert weights(out) == weights(undisturbed[0])
    assert checkpoint(out)[1] == checkpoint(undisturbed[0])[1]
    assert len(json.loads((tmp_path / "p.training" / HISTORY).read_text())) == 4


def test_a_finished_training_may_be_resumed(undisturbed, tmp_path):
    out = tmp_path / "p"
    learn(out)
    learn(out, resume=True)
    assert weights(out) == weights(undisturbed[0])


KILLED = """
import sys
sys.path.insert(0, {here!r})
import toys
import bt_tasksim.execution.runner
import bt_tasksim.training.episode_batch
bt_tasksim.execution.runner.build_pipeline = lambda robot, options: toys.World()
bt_tasksim.training.episode_batch.worlds_for = toys.toy_worlds
from bt_tasksim.scene.scene import CurriculumStage
from bt_tasksim.training.config import TrainConfig
from bt_tasksim.trees.nodes.train import Train
from bt_tasksim.training.node_training import NodeTraining
from bt_tasksim.training.ppo import train
from bt_tasksim.trees import sequence
import json
tree = sequence("toy tree", Train(toys.Raise()), toys.Check())
config = TrainConfig.from_dict(json.loads({config!r}))
train(tree, toys.SCENE, out={out!r}, config=config, workers=2, report=lambda p: print(p.steps[0], flush=True))
"""


def test_a_killed_training_loses_one_interval_at_most(tmp_path):
    config = dataclasses.replace(
        TINY, steps=64 * 40, checkpoint_every=2, evaluate_every=0, evaluation_draws=0
    )
    out, whole = tmp_path / "p", tmp_path / "whole"
    text = KILLED.format(here=str(Path(__file__).parent), config=json.dumps(config.to_dict()), out=str(out))
    process = subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE, text=True)
    done = [int(process.stdout.readline()) for _ in range(3)]
    time.sleep(0.3 * random.random())
    process.send_signal(signal.SIGKILL)
    done += [int(line) for line in process.stdout.read().split()]
    process.wait()
    process.stdout.close()
    rollouts = len(done)
    assert rollouts < 40, "it was killed in the middle"
    assert rollouts - 1 <= checkpoint(out)[0]["iteration"] <= rollouts + 1
    learn(out, config, resume=True)
    learn(whole, config)
    assert weights(out) == weights(whole)


def test_what_cannot_be_gone_on_with_is_one_sentence(tmp_path):
    out = tmp_path / "p"
    with pytest.raises(InputError, match=r"there is no checkpoint in '.*p.training' to go on from"):
        learn(out, resume=True)
    with pytest.raises(Stop):
        learn(out, report=stopped_after(1))
    with pytest.raises(InputError, match=r"there is a training in '.*p.training' already: go on with"):
        learn(out)
    with pytest.raises(InputError, match=r"other settings \(learning_rate 0.0004, now 0.001\): resume with"):
        learn(out, dataclasses.replace(TINY, learning_rate=1e-3), resume=True)
    paid = dataclasses.replace(TINY.reward, shaping=0.125)
    with pytest.raises(
        InputError, match=r"other settings \(reward\.shaping [\d.]+, now 0\.125\): resume with"
    ):
        learn(out, dataclasses.replace(TINY, reward=paid), resume=True)
    file = tmp_path / "p.training" / CHECKPOINT
    whole = file.read_bytes()
    for damaged in (whole[: len(whole) // 2], b"", whole.replace(b'\\"stage\\"', b'\\"lessen\\"')):
        file.write_bytes(damaged)
        with pytest.raises(InputError, match=r"is damaged .*: remove it and train anew"):
            learn(out, resume=True)
    file.write_bytes(whole)
    learn(out, resume=True)


@pytest.fixture
def begun(tmp_path):
    """A training that was stopped after its first rollout: its policy's folder, and its checkpoint."""
    out = tmp_path / "p"
    with pytest.raises(Stop):
        learn(out, report=stopped_after(1))
    return out, tmp_path / "p.training" / CHECKPOINT


def test_another_tree_is_not_gone_on_with(begun):
    out, _ = begun
    longer = sequence("toy tree", Train(Raise()), Check(), Check(0.44))
    with pytest.raises(InputError, match="of a training with another tree: resume with the same"):
        train(longer, SCENE, out=out, config=TINY, workers=1, resume=True)


def test_another_scene_robot_or_noise_is_not_gone_on_with(begun):
    out, _ = begun
    objects = {name: dataclasses.replace(spec, mass=(0.5, 0.6)) for name, spec in SCENE.objects.items()}
    with pytest.raises(InputError, match="with another scene: resume"):
        train(
            tree(), dataclasses.replace(SCENE, objects=objects), out=out, config=TINY, workers=1, resume=True
        )
    with pytest.raises(InputError, match="with another robot: resume"):
        train(tree(), SCENE.with_robot("so100"), out=out, config=TINY, workers=1, resume=True)
    with pytest.raises(InputError, match="with another choice of engines: resume"):
        learn(out, resume=True, options=EngineOptions(noise="none"))


def test_other_code_of_the_leaves_is_not_gone_on_with(begun, monkeypatch):
    out, _ = begun
    edited = {Path(toys.__file__): "other"}
    usual = subject.code_hash
    monkeypatch.setattr(subject, "code_hash", lambda file: edited.get(Path(file)) or usual(file))
    with pytest.raises(InputError, match="of a training with another module toys: resume"):
        learn(out, resume=True)


def test_every_flipped_byte_of_a_checkpoint_is_noticed(begun):
    out, file = begun
    whole = file.read_bytes()
    places = np.random.default_rng(4).choice(len(whole), 60, replace=False)
    for place in [*places.tolist(), len(whole) - 3]:
        content = bytearray(whole)
        content[place] ^= 1 << (place % 8)
        file.write_bytes(content)
        with pytest.raises(InputError, match=r"checkpoint '.*' is damaged"):
            read_checkpoint(file)
    file.write_bytes(whole)
    learn(out, resume=True)


def test_a_checkpoint_of_another_network_is_one_sentence(begun):
    """Its hash is right: whoever wrote it meant it so."""
    out, file = begun
    tensors, facts = read_checkpoint(file)
    for change in (
        {"policy/action_net.bias": np.zeros(7, np.float32)},
        {"statistics/mean": np.zeros(1)},
        {"optimizer/999/step": np.zeros(1, np.float32)},
        {"optimizer/0/momentum": np.zeros(1, np.float32)},
        {"best/layer0.weight": np.zeros((2, 2), np.float32)},
        {"unknown": np.zeros(1)},
    ):
        write_checkpoint(file, {**tensors, **change}, facts)
        with pytest.raises(InputError, match="is damaged"):
            learn(out, resume=True)
    write_checkpoint(file, {k: v for k, v in tensors.items() if k != "policy/log_std"}, facts)
    with pytest.raises(InputError, match="'policy/log_std' is missing"):
        learn(out, resume=True)
    write_checkpoint(file, tensors, dataclasses.replace(facts, stage=5))
    with pytest.raises(InputError, match="there is no stage 5"):
        learn(out, resume=True)


def test_a_checkpoint_of_before_has_no_hash_and_is_gone_on_with(begun, undisturbed):
    out, file = begun
    with safe_open(file, framework="np") as opened:
        tensors = {k: opened.get_tensor(k) for k in opened.keys()}  # noqa: SIM118
        facts = json.loads(opened.metadata()["facts"])
    del facts["about"]
    save_file(tensors, file, metadata={"facts": json.dumps(facts)})
    learn(out, resume=True)
    assert weights(out) == weights(undisturbed[0])


def test_two_trainings_into_one_folder_do_not_run_at_once(tmp_path):
    config = dataclasses.replace(TINY, steps=64 * 4000, evaluate_every=0, evaluation_draws=0)
    out = tmp_path / "p"
    text = KILLED.format(here=str(Path(__file__).parent), config=json.dumps(config.to_dict()), out=str(out))
    process = subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout.readline()
        with pytest.raises(LockedError, match=r"another process is training into '.*p'"):
            learn(out)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
        process.stdout.close()
    learn(out, dataclasses.replace(config, steps=64 * (checkpoint(out)[0]["iteration"] + 1)), resume=True)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["p", "p.training"]


def test_a_diverging_training_is_one_sentence_and_leaves_the_last_checkpoint(tmp_path):
    out = tmp_path / "p"
    wild = dataclasses.replace(TINY, steps=64 * 50)
    for rate in ("learning_rate", "final_learning_rate"):
        object.__setattr__(wild, rate, 1e30)  # beyond what a settings file may ask for
    with pytest.raises(InputError, match="the training diverged in rollout"):
        learn(out, wild)
    file = tmp_path / "p.training" / CHECKPOINT
    if file.exists():
        read_checkpoint(file)
    assert not out.exists()


def test_a_full_disk_is_one_sentence_and_leaves_the_last_checkpoint(begun, monkeypatch):
    out, file = begun
    before = file.read_bytes()

    def full(_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(MachineError, match="No space left on device"):
        learn(out, resume=True)
    assert file.read_bytes() == before


def test_beside_a_behaviour_of_ones_own_it_is_trained_in_batches(tmp_path, caplog):
    """With what makes a tree; without it world by world, and it comes to the same."""

    def own():
        return sequence(
            "own", py_trees.behaviours.Success("a behaviour of one's own"), Train(Raise()), Check()
        )

    policies, most = [], []
    for name, build in (("alone", None), ("batch", own)):
        toys.Worlds.made.clear()
        train(own(), SCENE, out=tmp_path / name, config=TINY, workers=1, build=build)
        policies.append(weights(tmp_path / name))
        most.append(max((max(worlds.sizes) for worlds in toys.Worlds.made), default=1))
    assert policies[0] == policies[1] and most[0] == 1 < most[1]
    assert [record.getMessage().startswith("the episodes run one by one") for record in caplog.records].count(
        True
    ) == 1


def test_what_cannot_be_trained_is_refused_before_it_begins(tmp_path):
    with pytest.raises(InputError, match="has no Train"):
        train(sequence("s", Raise()), SCENE)
    with pytest.raises(InputError, match="'steps' should be at least 1"):
        learn(None, steps=0)


def test_it_learns_what_pays(tmp_path):
    """A signal in time, before the tool has strayed: three centimetres are near enough.

    In one of three trainings at least; all do that were tried, as long as they go on exploring.
    """
    assert any(learns(tmp_path, seed) for seed in (1, 2, 3))


def learns(tmp_path, seed):
    """Whether a training's return rises."""
    config = TrainConfig(
        n_envs=4, n_steps=64, steps=4 * 64 * 10, epochs=8, minibatch=64, hidden=(16,), learning_rate=3e-3,
        terminate_bias=-0.3, log_std=-0.7, final_log_std=-0.7, evaluate_every=0, evaluation_draws=0,
        seed=seed,
    )  # fmt: skip
    scene = dataclasses.replace(SCENE, stages=(CurriculumStage("easy", tolerance=3.0),))
    out = tmp_path / f"p{seed}"
    easy = sequence("easy", Train(Raise(height=0.36)), Check(height=0.36, blind=True))
    train(easy, scene, out=out, config=config, workers=1)
    history = json.loads((tmp_path / f"p{seed}.training" / HISTORY).read_text())
    first, last = (np.mean([row["return"] for row in rows]) for rows in (history[:2], history[-2:]))
    return last > first + 0.3 and last > 0.6


@pytest.mark.parametrize(
    ("until", "share", "expected"),
    [(1.0, 0.25, "aabbcccc"), (1.0, 1.0, "aaaaaaaa"), (0.01, 1.0, "abcccccc")],
)
def test_a_stage_ends_with_success_or_when_its_share_is_spent(tmp_path, until, share, expected):
    config = dataclasses.replace(
        TINY,
        steps=8 * 64,
        success_window=1,
        terminate_bias=0.4,
        stage_share=share,
        evaluate_every=0,
        evaluation_draws=0,
    )
    tolerance = 1e-3 if until == 1.0 else 1e3
    stages = tuple(CurriculumStage(name, until=until, tolerance=tolerance) for name in "abc")
    scene = dataclasses.replace(SCENE, stages=stages)
    blind = sequence("blind", Train(Raise(height=0.36)), Check(height=0.36, blind=True))
    train(blind, scene, out=tmp_path / "p", config=config, workers=1)
    history = json.loads((tmp_path / "p.training" / HISTORY).read_text())
    assert "".join(row["stage"] for row in history) == expected


def test_nodes_are_trained_in_order_each_with_the_others_as_they_are(tmp_path):
    """The first leaf has no policy but the learned one, without which the second would not be reached."""
    config = dataclasses.replace(TINY, terminate_bias=1.5, log_std=-2.0, steps=128, evaluate_every=0)

    def both():
        first, second = Unprogrammed(height=0.35, name="first"), Unprogrammed(height=0.35, name="second")
        return sequence("two", Train(first, "a"), Train(second, "b"))

    seen = []
    train(both(), SCENE, out=tmp_path / "p", config=config, workers=1, report=lambda p: seen.append(p.train))
    assert seen == ["a", "a", "b", "b"]
    forward = [weights(tmp_path / "p" / name) for name in "ab"]
    seen.clear()
    out = tmp_path / "q"
    first = train(
        both(), SCENE, out=out, config=config, workers=1, backward=True, report=lambda p: seen.append(p.train)
    )
    assert seen == ["a", "a", "b", "b", "b", "a"], "back from the last to the first"
    for name, before in zip("ab", forward, strict=True):
        network, card = load_policy(out / name)
        assert weights(out / name) != before
        old, _ = load_policy(tmp_path / "p" / name)
        rows = np.random.default_rng(0).normal(size=(20, 3)).astype(np.float32)
        # It was not learned anew.
        assert np.abs(network(rows) - old(rows)).max() < 0.3
        assert card.concept == "unprogrammed"
    assert first.name.startswith("a@")


def test_the_speed_leaves_evaluations_out(monkeypatch):
    """An evaluation takes long here: the time left tells, the decisions a second do not."""
    evaluate = NodeTraining._evaluate

    def slow(self, pool, learner):
        time.sleep(2.0)
        return evaluate(self, pool, learner)

    monkeypatch.setattr(NodeTraining, "_evaluate", slow)
    told = []
    learn(None, dataclasses.replace(TINY, steps=128, evaluate_every=1), report=told.append)
    assert [progress.rate > 64 / 2.0 for progress in told] == [True, True]
    assert told[0].seconds_left > 2.0
