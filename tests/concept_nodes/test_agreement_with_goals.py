"""Where estimates are exact, a condition answers what the success evaluator says, whatever the state."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.any_tree.meshes import write
from bt_tasksim.concept.condition import Condition
from bt_tasksim.concept.seen import Seen
from bt_tasksim.concept_nodes import AtPose, Clear
from bt_tasksim.concept_nodes.spots import spots_on
from bt_tasksim.concept_nodes.view import views
from bt_tasksim.concept_nodes.whereabouts import Estimates
from bt_tasksim.core import poses
from bt_tasksim.core.errors import NoWayError
from bt_tasksim.core.facts import WorldFacts
from bt_tasksim.core.registry import parts
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.relations import FinalState, relation_named
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.spatial_laws import floats
from bt_tasksim.scene.specs import Goal, ObjectSpec
from tests.bt_tasksim.scene.states import state

ROBOT = load_robot("panda")
PEA = ((0.02,) * 3,) * 2
AGREED = ("anywhere", "inside", "beside")


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    """A tray, and hollow and solid things on the table: the drawn world and its facts."""
    files = write(tmp_path_factory.mktemp("meshes"), 3)
    mug, corner = files["mug"], files["corner"]
    scene = Scene(
        fixtures=["tray"],
        objects={
            "pea": ObjectSpec(("cube",), on="table", centre=(-0.1, -0.3), area=(0, 0), size=PEA),
            "box": ObjectSpec(("box",), on="table", centre=(0.0, -0.15), area=(0, 0)),
            "bowl": ObjectSpec(("cup",), inside="tray"),
            "mug": ObjectSpec(("mesh",), on="table", centre=(0.15, 0.0), area=(0, 0), mesh=str(mug)),
            "corner": ObjectSpec(("mesh",), on="table", centre=(0.15, -0.2), area=(0, 0), mesh=str(corner)),
        },
    )
    drawn = scene.sample(3)
    return drawn, drawn.world_model([tip.name for tip in ROBOT.tips], ROBOT.opening)


def seen_exactly(world, hidden):
    """What is seen where every estimate is exact."""
    observation = SimpleNamespace(
        objects=hidden.objects[None],
        tool_pose=hidden.tool_pose[None],
        arm_position=np.zeros((1, len(ROBOT.arm_joints))),
        hand_position=np.asarray(ROBOT.hand_open, float)[None],
        contacts=np.zeros((1, len(ROBOT.tips)), bool),
    )
    return Seen(observation, WorldFacts.of([world]), ROBOT, np.zeros(1))


def asked(goal, world, hidden):
    """What the condition of a goal's relation answers."""
    kinds = parts("concept").values()
    (kind,) = {k for k in kinds if issubclass(k, Condition) and k.relation == goal.relation}
    return bool(kind.value(**kind.from_goal(goal)).holds(seen_exactly(world, hidden))[0])


def judged(goal, drawn, world, hidden):
    return relation_named(goal.relation).evaluate(goal, FinalState(drawn, world, hidden)).reached


@st.composite
def placings(draw):
    """A goal, and where its object is: near what the goal refers to, or near something else."""
    relation = draw(st.sampled_from(AGREED))
    thing = draw(st.sampled_from(["pea", "box", "bowl", "corner"]))
    others = [n for n in ("box", "bowl", "mug", "corner") if n != thing]
    places = others if relation == "beside" else [*others, "tray", "table"]
    near = draw(st.sampled_from([*others, "tray", "table"]))
    limits = {"position_tolerance": draw(st.sampled_from([0.03, 0.01]))}
    if relation == "beside":
        limits["distance"] = draw(st.sampled_from([0.1, 0.03]))
    goal = Goal(
        thing, draw(st.sampled_from([near if near in places else places[0], *places])), relation, **limits
    )
    aside = [draw(st.floats(-0.12, 0.12)) for _ in range(2)]
    up = draw(st.sampled_from([0.0, 0.0, 0.004, 0.02, 0.05]))
    tilted = draw(st.sampled_from([0.0, 0.0, 0.1, 0.25, np.pi / 2, np.pi]))
    return goal, near, aside, up, tilted, draw(st.floats(-np.pi, np.pi)), draw(st.booleans())


def state_of(room, placing):
    drawn, world = room
    goal, near, (x, y), up, tilted, heading, on_top = placing
    hidden = state(drawn)
    final = FinalState(drawn, world, hidden)
    frame = (
        final.surface(near)
        if on_top or not final.is_object(near)
        else poses.pose([*final.pose(near)[:2], final.lowest(near)])
    )
    turn = poses.from_rotation_vector(tilted * np.array([np.cos(heading), np.sin(heading), 0.0]))
    turn = poses.quat_multiply(turn, poses.yaw(heading))
    at = poses.pose([frame[0] + x, frame[1] + y, 0.0], turn)
    lowest = FinalState(drawn, world, state(drawn, {goal.object: at})).lowest(goal.object)
    at[2] = frame[2] + up - lowest
    return state(drawn, {goal.object: at})


