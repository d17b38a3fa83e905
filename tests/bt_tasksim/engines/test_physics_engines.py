"""What every physics engine must do: fall, rest, hold, touch, push, and overwrite no state."""

import re

import numpy as np
import pytest
from physics_cases import PHYSICS, G, Still, holding, lifted, scene

from bt_tasksim.concept.contact import ContactState
from bt_tasksim.concept_nodes.taxonomy import state_of
from bt_tasksim.core import poses
from bt_tasksim.core.world import Command, JointTarget
from bt_tasksim.engines.base import PhysicsEngine
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.success import penetration

KINDS = ("box", "cube", "cup", "cylinder", "oval", "diamond")

pytestmark = [pytest.mark.physical, pytest.mark.parametrize("engine", PHYSICS)]


# ---- resting and falling ----------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_what_stands_stays_put(engine, kind):
    still = Still(scene(kind).sample(2), engine)
    before = still.state.objects.copy()
    state = still.step(40)
    assert np.abs(state.objects[:, :3] - before[:, :3]).max() < 5e-4
    assert poses.angle_between(state.objects[0, 3:], before[0, 3:]) < 5e-3
    hidden = still.physics.hidden()
    assert np.abs(hidden.velocities).max() < 5e-3 and hidden.penetration < 5e-4
    assert hidden.support[0, 1], "it touches the table"
    assert hidden.hand_force[0] == 0.0 and hidden.hand_distance[0] == np.inf
    assert state.time == pytest.approx(2.0) and hidden.time == state.time


def test_contact_points_give_the_class_of_a_named_object(engine):
    still = Still(scene("box").sample(2), engine)
    still.step(2)
    contacts = still.physics.contact_points()
    normals, points = contacts.on("thing")
    half = np.array(still.state.objects[0, :3]) - points.mean(axis=0)
    assert normals == pytest.approx(np.tile([0.0, 0.0, 1.0], (len(normals), 1)), abs=1e-3)
    assert np.abs(half[:2]).max() < 0.02 and half[2] > 0.02, "below the box, all around its middle"
    assert contacts.with_each_other("table", "thing") and not contacts.with_each_other("thing", "panda_hand")
    near = points[np.argsort(np.linalg.norm(points - points[0], axis=1))]  # a corner, and the next one
    middle, edge, along = still.state.objects[0, :3], near[:2].mean(axis=0), near[1] - near[0]
    assert state_of("thing", contacts) is ContactState.PC
    assert state_of("thing", contacts, "rotation", centre=middle) is ContactState.PR, "about the vertical"
    free = {state_of("thing", contacts, "rotation", centre=edge, axis=s * along) for s in (1.0, -1.0)}
    assert free == {ContactState.OP}, "about an edge it is stopped one way"
    assert state_of("table", contacts) is ContactState.PC, "what presses on it from above"


def test_contact_points_of_what_hangs_in_the_hand(engine):
    contacts = holding(engine=engine).pipeline.physics.contact_points()
    assert state_of("thing", contacts) is ContactState.NC
    assert state_of("thing", contacts, hand=True) is ContactState.TR


def test_the_arm_stays_put_too(engine):
    still = Still(scene().sample(0), engine)
    state = still.step(20)
    assert np.abs(state.joint_position - still.target.position).max() < 1e-3
    assert np.abs(state.wrench).max() < 0.1, "the hand's own weight is not felt"
    assert not state.tip_force.any()


def test_a_falling_object_obeys_gravity_in_fine_steps(engine):
    still = Still(lifted(scene().sample(1), 0.6), engine)
    start = still.state.objects[0, 2]
    times, heights = [], []
    for _ in range(6):
        state = still.step()
        times.append(float(state.time))
        heights.append(start - state.objects[0, 2])
    # Steps of a hundredth of a second would be 15 mm ahead after 0.3 s, fine ones are 3 mm.
    expected = G * np.array(times) ** 2 / 2
    assert np.all(np.abs(np.array(heights) - expected) < 0.007)
    assert state.velocities[0, 2] == pytest.approx(-G * 0.3, rel=0.01)


@pytest.mark.parametrize("kind", ["box", "cup", "diamond"])
def test_a_landing_is_no_deeper_than_two_millimetres(engine, kind):
    still = Still(lifted(scene(kind).sample(1), 0.25, turn=(0.5, 0.3, 0.0)), engine)
    still.step(80)
    assert 0 < still.physics.hidden().penetration < 0.002
    assert np.linalg.norm(still.physics.hidden().velocities[0, :3]) < 0.05


def test_a_ball_lands_no_deeper_than_that_either(engine):
    still = Still(lifted(scene("ball").sample(1), 0.25), engine)
    still.step(40)
    assert 0 < still.physics.hidden().penetration < 0.002
    assert abs(still.physics.hidden().velocities[0, 2]) < 0.05


def test_an_overlap_is_recorded_and_remembered(engine):
    still = Still(lifted(scene().sample(1), -0.06), engine)
    still.step(1)  # what overlaps is driven apart
    deepest = float(still.physics.hidden().penetration)
    assert 0.002 < deepest < 0.0601
    assert {"thing", "table"} == set(still.physics.deepest_pair[:2])
    said = penetration(deepest, still.physics.deepest_pair).sentence
    assert re.fullmatch(r"(thing and table|table and thing) overlapped by .* mm at \d\.\d\d s", said), said
    still.step(30)
    assert still.physics.hidden().penetration >= deepest
    fresh = Still(scene().sample(1), engine)
    assert fresh.physics.hidden().penetration < 5e-4
    still.physics.reset(Scene().sample(0))
    assert still.physics.hidden().penetration == 0.0 and still.physics.deepest_pair is None


# ---- holding ----------------------------------------------------------------------------------------------


