"""From goals alone to a tree: what it holds, in which order, and that it reaches them."""

import dataclasses

import numpy as np
import pytest
from draws import successes
from hypothesis import given, settings
from hypothesis import strategies as st
from py_trees.common import Status

from bt_tasksim import Goal, Scene
from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.declared import ConditionOf
from bt_tasksim.concept.parameters import ObjectName, PlaceName, Seconds
from bt_tasksim.concept_nodes import AtPose, Beside, Lifted, StandsOn, Wait, catalogue
from bt_tasksim.concept_nodes.carry import Carry
from bt_tasksim.core.errors import InputError
from bt_tasksim.core.outcomes import NO_WAY
from bt_tasksim.core.registry import register
from bt_tasksim.execution.batch_runner import BatchRunner
from bt_tasksim.execution.runner import Runner
from bt_tasksim.scene.goal_functions import GoalFunction
from bt_tasksim.scene.relations import relation_named
from bt_tasksim.scene.relations.base import FinalState, GoalRelation
from bt_tasksim.scene.specs import ObjectSpec, SpotSpec
from bt_tasksim.trees import check_tree, recovering, same_tree, tidy, tree_from_xml, tree_to_xml
from bt_tasksim.trees.from_goals import in_order
from bt_tasksim.trees.load import load_source
from bt_tasksim.trees.nodes.any_order import AnyOrder
from bt_tasksim.trees.walk import nodes_of


def acts(tree):
    """What a tree does, in order: concepts with their arguments."""
    leaves = [node for node in nodes_of(tree) if not node.children]
    return [repr(leaf.model) for leaf in leaves if not isinstance(leaf.model, Condition)]


@pytest.mark.parametrize(
    ("goal", "does"),
    [
        (
            Goal("cup", "spot"),
            ["Bring(target='cup', to='spot')", "Place(target='cup', on='spot')", "Release(target='cup')"],
        ),
        (
            Goal("cup", "bin", relation="inside"),
            ["Bring(target='cup', to='bin')", "Release(target='cup', into='bin')"],
        ),
    ],
)
def test_a_goal_is_reached_by_what_its_condition_needs(goal, does):
    assert acts(tidy([goal])) == ["Grasp(target='cup')", "Pick(target='cup')", *does]


def test_what_is_to_be_lifted_stays_in_the_hand_as_high_as_asked():
    tree = tidy([Goal("cup", "table", relation="lifted", height=0.25)])
    assert acts(tree) == ["Grasp(target='cup')", "Pick(target='cup', distance=0.25)"]
    assert tree.children[0].model == Lifted.value("cup", above="table", height=0.25)
    anywhere = tidy([Goal("cup", relation="lifted", height=0.25)])
    assert acts(anywhere) == acts(tree) and anywhere.children[0].model == Lifted.value("cup", height=0.25)
    assert anywhere.children[0].name == "lifted cup"


def test_a_goal_is_asked_before_and_after():
    tree = tidy([Goal("cup", "spot", position_tolerance=0.01)])
    asked = AtPose.value("cup", on="spot", tolerance=0.01)
    assert tree.children[0].model == asked and tree.children[1].children[-1].model == asked


def test_a_goal_that_holds_moves_nothing(toy):
    stage = toy(tidy([Goal("cup", "goal")]))
    stage.world.stand("cup", "goal")
    stage.look()
    assert stage.tick() == Status.SUCCESS and not stage.world.steps


def test_a_taken_spot_is_said(toy):
    stage = toy(tidy([Goal("cup", "goal")]))
    objects = stage.world.now.objects.copy()
    objects[1, :2] = stage.world.model.place("goal").pose[:2]
    stage.world.put(objects=objects)
    stage.look()
    assert stage.tick() == Status.FAILURE and not stage.world.steps
    assert "goal is taken by box" in stage.tree.tip().feedback_message


NAMES = "abcdef"


@st.composite
def arrangements(draw):
    """Goals of towers without circles, in any order."""
    count = draw(st.integers(1, len(NAMES)))
    goals, free = [], [f"spot {k}" for k in range(count)]
    for name in NAMES[:count]:
        place = draw(st.sampled_from(free))
        free.remove(place)
        free.append(name)
        goals.append(Goal(name, place))
    return draw(st.permutations(goals))