@settings(max_examples=300, deadline=None)
@given(placings())
def test_conditions_and_the_success_evaluator_agree(room, placing):
    hidden = state_of(room, placing)
    assert asked(placing[0], room[1], hidden) == judged(placing[0], *room, hidden)


@settings(max_examples=150, deadline=None)
@given(placings())
def test_where_something_is_at_its_pose_the_success_evaluator_says_so(room, placing):
    """Under limits that are tighter than the goal's what the condition lets pass is in place."""
    goal = replace(placing[0], relation="on", distance=0.1, position_tolerance=0.03, angle_tolerance=0.25)
    hidden = state_of(room, (goal, *placing[1:]))
    if asked(goal, room[1], hidden):
        assert judged(goal, *room, hidden)


def test_what_stands_next_to_or_on_a_third_thing_is_not_at_its_pose(room):
    drawn, world = room
    box = np.array(next(a.pose for a in drawn.objects if a.name == "box"))
    goal, top = Goal("pea", on="box"), box[2] + world.object("box").extent[2] / 2
    along = box[3:]  # what stands there stands as the box does
    middle = np.array([0.0, 0.0, top + 0.01 - box[2]])
    assert both(room, goal, put(room, "pea", poses.transform(box, middle), along))
    thin = world.object("box").extent[1] / 2
    wide = Goal("pea", on="box", position_tolerance=0.5)
    for aside, answer in ((thin - 0.001, True), (thin + 0.001, False)):
        hidden = put(room, "pea", poses.transform(box, middle + np.array([0.0, aside, 0.0])), along)
        seen = AtPose.value("pea", on="box", tolerance=0.5).holds(seen_exactly(world, hidden))
        assert bool(seen[0]) is judged(wide, drawn, world, hidden) is answer
    bowl = next(np.array(a.pose) for a in drawn.objects if a.name == "bowl")
    inside = put(room, "pea", [*bowl[:2], 0.04])
    assert not both(room, Goal("pea", on="table", position_tolerance=0.5), inside)


@pytest.mark.parametrize("relation", AGREED)
def test_these_placings_have_both_answers(room, relation):
    rng, found = np.random.default_rng(0), []
    where = {"inside": "mug", "beside": "box", "anywhere": "tray"}[relation]
    for _ in range(60):
        aside = rng.uniform(-0.08, 0.08, 2)
        placing = (Goal("pea", where, relation), where, aside, 0.007, 0.0, 0.0, False)
        found.append(judged(placing[0], *room, state_of(room, placing)))
    assert 5 < sum(found) < 55


def put(room, name, position, turn=(1.0, 0.0, 0.0, 0.0)):
    return state(room[0], {name: poses.pose(position, np.array(turn))})


def both(room, goal, hidden):
    answer = judged(goal, *room, hidden)
    assert asked(goal, room[1], hidden) == answer
    return answer


def test_beside_a_mugs_handle_is_not_in_the_mug(room):
    """Nor in the handle's opening, nor under the mug; but on its floor, up to its rim, however it lies."""
    drawn, world = room
    mug = np.array(next(a.pose for a in drawn.objects if a.name == "mug"))
    x, y, z = world.object("mug").extent
    goal = Goal("pea", inside="mug")
    middle = x / 2 - 0.012  # of the opening, between handle and wall

    def at(*local):
        return both(room, goal, put(room, "pea", poses.transform(mug, np.array(local))))

    axis = -(x - y) / 2  # the mug's own axis is off the box's middle by half of what the handle adds
    assert at(axis, 0.0, -z / 2 + 0.018) and at(axis, 0.0, z / 2 - 0.01)
    assert not at(axis, 0.0, z / 2 + 0.012)
    assert not at(middle, 0.0, 0.0)
    assert not at(x / 2 - 0.01, y / 2 - 0.01, -z / 2 + 0.01)  # in the corner of its box
    assert not at(axis, 0.0, -z / 2 - 0.02)
    over = poses.from_rotation_vector(np.array([np.pi / 2, 0.0, 0.0]))
    lying = poses.pose([*mug[:2], y / 2], over)
    inner = poses.transform(lying, np.array([axis, -0.01, 0.0]))
    assert both(room, goal, state(drawn, {"mug": lying, "pea": poses.pose(inner)}))


