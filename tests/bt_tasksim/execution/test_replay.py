"""A recorded run, run again."""

import dataclasses
import json

import numpy as np
import pytest

from bt_tasksim.errors import InputError
from bt_tasksim.replay import replay
from bt_tasksim.report.run_log import RunRecorder, read_text
from bt_tasksim.report.write import write_run
from bt_tasksim.resources import asset
from bt_tasksim.runner import Runner
from demos_decomp.log_file import read_log, write_log
from trees.scenarios import pick_and_place, shelf_to_shelf


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("runs") / "one"
    write_run(path, Runner(pick_and_place.build(), pick_and_place.scene()), 5)
    return path


@pytest.fixture
def tampered(folder, tmp_path):
    """Writes the run's log again, changed."""

    def make(source=None, **extra):
        log = read_log(folder / "run.h5")
        (run,) = log.demonstrations
        run = dataclasses.replace(run, extra={**run.extra, **extra})
        write_log(
            tmp_path / "run.h5", dataclasses.replace(log, source=source or log.source, demonstrations=(run,))
        )
        return tmp_path / "run.h5"

    return make


@pytest.mark.parametrize("what", [".", "run.h5"])
def test_identical(folder, what):
    found = replay(folder / what)
    assert found.identical and found.time is None and found.differences == {} and found.changed == {}
    assert found.why.startswith("identical bit for bit over ")
    assert found.result.success


def test_identical_in_another_scene(tmp_path):
    write_run(tmp_path / "one", Runner(shelf_to_shelf.build(), shelf_to_shelf.scene()), 2)
    assert replay(tmp_path / "one").identical


def test_the_first_difference_is_found(folder, tampered):
    values = read_log(folder / "run.h5").demonstrations[0].extra["state/joint_position"].copy()
    values[40, 2] += 1e-12
    values[60, 2] += 1e-3
    found = replay(tampered(**{"state/joint_position": values}))
    assert not found.identical and found.time == pytest.approx(2.0)
    assert found.differences == {"state/joint_position": pytest.approx(1e-3)}
    assert found.why == (
        "different from 2.00 s on, at most by: joint positions 0.001 rad or m; versions are the same"
    )


def test_another_version_is_named(folder, tampered):
    extra = read_log(folder / "run.h5").demonstrations[0].extra
    about = json.loads(read_text(extra["run/about"]))
    now = about["versions"]["sapien"]
    about["versions"]["sapien"] = "2.0"
    about["options"]["noise"] = "none"
    found = replay(tampered(**{"run/about": np.array(json.dumps(about).encode())}))
    assert not found.identical and found.changed == {"sapien": ("2.0", now)}
    assert found.why.endswith(f"recorded with sapien 2.0, now {now}")
    assert found.differences["observations/objects"] > 1e-4


@pytest.fixture
def with_policy(shipped, tmp_path):
    """A run with a pinned policy that was taken out again."""
    shipped("one", pins={"grasp": {"panda": "one"}})
    result, _ = write_run(tmp_path / "run", Runner(pick_and_place.build(), pick_and_place.scene()), 3)
    assert result.policies["grasp target"].startswith("one@")
    return tmp_path / "run", shipped("one", pins={})


def test_the_recorded_policy_is_taken_whatever_is_pinned_now(with_policy):
    run, _ = with_policy
    found = replay(run)
    assert found.identical and found.changed == {}
    assert found.result.policies["grasp target"].startswith("one@")


def test_another_policy_of_the_same_name_is_named(with_policy):
    from bt_tasksim.policy_files import load_policy, save_policy

    run, home = with_policy
    network, card = load_policy(home / "one")
    network.layers[0][1][0] = 0.3  # to the side
    new = save_policy(home / "one", network, card)
    found = replay(run)
    assert not found.identical
    assert found.changed == {"policy of 'grasp target'": (f"one@{card.hash}", f"one@{new.hash}")}
    assert found.why.endswith(f"recorded with policy of 'grasp target' one@{card.hash}, now one@{new.hash}")


def test_a_policy_that_is_gone_is_one_sentence(with_policy):
    import shutil

    run, home = with_policy
    shutil.rmtree(home / "one")
    with pytest.raises(InputError, match="leaf 'grasp target': no policy 'one'"):
        replay(run)


def test_a_demonstration_is_no_run():
    shipped = next(asset("demonstrations").rglob("*.h5"))
    with pytest.raises(InputError, match="is a demonstration, not the log of a run"):
        replay(shipped)


def test_bad_input(folder, tampered, tmp_path):
    with pytest.raises(InputError, match="there is no file"):
        replay(tmp_path / "no")
    with pytest.raises(InputError, match=r"there is no file '.*run.h5'"):
        replay(tmp_path)
    with pytest.raises(InputError, match="was recorded on a robot"):
        replay(tampered(source="robot"))
    with pytest.raises(InputError, match="does not hold its tree"):
        replay(tampered(**{"run/tree": np.array(b" ")}))
    about = json.loads(read_text(read_log(folder / "run.h5").demonstrations[0].extra["run/about"]))
    about["options"]["gravity"] = 1
    with pytest.raises(InputError, match="option 'gravity'"):
        replay(tampered(**{"run/about": np.array(json.dumps(about).encode())}))


def test_a_tree_that_xml_cannot_hold_is_given(tmp_path):
    from py_trees.behaviours import Success

    from concept_nodes import Grasp
    from trees import sequence

    def build():
        return sequence("mixed", Success("plain"), Grasp("target"))

    runner = Runner(build(), pick_and_place.scene())
    recorder = RunRecorder(runner)
    recorder.write(tmp_path / "run.h5", runner.run(1, record=recorder))
    with pytest.raises(InputError, match="does not hold its tree"):
        replay(tmp_path)
    assert replay(tmp_path, build()).identical