@given(arrangements())
def test_towers_are_built_from_below_whatever_the_order_of_goals(goals):
    order = in_order(goals)
    assert sorted(g.object for g in order) == sorted(g.object for g in goals)
    built = set()
    for goal in order:
        assert goal.place.startswith("spot") or goal.place in built
        built.add(goal.object)


@settings(max_examples=25, deadline=None)
@given(arrangements(), st.sampled_from([None, "table"]))
def test_a_tree_is_one_that_authors_can_write_and_keep(goals, parking):
    tree = tidy(goals, parking=parking)
    check_tree(tree)
    assert same_tree(tree_from_xml(tree_to_xml(tree)), tree)
    for goal in goals:
        asked = [
            n for n in nodes_of(tree) if not n.children and n.model == AtPose.value(goal.object, goal.place)
        ]
        assert len(asked) >= 2


def test_what_is_held_in_the_end_comes_last():
    lifted = Goal("a", "table", relation="lifted")
    assert in_order([lifted, Goal("b", "spot")])[-1] == lifted


@pytest.mark.parametrize(
    ("goals", "sentence"),
    [
        ([], "there is no goal to make a tree from"),
        (Goal("a", "spot"), "found one goal: write tidy"),
        ([Goal("a", "spot"), Goal("a", "table")], "two goals are about 'a'"),
        ([Goal("a", "b"), Goal("b", "c"), Goal("c", "a")], "in a circle: a on b, b on c, c on a"),
        ([Goal("a", "spot"), Goal("b", "spot")], "'a' and 'b' cannot both stand on the middle of 'spot'"),
        ([Goal(n, "table", relation="lifted") for n in "ab"], "the hand can hold one object"),
        ([Goal("a", "b"), Goal("b", beside="a")], "in a circle: a on b, b beside a"),
        (
            [Goal("a", "table", relation="lifted"), Goal("b", "a")],
            "'b' cannot be on 'a', which is to be held in the end",
        ),
    ],
)
def test_goals_that_contradict_each_other_are_refused(goals, sentence):
    with pytest.raises(InputError, match=sentence):
        tidy(goals)


def test_what_stands_beside_one_another_may_do_so_in_a_circle():
    goals = [Goal("a", beside="b"), Goal("b", beside="a"), Goal("c", beside="a")]
    order = in_order(goals)
    assert sorted(map(str, order)) == sorted(map(str, goals))
    assert order.index(goals[2]) > order.index(goals[0])
    assert acts(tidy(goals)).count("Bring(target='a', beside='b')") == 1


def test_a_relation_from_outside_says_itself_what_it_needs(upside_down):
    """What leaves open where has its turn last, and of what takes the middle there is one on a place."""
    kind = asks_whether_it_is_upside_down()
    goals = [upside_down, Goal("box", "spot")]
    assert in_order(goals) == goals
    kind.leaves_open = True
    assert in_order(goals) == goals[::-1]
    kind.takes_middle = True
    with pytest.raises(InputError, match="cannot both stand on the middle of 'table'"):
        in_order([upside_down, Goal("box", "table", relation="upside_down")])


@pytest.fixture
def upside_down():
    """A goal relation from outside, which nothing here asks about or brings about."""

    @register("goal relation", "upside_down")
    class UpsideDownRelation(GoalRelation):
        def evaluate(self, goal, final):
            raise NotImplementedError

    return Goal("cup", "table", relation="upside_down")


def asks_whether_it_is_upside_down():
    """A condition from outside, about the object alone."""

    @register("concept")
    class UpsideDown(Condition):
        """For tests."""

        target: ObjectName
        relation = "upside_down"

        def holds(self, seen):
            raise NotImplementedError

    return UpsideDown


def test_a_relation_that_nothing_asks_about_is_refused(upside_down):
    with pytest.raises(InputError, match="no condition asks whether 'cup' is upside_down 'table'"):
        tidy([upside_down])


