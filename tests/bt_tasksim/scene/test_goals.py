"""Goals: how they are written, several of them, those that are functions, and those that hold once."""

import dataclasses
import json
import math

import numpy as np
import pytest

from bt_tasksim.core import poses
from bt_tasksim.core.errors import FieldError, InputError
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.moments import Moments
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import Goal, ObjectSpec, SpotSpec
from bt_tasksim.scene.success import NO_GOAL, evaluate_success
from tests.bt_tasksim.scene.states import drawn, state, tilted

CUBE = ((0.05,) * 3,) * 2


def cube(y, **more):
    return ObjectSpec(("cube",), on="table", centre=(0.0, y), area=(0, 0), size=CUBE, yaw=0.0, **more)


OBJECTS = {"red": cube(-0.1), "blue": cube(0.1), "green": cube(0.25)}


@pytest.mark.parametrize(
    ("goal", "fields"),
    [
        (Goal("can", inside="bin"), ("can", "bin", "inside")),
        (Goal("cup", on="board"), ("cup", "board", "on")),
        (Goal("red", "blue"), ("red", "blue", "on")),
        (Goal("box", beside="cup"), ("box", "cup", "beside")),
        (Goal("box", on="cup", relation="beside"), ("box", "cup", "beside")),
        (Goal("box", on="board", relation="anywhere"), ("box", "board", "anywhere")),
        (Goal("box", "board", "stands"), ("box", "board", "on")),
        (Goal("box", relation="lifted"), ("box", "", "lifted")),
    ],
)
def test_ways_to_write_a_goal(goal, fields):
    assert (goal.object, goal.place, goal.relation) == fields
    assert Goal(**dataclasses.asdict(goal)) == goal == dataclasses.replace(goal)
    assert goal.when == "end" and str(goal) == " ".join(w for w in (fields[0], fields[2], fields[1]) if w)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Goal("cup"), r"names no place and no object: write Goal\('cup', on='table'\)"),
        (lambda: Goal("cup", "table", on="board"), "has one reference, found 'table' and on='board'"),
        (lambda: Goal("cup", on="a", inside="b"), "found on='a' and inside='b'"),
        (lambda: Goal("cup", inside="bin", relation="beside"), "write on='bin', relation='beside'"),
        (lambda: Goal("cup", on="cup"), "refers to 'cup' itself"),
        (lambda: Goal("cup", on="table", when="always"), "'end', 'once' or 'kept', found 'always'"),
        (lambda: Goal("cup", on="table", distance=math.nan), "'distance' should be .* finite"),
        (lambda: Goal("cup", on="table", height=-1), "'height' should be positive"),
        (lambda: Goal("cup", on="table", position_tolerance="1"), "'position_tolerance' should be a number"),
        (lambda: Goal(None, on="table"), "'object' should be text"),
        (lambda: Goal("cup", on=5), "'on' should be text"),
        (lambda: Goal("cup", "table", relation=None), "'relation' should be text"),
        (
            lambda: Scene(objects=OBJECTS, goals=[Goal("red", on="yellow")]),
            "names 'yellow', which is not in it",
        ),
        (lambda: Scene(objects=OBJECTS, goals=["red"]), "a goal is a Goal.*found 'red'"),
        (lambda: Scene(objects=OBJECTS, goals="red"), "should be a list"),
        (
            lambda: Scene(objects=OBJECTS, goal=Goal("red", "blue"), goals=[Goal("red", "table")]),
            "both are given",
        ),
    ],
)
def test_goals_that_cannot_be(make, words):
    with pytest.raises(FieldError, match=words):
        make()


