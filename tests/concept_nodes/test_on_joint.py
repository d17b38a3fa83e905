"""Drawers and doors: the hand goes along the joint, and refuses what it cannot do in one sentence."""

import numpy as np
import pytest
from draws import successes
from py_trees.common import Status

from bt_tasksim.concept_nodes import (
    AdjustDrawer,
    CloseDrawer,
    Grasp,
    OpenDoor,
    OpenDrawer,
    Pick,
    PressButton,
    Release,
)
from bt_tasksim.concept_nodes.handle import NO_PART, OTHER_PART, about_handle, at_handle
from bt_tasksim.concept_nodes.holding import NOT_HELD
from bt_tasksim.concept_nodes.limits import WRIST_STRAINED
from bt_tasksim.concept_nodes.on_joint import FURTHER, IN_TIME, JAMMED, NOT_THERE, TOO_FAR, JointMemory
from bt_tasksim.concept_nodes.press_button import AROUND, FIST, LEANS, LEVEL, _fists
from bt_tasksim.concept_nodes.press_button import JAMMED as BUTTON_JAMS
from bt_tasksim.concept_nodes.to_stop import GENTLY, SEARCHES
from bt_tasksim.core import poses
from bt_tasksim.core.outcomes import GOAL_LOST, NO_WAY
from bt_tasksim.core.resources import asset
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import Runner
from bt_tasksim.planning.bodies import bodies_of
from bt_tasksim.planning.hand_collision import hand_pieces
from bt_tasksim.planning.reference_motion import plan, position
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene import FixtureSpec, Goal, ObjectSpec, Scene
from bt_tasksim.trees import same_tree, sequence, tidy, tree_from_xml, tree_to_xml
from bt_tasksim.trees.load import load_source
from tests.bt_tasksim.scene.states import drawn, state
from tests.concept_nodes.test_agreement_with_goals import seen_exactly

CUP = {"cup": ObjectSpec(kinds=("cup",), on="table", centre=(-0.1, -0.25), area=(0.0, 0.0))}


def ran(*leaves, seed=3, goal=None, engines="sapien", fixture="chest", **scene):
    goal = goal or Goal("drawer", relation="shut")
    made = Scene(fixtures=[FixtureSpec(fixture)], goal=goal, name="chest", **scene)
    return Runner(sequence("the tree", *leaves), made, EngineOptions(engines=engines)).run(seed)


def stiff(tmp_path, friction):
    """The chest with a drawer that takes more to move."""
    text = asset("fixtures", "chest.yaml").read_text().replace("friction: 4.0", f"friction: {friction}")
    found = tmp_path / "chest.yaml"
    found.write_text(text)
    return str(found)


@pytest.mark.physical
@pytest.mark.parametrize("engines", ["sapien", "mujoco"])
def test_a_drawer_is_opened_adjusted_and_shut_again(engines):
    def run(seed):
        moved = (
            OpenDrawer("drawer", distance=0.18),
            AdjustDrawer("drawer", distance=0.10),
            CloseDrawer("drawer"),
        )
        return ran(Grasp("drawer"), *moved, Release("drawer"), seed=seed, engines=engines)

    (result,) = successes(run, range(3, 6), n=1)
    assert result.status == Status.SUCCESS and result.verdict.penetration < 0.002


@pytest.mark.parametrize(
    ("leaf", "reason"),
    [
        (OpenDrawer("drawer"), NOT_HELD),
        (OpenDoor("drawer"), OTHER_PART[True]),
        (OpenDrawer("drawer", distance=0.6), TOO_FAR[False]),
        (AdjustDrawer("drawer", distance=0.6), TOO_FAR[False]),
        (OpenDrawer("cup"), NO_PART),
        (Pick("drawer"), NOT_HELD),
    ],
)
def test_what_cannot_be_done_is_refused(leaf, reason):
    result = ran(leaf, objects=CUP)
    assert result.status == Status.FAILURE and result.outcome.is_a(reason)