def test_a_relation_of_ones_own_is_reached_by_a_concept_of_ones_own(upside_down):
    @register("concept")
    class UpsideDown(Condition):
        """For tests."""

        target: ObjectName
        place: PlaceName
        relation = "upside_down"

        def holds(self, seen):
            raise NotImplementedError

    with pytest.raises(InputError, match=r"no concept establishes UpsideDown\(target='cup', place='table'\)"):
        tidy([upside_down])

    @register("concept")
    class Flip(Carry):
        """For tests."""

        target: ObjectName
        place: PlaceName
        establishes = (ConditionOf("UpsideDown", target="target", place="place"),)
        requires = (ConditionOf("Over", target="target", place="place"),)

        def begin(self, seen):
            raise NotImplementedError

    does = acts(tidy([upside_down]))
    assert does[-3:] == ["Bring(target='cup', to='table')", "Flip(target='cup', place='table')", does[-1]]
    assert does[-1] == "Release(target='cup')" and does[0] == "Grasp(target='cup')"


def test_a_concept_that_needs_more_than_a_goal_says_is_named(upside_down):
    asks_whether_it_is_upside_down()

    @register("concept")
    class Flip(Wait):
        """For tests."""

        target: ObjectName
        establishes = (ConditionOf("UpsideDown", target="target"),)

    with pytest.raises(InputError, match="Flip does, and nothing says its 'duration'"):
        tidy([upside_down])


def test_standing_anywhere_and_beside_is_reached_by_placing_so():
    tree = tidy([Goal("cup", "table", relation="anywhere")])
    assert tree.children[0].model == StandsOn.value("cup", "table")
    assert acts(tree)[2:] == [
        "Bring(target='cup', to='table', anywhere=True)",
        "Place(target='cup', on='table', anywhere=True)",
        "Release(target='cup')",
    ]
    tree = tidy([Goal("box", "cup", relation="beside", distance=0.08)])
    assert tree.children[0].model == Beside.value("box", "cup", gap=0.08)
    assert acts(tree)[2:] == [
        "Bring(target='box', beside='cup')",
        "Place(target='box', beside='cup')",
        "Release(target='box')",
    ]


def test_what_may_stand_anywhere_leaves_the_middle_to_others():
    anywhere, middle = Goal("a", "table", relation="anywhere"), Goal("b", "table")
    assert in_order([anywhere, middle]) == [middle, anywhere]


def test_nothing_waits_on_the_parking_place_that_is_not_kept_from_its_own():
    tree = tidy([Goal("a", "spot"), Goal("b", "a", relation="beside")], parking="table")
    waits = [node.name for node in nodes_of(tree) if "waits on" in node.name]
    assert waits == ["a waits on table"]


def test_what_stands_on_another_waits_for_that_ones_goal():
    tree = tidy([Goal("red", "blue"), Goal("blue", "spot"), Goal("box", beside="blue")])
    work = {stage.name: stage.children[1] for stage in tree.decorated.children[0].children}
    for name in ("red on blue", "box beside blue"):
        assert work[name].children[0].model == AtPose.value("blue", on="spot")
    assert work["blue on spot"].children[0].model != AtPose.value("blue", on="spot")


@pytest.mark.parametrize("parking", [None, "table"])
def test_nothing_is_taken_any_more_once_something_is_to_be_held(parking):
    tree = tidy([Goal("a", "table", relation="lifted"), Goal("b", "s"), Goal("c", "t")], parking=parking)
    free, last, *checks = tree.decorated.children
    assert type(free) is AnyOrder and len(free.children) == (2 if parking is None else 4)
    assert last.name == "a lifted table" and len(checks) == 3


def test_needs_that_go_round_in_a_circle_are_said(upside_down):
    asks_whether_it_is_upside_down()

    @register("concept")
    class Flip(Wait):
        """For tests."""

        target: ObjectName
        duration: Seconds = 1.0
        establishes = (ConditionOf("UpsideDown", target="target"),)
        requires = (ConditionOf("UpsideDown", target="target"),)

    with pytest.raises(InputError, match="UpsideDown needs UpsideDown"):
        tidy([upside_down])


def test_what_concepts_declare_exists():
    known = catalogue()
    declared = [(kind, one) for kind in known.values() if not issubclass(kind, Condition)
                for one in (*kind.establishes, *kind.requires)]  # fmt: skip
    assert len(declared) > 10
    for kind, one in declared:
        assert issubclass(known[one.condition], Condition)
        assert one.parameters.keys() <= known[one.condition].parameters().keys()
        assert {*one.parameters.values(), *one.given} <= kind.parameters().keys()