def test_one_goal_is_the_short_form_of_several():
    one, other = Goal("red", on="blue"), Goal("green", on="table")
    scene = Scene(objects=OBJECTS, goal=one)
    assert scene == Scene(objects=OBJECTS, goals=[one]) and scene.goal == one
    assert Scene(objects=OBJECTS, goals=scene.goals).goals == (one,)
    assert dataclasses.replace(scene, name="x").goals == (one,)
    assert dataclasses.replace(scene, goal=other).goals == (other,)
    assert dataclasses.replace(scene, goals=[one, other]).goals == (one, other)
    assert dataclasses.replace(scene, goal=None).goals == () == dataclasses.replace(scene, goals=[]).goals


def test_a_drawn_world_keeps_its_goals_in_json_and_reads_the_former_one():
    def tidy(final):
        return True

    goals = [Goal("red", on="blue", when="once"), Goal("green", on="table"), tidy]
    world = Scene(objects=OBJECTS, goals=goals).sample(0)
    again = ActorConfiguration.from_json(world.to_json())
    assert again.goals == world.goals == tuple(goals[:2]) and again.goal == goals[0]
    assert [str(f) for f in again.functions] == ["tidy"]
    data = json.loads(world.to_json())
    data["goal"] = {"object": "red", "place": "table", "relation": "stands", "height": 0.3}
    del data["goals"], data["functions"]
    former = ActorConfiguration.from_json(json.dumps(data))
    assert former.goals == (Goal("red", on="table"),) and former.functions == ()
    assert ActorConfiguration.from_json(json.dumps(data | {"goal": None})).goals == ()


STACKED = {"red": poses.pose([0.5, 0.1, 0.075])}


def verdict(goals, at, moments=None, **changes):
    configuration, world = drawn(Scene(objects=OBJECTS, goals=goals))
    return evaluate_success(configuration, world, state(configuration, at, **changes), moments)


def test_all_goals_count_and_the_first_wrong_one_is_told():
    goals = [Goal("red", on="blue"), Goal("green", beside="blue", distance=0.2)]
    found = verdict(goals, STACKED)
    assert found.success and found.judged and [p.reached for p in found.placements] == [True, True]
    assert found.why == (
        "all 2 goals are reached: red stands on blue, 0 mm and 0 degrees off; green stands 100 mm beside blue"
    ) or found.why.startswith("all 2 goals are reached: red stands on blue")
    far = {**STACKED, "green": poses.pose([0.5, 0.45, 0.025])}
    found = verdict(goals, far)
    assert not found.success and found.reason == "too_far_beside"
    assert [p.reached for p in found.placements] == [True, False]
    data = found.to_data()
    assert [p["goal"] for p in data["placements"]] == ["red on blue", "green beside blue"]
    assert [p["reason"] for p in data["placements"]] == ["", "too_far_beside"] and json.dumps(data)


def test_every_object_of_a_goal_has_to_be_at_rest_and_let_go():
    goals = [Goal("red", on="blue"), Goal("green", beside="blue", distance=0.2)]
    assert verdict(goals, STACKED, hand_distance=np.array([np.inf, np.inf, 0.0])).reason == "hand_not_clear"
    moving = np.zeros((3, 6))
    moving[2, 0] = 0.1
    assert verdict(goals, STACKED, velocities=moving).reason == "not_at_rest"
    assert verdict(goals[:1], STACKED, velocities=moving).success  # green is none of its business


def test_only_what_no_goal_names_and_nobody_may_move_is_knocked_over():
    away = {**STACKED, "green": poses.pose([0.35, 0.25, 0.025])}
    assert verdict([Goal("red", on="blue")], away).reason == "knocked_over"
    free = {**OBJECTS, "green": cube(0.25, movable=True)}
    configuration, world = drawn(Scene(objects=free, goals=[Goal("red", on="blue")]))
    assert evaluate_success(configuration, world, state(configuration, away)).success


AWAY = {"green": poses.pose([0.35, 0.25, 0.025])}
OVER = {"green": poses.pose([0.5, 0.25, 0.025], tilted(20))}


def red_is_there(final):
    return bool(final.pose("red")[0] > 0.0)


