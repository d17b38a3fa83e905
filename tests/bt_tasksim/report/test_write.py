"""A run's folder is whole or not there."""

import json
import resource
import signal

import cv2
import pytest
from draws import good_seed

from bt_tasksim.concept_nodes import TimePassed
from bt_tasksim.core.errors import InputError, LeafError, LostEngine, MachineError, Terminated
from bt_tasksim.demos_decomp.log_file import read_log
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.replay import replay
from bt_tasksim.execution.runner import Runner
from bt_tasksim.report import write
from bt_tasksim.report.report import NO_VIDEO
from bt_tasksim.report.video import Film
from bt_tasksim.report.write import FILES, filming_runner, write_run
from bt_tasksim.scene.scene import Scene
from bt_tasksim.trees import retry
from bt_tasksim.trees.scenarios import pick_and_place

pytestmark = pytest.mark.physical


@pytest.fixture(scope="module")
def runner():
    return Runner(pick_and_place.build(), pick_and_place.scene())


@pytest.fixture(scope="module")
def seed(runner):
    """One with which the run succeeds."""
    return good_seed(runner.run, range(3, 6))


def names(folder):
    return sorted(p.name for p in folder.iterdir())


def test_without_a_video(runner, seed, tmp_path):
    result, files = write_run(tmp_path / "runs" / "one", runner, seed, scenario="pick_and_place")
    assert result.success and files.remarks == ()
    assert names(files.folder) == ["report.html", "result.json", "run.h5", "tree.svg"]
    assert set(files.paths) == set(names(files.folder))
    content = json.loads(files.paths["result.json"].read_text())
    wanted = (
        "status success reason why seed scenario robot engines perception policies control_steps sim_time"
    )
    assert set(wanted.split()) | {"verdict", "versions"} <= set(content)
    assert content["seed"] == seed and content["success"] is True
    assert files.paths["tree.svg"].read_text().count('data-status="SUCCESS"') == 6
    assert json.dumps(NO_VIDEO) in files.paths["report.html"].read_text()


def test_a_second_run_replaces_the_first(runner, tmp_path):
    write_run(tmp_path / "one", runner, 3)
    _, files = write_run(tmp_path / "one", runner, 4)
    assert json.loads(files.paths["result.json"].read_text())["seed"] == 4
    assert names(tmp_path) == ["one"]


def test_a_folder_with_other_things_is_refused_before_the_run(runner, tmp_path, monkeypatch):
    (tmp_path / "one").mkdir()
    (tmp_path / "one" / "thesis.tex").write_text("mine")
    monkeypatch.setattr(runner, "run", None)
    with pytest.raises(InputError, match=r"thesis\.tex"):
        write_run(tmp_path / "one", runner, 3)


@pytest.mark.parametrize("kind", [KeyboardInterrupt, Terminated])
def test_an_interrupted_run_leaves_its_log(runner, tmp_path, kind):
    def watch(step):
        if step.observation.time > 1:
            raise kind

    with pytest.raises(kind, match=r"what was run is in .*one"):
        write_run(tmp_path / "runs" / "one", runner, 3, watch=watch)
    assert names(tmp_path / "runs" / "one") == ["report.html", "result.json", "run.h5", "tree.svg"]
    told = json.loads((tmp_path / "runs/one/result.json").read_text())
    assert (told["status"], told["reason"], told["success"]) == ("INVALID", "run_interrupted", False)
    log = read_log(tmp_path / "runs/one/run.h5")
    assert log.source == "simulation" and log.demonstrations[0].time[-1] > 1
    found = replay(tmp_path / "runs/one")
    assert found.differences == {} and "the repeated run goes on" in found.why


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (LeafError("leaf 'x' raised KeyError: 'y'"), "leaf_raised"),
        (LostEngine("the bridge has gone"), "machine_failed"),
    ],
)
def test_a_run_that_an_error_ends_leaves_its_log(runner, tmp_path, error, reason):
    """On a robot, what led to it happens once."""

    def watch(step):
        if step.observation.time > 1:
            raise error

    said = f"^{error}; what was run is in .*one$"
    with pytest.raises(type(error), match=said) as caught:
        write_run(tmp_path / "runs" / "one", runner, 3, watch=watch)
    assert caught.value is error
    assert names(tmp_path / "runs" / "one") == ["report.html", "result.json", "run.h5", "tree.svg"]
    told = json.loads((tmp_path / "runs/one/result.json").read_text())
    assert (told["status"], told["reason"], told["success"]) == ("INVALID", reason, False)
    assert told["why"] in str(error)
    assert replay(tmp_path / "runs/one").differences == {}


