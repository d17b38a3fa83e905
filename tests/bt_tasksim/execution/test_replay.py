"""A recorded run, run again."""

import dataclasses
import json
import socket

import numpy as np
import pytest

from bt_tasksim.core.errors import InputError
from bt_tasksim.core.resources import asset
from bt_tasksim.demos_decomp.log_file import read_log, write_log
from bt_tasksim.execution.replay import replay
from bt_tasksim.execution.run_log import RunRecorder, read_text
from bt_tasksim.execution.runner import Runner
from bt_tasksim.report.write import write_run
from bt_tasksim.trees.scenarios import pick_and_place, shelf_to_shelf
from bt_tasksim.trees.xml_reader import tree_from_xml


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("runs") / "one"
    write_run(path, Runner(pick_and_place.build(), pick_and_place.scene()), 5)
    return path


@pytest.fixture
def tampered(folder, tmp_path):
    """Writes the run's log again, changed."""

    def make(source=None, run=folder, fields=None, without=(), **extra):
        log, fields = read_log(run / "run.h5"), dict(fields or {})
        (found,) = log.demonstrations
        fields["notes"] = {**found.notes, **fields.get("notes", {})}
        fields["extra"] = {k: v for k, v in {**found.extra, **extra}.items() if k not in without}
        changed = dataclasses.replace(found, **fields)
        description = changed.notes["why"]
        log = dataclasses.replace(log, description=description, demonstrations=(changed,))
        write_log(tmp_path / "run.h5", dataclasses.replace(log, source=source or log.source))
        return tmp_path / "run.h5"

    return make


@pytest.mark.parametrize("what", [".", "run.h5"])
def test_identical(folder, what):
    found = replay(folder / what)
    assert found.identical and found.time is None and found.differences == {} and found.changed == {}
    assert found.why.startswith("identical bit for bit over ")
    assert found.result.success == json.loads((folder / "result.json").read_text())["success"]


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


def test_the_first_seconds_alone(folder, tampered):
    found = replay(folder, until=1.5)
    assert found.identical and found.why == "identical bit for bit over 30 ticks: the first 1.5 s"
    values = read_log(folder / "run.h5").demonstrations[0].extra["state/joint_position"].copy()
    values[20, 2] += 1e-3
    assert replay(tampered(**{"state/joint_position": values}), until=1.5).time == pytest.approx(1.0)
    with pytest.raises(InputError, match="the first 0 s has nothing to compare"):
        replay(folder, until=0.0)


@pytest.mark.parametrize("changes", [{"success": False}, {"success": False, "reason": "dropped"}])
def test_a_run_that_is_said_to_have_ended_otherwise_is_not_the_same(folder, tampered, changes):
    text = read_text(read_log(folder / "run.h5").demonstrations[0].extra["run/about"])
    about = {**json.loads(text), **changes}
    found = replay(tampered(**{"run/about": json.dumps(about)}))
    assert not found.identical and found.differences == {} and found.result.success
    said = f"fails ({changes['reason']})" if "reason" in changes else "fails"
    assert f"the log says that it {said}, and it is judged now: " in found.why
    assert replay(folder, until=1.5).identical, "how a run ends is no matter of its first seconds"


UNTITLED = [
    "commands/posture",
    "state/joint_effort",
    "observations/arm_position",
    "observations/contacts",
    "observations/tips",
    "tree/necessary_cost",
]


@pytest.mark.parametrize("name", UNTITLED)
def test_every_array_of_numbers_is_compared(folder, tampered, name):
    values = read_log(folder / "run.h5").demonstrations[0].extra[name].astype(float)
    values[30] = np.where(np.isnan(values[30]), 1.0, values[30] + 1.0)
    found = replay(tampered(**{name: values}))
    assert not found.identical and found.time == pytest.approx(1.5)
    assert list(found.differences) == [name] and f"at most by: {name}" in found.why


ASIDE = np.array([0.5, 0, 0, 0, 0, 0, 0])

