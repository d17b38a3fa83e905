"""ManiSkill's trajectory files are read, and their tasks recognised."""

from __future__ import annotations

import copy
import json
import shutil

import h5py
import numpy as np
import pytest

from bt_tasksim.core.errors import InputError
from bt_tasksim.demos_decomp.readers import maniskill, open_log
from bt_tasksim.demos_decomp.recognition import recognise
from tests.attacks import trajectories

EXPECTED = {
    "PickCube-v1": ["grasp", "pick", "bring"],
    "StackCube-v1": ["grasp", "pick", "bring", "place", "release"],
    "LiftPegUpright-v1": ["grasp", "pick", "bring", "place", "release"],
    "PushCube-v1": [],
    "PullCube-v1": [],
}


@pytest.fixture(params=EXPECTED)
def task(request):
    return request.param


@pytest.fixture
def log(recorded, task):
    return open_log(recorded / "maniskill" / task / "trajectory.h5")


def test_sequences(log, task):
    found = [recognise(shown) for shown in log.demonstrations]
    right = sum([t.concept for t in tasks] == EXPECTED[task] for tasks, _ in found)
    assert len(found) == 10
    assert right >= (9 if task == "PickCube-v1" else 10)
    for tasks, remarks in found:
        assert [t.concept for t in tasks] == EXPECTED[task] or remarks, "a miss must say why"


@pytest.mark.parametrize(("task", "start"), [("PickCube-v1", 19), ("StackCube-v1", 18)])
def test_hand_pose_is_that_of_the_simulator(recorded, log, task, start):
    """State observations hold the tool's pose in ManiSkill's world (after 9 + 9 joint values)."""
    with h5py.File(recorded / "maniskill" / task / "trajectory.h5") as file:
        seen = file["traj_0/obs"][:, start : start + 7]
    hand = log.demonstrations[0].hand_pose
    np.testing.assert_allclose(hand[:, :3], seen[:, :3] + [0.615, 0, 0], atol=2e-4)
    assert (np.abs(np.sum(hand[:, 3:] * seen[:, 3:], axis=1)) > 1 - 1e-5).all()


def test_frames_sizes_and_names(log, task):
    shown = log.demonstrations[0]
    assert log.source == "maniskill"
    assert (shown.task, shown.name) == (task, "000")
    assert np.diff(shown.time) == pytest.approx(0.05)
    assert set(shown.places) == {"table"}
    assert not any(name.startswith(("goal", "table")) for name in shown.objects)
    for track in shown.objects.values():
        assert 0.3 < track.pose[0, 0] < 0.8
        assert 0.01 < track.pose[0, 2] < 0.05
    assert 0.07 < shown.hand_opening[0] < 0.081


def test_a_trajectory_may_be_numbered_with_zeros(recorded, tmp_path):
    for suffix in ("h5", "json"):
        shutil.copy(recorded / "maniskill" / "PickCube-v1" / f"trajectory.{suffix}", tmp_path)
    file = tmp_path / "trajectory.h5"
    file.chmod(0o644)
    with h5py.File(file, "r+") as opened:
        opened.move("traj_2", "traj_02")
    assert [shown.name for shown in open_log(file).demonstrations] == [f"{k:03d}" for k in range(10)]


def test_stacked_onto_the_other_cube(recorded):
    for shown in open_log(recorded / "maniskill" / "StackCube-v1" / "trajectory.h5").demonstrations:
        tasks, _ = recognise(shown)
        assert tasks[1].parameters["off"] == "table"
        assert tasks[2].parameters["to"] == tasks[3].parameters["on"] == "cubeB"


