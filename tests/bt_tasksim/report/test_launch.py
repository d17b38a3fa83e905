"""``run`` from Python: the folder it keeps is that of the command line."""

import json
import logging

import pytest

from bt_tasksim import Scene, run
from bt_tasksim.concept_nodes import TimePassed
from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.replay import replay
from bt_tasksim.execution.runner import Runner
from bt_tasksim.trees import retry
from bt_tasksim.trees.scenarios import pick_and_place

pytestmark = pytest.mark.physical


def test_the_folder_is_that_of_the_command_line(tmp_path):
    from bt_tasksim.cli.main import main

    result = run(pick_and_place.build(), pick_and_place.scene(), seed=3, out=tmp_path / "runs" / "python")
    main(["run", "pick_and_place", "--seed", "3", "--out", str(tmp_path / "runs" / "shell")])
    names = [sorted(p.name for p in (tmp_path / "runs" / way).iterdir()) for way in ("python", "shell")]
    assert names[0] == names[1] == ["report.html", "result.json", "run.h5", "tree.svg"]
    told = [json.loads((tmp_path / "runs" / way / "result.json").read_text()) for way in ("python", "shell")]
    for about in told:
        del about["wall_time"]
    assert told[0] == told[1] and told[0]["success"] is result.success
    assert replay(tmp_path / "runs" / "python").identical


def test_a_place_that_is_no_good_is_refused_before_the_run(tmp_path, monkeypatch):
    monkeypatch.setattr(Runner, "run", None)
    tree, scene = pick_and_place.build(), pick_and_place.scene()
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").touch()
    with pytest.raises(InputError, match=r"thesis\.tex"):
        run(tree, scene, out=tmp_path / "mine")
    with pytest.raises(InputError, match="does not exist"):
        run(tree, scene, out=tmp_path / "new", video=tmp_path / "gone" / "a.mp4")
    with pytest.raises(InputError, match=r"\.mp4"):
        run(tree, scene, out=tmp_path / "new", video=tmp_path / "a.avi")
    with pytest.raises(InputError, match="out="):
        run(tree, scene, video=True)
    with pytest.raises(InputError, match="noise"):
        run(tree, scene, options=EngineOptions(), noise="none")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["mine"]


@pytest.mark.parametrize(("wrong", "right"), [("nosie", "noise"), ("polices", "policy"), ("sead", "seed")])
def test_an_option_that_there_is_not(wrong, right):
    with pytest.raises(InputError, match=rf"unknown option '{wrong}'; did you mean .*'{right}'"):
        run(pick_and_place.build(), pick_and_place.scene(), **{wrong: "none"})


def test_a_policy_goes_over_the_trees_own(monkeypatch):
    monkeypatch.setattr(
        Runner,
        "run",
        lambda self, seed: {n.name: n.policy for n in self.tree.iterate() if hasattr(n, "policy")},
    )
    tree, scene = pick_and_place.build(), pick_and_place.scene()
    assert run(tree, scene, policy={"grasp": "programmed"})["grasp target"] == "programmed"
    with pytest.raises(InputError, match=r"'grsp'.*did you mean 'grasp'"):
        run(pick_and_place.build(), scene, policy={"grsp": "programmed"})


def test_what_could_not_be_written_is_said(tmp_path, caplog):
    with caplog.at_level(logging.WARNING):
        run(retry(30, TimePassed(0.5)), Scene(), out=tmp_path / "one")
    assert "No run.h5" in caplog.text and (tmp_path / "one" / "report.html").exists()


def test_filmed(tmp_path):
    def filmed(**places):
        try:
            return run(retry(5, TimePassed(0.2)), Scene(), **places)
        except MachineError as error:
            pytest.skip(f"no pictures on this machine: {error}")

    filmed(out=tmp_path / "one", video=True)
    assert (tmp_path / "one" / "run.mp4").stat().st_size > 1000
    filmed(out=tmp_path / "two", video=tmp_path / "two.mp4", options=EngineOptions(noise="none"))
    assert (tmp_path / "two.mp4").read_bytes() == (tmp_path / "two" / "run.mp4").read_bytes()