OTHER_FIELDS = {
    "time": lambda run: {"time": run.time * 1.001},
    "hand/pose": lambda run: {"hand_pose": run.hand_pose + ASIDE},
    "hand/opening": lambda run: {"hand_opening": run.hand_opening + 1e-6},
    "objects/target/pose": lambda run: {
        "objects": {
            **run.objects,
            "target": dataclasses.replace(run.objects["target"], pose=run.objects["target"].pose + ASIDE),
        }
    },
}


@pytest.mark.parametrize("name", OTHER_FIELDS)
def test_what_a_demonstration_holds_of_a_run_is_compared(folder, tampered, name):
    run = read_log(folder / "run.h5").demonstrations[0]
    found = replay(tampered(fields=OTHER_FIELDS[name](run)))
    assert not found.identical and list(found.differences) == [name]


SAID = {
    "status": (lambda about: about.update(status="FAILURE"), "its status 'FAILURE', and now it is 'SUCCESS'"),
    "why": (lambda about: about.update(why="on the moon"), "its why 'on the moon', and now it is "),
    "judged": (lambda about: about.update(judged=False), "its judged False, and now it is True"),
    "verdict": (lambda about: about["verdict"].update(position_error=0.0), "its verdict.position_error 0.0"),
    "leaf": (lambda about: about.update(leaf="nobody"), "its leaf 'nobody', and now it is ''"),
    "robot": (lambda about: about.update(robot="ur5e"), "its robot 'ur5e', and now it is 'panda'"),
}


@pytest.mark.parametrize("name", SAID)
def test_all_that_a_log_says_of_its_run_is_compared(folder, tampered, name):
    change, said = SAID[name]
    found = replay(tampered(**changed(folder, "about", change)))
    assert not found.identical and found.differences == {}
    assert f"the log says of {said}" in found.why


ATTRIBUTES = {
    "success": {"notes": {"success": "no"}},
    "status": {"notes": {"status": "FAILURE"}},
    "why": {"notes": {"why": "on the moon"}},
    "task": {"task": "push"},
    "seed": {"seed": 99},
}


@pytest.mark.parametrize("name", ATTRIBUTES)
def test_attributes_that_say_something_else_are_told(folder, tampered, name):
    found = replay(tampered(fields=ATTRIBUTES[name]))
    assert not found.identical and f"the log says of its attribute.{name} " in found.why


def test_what_nodes_said_is_compared(folder, tampered):
    texts = read_log(folder / "run.h5").demonstrations[0].extra["messages/text"]
    found = replay(tampered(**{"messages/text": np.array([b"a lie"] * len(texts))}))
    assert not found.identical and "the log says of its messages.text[0] 'a lie', and now it is " in found.why


def test_what_a_log_lacks_is_not_compared(folder, tampered):
    def change(about):
        for name in ("status", "success", "judged", "reason", "why", "leaf", "outcome", "verdict"):
            del about[name]

    path = tampered(
        without=("commands/posture", "messages/text", "run/nodes"), **changed(folder, "about", change)
    )
    assert replay(path).identical


@pytest.fixture(scope="module")
def idle(tmp_path_factory):
    """A run whose tree succeeds and whose goal is missed."""
    path = tmp_path_factory.mktemp("runs") / "idle"
    scene = pick_and_place.scene()
    result, _ = write_run(path, Runner(tree_from_xml(WAIT, {}), scene), 5)
    assert result.status.name == "SUCCESS" and not result.success and result.judged
    return path


WAIT = '<root BTCPP_format="4"><BehaviorTree ID="wait"><Wait duration="0.5"/></BehaviorTree></root>'


def said_to_succeed(about):
    about.update(success=True, judged=True, reason="", why="all is well", outcome=None, verdict=None)


