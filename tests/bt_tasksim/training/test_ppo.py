"""Training from the tree to the policy on disk: it learns, and it can be killed at any time."""

import dataclasses
import json
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors import safe_open
from toys import SCENE, Check, Raise, Unprogrammed

from bt_tasksim.errors import InputError
from bt_tasksim.policy_files import load_policy
from bt_tasksim.scene import Lesson
from bt_tasksim.training.config import TrainConfig
from bt_tasksim.training.decorator import Train
from bt_tasksim.training.ppo import CHECKPOINT, HISTORY, train
from trees import sequence

TINY = TrainConfig(
    steps=256, lanes=2, lane_steps=32, epochs=2, minibatch=32, hidden=(8,), evaluate_every=2,
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

        patch.setattr("bt_tasksim.runner.build_pipeline", lambda robot, options: toys.World())
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
import bt_tasksim.runner
bt_tasksim.runner.build_pipeline = lambda robot, options: toys.World()
from bt_tasksim.scene import Lesson
from bt_tasksim.training.config import TrainConfig
from bt_tasksim.training.decorator import Train
from bt_tasksim.training.ppo import train
from trees import sequence
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
    with pytest.raises(InputError, match="was written with other settings: resume with the same"):
        learn(out, dataclasses.replace(TINY, learning_rate=1e-3), resume=True)
    file = tmp_path / "p.training" / CHECKPOINT
    whole = file.read_bytes()
    for damaged in (whole[: len(whole) // 2], b"", whole.replace(b'\\"lesson\\"', b'\\"lessen\\"')):
        file.write_bytes(damaged)
        with pytest.raises(InputError, match=r"is damaged .*: remove it and train anew"):
            learn(out, resume=True)
    file.write_bytes(whole)
    learn(out, resume=True)


def test_what_cannot_be_trained_is_refused_before_it_begins(tmp_path):
    with pytest.raises(InputError, match="has no Train"):
        train(sequence("s", Raise()), SCENE)
    with pytest.raises(InputError, match="'steps' should be a positive whole number"):
        learn(None, steps=0)


def test_it_learns_what_pays(tmp_path):
    """A signal in time, before the tool has strayed: three centimetres are near enough."""
    config = TrainConfig(
        lanes=4, lane_steps=64, steps=4 * 64 * 10, epochs=8, minibatch=64, hidden=(16,), learning_rate=3e-3,
        terminate_bias=0.0, log_deviation=-0.7, evaluate_every=0, evaluation_draws=0, seed=1,
    )  # fmt: skip
    scene = dataclasses.replace(SCENE, lessons=(Lesson("easy", tolerance=3.0),))
    out = tmp_path / "p"
    easy = sequence("easy", Train(Raise(height=0.36)), Check(height=0.36, blind=True))
    train(easy, scene, out=out, config=config, workers=1)
    history = json.loads((tmp_path / "p.training" / HISTORY).read_text())
    first, last = (np.mean([row["return"] for row in rows]) for rows in (history[:2], history[-2:]))
    assert last > first + 0.3 and last > 0.6


@pytest.mark.parametrize(
    ("until", "share", "expected"),
    [(1.0, 0.25, "aabbcccc"), (1.0, 1.0, "aaaaaaaa"), (0.01, 1.0, "abcccccc")],
)
def test_a_lesson_ends_with_success_or_when_its_share_is_spent(tmp_path, until, share, expected):
    config = dataclasses.replace(
        TINY,
        steps=8 * 64,
        success_window=1,
        terminate_bias=0.4,
        lesson_share=share,
        evaluate_every=0,
        evaluation_draws=0,
    )
    tolerance = 1e-3 if until == 1.0 else 1e3
    lessons = tuple(Lesson(name, until=until, tolerance=tolerance) for name in "abc")
    scene = dataclasses.replace(SCENE, lessons=lessons)
    blind = sequence("blind", Train(Raise(height=0.36)), Check(height=0.36, blind=True))
    train(blind, scene, out=tmp_path / "p", config=config, workers=1)
    history = json.loads((tmp_path / "p.training" / HISTORY).read_text())
    assert "".join(row["lesson"] for row in history) == expected


def test_nodes_are_trained_in_order_each_with_the_others_as_they_are(tmp_path):
    """The first leaf has no policy but the learned one, without which the second would not be reached."""
    config = dataclasses.replace(TINY, terminate_bias=1.5, log_deviation=-2.0, steps=128, evaluate_every=0)

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
