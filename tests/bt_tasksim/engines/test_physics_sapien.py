"""Physics: falling, resting, holding, touching, pushing, and the same again bit for bit."""

import dataclasses

import numpy as np
import pytest
from py_trees.common import Status

from bt_tasksim import poses
from bt_tasksim.engines.physics_sapien import SapienPhysics
from bt_tasksim.engines.pipeline import PhysicsEngine
from bt_tasksim.engines.registry import EngineOptions
from bt_tasksim.robot import load_robot
from bt_tasksim.runner import Runner
from bt_tasksim.scene import ObjectSpec, Scene
from bt_tasksim.world import Command, JointTarget
from concept_nodes import Grasp, Pick
from trees import sequence
from trees.load import load_source

G = 9.81
KINDS = ("box", "cube", "cup", "cylinder", "oval", "diamond")


def scene(kind="box", mass=0.2, **settings):
    spec = ObjectSpec(
        kinds=(kind,),
        on="table",
        centre=(0.0, -0.14),
        area=(0.03, 0.03),
        mass=(mass, mass),
        friction=(0.7, 0.7),
    )
    return Scene(**{"objects": {"thing": spec}, **settings})


def lifted(configuration, height, turn=(0.0, 0.0, 0.0)):
    """The configuration with its object raised and turned."""
    actor = configuration.objects[0]
    move = poses.pose([0, 0, height], poses.from_rotation_vector(np.array(turn)))
    pose = np.array(actor.pose)
    pose[2] += height
    pose[3:] = poses.quat_multiply(move[3:], pose[3:])
    return dataclasses.replace(configuration, objects=(dataclasses.replace(actor, pose=tuple(pose)),))


class Still:
    """A robot that stays where it is."""

    def __init__(self, configuration):
        self.physics = SapienPhysics(load_robot(configuration.robot))
        self.state = self.physics.reset(configuration)
        self.target = JointTarget(self.state.joint_position.copy(), np.zeros_like(self.state.joint_velocity))

    def step(self, n=1):
        for _ in range(n):
            self.state = self.physics.step(self.target)
        return self.state


def holding(kind="box", mass=0.2, seed=0, **settings):
    """A runner at the instant at which the object hangs in the hand."""
    tree = sequence("lift", Grasp("thing"), Pick("thing", distance=0.1))
    runner = Runner(tree, scene(kind, mass, **settings), EngineOptions(noise="none"))
    runner.begin(seed)
    for _ in range(400):
        runner.tick()
        if tree.status != Status.RUNNING:
            break
        runner.context.advance(runner.pipeline.step(runner.context.command))
    assert tree.status == Status.SUCCESS, tree.tip().feedback_message
    return runner


# ---- resting and falling ----------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_what_stands_stays_put(kind):
    still = Still(scene(kind).sample(2))
    before = still.state.objects.copy()
    state = still.step(40)
    assert np.abs(state.objects[:, :3] - before[:, :3]).max() < 5e-4
    assert poses.angle_between(state.objects[0, 3:], before[0, 3:]) < 5e-3
    hidden = still.physics.hidden()
    assert np.abs(hidden.velocities).max() < 5e-3 and hidden.penetration < 5e-4
    assert hidden.support[0, 1], "it touches the table"
    assert hidden.hand_force[0] == 0.0 and hidden.hand_distance[0] == np.inf
    assert state.time == pytest.approx(2.0) and hidden.time == state.time


def test_the_arm_stays_put_too():
    still = Still(scene().sample(0))
    state = still.step(20)
    assert np.abs(state.joint_position - still.target.position).max() < 1e-3
    assert np.abs(state.wrench).max() < 0.1, "the hand's own weight is not felt"
    assert not state.tip_force.any()


def test_a_falling_object_obeys_gravity_in_fine_steps():
    still = Still(lifted(scene().sample(1), 0.6))
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
def test_a_landing_is_no_deeper_than_two_millimetres(kind):
    still = Still(lifted(scene(kind).sample(1), 0.25, turn=(0.5, 0.3, 0.0)))
    still.step(40)
    assert 0 < still.physics.hidden().penetration < 0.002
    assert np.linalg.norm(still.physics.hidden().velocities[0, :3]) < 0.05