@pytest.mark.parametrize("functions", [[], [{"name": "mine"}]])
def test_a_failure_is_no_success_where_its_goals_were_taken_out(idle, tampered, functions):
    """Goals that are functions cannot be asked again, and this is said."""

    def change(world):
        world.update(goals=[], functions=functions)

    notes = {"success": "yes", "why": "all is well"}
    extra = changed(idle, "configuration", change) | changed(idle, "about", said_to_succeed)
    found = replay(tampered(run=idle, fields={"notes": notes}, **extra))
    assert found.identical == bool(functions)
    assert (
        "was not judged: it is a function" if functions else "the log says of its judged True"
    ) in found.why


def test_a_function_excuses_no_goal_that_is_missed(idle, tampered):
    extra = changed(idle, "configuration", lambda world: world.update(functions=[{"name": "mine"}]))
    found = replay(tampered(run=idle, **extra, **changed(idle, "about", said_to_succeed)))
    assert not found.identical and "the log says that it succeeds, and it is judged now: " in found.why


def test_a_run_with_a_goal_that_is_a_function_is_replayed(tmp_path):
    def stands(final):
        return False, "never good enough"

    scene = dataclasses.replace(pick_and_place.scene(), goals=(stands,))
    result, _ = write_run(tmp_path, Runner(pick_and_place.build(), scene), 5)
    assert not result.success
    found = replay(tmp_path)
    assert found.identical and "was not judged: it is a function" in found.why


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
    from bt_tasksim.policy.files import load_policy, save_policy

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
    with pytest.raises(InputError, match=r"leaf 'grasp target' ran with the policy 'one'.*--policy grasp="):
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


def changed(folder, name, change):
    """A part of the run in JSON, changed."""
    content = json.loads(read_text(read_log(folder / "run.h5").demonstrations[0].extra[f"run/{name}"]))
    change(content)
    return {f"run/{name}": np.array(json.dumps(content).encode())}