# ---- in physics ------------------------------------------------------------------------------------------


@pytest.mark.physical
@pytest.mark.parametrize(
    ("scenario", "goal"),
    [
        ("pick_and_place", Goal("target", "goal")),
        ("pick_and_throw", Goal("cup", "trash_bin", relation="inside")),
        ("grasp_then_pick", Goal("target", "table", relation="lifted", height=0.3)),
    ],
)
def test_it_does_what_the_scenarios_trees_do(scenario, goal):
    scene = dataclasses.replace(load_source(scenario).scene, goal=goal)
    results = successes(Runner(tidy([goal]), scene).run, range(7, 12), n=2)
    assert all(result.status == Status.SUCCESS for result in results)


def reached(runner, goals):
    """Runs a seed: the tree succeeds, and physics says that each goal is reached."""

    def run(seed):
        result = runner.run(seed)
        world = result.configuration.world_model([t.name for t in runner.robot.tips], runner.robot.opening)
        final = FinalState(result.configuration, world, runner.pipeline.hidden())
        there = [relation_named(goal.relation).evaluate(goal, final).reached for goal in goals]
        return dataclasses.replace(result, success=result.status == Status.SUCCESS and all(there))

    return run


MANY = range(7, 11)
"""Two of these draws succeed, where a run carries several things about and takes long."""
ASIDE = {"s1": 0.22, "s2": -0.22}
SPOTS = [SpotSpec(name, on="table", centre=(0.0, y), area=(0.02, 0.02)) for name, y in ASIDE.items()]


def cubes(**places):
    objects = {name: ObjectSpec(kinds=("cube",), on=place, area=(0.0, 0.0)) for name, place in places.items()}
    return Scene("panda", objects=objects, spots=SPOTS)


@pytest.mark.physical
def test_a_spot_that_is_taken_is_freed_first():
    goals = [Goal("red", "s1"), Goal("blue", "s2")]
    assert in_order(goals) == goals  # red, whose spot is taken, would be first
    successes(reached(Runner(tidy(goals), cubes(red="table", blue="s1")), goals), MANY, n=2)


@pytest.mark.physical
def test_two_that_stand_on_each_others_spots_change_places():
    goals = [Goal("red", "s2"), Goal("blue", "s1")]
    scene = cubes(red="s1", blue="s2")
    successes(reached(Runner(tidy(goals, parking="table"), scene), goals), MANY, n=2)
    stuck = Runner(tidy(goals), scene).run(7)
    assert stuck.status == Status.FAILURE and np.isclose(stuck.sim_time, 0.05, atol=0.2)


WALLS = {"n": (0.0, 0.047), "s": (0.0, -0.047), "e": (0.047, 0.0), "w": (-0.047, 0.0)}
"""Where posts stand about a cube of 4 cm, 12 mm away, in the table's frame, metres."""
FREE = {"cube": (0.0, 0.28), "n": (-0.1, -0.22), "s": (-0.02, -0.3), "e": (0.1, -0.22), "w": (-0.1, 0.2)}
"""Spots that are clear of them."""


def walled(*more):
    """A cube amid four posts of 9 cm, between which no hand has room; and more cubes."""

    def thing(size, x, y):
        return ObjectSpec("box", on="table", centre=(x, y), area=(0.001, 0.001), yaw=0.0, size=(size, size))

    objects = {"cube": thing((0.04, 0.04, 0.04), 0.0, 0.0)}
    objects |= {name: thing((0.03, 0.03, 0.09), *at) for name, at in WALLS.items()}
    objects |= {name: thing((0.04, 0.04, 0.04), 0.0, -0.2) for name in more}
    spots = [SpotSpec(f"s_{name}", on="table", centre=at, area=(0.01, 0.01)) for name, at in FREE.items()]
    return Scene("panda", objects=objects, spots=spots)


@pytest.mark.physical
@pytest.mark.parametrize("how", [tidy, lambda goals: recovering(tidy(goals))], ids=["tidy", "recovering"])
def test_what_is_in_the_way_of_a_grasp_goes_to_its_own_place_first(how):
    goals = [Goal(name, f"s_{name}") for name in ("cube", *WALLS)]
    assert in_order(goals)[0].object == "cube"
    successes(reached(Runner(how(goals), walled()), goals), MANY, n=2)