def test_an_overlap_is_recorded_and_remembered():
    still = Still(lifted(scene().sample(1), -0.06))
    still.step(1)  # what overlaps is driven apart at 1 m/s
    deepest = float(still.physics.hidden().penetration)
    assert 0.002 < deepest < 0.0601
    assert {"thing", "table"} == set(still.physics.deepest_pair[:2])
    still.step(30)
    assert still.physics.hidden().penetration >= deepest
    fresh = Still(scene().sample(1))
    assert fresh.physics.hidden().penetration < 5e-4


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
def test_the_wrist_feels_the_weight_of_what_is_held_whichever_way_it_is_turned(robot, kind, mass):
    runner = holding(kind, mass, robot=robot)
    weight = np.array([0, 0, -mass * G])
    for tilt in (0.0, 0.5):
        turned = runner.pipeline.state.tool_pose.copy()
        turned[3:] = poses.quat_multiply(poses.from_rotation_vector(np.array([0, -tilt, 0])), turned[3:])
        for _ in range(20):
            runner.pipeline.step(Command(tool=turned))
        force, torque, lever = felt(runner)
        assert np.linalg.norm(force - weight) < 0.2 * mass * G
        assert np.linalg.norm(torque - np.cross(lever, weight)) < 0.03, "its moment about the tool, Nm"


def test_the_wrist_feels_a_support_from_below():
    runner = holding("box", 0.2)
    tool = runner.pipeline.state.tool_pose.copy()
    forces = []
    for _ in range(30):
        tool = tool + np.array([0, 0, -0.004, 0, 0, 0, 0])
        runner.pipeline.step(Command(tool=tool))
        state = runner.pipeline.state
        forces.append(float(poses.rotate(state.tool_pose[3:], state.wrench[:3])[2]))
    assert forces[3] == pytest.approx(-0.2 * G, abs=1.0) and forces[-1] > 5.0


def test_both_fingertips_press_against_each_other():
    runner = holding("box", 0.2)
    for _ in range(10):
        runner.pipeline.step(Command())
    state, hidden = runner.pipeline.state, runner.pipeline.hidden()
    left, right = state.tip_force
    assert np.linalg.norm(left) > 5 and np.linalg.norm(right) > 5
    y = poses.rotate(state.tool_pose[3:], np.array([0.0, 1, 0]))
    assert (left @ y) * (right @ y) < 0, "one pushes one way, the other the other way"
    assert left @ y == pytest.approx(-(right @ y), rel=0.1)
    assert np.abs(left + right).max() < 0.1 * np.linalg.norm(left), "PhysX reports no friction here"
    assert hidden.hand_force[0] == pytest.approx(np.linalg.norm(left) + np.linalg.norm(right), rel=1e-6)
    assert hidden.hand_distance[0] == 0.0 and not hidden.support[0].any()


@pytest.mark.parametrize(
    ("robot", "kind"), [("panda", "box"), ("panda", "diamond"), ("xarm7_ability", "box")]
)
def test_the_hands_skin_keeps_what_it_presses_from_overlapping(robot, kind):
    runner = holding(kind, 0.2, robot=robot)
    hidden = runner.pipeline.hidden()
    assert hidden.hand_force[0] > 10.0 and hidden.hand_distance[0] == 0.0, "what rests on the skin touches"
    assert hidden.penetration < 2e-4, runner.pipeline.physics.deepest_pair


