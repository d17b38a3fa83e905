"""Success of ready-made scenarios is what the physics says, not what the tree says; and another robot's."""

import dataclasses

import numpy as np
import pytest
from draws import good_seed, successes
from py_trees.common import Status

from bt_tasksim.concept_nodes import Bring, Grasp, Pick, Place, Release
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import Runner
from bt_tasksim.scene.specs import Goal, SpotSpec
from bt_tasksim.trees import sequence
from bt_tasksim.trees.load import load_source

pytestmark = pytest.mark.physical


def runner_of(name, robot=None, scene=None, tree=None, **options):
    source = load_source(name, robot)
    return Runner(tree or source.build(), scene or source.scene, EngineOptions(**options))


@pytest.mark.parametrize("name", ["pick_and_place"])
def test_with_the_five_fingered_hand(name):
    successes(runner_of(name, "xarm7_ability").run, range(4, 9))


# ---- sabotage ---------------------------------------------------------------------------------------------


def deceived(run, reason):
    """No draw succeeds, though in one at least the tree believes that it has."""

    def watched(seed):
        result = run(seed)
        assert not result.success
        return result

    (result,) = successes(watched, range(7, 10), n=1, wanted=lambda r: r.status == Status.SUCCESS)
    assert result.reason == reason
    return result


def test_another_goal_is_not_reached_though_the_tree_says_success():
    source = load_source("pick_and_place")
    far = SpotSpec("elsewhere", on="table", centre=(0.12, 0.0), area=(0.0, 0.0))
    scene = dataclasses.replace(
        source.scene, spots=[*source.scene.spots, far], goal=Goal("target", "elsewhere")
    )
    result = deceived(runner_of("pick_and_place", scene=scene).run, "not_in_place")
    assert result.outcome.names["place"] == "elsewhere"


def test_the_object_of_the_goal_is_another_one():
    source = load_source("pick_and_throw")
    other = dataclasses.replace(
        source.scene.objects["cup"], kinds=("cube",), centre=(0.1, 0.2), area=(0.0, 0.0)
    )
    scene = dataclasses.replace(
        source.scene,
        objects={**source.scene.objects, "cube": other},
        goal=Goal("cube", "trash_bin", relation="inside"),
    )
    deceived(runner_of("pick_and_throw", scene=scene).run, "not_inside")


def test_a_stricter_tolerance_turns_success_into_failure():
    runner = runner_of("shelf_to_shelf")
    seed = good_seed(runner.run, range(7, 10))
    drawn = runner.scene.sample(seed)
    strict = dataclasses.replace(drawn, goal=dataclasses.replace(drawn.goal, position_tolerance=1e-5))
    result = runner.finish(strict, runner.reset(strict))
    assert result.status == Status.SUCCESS and not result.success and result.reason == "not_in_place"


def test_a_place_that_is_calibrated_wrong_deceives_the_tree_and_not_the_judge():
    runner = runner_of("pick_and_place", noise="none")

    def run(seed):
        configuration = runner.scene.sample(seed)
        world = runner.reset(configuration)
        place = configuration.places[-1]
        assert place.name == "goal"
        moved = dataclasses.replace(place, pose=place.pose + np.array([0.06, 0, 0, 0, 0, 0, 0]))
        runner.context.begin([dataclasses.replace(world, places={**world.places, "goal": moved})])
        return runner.finish(configuration, world)

    result = deceived(run, "not_in_place")
    assert result.verdict.position_error == pytest.approx(0.06, abs=0.015)


def test_a_tree_that_does_nothing_is_no_success():
    from py_trees.behaviours import Success

    result = runner_of("pick_and_place", tree=Success("done at once")).run(7)
    assert result.status == Status.SUCCESS and not result.success and result.reason == "not_in_place"


def test_recovering_needs_its_tree():
    """The same blow, and a tree without recovery: it fails in 56 of 60 draws and says why."""
    source = load_source("pick_and_place_recovering")
    successes(Runner(source.build(), source.scene).run, range(7, 12))
    straight = sequence(
        "no second try",
        Grasp("cube"),
        Pick("cube"),
        Bring("cube", to="goal"),
        Place("cube", on="goal"),
        Release("cube"),
    )
    results = [Runner(straight, source.scene).run(seed) for seed in range(7, 13)]
    failed = [result for result in results if not result.success]
    assert len(failed) >= 2
    assert any("cube is no" in result.why for result in failed)