def red_is_there_by_the_arrays(final):
    return bool(final.hidden.objects[0, 0] > 0.0)


def red_is_whole(final):
    """By the laws that trees and goals share, which ask about one body at a time."""
    where = final.whereabouts
    return bool((where.body("red").pose[:, 2] > 0.0).all() and (where.hollow("red").boxes.shape[-1] == 6))


@pytest.mark.parametrize("moved", [AWAY, OVER])
def test_what_no_function_looks_at_is_knocked_over(moved):
    assert verdict([red_is_there], {}).success
    assert verdict([red_is_there], {"red": poses.pose([0.7, 0.1, 0.025])}).success
    assert verdict([red_is_there], moved).reason == "knocked_over"
    assert verdict([red_is_whole], moved).reason == "knocked_over"
    assert verdict([red_is_there, lambda final: final.touched("green") or True], moved).success
    assert verdict([red_is_there, Goal("green", "table", position_tolerance=1.0)], AWAY).success
    assert verdict([red_is_there_by_the_arrays], moved).success  # nobody knows what it looks at


@pytest.mark.parametrize("moved", [AWAY, OVER])
def test_what_nothing_lifts_is_knocked_over(moved):
    held = {"hand_distance": np.array([0.0, np.inf, np.inf])}
    up = {"red": poses.pose([0.5, -0.1, 0.325])}
    goals = [Goal("red", relation="lifted")]
    assert verdict(goals, up, **held).success
    assert verdict(goals, {**up, **moved}, **held).reason == "knocked_over"


def test_what_lay_and_was_set_upright_was_moved():
    lying = {**OBJECTS, "green": cube(0.25)}
    configuration, world = drawn(Scene(objects=lying, goals=[Goal("red", on="blue")]))
    poses_now = [list(actor.pose) for actor in configuration.objects]
    poses_now[2][3:] = tilted(60).tolist()
    actors = tuple(
        dataclasses.replace(actor, pose=tuple(pose))
        for actor, pose in zip(configuration.objects, poses_now, strict=True)
    )
    began = dataclasses.replace(configuration, objects=actors)
    assert evaluate_success(began, world, state(began, STACKED)).success
    upright = {**STACKED, "green": poses.pose(poses_now[2][:3])}
    assert evaluate_success(began, world, state(began, upright)).reason == "knocked_over"


def test_what_stands_on_a_moved_object_is_carried_and_not_knocked_over():
    objects = {
        "red": cube(-0.1),
        "pea": ObjectSpec(("cube",), on="red", size=((0.03,) * 3,) * 2, area=(0, 0)),
    }
    configuration, world = drawn(
        Scene(objects=objects, goals=[Goal("red", on="table", position_tolerance=0.5)])
    )
    assert configuration.objects[1].base == "red" and configuration.objects[1].on == "table"
    carried = {"red": poses.pose([0.6, 0.1, 0.025]), "pea": poses.pose([0.6, 0.1, 0.065])}
    assert evaluate_success(configuration, world, state(configuration, carried)).success
    fallen = {**carried, "pea": poses.pose([0.7, 0.1, 0.015])}
    assert evaluate_success(configuration, world, state(configuration, fallen)).reason == "knocked_over"


def test_what_stands_on_what_is_carried_is_carried_too():
    small = {"size": ((0.03,) * 3,) * 2, "area": (0, 0)}
    objects = {
        "red": cube(-0.1),
        "pea": ObjectSpec(("cube",), on="red", **small),
        "crumb": ObjectSpec(("cube",), on="pea", **small),
    }
    goal = Goal("red", on="table", position_tolerance=0.5, angle_tolerance=3.0)
    configuration, world = drawn(Scene(objects=objects, goals=[goal]))
    carried = poses.multiply(poses.pose([0.6, 0.3, 0.0], tilted(80, axis=2)), poses.pose([-0.5, 0.1, 0.0]))
    at = {actor.name: poses.multiply(carried, np.array(actor.pose)) for actor in configuration.objects}
    assert evaluate_success(configuration, world, state(configuration, at)).success
    at["crumb"] = poses.shifted(at["crumb"], np.array([0.08, 0.0, -0.03]))
    found = evaluate_success(configuration, world, state(configuration, at))
    assert found.reason == "knocked_over" and found.outcome.names == {"object": "crumb"}