@pytest.mark.parametrize("robot", ["panda", "xarm7_ability"])
def test_frames_that_physx_need_not_move_are_where_kinematics_says(robot):
    from bt_tasksim.engines.kinematics_pinocchio import PinocchioKinematics

    still = Still(scene(robot=robot).sample(0))
    kinematics, q = PinocchioKinematics(load_robot(robot)), still.state.joint_position
    tool = kinematics.forward(q)
    assert np.allclose(still.state.tool_pose[:3], tool[:3], atol=1e-5)
    assert abs(still.state.tool_pose[3:] @ tool[3:]) == pytest.approx(1.0, abs=1e-6)
    assert np.allclose(still.state.tips, kinematics.tips(q), atol=1e-5)
    assert not any("tcp" in name or name.endswith("_tip") for name in still.physics._links)


def test_effort_is_the_drives_own_law():
    runner = holding("box", 0.2)
    robot, state = runner.robot, runner.pipeline.state
    k, d, limit = (robot.drive_array(n) for n in ("stiffness", "damping", "force_limit"))
    for offset, limited in ((0.01, False), (0.8, True)):
        target = JointTarget(state.joint_position + offset, np.full_like(state.joint_position, 0.02))
        state = runner.pipeline.physics.step(target)
        law = k * (target.position - state.joint_position) + d * (target.velocity - state.joint_velocity)
        assert np.any(np.abs(law) > limit) == limited
        assert np.allclose(state.joint_effort, np.clip(law, -limit, limit))


def test_fingers_that_press_shut_feel_it():
    runner = holding("box", 0.2)
    for _ in range(5):
        effort = runner.pipeline.step(Command()).hand_effort
    assert np.all(effort < -0.3) and np.all(effort >= -1.0)


# ---- pushing ----------------------------------------------------------------------------------------------


def test_a_disturbance_pushes_the_object_out_of_the_hand():
    undisturbed = holding("box", 0.2)
    disturbed = holding("box", 0.2, knock="thing")
    delay = disturbed.scene.sample(0).disturbance.delay
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


# ---- the same again ---------------------------------------------------------------------------------------


def episode(runner, seed):
    states = []
    runner.begin(seed)
    while True:
        runner.tick()
        states.append(runner.pipeline.state)
        if runner.tree.status != Status.RUNNING:
            return states
        runner.context.advance(runner.pipeline.step(runner.context.command))


def runner_of(scenario):
    source = load_source(scenario)
    return Runner(source.build(), source.scene)


def assert_identical(a, b):
    assert len(a) == len(b) > 80
    for x, y in zip(a, b, strict=True):
        for name in x.__slots__:
            assert np.array_equal(getattr(x, name), getattr(y, name)), f"{name} at {float(x.time):.2f} s"


@pytest.mark.parametrize("scenario", ["pick_and_place", "shelf_to_shelf", "pick_and_throw"])
def test_same_seed_same_states_bit_for_bit_in_any_order_of_episodes(scenario):
    first = runner_of(scenario)
    forth = {seed: episode(first, seed) for seed in (11, 12, 13)}
    second = runner_of(scenario)
    back = {seed: episode(second, seed) for seed in (13, 11, 12, 13)}
    for seed in forth:
        assert_identical(forth[seed], back[seed])
    assert len(forth[11]) != len(forth[12]) or not np.array_equal(
        forth[11][-1].objects, forth[12][-1].objects
    ), "other seeds are other worlds"


def test_after_episodes_of_another_scene_and_robot():
    alone = episode(runner_of("pick_and_place"), 21)
    other = load_source("pick_and_throw", robot="xarm7_ability")
    disturbing = Runner(other.build(), other.scene)
    disturbing.begin(1)
    for _ in range(10):
        disturbing.tick()
        disturbing.context.advance(disturbing.pipeline.step(disturbing.context.command))
    again = runner_of("pick_and_place")
    episode(again, 20)
    assert_identical(alone, episode(again, 21))


def test_states_are_not_overwritten_by_later_steps():
    still = Still(lifted(scene().sample(1), 0.3))
    kept = still.state
    copy = {name: np.copy(getattr(kept, name)) for name in kept.__slots__}
    still.step(5)
    assert all(np.array_equal(getattr(kept, name), value) for name, value in copy.items())


def test_it_plays_the_role():
    assert isinstance(SapienPhysics(load_robot("panda")), PhysicsEngine)
