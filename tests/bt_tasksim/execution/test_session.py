"""A run by hand is the run that `run` makes, and shows what is going on in between."""

from __future__ import annotations

import numpy as np
import pytest
from py_trees.behaviour import Behaviour
from py_trees.behaviours import Running
from py_trees.common import Status

from bt_tasksim import InputError, Runner, Scene, Session, run
from bt_tasksim.core.errors import LeafError
from bt_tasksim.engines.base import PhysicsEngine
from bt_tasksim.execution.runner import BROKEN_OFF
from concept_nodes import Grasp, Pick
from trees import sequence

SCENE = Scene(objects={"box": "on table"})


def tree():
    return sequence("grasp and pick", Grasp("box"), Pick("box", distance=0.05))


@pytest.fixture(scope="module")
def whole():
    return run(tree(), SCENE, seed=3)


def test_a_session_is_the_same_run_bit_for_bit(whole):
    seen = []
    with Session(tree(), SCENE, seed=3) as session:
        assert session.status == Status.INVALID and session.active is None and session.time == 0.0
        while session.step():
            seen.append((session.time, session.active.name, session.observation.tool_pose))
            assert session.status == Status.RUNNING
            assert session.command.tool is not None or session.command.hand is not None
        result = session.result
    assert not session.step(), "it is over"
    assert result.status == whole.status and result.success == whole.success
    assert result.control_steps == whole.control_steps == len(seen)
    for name in ("tool", "box"):
        np.testing.assert_array_equal(result.path(name), whole.path(name))
    leaves = list(dict.fromkeys(name for _, name, _ in seen))
    assert leaves == ["grasp box", "pick box"]
    assert session.feedback == session.active.outcome.sentence != "", "what the last leaf has to say"
    assert np.array_equal([t for t, *_ in seen], whole.times[1 : len(seen) + 1])


def test_a_path_ends_where_the_world_ends_and_a_reset_begins_it_anew(whole):
    with Session(tree, SCENE, seed=4) as session:
        first = session.tree
        session.step()
        session.reset(seed=3)
        assert session.tree is not first, "what makes a tree makes a new one"
        while session.step():
            pass
        assert session.status == Status.SUCCESS and session.active.name == "pick box"
        np.testing.assert_array_equal(session.hidden.objects[0], session.result.poses["box"])
        np.testing.assert_array_equal(session.result.path("box"), whole.path("box"))
    lift = whole.path("box")[:, 2]
    assert lift[-1] - lift[0] > 0.03, "it was picked"
    assert whole.path("tool").shape == (len(whole.times), 7)
    np.testing.assert_array_equal(whole.poses["tool"], whole.path("tool")[-1])
    with pytest.raises(InputError, match="no path of 'bx'; did you mean 'box'"):
        whole.path("bx")


def test_there_is_no_result_before_the_end_and_what_it_shows_is_short(whole):
    with Session(tree(), SCENE, seed=3) as session:
        session.step()
        with pytest.raises(InputError, match="goes on: step until"):
            _ = session.result
        with pytest.raises(InputError, match="rendering=True"):
            session.image()
        assert repr(session) == "<Session 'grasp and pick' seed=3: RUNNING at 'grasp box', 0.05 s>"
        assert "grasp and pick" in session._repr_html_()
    with pytest.raises(InputError, match="has broken off"):
        _ = session.result
    assert len(repr(whole)) < 120 and "\n" not in repr(whole)


def test_options_are_those_of_run():
    with pytest.raises(InputError, match="unknown option 'noize'; did you mean 'noise'"):
        Session(tree(), SCENE, noize="none")
    with Session(tree(), SCENE, seed=3, noise="none") as session:
        assert session.runner.options.noise == "none"