def test_without_goals_only_the_trees_word_is_taken():
    found = verdict([], STACKED)
    assert found.success and found.outcome.is_a(NO_GOAL) and not found.judged
    assert "nothing was judged" in found.why and found.to_data()["judged"] is False


# ---- functions --------------------------------------------------------------------------------------------


def high(final):
    height = float(final.pose("red")[2])
    return height > 0.05, f"red is {1000 * height:.0f} mm up"


@pytest.mark.parametrize(
    ("function", "success", "words"),
    [
        (high, True, "high: red is 75 mm up"),
        (lambda final: final.pose("red")[2] > 0.05, True, "it is reached"),
        (lambda final: final.pose("red")[2] > 0.5, False, "it is not reached"),
    ],
)
def test_a_goal_may_be_a_function(function, success, words):
    found = verdict([function], STACKED)
    assert found.success is success and words in found.why and found.judged
    assert found.reason == ("" if success else "function_false") and math.isnan(found.position_error)


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (
            lambda final: final.pose("rde"),
            r"test_goals\.py:\d+\): no object 'rde' in the scene; did you mean 'red'",
        ),
        (lambda final: 1 / 0, r"raised ZeroDivisionError: division by zero \(test_goals\.py:\d+\)"),
        (lambda final: "yes", r"\(test_goals\.py:\d+\) should answer with True or False.*found 'yes'"),
    ],
)
def test_errors_in_a_function_say_its_file_and_line(function, words):
    with pytest.raises(InputError, match=words):
        verdict([function], STACKED)


def test_a_function_cannot_change_what_others_are_judged_by():
    """Lifted out of the state by one function, a thing would be knocked over, or in place, for the others."""

    def moves(final):
        final.pose("red")[:3] += 1.0
        return True

    with pytest.raises(InputError, match=r"goal 'moves' raised ValueError.*read-only"):
        verdict([moves, high], STACKED)


def test_a_function_that_is_not_here_is_not_judged():
    configuration, world = drawn(Scene(objects=OBJECTS, goals=[high, Goal("red", on="blue")]))
    again = ActorConfiguration.from_json(configuration.to_json())
    found = evaluate_success(again, world, state(again, STACKED))
    assert found.success and not found.judged and [p.reached for p in found.placements] == [True, None]
    assert "the goal 'high' was not judged" in found.why
    found = evaluate_success(again, world, state(again))
    assert found.reason == "not_in_place" and found.judged  # whatever the function would say


# ---- once -------------------------------------------------------------------------------------------------


def test_once_is_any_moment_at_which_it_is_at_rest_and_let_go():
    goals = [Goal("red", on="blue", when="once"), Goal("red", on="table", position_tolerance=1.0)]
    configuration, world = drawn(Scene(objects=OBJECTS, goals=goals))
    moments = Moments(configuration, world)
    assert moments.open
    back = state(configuration)
    held = state(configuration, STACKED, hand_distance=np.array([0.0, np.inf, np.inf]))
    for passing in (back, held):
        moments.look(passing)
    never = evaluate_success(configuration, world, back, moments)
    assert never.reason == "not_in_place" and "at no moment of the run" in never.why
    moments.look(state(configuration, STACKED, time=2.5))
    assert not moments.open
    found = evaluate_success(configuration, world, back, moments)
    assert found.success and found.placements[0].time == 2.5 and found.placements[0].when == "once"
    assert not evaluate_success(
        configuration,
        world,
        state(configuration, {"red": poses.pose([0.5, -0.1, 0.025], tilted(45))}),
        moments,
    ).success


