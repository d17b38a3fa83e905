"""Whatever stands where a file is expected, it is refused at once: pipes, devices, files without an end."""

import os
import signal

import pytest

from bt_tasksim.cli.convert import convert_files
from bt_tasksim.core.errors import InputError
from bt_tasksim.policy.files import load_card, load_policy
from bt_tasksim.robot.urdf_visuals import read_urdf
from bt_tasksim.scene.fixtures import load_fixture
from bt_tasksim.scene.scene_file import load_scene
from bt_tasksim.training.session import load_settings
from bt_tasksim.trees.xml_reader import load_tree, scene_of_tree

READERS = {
    "tree.xml": load_tree,
    "scene.xml": scene_of_tree,
    "card.json": lambda file: load_card(file.parent),
    "policy.safetensors": lambda file: load_policy(file.parent),
    "robot.urdf": read_urdf,
    "own.py": lambda file: convert_files([file]),
    "scene.yaml": load_scene,
    "fixture.yaml": lambda file: load_fixture(str(file)),
    "settings.yaml": load_settings,
}


def pipe(file):
    os.mkfifo(file)


def device(file):
    file.symlink_to("/dev/zero")


def endless(file):
    file.touch()
    os.truncate(file, 1 << 40)


@pytest.fixture
def at_once():
    """Ends what waits or reads for ever."""
    before = signal.signal(signal.SIGALRM, lambda *_: pytest.fail("it does not end"))
    signal.alarm(30)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize("odd", [pipe, device, endless])
@pytest.mark.parametrize("name", READERS)
def test_what_is_no_ordinary_file_or_too_large_is_refused(tmp_path, policy, at_once, name, odd):
    file = (policy("mine") if name in ("card.json", "policy.safetensors") else tmp_path) / name
    file.unlink(missing_ok=True)
    odd(file)
    with pytest.raises(InputError, match=r"not an ordinary file|is larger than|no fixture file"):
        READERS[name](file)
