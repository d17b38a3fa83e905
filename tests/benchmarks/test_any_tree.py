"""Random tasks: the laws of their generator, a few of them run, and what the oracle says of clear cases."""

from __future__ import annotations

import dataclasses
import json
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from benchmarks.any_tree import tasks
from benchmarks.any_tree.__main__ import main
from benchmarks.any_tree.episodes import Conditions, Player
from benchmarks.any_tree.five import FIVE
from benchmarks.any_tree.goals import Step, allowed
from benchmarks.any_tree.handling import Mover, State
from benchmarks.any_tree.oracle import judge
from benchmarks.any_tree.report import summary
from benchmarks.any_tree.settings import SETTINGS
from benchmarks.any_tree.tasks import Task, task
from benchmarks.any_tree.trees import TREES, tree_of
from bt_tasksim import EngineOptions, Goal, ObjectSpec, Scene, SpotSpec, load_robot
from bt_tasksim.concept.leaf import ConceptNode
from bt_tasksim.core import poses
from bt_tasksim.core.errors import InputError
from bt_tasksim.scene.outlines import overlapping
from bt_tasksim.scene.starts import parts_of

QUICK = settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
SEEDS = st.integers(920_000, 929_999)
ROBOTS = st.sampled_from(sorted(SETTINGS))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where meshes are written."""
    return tmp_path_factory.mktemp("meshes")


@pytest.fixture(autouse=True)
def no_meshes(monkeypatch: pytest.MonkeyPatch) -> None:
    """To cut meshes into parts takes seconds: kinds alone will do, save where a test says otherwise."""
    monkeypatch.setattr("benchmarks.any_tree.things.MESHES", 0.0)


@QUICK
@given(seed=SEEDS, robot=ROBOTS)
def test_a_seed_makes_one_task(seed: int, robot: str, folder: Path) -> None:
    one, other = (task(seed, robot, folder) for _ in range(2))
    assert one.words == other.words
    assert one.sample().to_json() == other.sample().to_json()
    assert one.steps == other.steps


@QUICK
@given(seed=SEEDS, robot=ROBOTS)
def test_things_begin_clear_of_each_other(seed: int, robot: str, folder: Path) -> None:
    drawn = task(seed, robot, folder)
    actors = drawn.sample().objects
    for a, b in combinations(actors, 2):
        if b.name not in (a.base,) and a.name not in (b.base,):
            gap = min(drawn.gap, 0.01) - 1e-6  # a scene lets circles that are 1 cm apart pass
            assert not overlapping(parts_of(a), parts_of(b), gap), drawn.words


@QUICK
@given(seed=SEEDS, robot=ROBOTS)
def test_goals_name_what_is_there_in_an_order_that_can_be(seed: int, robot: str, folder: Path) -> None:
    drawn = task(seed, robot, folder)
    known = {*drawn.scene.object_names, *drawn.scene.place_names}
    assert 1 <= len(drawn.steps) <= tasks.MOST
    assert [step.goal for step in drawn.steps] == list(drawn.scene.goals)
    assert len({step.target for step in drawn.steps}) == len(drawn.steps)
    for step in drawn.steps:
        assert step.target in drawn.scene.objects
        assert step.goal.place in known and step.place in known
    assert allowed(drawn.steps, {actor.name: actor for actor in drawn.sample().objects})


@QUICK
@given(seed=SEEDS, robot=ROBOTS, kind=st.sampled_from(TREES))
def test_trees_do_every_step(seed: int, robot: str, kind: str, folder: Path) -> None:
    drawn = task(seed, robot, folder)
    leaves = [node for node in drawn.tree(kind).iterate() if isinstance(node, ConceptNode)]
    assert {leaf.model.actor for leaf in leaves} >= {step.target for step in drawn.steps}


def test_a_goal_that_is_reached_first_bears_what_comes_after() -> None:
    down, on = (Step(a, Goal(a, on=b), b) for a, b in (("a", "table"), ("b", "a")))
    assert allowed([down, on], {}) and not allowed([on, down], {})


def test_an_unknown_tree_or_robot_is_refused(folder: Path) -> None:
    with pytest.raises(InputError, match="obvious"):
        tree_of((), (), "obvius")
    with pytest.raises(InputError, match="panda"):
        task(920_000, "pandas", folder)


def test_meshes_are_written_once_and_begin_on_their_foot(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("benchmarks.any_tree.things.MESHES", 1.0)
    monkeypatch.setattr("benchmarks.any_tree.things.FORMS", {"book": None, "wedge": None})
    drawn = task(920_001, "panda", folder)
    assert all(spec.mesh is not None for spec in drawn.scene.objects.values())
    assert {path.suffix for path in folder.iterdir()} == {".obj"}


def _one(robot: str, goal: Goal, fixtures: tuple[str, ...] = (), **spec: object) -> Task:
    """A task with one object and one goal."""
    said = {"kinds": ("cube",), "on": "table", "area": (0.0, 0.0)} | spec
    scene = Scene(
        robot,
        fixtures,
        {"cube": ObjectSpec(**said)},  # type: ignore[arg-type]
        [SpotSpec("spot", "table", (-0.05, -0.2), (0.0, 0.0))],
        goals=[goal],
    )
    step = Step("cube", goal, goal.place, drop=goal.relation == "inside")
    return Task(920_002, robot, "evaluation", scene, (step,), "test", 0.0, 0.0, "one cube")


def test_the_oracle_finds_what_is_easy() -> None:
    found = judge(_one("panda", Goal("cube", on="spot")), seconds=30.0)
    assert found.possible and found.order == ("cube",), found


@pytest.mark.parametrize(
    ("goal", "spec", "reason"),
    [
        (Goal("cube", on="spot"), {"size": ((0.11,) * 3, (0.12,) * 3)}, "no grip fits the hand"),
        (Goal("cube", on="spot"), {"mass": (9.0, 9.5)}, "too heavy"),
        (Goal("cube", on="spot"), {"centre": (0.4, 0.4)}, "every grasp is out of reach"),
    ],
)
def test_the_oracle_says_why_something_cannot_be(goal: Goal, spec: dict[str, object], reason: str) -> None:
    found = judge(_one("panda", goal, **spec), seconds=4.0)
    assert not found.possible and found.reason == reason, found


def test_two_draws_are_run_judged_and_counted(folder: Path) -> None:
    asked = Conditions("panda", "obvious", None, EngineOptions(), folder)
    player = Player(asked)
    try:
        draws = [json.loads(json.dumps(player.play(seed))) for seed in (920_003, 920_004)]
    finally:
        player.close()
    for draw in draws:
        assert draw["status"] in ("SUCCESS", "FAILURE")
        assert draw["success"] or draw["reason"]
        assert (draw["lie"] or draw["overlap"]) == (draw["status"] == "SUCCESS" and not draw["success"])
    assert summary(draws)["episodes"] == 2


def test_a_measurement_goes_on_where_it_was_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("benchmarks.sealed.OUT", tmp_path)
    monkeypatch.setattr("benchmarks.sealed.keep.__defaults__", (tmp_path,))
    played: list[int] = []

    def play(self: Player, seed: int) -> dict[str, object]:
        played.append(seed)
        known = {"leaf": "", "concept": "", "reason": "", "why": "", "words": "", "lie": False}
        return {**known, "seed": seed, "success": True, "status": "SUCCESS"}

    monkeypatch.setattr(Player, "play", play)
    for episodes in ("2", "3"):
        assert main(["--episodes", episodes, "--seed", "920010"]) == 0
    assert played == [920_010, 920_011, 920_012]
    assert "3 of 3" in capsys.readouterr().out
    written = json.loads((tmp_path / "any_tree-panda.json").read_text())
    assert written["episodes"] == 3 and written["lies"] == 0
    assert main(["--episodes", "3", "--seed", "920010", "--noise", "original"]) == 0
    assert main(["--episodes", "3", "--seed", "920010", "--oracle", "5"]) == 2, "under other conditions"


@pytest.mark.parametrize("name", FIVE)
def test_the_five_trees_fit_their_scenes(name: str) -> None:
    known = FIVE[name]("panda")
    for seed in range(920_000, 920_010):
        drawn = known.scene.sample(seed)
        assert len(drawn.objects) == len(known.scene.objects)
        assert np.isfinite([actor.pose for actor in drawn.objects]).all()
    assert len(list(tree_of(known.steps, known.scene.goals, "obvious").iterate())) > 4
    assert dataclasses.is_dataclass(known)


def test_objects_in_one_colour_stand_where_they_stood(folder: Path) -> None:
    drawn = task(920_003, "panda", folder)
    before, after = drawn.sample(), drawn.in_colours(1).sample()
    assert len({actor.colour for actor in after.objects}) == 1
    assert [actor.pose for actor in after.objects] == [actor.pose for actor in before.objects]
    assert Conditions("panda", "obvious", None, EngineOptions(), folder).to_data().get("colours") is None


@pytest.mark.parametrize(("beyond", "meets"), [(0.0, True), (0.03, True), (0.048, False)])
def test_fingers_that_close_before_a_thing_do_not_grasp_it_in_the_oracle_either(beyond, meets):
    """The Ability hand's end 14 mm beyond its tool's origin at most, and half the cube is 26 mm."""
    robot = load_robot("xarm7_ability")
    cube = ObjectSpec(kinds=("cube",), on="table", size=((0.052,) * 3,) * 2)
    drawn = Scene("xarm7_ability", objects={"cube": cube}).sample(0)
    (actor,) = drawn.objects
    world = drawn.world_model([tip.name for tip in robot.tips], robot.opening)
    state = State({"cube": np.array(actor.pose)}, robot.rest)
    mover = Mover(robot, world, actor, state, 0.0, np.random.default_rng(0))
    assert mover._meets(poses.pose([0.0, 0.0, beyond])) == meets