def test_a_session_that_is_left_early_ends_every_node_and_has_a_robot_hold(monkeypatch):
    held: list[str] = []
    monkeypatch.setattr(PhysicsEngine, "hold", lambda engine, why: held.append(why))
    root = sequence("wait", Running("for ever"))
    with Session(root, SCENE) as session:
        session.step()
        assert root.status == Status.RUNNING
    assert root.status == Status.INVALID and held == [BROKEN_OFF]
    with Session(root, SCENE):
        pass
    assert held == [BROKEN_OFF] * 2, "a robot that was reset and never moved holds, too"


class Broken(Behaviour):
    def update(self):
        raise ValueError("too large")


def test_an_error_of_a_leaf_names_its_file_and_line_and_ends_the_session():
    with Session(sequence("s", Broken("mine")), SCENE) as session:
        with pytest.raises(LeafError, match=r"'mine' raised ValueError in test_session\.py:\d+: too large"):
            session.step()
        assert not session.step()
        with pytest.raises(InputError, match="has broken off"):
            _ = session.result


def test_two_sessions_go_on_side_by_side(whole):
    with Session(tree(), SCENE, seed=3) as one, Session(tree(), SCENE, seed=5) as other:
        while one.step():
            other.step()
        np.testing.assert_array_equal(one.result.path("box"), whole.path("box"))


def test_a_result_without_paths_says_so():
    runner = Runner(tree(), SCENE)
    runner.begin(1)
    with runner, pytest.raises(InputError, match="keeps no paths"):
        runner.broken_off(0).path("box")


def test_a_session_draws_what_is_there_now():
    with Session(tree(), SCENE, seed=3, rendering=True) as session:
        first = session.image()
        while session.active is None or session.active.name == "grasp box":
            session.step()
        later = session.image()
        assert first.shape == later.shape == (480, 640, 3) and first.dtype == np.uint8
        assert 0.001 < np.mean(np.abs(first.astype(int) - later).max(axis=-1) > 20) < 0.5, "the arm has moved"
        with pytest.raises(InputError, match="did you mean 'overview'"):
            session.image("overviev")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Session("x", 3), r"a tree is a py_trees behaviour, .* found 'x': .*load_source\('x'\)"),
        (lambda: Session(tree(), 3), "a scene is a Scene, found 3"),
        (lambda: Session(tree(), "a.yaml"), r"found 'a.yaml': load_scene\('a.yaml'\)"),
        (lambda: Session(tree(), Scene), "a scene is a Scene, found .*: call it"),
        (lambda: Session(lambda: 3, SCENE), "should return a py_trees behaviour, found 3"),
        (
            lambda: Session(tree(), SCENE, policy="programmed"),
            "found 'programmed'",
        ),
        (lambda: Session(tree(), SCENE, policy={"Grasp": 3}), "names by concept"),
        (
            lambda: Session(tree(), SCENE, options={"noise": "none"}),
            "are EngineOptions, found a",
        ),
        (lambda: Session(tree(), SCENE, longest=-1), "positive number of seconds, found -1"),
        (lambda: Session(tree(), SCENE, noise=3), "the option 'noise' should be text, found 3"),
        (lambda: Session(tree(), SCENE, rendering="no"), "'rendering' should be True or False, found 'no'"),
        (lambda: Session(tree(), SCENE, timeout="1"), "the option 'timeout' should be a number"),
        (lambda: run("x", SCENE), "a tree is a py_trees behaviour"),
        (lambda: Runner(3, SCENE), "a tree is a py_trees behaviour"),
        (lambda: Runner(lambda: 3, SCENE), "should return a py_trees behaviour, found 3"),
    ],
)
def test_what_is_no_tree_no_scene_and_no_option_is_said_in_a_sentence(make, words):
    with pytest.raises(InputError, match=words):
        make()


def test_a_closed_session_says_that_it_is_closed():
    session = Session(tree(), SCENE, seed=3)
    session.step()
    session.close()
    session.close()
    assert not session.step() and session.time > 0.0 and "broken off" in repr(session)
    for use in (session.reset, session.image, session.__enter__):
        with pytest.raises(InputError, match="this session is closed: make a new one"):
            use()