def test_no_grasp_is_blamed_for_a_drawer_that_goes_less_far():
    result = ran(Grasp("drawer"), OpenDrawer("drawer", distance=0.6))
    assert result.status == Status.FAILURE and result.outcome.is_a(TOO_FAR[False])


@pytest.mark.parametrize(
    ("force_limit", "reasons"),
    [(50.0, (WRIST_STRAINED, NOT_THERE[False])), (200.0, (GOAL_LOST,))],
    ids=["it pulls no harder than it may", "the fingers slip off"],
)
def test_a_drawer_that_is_stuck_is_given_up_before_anything_breaks(tmp_path, force_limit, reasons):
    pulls = OpenDrawer("drawer", distance=0.15, force_limit=force_limit)
    result = ran(Grasp("drawer"), pulls, fixture=stiff(tmp_path, 300.0))
    assert result.status == Status.FAILURE
    assert any(result.outcome.is_a(why) for why in reasons), result.outcome.sentence


def hand_on_the_drawer(pressed):
    """What is seen of a shut drawer while so many newtons press the hand out again, and a way of it there."""
    made = Scene(fixtures=[FixtureSpec("chest")], goal=Goal("drawer", relation="shut"))
    configuration, model = drawn(made)
    seen = seen_exactly(model, state(configuration))
    tool, part = seen.tool, seen.object("drawer")
    law = seen.model("drawer").joints
    out = poses.rotate(law.pose(np.zeros(1))[:, 3:], law.axis)
    force = poses.rotate(poses.quat_conjugate(tool[:, 3:]), pressed * out)
    seen.observation.wrench = np.concatenate([force, np.zeros((1, 3))], axis=-1)
    return seen, lambda goal: JointMemory(
        plan([tool, poses.multiply(law.pose(goal), poses.relative(part, tool))], 0.1),
        poses.relative(tool, part),
        goal,
        np.zeros(1),
        tool[:, :3],
        np.zeros(1, bool),
        np.zeros((1, 3)),
        np.zeros(1),
        np.zeros(1),
        np.zeros(1, int),
        np.zeros(1),
        np.zeros(1),
    )


def test_a_part_that_stays_far_behind_the_hand_is_jammed():
    """The hand goes on with no force at the wrist, and the drawer is seen where it was."""
    pulls = OpenDrawer.value(target="drawer", distance=0.15)
    seen, remembered = hand_on_the_drawer(0.0)
    memory = remembered(np.array([0.15]))
    for _ in range(100):
        memory = pulls.advance(None, seen, memory)
        broken = [each.reason for each in pulls.limits(seen, memory) if np.all(each.applies)]
        if broken:
            break
    assert broken == [JAMMED[False]]


@pytest.mark.parametrize(
    ("pressed", "ticks"),
    [(30.0, 1), (15.0, 2), (5.0, None), (-30.0, None)],
    ids=["a firm stop at once", "a soft one in two ticks", "friction is none", "nor is what pulls on"],
)
def test_a_stop_is_felt(pressed, ticks):
    """Nothing is pressed for another period against a stop that is firm."""
    shuts, (seen, remembered) = CloseDrawer.value(target="drawer"), hand_on_the_drawer(pressed)
    memory = remembered(np.zeros(1))._replace(progress=np.array([-1.0]))  # on its way, not at its end
    felt = None
    for tick in range(1, 6):
        if felt is None and shuts.done(seen, memory):
            felt = tick
        memory = shuts.advance(None, seen, memory)
    assert felt == ticks