def test_kept_is_for_so_many_seconds_without_a_break():
    goal = Goal("red", on="blue", when="kept", duration=1.0)
    configuration, world = drawn(Scene(objects=OBJECTS, goals=[goal]))
    moments = Moments(configuration, world)

    def look(times, at):
        for time in times:
            moments.look(state(configuration, at, time=time))
        return evaluate_success(configuration, world, state(configuration, STACKED), moments)

    broken = look(np.arange(0.0, 0.96, 0.05), STACKED)
    assert not broken.success and moments.open and broken.reason == "not_kept"
    assert broken.why == "red on blue for 0.95 s without a break at most, and not for 1 s"
    assert not look([0.96], {}).success
    assert not look(np.arange(1.0, 1.96, 0.05), STACKED).success
    found = look([2.0], STACKED)
    assert found.success and not moments.open and found.placements[0].time == 2.0


def test_a_duration_goes_with_kept():
    with pytest.raises(FieldError, match=r"'duration' .* goes with when='kept', and 'when' is 'once'"):
        Goal("red", on="blue", when="once", duration=2.0)


def test_goals_for_the_end_alone_are_not_watched():
    configuration, world = drawn(Scene(objects=OBJECTS, goals=[Goal("red", on="blue")]))
    assert not Moments(configuration, world).open


def test_all_goals_that_are_not_reached_are_named_and_the_first_one_gives_the_reason():
    wanted = [Goal("red", on="blue"), Goal("blue", on="green"), Goal("green", "table", "anywhere")]
    found = verdict(wanted, {})
    assert found.reason == "not_in_place" and not found.success
    assert found.why.startswith(
        "2 of 3 goals are not reached (red on blue, blue on green): red does not stand"
    )
    many = verdict([Goal(a, on=b) for a in OBJECTS for b in OBJECTS if a != b], {})
    assert "6 of 6 goals" in many.why and many.why.count(" on ") == 6 and ", and 1 more)" in many.why
    assert verdict(wanted[:1], {}).why.startswith("red does not stand on blue")


@pytest.mark.parametrize(
    "written",
    [
        lambda final: final.hidden.objects,
        lambda final: final.pose("red"),
        lambda final: final.place("table").pose,
        lambda final: final.surface("table"),
        lambda final: final.world.places["table"].access,
        lambda final: final.configuration.places[0].pose,
    ],
)
def test_no_function_writes_into_what_others_are_given(written):
    def careless(final):
        written(final)[...] = 0.0
        return True

    with pytest.raises(InputError, match=r"'careless' raised ValueError.*read-only \(test_goals.py:\d+\)"):
        verdict([careless], {})


def test_other_functions_are_other_goals():
    one, two = (Scene(objects=OBJECTS, goals=[judge]) for judge in (lambda f: True, lambda f: False))
    assert one != two and one == Scene(objects=OBJECTS, goals=one.goals)
    world = one.sample(0)
    assert ActorConfiguration.from_json(world.to_json()).functions == world.functions


@pytest.mark.parametrize("place", ["table", "spot"])
def test_nothing_is_to_be_inside_what_is_no_container(place):
    spot = SpotSpec("spot", "table", (0.0, 0.1), (0.0, 0.0))
    with pytest.raises(InputError, match=f"inside '{place}', which is no container: name one, such as tray"):
        Scene(
            fixtures=["tray"], objects={"cup": "cup on table"}, spots=[spot], goal=Goal("cup", inside=place)
        )


def test_nothing_is_to_be_inside_an_object_without_a_hollow():
    objects = {"cup": "cup on table", "block": "cube on table"}
    scene = Scene(objects=objects, goal=Goal("cup", inside="block"))
    with pytest.raises(InputError, match="nothing can come to be inside 'block'"):
        scene.sample(0)