def felt(runner, n=20):
    """Mean force and torque at the tool in the robot's base frame, and the lever of the object."""
    forces, torques = [], []
    for _ in range(n):
        runner.pipeline.step(Command())
        state = runner.pipeline.state
        forces.append(poses.rotate(state.tool_pose[3:], state.wrench[:3]))
        torques.append(poses.rotate(state.tool_pose[3:], state.wrench[3:]))
    lever = state.objects[0, :3] - state.tool_pose[:3]
    return np.mean(forces[n // 3 :], axis=0), np.mean(torques[n // 3 :], axis=0), lever


@pytest.mark.parametrize(
    ("robot", "kind", "mass"),
    [("panda", "box", 0.15), ("panda", "cylinder", 0.3), ("xarm7_ability", "cylinder", 0.2)],
)
def test_the_wrist_feels_the_weight_of_what_is_held_whichever_way_it_is_turned(engine, robot, kind, mass):
    runner = holding(kind, mass, engine=engine, robot=robot)
    weight = np.array([0, 0, -mass * G])
    for tilt in (0.0, 0.5):
        turned = runner.pipeline.state.tool_pose.copy()
        turned[3:] = poses.quat_multiply(poses.from_rotation_vector(np.array([0, -tilt, 0])), turned[3:])
        for _ in range(20):
            runner.pipeline.step(Command(tool=turned))
        force, torque, lever = felt(runner)
        assert np.linalg.norm(force - weight) < 0.2 * mass * G
        assert np.linalg.norm(torque - np.cross(lever, weight)) < 0.03, "its moment about the tool, Nm"


def test_the_wrist_feels_a_support_from_below(engine):
    runner = holding("box", 0.2, engine=engine)
    tool = runner.pipeline.state.tool_pose.copy()
    forces = []
    for _ in range(30):
        tool = tool + np.array([0, 0, -0.004, 0, 0, 0, 0])
        runner.pipeline.step(Command(tool=tool))
        state = runner.pipeline.state
        forces.append(float(poses.rotate(state.tool_pose[3:], state.wrench[:3])[2]))
    assert forces[3] == pytest.approx(-0.2 * G, abs=1.0) and forces[-1] > 5.0


def test_both_fingertips_press_against_each_other(engine):
    runner = holding("box", 0.2, engine=engine)
    for _ in range(10):
        runner.pipeline.step(Command())
    state, hidden = runner.pipeline.state, runner.pipeline.hidden()
    left, right = state.tip_force
    assert np.linalg.norm(left) > 5 and np.linalg.norm(right) > 5
    y = poses.rotate(state.tool_pose[3:], np.array([0.0, 1, 0]))
    assert (left @ y) * (right @ y) < 0, "one pushes one way, the other the other way"
    assert left @ y == pytest.approx(-(right @ y), rel=0.1)
    assert hidden.hand_force[0] == pytest.approx(np.linalg.norm(left) + np.linalg.norm(right), rel=1e-6)
    assert hidden.hand_distance[0] == 0.0 and not hidden.support[0].any()


def test_effort_is_the_drives_own_law(engine):
    runner = holding("box", 0.2, engine=engine)
    robot, state = runner.robot, runner.pipeline.state
    k, d, limit = (robot.drive_array(n) for n in ("stiffness", "damping", "force_limit"))
    for offset, limited in ((0.01, False), (0.8, True)):
        target = JointTarget(state.joint_position + offset, np.full_like(state.joint_position, 0.02))
        state = runner.pipeline.physics.step(target)
        law = k * (target.position - state.joint_position) + d * (target.velocity - state.joint_velocity)
        assert np.any(np.abs(law) > limit) == limited
        off = np.abs(state.joint_effort - np.clip(law, -limit, limit))
        assert np.all(off < 2e-6 * k + 1e-5), "as exact as targets are (see `perturbation`)"


def test_fingers_that_press_shut_feel_it(engine):
    runner = holding("box", 0.2, engine=engine)
    for _ in range(5):
        effort = runner.pipeline.step(Command()).hand_effort
    assert np.all(effort < -0.3) and np.all(effort >= -1.0)


# ---- pushing ----------------------------------------------------------------------------------------------


def test_a_disturbance_pushes_the_object_out_of_the_hand(engine):
    undisturbed = holding("box", 0.2, engine=engine)
    disturbed = holding("box", 0.2, engine=engine, disturbed="thing")
    delay = 1.6  # seconds, the longest that is drawn
    forces = {}
    for name, runner in (("undisturbed", undisturbed), ("disturbed", disturbed)):
        forces[name] = []
        for _ in range(round((delay + 1.5) / 0.05)):
            runner.pipeline.step(Command())
            forces[name].append(float(runner.pipeline.hidden().hand_force[0]))
    assert min(forces["undisturbed"]) > 5.0
    assert forces["disturbed"][-1] == 0.0
    hidden = disturbed.pipeline.hidden()
    assert hidden.objects[0, 2] < undisturbed.pipeline.hidden().objects[0, 2] - 0.05
    assert hidden.support[0].any() and hidden.penetration < 0.002


# ---- states -----------------------------------------------------------------------------------------------


def test_states_are_not_overwritten_by_later_steps(engine):
    still = Still(lifted(scene().sample(1), 0.3), engine)
    kept, hidden = still.state, still.physics.hidden()
    copies = [{name: np.copy(getattr(o, name)) for name in o.__slots__} for o in (kept, hidden)]
    still.step(5)
    for o, copy in zip((kept, hidden), copies, strict=True):
        assert all(np.array_equal(getattr(o, name), value) for name, value in copy.items())


def test_it_plays_the_role(engine):
    assert isinstance(PHYSICS[engine](load_robot("panda")), PhysicsEngine)