def test_a_stop_that_is_not_felt_is_looked_for_a_little_way_on():
    """Where the part seems to be shut the hand has come to the end of its way, and nothing holds it up."""
    shuts, (seen, remembered) = CloseDrawer.value(target="drawer"), hand_on_the_drawer(0.0)
    memory = remembered(np.zeros(1))
    memory = memory._replace(progress=memory.path.duration, late=np.array([IN_TIME]))
    ends = []
    while not shuts.done(seen, memory) and len(ends) < 200:
        memory = shuts.advance(None, seen, memory)
        ends.append(float(shuts.command(None, seen, memory).tool[0, 0] - seen.tool[0, 0]))
    assert ends[-1] == pytest.approx(SEARCHES, abs=1e-3), "inwards, away from the robot"
    assert max(np.diff([0.0, *ends])) <= 1.01 * GENTLY * seen.world.control_period
    felt, _ = hand_on_the_drawer(30.0)
    memory = remembered(np.zeros(1))._replace(progress=memory.progress, late=memory.late)
    assert shuts.done(felt, memory) and not shuts.done(seen, memory)


@pytest.mark.parametrize(("late", "off", "done"), [(0.1, 0.0, True), (0.1, 0.003, False), (2.0, 0.003, True)])
def test_a_part_is_given_time_to_come_closer_to_what_is_asked(late, off, done):
    pulls = AdjustDrawer.value(target="drawer", distance=off)
    seen, remembered = hand_on_the_drawer(0.0)
    memory = remembered(np.array([off]))
    assert pulls.done(seen, memory._replace(progress=memory.path.duration, late=np.array([late]))) == done


def test_a_handle_is_held_while_the_fingers_are_about_it_though_none_is_felt():
    seen, _ = hand_on_the_drawer(0.0)
    handle = poses.transform(seen.object("drawer")[:, None, :], seen.model("drawer").handles)[:, :1, :]
    held = []
    for tips, closure, felt in ((handle, 0.5, True), (handle, 0.5, False), (handle, 1.0, False)):
        seen.observation.tips = np.repeat(tips, 2, axis=1)
        seen.observation.closure = np.array([closure])
        seen.observation.contacts = np.full((1, 2), felt)
        held.append((bool(at_handle(seen, "drawer")[0]), bool(about_handle(seen, "drawer")[0])))
    assert held == [(True, True), (False, True), (False, False)]
    seen.observation.tips = seen.observation.tips + 0.1
    seen.observation.closure = np.array([0.5])
    assert not about_handle(seen, "drawer")[0]


def test_a_part_that_has_stayed_behind_is_taken_on_beyond_the_end_of_the_way():
    """Fingers that give way leave it behind: the hand goes on until it is there, and no farther."""
    pulls = AdjustDrawer.value(target="drawer", distance=0.01)
    seen, remembered = hand_on_the_drawer(0.0)
    memory = remembered(np.array([0.01]))
    ends = []
    for _ in range(60):
        memory = pulls.advance(None, seen, memory)
        ends.append(float(np.linalg.norm(pulls.command(None, seen, memory).tool[0, :3] - seen.tool[0, :3])))
    assert max(ends[:2]) < 0.011 and ends[-1] == pytest.approx(0.01 + FURTHER[False], abs=1e-3)
    assert (np.diff(ends) > -1e-9).all()


def test_a_hand_that_was_held_up_on_its_way_goes_on_from_there():
    """One control period of force is no end of the way: no step is longer than its speed."""
    pulls = OpenDrawer.value(target="drawer", distance=0.2)
    seen, remembered = hand_on_the_drawer(0.0)
    strained, _ = hand_on_the_drawer(-0.92 * pulls.force_limit)
    memory = remembered(np.array([0.2]))
    tools = []
    for tick in range(25):
        at = strained if tick == 10 else seen
        memory = pulls.advance(None, at, memory)
        tools.append(pulls._led(at, memory)[0][0, :3])
    steps = np.linalg.norm(np.diff(tools, axis=0), axis=1)
    assert steps.max() <= pulls.speed * seen.world.control_period and not memory.further.any()
    assert steps[9] == 0.0 < steps[10], "it stood still meanwhile"