def test_missing_or_wrong_files_are_refused(recorded, tmp_path):
    source = recorded / "maniskill" / "PickCube-v1"
    path = tmp_path / "trajectory.h5"
    shutil.copy(source / "trajectory.h5", path)
    path.chmod(0o644)
    with pytest.raises(InputError, match=r"needs 'trajectory\.json' beside it"):
        open_log(path)
    about = path.with_suffix(".json")
    about.write_text("{")
    with pytest.raises(InputError, match="not JSON"):
        open_log(path)
    about.write_text("{}")
    with pytest.raises(InputError, match="has no env_info and episodes"):
        open_log(path)
    about.write_text(json.dumps({"env_info": {"env_id": "PickCube-v1"}, "episodes": []}))
    assert len(open_log(path).demonstrations) == 10
    with h5py.File(path, "a") as file:
        file["traj_0/env_states/articulations"].move("panda", "panda_stick")
    with pytest.raises(InputError, match="shows no robot that is known here"):
        open_log(path)
    with h5py.File(path, "a") as file:
        del file["traj_0/env_states"]
    with pytest.raises(InputError, match="record the trajectories with env states"):
        open_log(path)
    path.write_bytes(path.read_bytes()[:5000])
    with pytest.raises(InputError):
        open_log(path)


def test_an_unknown_actor_is_as_high_as_it_rests():
    pose = np.array([[0.5, 0, 0.03, 1, 0, 0, 0]])
    np.testing.assert_allclose(maniskill._size("Other-v1", "thing", pose), [0.06] * 3)


def told(change):
    """What `trajectory.json` says, changed."""
    about = copy.deepcopy(trajectories.ABOUT)
    change(about)
    return about


@pytest.fixture
def made(tmp_path):
    """Writes a trajectory of two lifts, each part of it changed."""

    def write(states=lambda file: None, about=trajectories.ABOUT):
        path = tmp_path / "trajectory.h5"
        path.write_bytes(trajectories.trajectory())
        with h5py.File(path, "a") as file:
            states(file)
        path.with_suffix(".json").write_text(json.dumps(about))
        return path

    return write


def instead(name, values):
    def change(file):
        del file[name]
        file[name] = values

    return change


ROBOT, CUBE = "traj_0/env_states/articulations/panda", "traj_1/env_states/actors/cube"
STATES = {
    "text": instead(ROBOT, np.array([b"a"] * 60)),
    "one row": instead(ROBOT, np.zeros((1, 31))),
    "three dimensions": instead(ROBOT, np.zeros((60, 31, 1))),
    "columns": instead(ROBOT, np.zeros((60, 20))),
    "rows of an actor": instead(CUBE, np.zeros((59, 13))),
    "zero quaternions": instead(CUBE, np.zeros((60, 13))),
    "NaN": lambda file: file[ROBOT].__setitem__((3, 15), np.nan),
    "far": lambda file: file[CUBE].__setitem__((3, 0), 1e150),
    "a group": lambda file: (file.__delitem__(CUBE), file.create_group(CUBE), file.__delitem__(ROBOT)),
    "elsewhere": instead("traj_0/env_states/actors", h5py.ExternalLink("other.h5", "/")),
    "huge": lambda file: file["traj_0/env_states/actors"].create_dataset("big", (10**11,), "f8", chunks=(9,)),
}
TOLD = {
    "environment": lambda about: about["env_info"].update(env_id=["PickCube-v1"]),
    "rate in words": lambda about: about["env_info"]["env_kwargs"].update(control_freq="fast"),
    "rate": lambda about: about["env_info"]["env_kwargs"].update(control_freq=1e150),
    "settings": lambda about: about["env_info"].update(env_kwargs=[1]),
    "seed": lambda about: about["episodes"][0].update(episode_seed="seven"),
    "numbers": lambda about: about["episodes"][0].update(episode_id=[0]),
    "episodes": lambda about: about.update(episodes=3),
    "description": lambda about: about.update(source_desc={"a": 1}),
}


def test_a_sound_trajectory_is_read(made):
    assert [shown.name for shown in open_log(made()).demonstrations] == ["000", "001"]


@pytest.mark.parametrize("name", STATES)
def test_faulty_states_are_one_sentence(made, name):
    with pytest.raises(InputError, match=r"trajectory\.h5") as caught:
        open_log(made(STATES[name]))
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("name", TOLD)
def test_a_faulty_description_is_one_sentence(made, name):
    with pytest.raises(InputError, match=r"trajectory\.json") as caught:
        open_log(made(about=told(TOLD[name])))
    assert str(caught.value).isprintable()