def test_what_stands_in_a_tray_or_on_a_thing_does_not_stand_on_the_table(room):
    drawn, world = room
    tray = world.place("tray").pose
    goal = Goal("pea", on="table", relation="anywhere")
    in_tray = put(room, "pea", poses.transform(tray, np.array([-0.1, 0.0, 0.01])))
    assert not both(room, goal, in_tray)
    assert both(room, Goal("pea", on="tray", relation="anywhere"), in_tray)
    assert both(room, goal, put(room, "pea", [0.4, -0.3, 0.01]))
    mug = next(a.pose for a in drawn.objects if a.name == "mug")
    axis = -(world.object("mug").extent[0] - world.object("mug").extent[1]) / 2
    floor = poses.transform(np.array(mug), np.array([axis, 0.0, 0.0]))
    assert not both(room, goal, put(room, "pea", [*floor[:2], 0.017]))
    corner = next(a.pose for a in drawn.objects if a.name == "corner")
    arm = poses.transform(np.array(corner), np.array([0.03, 0.0, 0.0]))
    assert not both(room, goal, put(room, "pea", [*arm[:2], 0.03]))


def test_the_opening_of_a_handle_is_still_on_the_table(room):
    drawn, world = room
    mug = next(a.pose for a in drawn.objects if a.name == "mug")
    opening = poses.transform(np.array(mug), np.array([world.object("mug").extent[0] / 2 - 0.012, 0.0, 0.0]))
    goal = Goal("pea", on="table", relation="anywhere")
    assert both(room, goal, put(room, "pea", [*opening[:2], 0.01]))


def test_what_lies_tilted_stands_nowhere_and_beside_nothing(room):
    tilted = poses.from_rotation_vector(np.array([0.3, 0.0, 0.0]))
    leaning = put(room, "box", [0.4, -0.3, 0.04], tilted)
    assert not both(room, Goal("box", on="table", relation="anywhere", position_tolerance=0.05), leaning)


CLUTTER = Scene(
    fixtures=["tray"],
    objects={
        "it": ObjectSpec(("box", "cylinder"), on="table", centre=(-0.1, -0.35), area=(0, 0)),
        **{
            f"thing {k}": ObjectSpec(
                ("box", "cup", "cylinder"), on="table", centre=(0.1, -0.2), area=(0.08, 0.12)
            )
            for k in range(3)
        },
    },
)


def cluttered(seed, moved):
    """What is seen where three things stand off the middle of the tray by so much."""
    drawn = CLUTTER.sample(seed)
    world = drawn.world_model([tip.name for tip in ROBOT.tips], ROBOT.opening)
    tray, at = world.place("tray").pose, {}
    for k, (x, y) in enumerate(moved):
        height = world.object(f"thing {k}").extent[2] / 2
        at[f"thing {k}"] = poses.pose(poses.transform(tray, np.array([x, y, height])))
    return seen_exactly(world, state(drawn, at))


@settings(max_examples=25, deadline=None)
@given(
    st.integers(0, 10**6),
    st.lists(st.tuples(st.floats(-0.14, 0.14), st.floats(-0.1, 0.1)), min_size=3, max_size=3),
    st.sampled_from(["tray", "thing 0", "table"]),
)
def test_there_is_room_where_a_spot_is_found(seed, moved, place):
    seen = cluttered(seed, moved)
    room = bool(Clear.value(place, "it", anywhere=True).holds(seen)[0])
    try:
        spots = len(spots_on(views(seen)[0], "it", place).poses)
    except NoWayError:
        spots = 0
    assert room == (spots > 0)


@pytest.mark.parametrize(
    ("place", "moved", "margin", "sentence"),
    [
        ("tray", [], 0.0, "tray has room"),
        ("tray", [], 0.3, "tray has room"),
        ("tray", [(0.1, 0.0), (0.0, 0.0), (-0.1, 0.0)], 0.1, "tray has no room for it"),
        ("thing 1", [(0.1, 0.0), (0.0, 0.0), (-0.1, 0.0)], 0.0, "thing 1 has room"),
    ],
)
def test_room_is_said(place, moved, margin, sentence):
    seen = cluttered(1, moved)
    condition = Clear.value(place, "it", margin=margin, anywhere=True)
    assert bool(condition.holds(seen)[0]) is (sentence.endswith("room"))
    assert condition.explain(seen).at(0).sentence == sentence


def test_nothing_unseen_finds_room_or_gives_it():
    seen = cluttered(1, [])
    seen.observation.objects[0, seen.world.column("it")] = np.nan
    assert not Clear.value("tray", "it", anywhere=True).holds(seen)[0]
    seen = cluttered(1, [])
    seen.observation.objects[0, seen.world.column("thing 0")] = np.nan
    assert not Clear.value("thing 0", "it", anywhere=True).holds(seen)[0]


@pytest.mark.parametrize(
    ("height", "floats_there"), [(0.0, False), (0.015, False), (0.12, True), (0.4, True)]
)
def test_what_is_seen_in_the_air_is_not_at_rest_there(room, height, floats_there):
    drawn, world = room
    hidden = state(drawn)
    at = world.objects.index(world.object("bowl"))
    objects = hidden.objects.copy()
    objects[at, 2] += height
    seen = seen_exactly(world, replace(hidden, objects=objects))
    assert floats(Estimates(seen), "bowl", "tray").tolist() == [floats_there]