@pytest.mark.physical
@pytest.mark.parametrize("how", [tidy, lambda goals: recovering(tidy(goals))], ids=["tidy", "recovering"])
def test_what_cannot_be_reached_is_said_when_all_else_is(how):
    goals = [Goal("cube", "s_cube"), Goal("other", "s_s")]
    tree = how(goals)

    def failed_with_the_other_there(result):
        cube, other = result.verdict.placements
        return result.status == Status.FAILURE and other.reached and not cube.reached

    scene = dataclasses.replace(walled("other"), goals=goals)
    runner = Runner(tree, scene)
    for result in successes(runner.run, range(5), n=2, wanted=failed_with_the_other_there):
        assert "no grasp of cube serves" in result.why and result.reason == NO_WAY.name
        assert tree.rounds == 2, "the second one has done nothing, and is the last"


@pytest.mark.physical
def test_nothing_is_put_on_what_is_not_where_it_should_be():
    goals = [Goal("other", "cube"), Goal("cube", "s_cube")]
    tree = tidy(goals)
    result = Runner(tree, dataclasses.replace(walled("other"), goals=goals)).run(0)
    assert result.status == Status.FAILURE and tree.rounds == 1 and result.sim_time < 0.1
    assert "no grasp of cube serves" in result.why


@pytest.mark.physical
def test_in_a_batch_it_is_the_same():
    goals = [Goal(name, f"s_{name}") for name in ("cube", "n", "s")]
    scene = dataclasses.replace(walled(), goals=goals)
    alone = {seed: Runner(tidy(goals), scene).run(seed) for seed in (0, 1)}
    with BatchRunner(lambda: tidy(goals), scene, None, 2, 1) as batch:
        for seed, found in batch.run(range(2)):
            one = alone[seed]
            assert (one.success, one.why, one.control_steps) == (
                found.success,
                found.why,
                found.control_steps,
            )


@pytest.mark.physical
def test_two_find_room_on_one_tray_and_one_beside_another():
    goals = [Goal("cup", "tray", relation="anywhere"), Goal("box", "tray", relation="anywhere")]
    scene = Scene("panda", fixtures=["tray"], objects={"cup": "on table", "box": "on table"})
    successes(reached(Runner(tidy(goals), scene), goals), range(7, 12), n=4)
    goals = [Goal("box", "cup", relation="beside")]
    scene = Scene("panda", fixtures=["tray"], objects={"cup": "on tray", "box": "on table"})
    successes(reached(Runner(tidy(goals), scene), goals), range(7, 12), n=4)


def test_a_function_is_no_goal_that_a_tree_can_be_made_of():
    def tidied(final):
        return True

    for other in (GoalFunction.of(tidied), tidied):
        with pytest.raises(InputError, match=r"'.*tidied.*' is a function, or no goal at all"):
            tidy([Goal("a", on="table"), other])


def test_goals_may_come_from_a_generator():
    goals = [Goal("a", on="spot"), Goal("b", on="a")]
    assert same_tree(tidy(goal for goal in goals), tidy(goals))


@pytest.mark.physical
@pytest.mark.parametrize(
    ("goal", "fixtures", "things"),
    [
        (Goal("can", inside="tray"), ["tray"], {"can": "cylinder on table"}),
        (
            Goal("can", inside="cup"),
            [],
            {"cup": "cup on table", "can": ObjectSpec(("cube",), on="table", size=((0.02,) * 3,) * 2)},
        ),
    ],
)
def test_what_is_taller_than_a_low_container_is_in_it_and_a_small_thing_in_a_cup(goal, fixtures, things):
    """The condition that the tree asks in the end agrees with the success evaluator."""
    scene = Scene(fixtures=fixtures, objects=things, goals=[goal])
    with Runner(lambda: tidy([goal]), scene) as runner:
        for result in successes(runner.run, range(5)):
            assert result.status == Status.SUCCESS, "the tree knows that it is there"


def test_what_is_no_list_of_goals_or_moves_its_own_parking_place_is_refused():
    with pytest.raises(InputError, match="takes a sequence of goals, found nothing"):
        tidy(None)
    with pytest.raises(InputError, match="'a' cannot be the parking place, since a goal moves it"):
        tidy([Goal("a", on="spot"), Goal("b", on="table")], parking="a")
