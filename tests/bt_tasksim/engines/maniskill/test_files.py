"""Environments' files and the names that engines have: what is refused, and with which sentence."""

import pytest

from bt_tasksim.concept_nodes import Grasp
from bt_tasksim.core.errors import InputError
from bt_tasksim.engines.maniskill.files import bundled, load_environment_file
from bt_tasksim.engines.maniskill.world import LARGEST_SEED, EnvironmentWorld, environment_seed
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import Runner
from bt_tasksim.scene.scene import Scene
from bt_tasksim.trees import sequence


def environment(tmp_path, text):
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    return str(path)


@pytest.mark.parametrize("name", bundled())
def test_bundled_files_are_named_after_their_environments(name):
    file = load_environment_file(name)
    assert file.environment == name and file.robots and file.objects


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("environment: A-v1\nrobots: {}\n", "robots"),
        ("environment: A-v1\nrobots: {panda: panada}\n", "panada"),
        ("environment: A-v1\nrobots: {panda: panda}\nobject: {cube: {}}\n", "did you mean 'objects'"),
        ("environment: A-v1\nrobots: {panda: panda}\nplaces: {goal: {}}\n", "actor"),
        (
            "environment: A-v1\nrobots: {panda: panda}\nobjects: {a: {}}\nplaces: {a: {actor: b}}\n",
            "both called 'a'",
        ),
        ("environment: A-v1\nrobots: {panda: panda}\ndistance: {object: a, place: b}\n", "not in the file"),
    ],
)
def test_faulty_files_are_refused_with_the_field(tmp_path, text, said):
    with pytest.raises(InputError, match=said):
        load_environment_file(environment(tmp_path, text))


@pytest.mark.parametrize("name", ["maniskill", "maniskill:"])
def test_an_environment_must_be_named(name):
    with pytest.raises(InputError, match="name the ManiSkill environment"):
        EngineOptions(engines=name)


def test_an_environment_without_a_file_is_refused_with_the_nearest_one():
    with pytest.raises(InputError, match=r"PickCub-v1.*did you mean 'PickCube-v1'"):
        EngineOptions(engines="maniskill:PickCub-v1").own_world()


def test_a_world_has_the_names_of_its_file_and_no_stages():
    world = EngineOptions(engines="maniskill:StackCube-v1").own_world()
    assert set(world.object_names) == {"cubeA", "cubeB"} and set(world.place_names) == {"table"}
    assert world.robot == "panda_wristcam" and world.with_robot("panda").robot == "panda"
    assert not world.stages
    with pytest.raises(InputError, match="xarm7_ability"):
        world.with_robot("xarm7_ability")
    with pytest.raises(InputError, match="simulation"):
        world.sample(0)


def test_seeds_of_evaluations_are_maniskills_own_and_those_of_trainings_others():
    assert [environment_seed(s, "evaluation") for s in (0, 1000)] == [0, 1000]
    others = {environment_seed(s, stream) for s in range(50) for stream in ("training", "validation")}
    assert len(others) == 100 and min(others) >= 2**31 and max(others) <= LARGEST_SEED
    with pytest.raises(InputError, match="seeds"):
        environment_seed(2**32, "evaluation")


def test_a_runner_without_a_scene_needs_engines_that_bring_one():
    with pytest.raises(InputError, match="name a scene"):
        Runner(sequence("s", Grasp("cube")), None, EngineOptions())


def test_another_scene_is_refused_before_anything_starts():
    tree = sequence("s", Grasp("cube"))
    with pytest.raises(InputError, match="own world"):
        Runner(tree, Scene(objects={"cube": "on table"}), EngineOptions(engines="maniskill:PickCube-v1"))


def test_the_file_of_another_environment_is_no_world_of_this_one(tmp_path):
    mine = environment(tmp_path, "environment: PickCube-v1\nrobots: {panda: panda}\nobjects: {cube: {}}\n")
    world = EnvironmentWorld(mine)
    assert world.name == "PickCube-v1" and set(world.object_names) == {"cube"}
    with pytest.raises(InputError, match="own world"):
        Runner(sequence("s", Grasp("cube")), world, EngineOptions(engines="maniskill:PickCube-v1"))
