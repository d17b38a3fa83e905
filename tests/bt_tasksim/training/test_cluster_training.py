"""Training on a Ray cluster: the same policy, whatever the actors, and whoever is killed."""

import importlib.util
import json
import os
import socket
from pathlib import Path

import pytest
import toys
from safetensors import safe_open
from toys import SCENE, Check, Raise

from bt_tasksim.cli.main import main
from bt_tasksim.core.errors import BtTasksimWarning, InputError
from bt_tasksim.policy.files import CHECKPOINT
from bt_tasksim.training.collectors import DrawTask
from bt_tasksim.training.config import TrainConfig
from bt_tasksim.training.named_tree import NamedTree
from bt_tasksim.training.ppo import train
from bt_tasksim.training.record import HISTORY
from bt_tasksim.training.rollouts import TaskShare
from bt_tasksim.trees import sequence
from bt_tasksim.trees.nodes.train import Train

needs_ray = pytest.mark.skipif(
    importlib.util.find_spec("ray") is None, reason="Ray is not installed: pip install 'bt-tasksim[cluster]'"
)
TINY = TrainConfig(
    steps=384, n_envs=3, n_steps=32, epochs=2, minibatch=32, hidden=(8,), evaluate_every=2,
    evaluation_draws=5, checkpoint_every=1, seed=3,
)  # fmt: skip
TREE = """
import os
import signal
import sys

sys.path.insert(0, {here!r})
import toys

from bt_tasksim.trees import sequence
from bt_tasksim.trees.nodes.train import Train

HEIGHT = 0.45
if "ray" in sys.modules:  # an actor
    import bt_tasksim.training.episode_batch

    class Deadly(toys.Worlds):
        steps = 0

        def step(self, *arguments):
            Deadly.steps += 1
            marker = os.environ.get("ONE_ACTOR_DIES", "")
            if Deadly.steps == 20 and marker and not os.path.exists(marker):
                with open(marker, "w") as file:
                    file.write(str(len(self.each)))
                os.kill(os.getpid(), signal.SIGKILL)
            return super().step(*arguments)

    bt_tasksim.training.episode_batch.worlds_for = lambda robot, options, count, threads: Deadly(robot, count)
    HEIGHT = float(os.environ.get("HEIGHT_THERE", HEIGHT))


def build():
    return sequence("toy tree", Train(toys.Raise()), toys.Check(HEIGHT))


def scene():
    return toys.SCENE
"""


class Stop(Exception):
    """Ends a training from its report."""


@pytest.fixture
def named(tmp_path, monkeypatch, toy_engines):
    """The toy tree's file, by whose name actors find it; they have toy worlds, too."""
    monkeypatch.chdir(tmp_path)
    Path("toy_tree.py").write_text(TREE.format(here=str(Path(toys.__file__).parent)))
    return NamedTree("toy_tree.py", plugins=())


def learn(out, **settings):
    tree = sequence("toy tree", Train(Raise()), Check())
    return train(tree, SCENE, out=out, config=TINY, **settings)


def left(out):
    """Everything that a training has left, but for its times."""
    beside = Path(f"{out}.training")
    with safe_open(beside / CHECKPOINT, framework="np") as file:
        tensors = {k: file.get_tensor(k).tobytes() for k in file.keys()}  # noqa: SIM118
    rows = json.loads((beside / HISTORY).read_text())
    history = [{k: v for k, v in row.items() if k not in ("seconds", "rate")} for row in rows]
    return Path(out, "policy.safetensors").read_bytes(), tensors, history


def there():
    """All that is in the working folder, but for what Python compiles."""
    return [path for path in sorted(Path().rglob("*")) if "__pycache__" not in path.parts]


@needs_ray
def test_two_actors_learn_what_one_process_does_also_after_one_was_killed(named, monkeypatch):
    """Stopped in the middle, and gone on with by actors of which one dies in its first rollout."""
    learn("alone", workers=1)

    def stop(progress):
        if progress.steps[0] == TINY.steps // 2:
            raise Stop

    with pytest.raises(Stop):
        learn("p", workers=1, report=stop)
    monkeypatch.setenv("ONE_ACTOR_DIES", os.path.abspath("killed"))
    with pytest.warns(BtTasksimWarning, match="an actor on .* ended"):
        learn("p", workers=2, cluster="local", source=named, resume=True)
    assert Path("killed").read_text() == "4", "half of three environments, two episodes of each side by side"
    assert left("p") == left("alone")


@needs_ray
def test_an_actor_that_finds_another_tree_is_refused_and_nothing_is_written(named, monkeypatch, capsys):
    monkeypatch.setenv("HEIGHT_THERE", "0.44")
    before = there()
    assert main(["train", "toy_tree.py", "--cluster", "local", "--workers", "1", "--out", "p"]) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1
    assert "another tree" in err and "is found there by the name 'toy_tree.py'" in err
    assert there() == before


@needs_ray
def test_what_cannot_be_trained_on_a_cluster_is_one_sentence(named, capsys):
    with pytest.raises(InputError, match=r"actors of a cluster build the tree themselves: .*NamedTree\("):
        learn("p", cluster="local")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        nobody = f"127.0.0.1:{probe.getsockname()[1]}"
    before = there()
    for words, code, said in (
        (["--cluster", "ray://10.0.0.1"], 2, "a cluster is 'local' or HOST:PORT"),
        (["--cluster", nobody], 1, f"no Ray cluster answers at {nobody}"),
        (["--cluster", "local", "--engines", "remote:127.0.0.1:5555"], 2, "leave --cluster away"),
    ):
        capsys.readouterr()
        assert main(["train", "toy_tree.py", *words]) == code
        out, err = capsys.readouterr()
        assert out == "" and err.count("\n") == 1 and said in err
        assert there() == before


def test_where_ray_is_not_installed_it_says_what_to_do(named, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"pip install 'bt-tasksim\[cluster\]'"):
        learn("p", cluster="local", source=named)


def test_a_share_that_ends_every_actor_is_named_in_a_line():
    assert str(TaskShare([DrawTask({}, 1)])) == "a share of 1 environments or draws"
