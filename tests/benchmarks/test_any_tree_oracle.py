"""The oracle allows what the judge allows, and its end states are judged by physics."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.any_tree import oracle
from benchmarks.any_tree.goals import Step
from benchmarks.any_tree.handling import Mover, State, Stuck, _plane
from benchmarks.any_tree.oracle import goal_poses, judge
from benchmarks.any_tree.steady import overturned, settled, verdict
from benchmarks.any_tree.tasks import Task
from benchmarks.any_tree.things import mesh_file
from bt_tasksim import Goal, ObjectSpec, Scene, SpotSpec, load_robot
from bt_tasksim.core import poses
from bt_tasksim.scene.configuration import ActorConfiguration

CUBE = ObjectSpec(kinds=("cube",), on="table", size=((0.04,) * 3,) * 2, area=(0.0, 0.0))


def drawn(goals: list[Goal], fixtures: tuple[str, ...] = (), **objects: ObjectSpec) -> ActorConfiguration:
    spots = [SpotSpec("spot", "table", (-0.05, -0.2), (0.0, 0.0))]
    return Scene("panda", fixtures, objects, spots, goals=goals).sample(920_100)


def world_of(configuration: ActorConfiguration):
    robot = load_robot(configuration.robot)
    return configuration.world_model([tip.name for tip in robot.tips], robot.opening)


@pytest.mark.parametrize(("aside", "turned", "reached"), [(0.026, 8.0, True), (0.034, 0.0, False)])
def test_the_judge_of_every_run_judges_what_the_oracle_has_left(aside, turned, reached):
    configuration = drawn([Goal("cube", on="spot")], cube=CUBE)
    spot = np.asarray(world_of(configuration).place("spot").pose)
    there = poses.pose([aside, 0.0, 0.021], poses.yaw(np.deg2rad(turned)))
    found = verdict(configuration, {"cube": poses.multiply(spot, there)}, [])
    assert found.success == reached, found.why


def test_what_is_let_go_falls_into_its_container_one_after_the_other():
    """Both from the same place: they would be in each other, were they let go at once."""
    goals = [Goal(name, inside="trash_bin") for name in ("one", "two")]
    other = replace(CUBE, centre=(0.1, 0.1))
    configuration = drawn(goals, ("trash_bin",), one=CUBE, two=other)
    place = world_of(configuration).place("trash_bin")
    above = poses.multiply(np.asarray(place.pose), poses.pose([*place.centre, place.height + 0.05]))
    found = verdict(configuration, {}, [("one", above), ("two", above)])
    assert found.success, found.why
    beside = poses.shifted(above, np.array([0.0, 0.3, 0.0]))
    assert not verdict(configuration, {}, [("one", above), ("two", beside)]).success


@pytest.mark.parametrize("meant", [True, False])
def test_only_what_has_no_goal_must_not_fall_over_at_the_start(meant):
    """Where something with a goal falls over, it is taken from where it then lies."""
    configuration = drawn([Goal("cube", on="spot")] if meant else [], cube=CUBE)
    (actor,) = configuration.objects
    turn = poses.from_rotation_vector(np.array([0.0, np.deg2rad(50.0), 0.0]))
    on_edge = poses.multiply(np.array(actor.pose), poses.pose([0.0, 0.0, 0.03], turn))
    leant = replace(configuration, objects=(replace(actor, pose=tuple(on_edge.tolist())),))
    assert bool(overturned(leant, settled(leant, {}))) == (not meant)


def test_on_an_object_the_weight_counts_and_not_the_middle(tmp_path: Path):
    """The weight of a corner is beside its middle: in the middle of a small cube it would fall."""
    file = mesh_file(tmp_path, "corner", 5, 1.0)
    corner = ObjectSpec(mesh=str(file), on="table", area=(0.0, 0.0), centre=(0.1, 0.1))
    small = replace(CUBE, size=((0.03,) * 3,) * 2)
    goal = Goal("corner", on="cube")
    configuration = drawn([goal], cube=small, corner=corner)
    actors = {actor.name: actor for actor in configuration.objects}
    state = State({name: np.array(actor.pose) for name, actor in actors.items()}, load_robot("panda").rest)
    step, rng = Step("corner", goal, "cube"), np.random.default_rng(0)
    found = goal_poses(step, actors, world_of(configuration), state, rng)
    weight = np.asarray(actors["corner"].shape().mass.pose)[None, :3]
    below = state.objects["cube"]
    for pose in found:
        assert np.linalg.norm(pose[:2] - below[:2]) <= goal.position_tolerance
        assert (
            np.abs(poses.transform(pose, weight)[0, :2] - below[:2]).max() < 0.015 * np.sqrt(2) + oracle.EDGE
        )
    assert found and any(np.linalg.norm(pose[:2] - below[:2]) > 0.005 for pose in found)
    assert any(verdict(configuration, {**state.objects, "corner": pose}, []).success for pose in found[:8])


def _two(monkeypatch: pytest.MonkeyPatch, orders: int) -> list[float]:
    """Seconds given to each try of a task of one or two orders, none of which works."""
    goals = [Goal("cube", on="spot")] + [Goal("other", on="spot")] * (orders - 1)
    others = {"other": replace(CUBE, centre=(0.1, 0.1))} if orders > 1 else {}
    spots = [SpotSpec("spot", "table", (-0.05, -0.2), (0.0, 0.0))]
    scene = Scene("panda", (), {"cube": CUBE, **others}, spots, goals=goals)
    steps = tuple(Step(goal.object, goal, "spot") for goal in goals)
    given: list[float] = []

    def done(self: object, order: object, until: float) -> tuple[int, Stuck]:
        given.append(until)
        return 0, Stuck("there is no way", "none", False)

    monkeypatch.setattr(oracle._Search, "done", done)
    monkeypatch.setattr("benchmarks.any_tree.oracle.time.process_time", lambda: 100.0)
    found = judge(Task(920_100, "panda", "evaluation", scene, steps, "test", 0.0, 0.0, "two"), 50.0)
    assert not found.possible and not found.exhausted
    return [until - 100.0 for until in given]


def test_the_only_order_has_all_the_time_and_the_first_of_several_the_most(monkeypatch):
    assert _two(monkeypatch, 1)[0] == 50.0
    first, *others = _two(monkeypatch, 2)
    assert 25.0 < first < 50.0 and others[-1] == 50.0


def test_an_end_that_falls_over_is_tried_again_in_another_way(monkeypatch):
    configuration = drawn([Goal("cube", on="spot")], cube=CUBE)
    asked: list[object] = []

    def judged(*given: object) -> object:
        asked.append(given)
        return verdict(configuration, {}, [])  # which leaves it where it was

    monkeypatch.setattr(oracle, "verdict", judged)
    monkeypatch.setattr(Mover, "moved", lambda self, goals, lowered: self._state)
    search = oracle._Search(
        load_robot("panda"), configuration, {"cube": np.array(configuration.objects[0].pose)}
    )
    done, stuck = search.done([Step("cube", Goal("cube", on="spot"), "spot")], np.inf)
    assert done == 1 and stuck is not None and stuck.exhausted and len(asked) == oracle.AGAIN


@pytest.mark.parametrize(
    ("name", "five_joints"), [("so100", True), ("panda", False), ("xarm7_ability", False)]
)
def test_an_arm_of_five_joints_points_its_hand_in_a_plane(name, five_joints):
    robot = load_robot(name)
    plane = _plane(robot)
    assert (plane.most < 0.1) == five_joints
    if five_joints:
        ahead = poses.frame_from_axes(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
        aside = poses.frame_from_axes(np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0]))
        tools = np.array([[plane.axis[0] + 0.3, plane.axis[1], 0.1, *turn] for turn in (ahead, aside)])
        assert plane.holds(tools, 0.12).tolist() == [True, False]