@pytest.fixture
def address():
    """An address at which nobody may knock."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(0.2)
        yield server.getsockname()[1]
        with pytest.raises(TimeoutError):
            server.accept()


@pytest.mark.parametrize("option", ["engines", "perception", "kinematics", "renderer"])
@pytest.mark.parametrize("kind", ["ros", "remote"])
def test_no_address_in_a_log_is_connected_to(folder, tampered, address, option, kind):
    name = f"{kind}:127.0.0.1:{address}"
    path = tampered(**changed(folder, "about", lambda about: about["options"].update({option: name})))
    if option == "renderer":  # nothing is drawn
        assert replay(path).identical
        return
    with pytest.raises(InputError, match=f"{option} '{name}'; only a run in which all engines"):
        replay(path)


def test_files_and_keys_in_a_log_count_for_nothing(folder, tampered, tmp_path):
    def change(about):
        about["options"] |= {"ros": "/etc/passwd", "key": "/etc/passwd", "real_time": True, "rendering": True}

    assert replay(tampered(**changed(folder, "about", change))).identical


@pytest.mark.parametrize("name", ["/etc/passwd", "../robots/panda", "mine.yaml", "", "panda.yaml"])
def test_only_a_robot_that_is_bundled_or_named_is_taken(folder, tampered, name):
    path = tampered(**changed(folder, "configuration", lambda world: world.update(robot=name)))
    with pytest.raises(InputError, match="is no bundled one; name it: --robot"):
        replay(path)
    assert replay(path, robot="panda").identical


def test_only_a_mesh_that_is_bundled_or_in_a_named_folder_is_taken(folder, tampered, tmp_path):
    def change(world):
        world["objects"][0] |= {"kind": "mesh", "mesh": "/etc/passwd"}

    path = tampered(**changed(folder, "configuration", change))
    with pytest.raises(InputError, match="name its folder: --objects"):
        replay(path)
    with pytest.raises(InputError, match="name its folder: --objects"):
        replay(path, objects=tmp_path)
    (tmp_path / "passwd").write_text("no mesh")
    with pytest.raises(InputError, match=r"mesh .*passwd.* cannot be read"):
        replay(path, objects=tmp_path)


def test_only_a_policy_that_is_bundled_or_named_is_taken(folder, tampered, tmp_path):
    path = tampered(
        **changed(folder, "policies", lambda leaves: leaves[0].update(source=str(tmp_path / "secret")))
    )
    with pytest.raises(InputError, match=r"ran with the policy .*secret.*--policy grasp=FOLDER"):
        replay(path)
    assert replay(path, policies=[("grasp", "programmed")]).identical
    with pytest.raises(InputError, match="the run has no leaf of this concept"):
        replay(path, policies=[("grip", "programmed")])


def test_a_policy_named_in_the_recorded_tree_is_no_exception(folder, tampered, tmp_path):
    tree = read_text(read_log(folder / "run.h5").demonstrations[0].extra["run/tree"])
    tree = tree.replace("<Grasp ", f'<Grasp policy="{tmp_path}" ', 1)
    path = tampered(**{"run/tree": np.array(tree.encode()), "run/policies": np.array(b"[]")})
    with pytest.raises(InputError, match="--policy grasp=FOLDER"):
        replay(path)


BROKEN = {
    "no JSON": {"run/about": np.array(b"{")},
    "deep": {"run/about": np.array(b"[" * 100_000)},
    "a list": {"run/about": np.array(b"[]")},
    "numbers": {"run/about": np.zeros(1)},
    "no tree": {"run/tree": np.array(b"<root/>")},
    "policies of nobody": {"run/policies": np.array(b'[{"node": 99, "source": "programmed"}]')},
    "policies in words": {"run/policies": np.array(b'[{"node": "one", "source": "programmed"}]')},
    "text compared": {"state/joint_position": np.array(b"none")},
    "too few rows": {"tree/status": np.zeros((3, 6))},
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_part_is_one_sentence(tampered, name):
    with pytest.raises(InputError, match=r"run\.h5"):
        replay(tampered(**BROKEN[name]))


WORLDS = {
    "mass": lambda world: world["objects"][0].update(mass=-1.0),
    "text": lambda world: world["objects"][0].update(pose="here"),
    "NaN": lambda world: world["objects"][0]["pose"].__setitem__(0, float("nan")),
    "far": lambda world: world["objects"][0]["pose"].__setitem__(0, 1e150),
    "frequency": lambda world: world.update(physics_frequency=10_000_000),
    "seed": lambda world: world.update(seed=-1),
    "unknown": lambda world: world.update(gravity=1.0),
    "objects": lambda world: world.update(objects=world["objects"] * 1000),
    "joints": lambda world: world.update(joint_position=[0.0] * 3, hand_start=[]),
}


@pytest.mark.parametrize("name", WORLDS)
def test_a_world_that_cannot_be_is_one_sentence(folder, tampered, name):
    with pytest.raises(InputError, match=r"run\.h5.*configuration"):
        replay(tampered(**changed(folder, "configuration", WORLDS[name])))


def test_a_repetition_ends_at_twice_the_recorded_time_or_5_s_later(folder, tampered):
    tree = '<root BTCPP_format="4"><BehaviorTree ID="wait"><Wait duration="1000"/></BehaviorTree></root>'
    path = tampered(
        **{"run/tree": np.array(tree.encode()), "run/policies": np.array(b"[]")},
        **changed(folder, "about", lambda about: about.update(longest=1e6)),
    )
    found = replay(path)
    recorded = read_log(path).demonstrations[0].time[-1]
    assert not found.identical and found.result.sim_time < recorded + max(recorded, 5.0) + 1.0


def test_a_tree_that_xml_cannot_hold_is_given(tmp_path):
    from py_trees.behaviours import Success

    from bt_tasksim.concept_nodes import Grasp
    from bt_tasksim.trees import sequence

    def build():
        return sequence("mixed", Success("plain"), Grasp("target"))

    runner = Runner(build(), pick_and_place.scene())
    recorder = RunRecorder(runner)
    recorder.write(tmp_path / "run.h5", runner.run(1, record=recorder))
    with pytest.raises(InputError, match="does not hold its tree"):
        replay(tmp_path)
    assert replay(tmp_path, build()).identical