def test_beyond_a_stop_that_is_not_felt_the_hand_goes_no_faster():
    shuts, (seen, remembered) = CloseDrawer.value(target="drawer"), hand_on_the_drawer(0.0)
    law, memory = seen.model("drawer").joints, remembered(np.zeros(1))
    grip = poses.inverse(memory.grip)
    way = [poses.multiply(law.pose(np.array([value])), grip) for value in (0.1, -0.06)]
    memory = memory._replace(path=plan(way, 0.15))
    inwards = (way[1] - way[0])[0, :3] / 0.16
    stop, period, speeds = (way[0][0, :3] + 0.1 * inwards), seen.world.control_period, []
    while float(memory.progress[0]) < float(memory.path.duration[0]) - 0.3:
        before = position(memory.path, memory.progress)
        memory = memory._replace(progress=memory.progress + period * shuts._share(seen, memory))
        here = position(memory.path, memory.progress)
        speeds.append(((here[0] - stop) @ inwards, float(np.linalg.norm(here - before)) / period))
    beyond = [speed for depth, speed in speeds if 0.002 < depth < 0.045]
    assert max(speed for _, speed in speeds) > 5 * GENTLY, "on its way it is faster"
    assert len(beyond) > 20 and max(beyond) <= 1.1 * GENTLY


def test_a_way_that_the_arm_cannot_go_is_refused_before_it_is_begun():
    far = FixtureSpec("chest", at=(0.95, 0.0))
    made = Scene(fixtures=[far], goal=Goal("drawer", relation="open"), name="far")
    tree = sequence("the tree", Grasp("drawer"), OpenDrawer("drawer"))
    result = Runner(tree, made, EngineOptions()).run(3)
    assert result.status == Status.FAILURE and result.outcome.is_a(NO_WAY)


def test_goals_of_parts_become_trees_of_what_moves_them():
    tree = tidy([Goal("drawer", relation="open", value=0.15), Goal("door", relation="shut")])
    said = tree_to_xml(tree)
    assert all(f"<{name} " in said for name in ("Slides", "OpenDrawer", "Turns", "CloseDoor", "IsShut"))
    assert same_tree(tree, tree_from_xml(said))


@pytest.mark.physical
@pytest.mark.parametrize("name", ["turn_knob", "press_button"])
def test_controls_are_worked(name):
    source = load_source(name)
    (result,) = successes(Runner(source.build(), source.scene, EngineOptions()).run, range(3, 6), n=1)
    assert result.status == Status.SUCCESS and result.verdict.penetration < 0.002


STUCK = """
name: bell
pose: [0.5, 0.0, 0.0, 1, 0, 0, 0]
boxes: [{position: [0, 0, 0.1], size: [0.2, 0.2, 0.2]}]
places: []
parts:
  - {name: button, joint: slide, axis: [0, 0, -1], limits: [0, 0.015], mass: 0.1, friction: 300.0,
     boxes: [{position: [0, 0, 0.21], size: [0.05, 0.05, 0.04]}]}
"""


def test_what_stops_a_button_before_the_end_of_its_way_is_not_its_stop(tmp_path):
    fixture = tmp_path / "bell.yaml"
    fixture.write_text(STUCK)
    result = ran(PressButton("button"), fixture=str(fixture), goal=Goal("button", relation="open"))
    assert result.status == Status.FAILURE and result.outcome.is_a(BUTTON_JAMS)


@pytest.mark.parametrize("robot", ["panda", "xarm7_ability"])
def test_the_front_of_a_fist_that_leans_is_where_the_button_is(robot):
    robot, axis = load_robot(robot), np.array([0.6, 0.0, -0.8])
    hand = robot.hand_position(np.array([FIST]))
    corners = np.concatenate(hand_pieces(bodies_of(robot), hand))
    found = list(_fists(robot, hand, axis))
    assert len(found) == AROUND * (1 + 2 * len(LEANS))
    for k, (rotation, ahead) in enumerate(found):
        lean = [0.0, *LEANS][(k + AROUND) // (2 * AROUND)]
        assert poses.z_axis(rotation) @ axis == pytest.approx(np.cos(lean))
        reach = (poses.rotate(rotation, corners) @ axis).max()
        assert ahead @ axis == pytest.approx(reach, abs=LEVEL if k >= AROUND else 0.02)