def test_a_run_that_is_interrupted_before_it_begins_leaves_nothing(runner, tmp_path):
    def watch(step):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_run(tmp_path / "runs" / "one", runner, 3, watch=watch)
    assert names(tmp_path) == []


@pytest.mark.parametrize("name", FILES)
def test_a_folder_of_a_files_name_is_refused_before_the_run(runner, tmp_path, monkeypatch, name):
    (tmp_path / "one" / name).mkdir(parents=True)
    (tmp_path / "one" / name / "thesis.tex").write_text("mine")
    monkeypatch.setattr(runner, "run", None)
    with pytest.raises(InputError, match="it holds other things, such as 'a folder named"):
        write_run(tmp_path / "one", runner, 3)
    assert (tmp_path / "one" / name / "thesis.tex").read_text() == "mine"


def test_full_disk(runner, tmp_path):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (8192, before[1]))
        with pytest.raises(MachineError) as caught:
            write_run(tmp_path / "one", runner, 3)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    assert (
        str(caught.value) == f"cannot write '{tmp_path}/one/report.html': File too large; nothing was written"
    )
    assert names(tmp_path) == []


def test_a_run_that_the_log_cannot_hold_is_written_without(tmp_path):
    runner = Runner(retry(30, TimePassed(0.5)), Scene())
    _, files = write_run(tmp_path / "one", runner, 0)
    assert "run.h5" not in files.paths and "report.html" in files.paths
    (remark,) = files.remarks
    assert remark.startswith("No run.h5: ") and "no objects" in remark and str(tmp_path) not in remark


def test_no_rendering_device(tmp_path, monkeypatch):
    made = []

    def build(tree, scene, options, longest):
        made.append(options.rendering)
        if options.rendering:
            raise MachineError("SAPIEN finds no Vulkan device")
        return Runner(tree, scene, options, longest=longest)

    monkeypatch.setattr(write, "Runner", build)
    runner, why = filming_runner(pick_and_place.build(), pick_and_place.scene(), EngineOptions())
    assert made == [True, False] and why == "No video: SAPIEN finds no Vulkan device."
    _, files = write_run(tmp_path / "one", runner, 3, no_video=why)
    assert files.remarks == (why,)
    assert why in files.paths["report.html"].read_text()


def test_filmed(tmp_path):
    try:
        runner, why = filming_runner(pick_and_place.build(), pick_and_place.scene())
        if why:
            pytest.skip(why)
        runner.longest = 0.5
        _, files = write_run(tmp_path / "one", runner, 3, film=Film("scene", (320, 180), fps=4))
    except MachineError as error:
        pytest.skip(f"no pictures on this machine: {error}")
    assert names(files.folder) == sorted(write.FILES) and files.remarks == ()
    assert files.paths["run.mp4"].stat().st_size > 5000
    film = cv2.VideoCapture(str(files.paths["run.mp4"]))
    assert (film.get(cv2.CAP_PROP_FRAME_WIDTH), film.get(cv2.CAP_PROP_FRAME_HEIGHT)) == (320, 180)
    assert film.get(cv2.CAP_PROP_FPS) == pytest.approx(4)
    assert files.paths["report.html"].stat().st_size > files.paths["run.mp4"].stat().st_size
