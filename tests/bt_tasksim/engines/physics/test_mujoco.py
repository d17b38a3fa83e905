"""MuJoCo: drives beside SAPIEN's, friction, presses, forces that add up, and the same again bit for bit."""

import json
import subprocess
import sys

import numpy as np
import pytest
from draws import successes
from hypothesis import given, settings
from hypothesis import strategies as st
from physics_cases import PHYSICS, G, Still, assert_identical, episode, holding, runner_of, scene

from bt_tasksim.core import poses
from bt_tasksim.core.errors import MachineError
from bt_tasksim.core.world import Command, JointTarget
from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics
from bt_tasksim.engines.physics.mujoco import MujocoPhysics
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import Runner
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.box import Box
from bt_tasksim.scene.configuration import ActorConfiguration, ObjectActor
from bt_tasksim.scene.fixtures import Fixture
from bt_tasksim.scene.scene import Scene
from bt_tasksim.trees.load import load_source

pytestmark = pytest.mark.physical

# ---- the robot --------------------------------------------------------------------------------------------


def wave(robot, time):
    """A smooth motion of all joints, two seconds there and back, arm by 0.25 rad and hand half shut."""
    start = np.concatenate([robot.rest, robot.hand_open])
    arm = np.full(len(robot.arm_joints), -0.25)
    size, rate = np.concatenate([arm, 0.5 * (robot.hand_closed - robot.hand_open)]), np.pi
    position = start + size * (1 - np.cos(rate * time)) / 2
    return JointTarget(position, size * rate * np.sin(rate * time) / 2)


@pytest.mark.parametrize("name", ["panda", "xarm7_ability"])
def test_drives_follow_a_free_motion_as_those_of_sapien_do(name):
    robot, configuration = load_robot(name), Scene(robot=name).sample(0)
    engines = [PHYSICS[engine](robot) for engine in ("sapien", "mujoco")]
    for engine in engines:
        engine.reset(configuration)
    moved = 0.0
    for k in range(1, 41):
        target = wave(robot, 0.05 * k)
        theirs, ours = (engine.step(target) for engine in engines)
        moved = max(moved, np.abs(ours.joint_position[0] - robot.rest[0]))
        assert np.abs(ours.joint_position - theirs.joint_position).max() < 0.002, "rad, m"
        assert np.abs(ours.joint_velocity - theirs.joint_velocity).max() < 0.03, "rad/s, m/s"
        assert np.linalg.norm(ours.tool_pose[:3] - theirs.tool_pose[:3]) < 0.001
        assert np.abs(ours.tips - theirs.tips).max() < 0.001
        assert np.abs(ours.joint_position - target.position).max() < 0.035, "what they lag behind"
    assert moved > 0.2
    assert engines[1].hidden().penetration == 0.0, "no two links touched"


def test_joints_that_follow_others_do(name="xarm7_ability"):
    robot = load_robot(name)
    physics = MujocoPhysics(robot)
    physics.reset(Scene(robot=name).sample(0))
    for k in range(1, 16):
        state = physics.step(wave(robot, 0.05 * k))
        at = dict(zip(robot.joints, state.joint_position, strict=True))
        for finger in ("index", "middle", "ring", "pinky"):
            follows = 0.72349796 + 1.05851325 * at[f"{finger}_q1"]
            assert at[f"{finger}_q2"] == pytest.approx(follows, abs=0.005)


@settings(max_examples=15, deadline=None)
@given(name=st.sampled_from(["panda", "xarm7_ability", "so100"]), seed=st.integers(0, 2**16))
def test_tool_and_tips_are_where_pinocchio_says(name, seed):
    robot, rng = load_robot(name), np.random.default_rng(seed)
    arm = rng.uniform(robot.arm_lower, robot.arm_upper)
    joints = np.concatenate(
        [arm, robot.hand_position(rng.uniform(0, 1, 1 + len(robot.synergies)) * [1.0] * 1)]
    )
    configuration = ActorConfiguration(name, (), (), (), 0, joint_position=tuple(joints))
    state, kinematics = MujocoPhysics(robot).reset(configuration), PinocchioKinematics(robot)
    expected = kinematics.forward(joints)
    assert np.allclose(state.tool_pose[:3], expected[:3], atol=1e-6)
    assert poses.angle_between(state.tool_pose[3:], expected[3:]) < 1e-6
    assert np.allclose(state.tips, kinematics.tips(joints), atol=1e-6)


def test_a_drive_at_its_limit_does_not_chatter():
    """The jaw of the small arm is so light that its drive could turn it round within a step."""
    robot = load_robot("so100")
    physics = MujocoPhysics(robot)
    state = physics.reset(Scene(robot="so100").sample(0))
    shut = JointTarget(np.concatenate([robot.rest, robot.hand_closed]), np.zeros_like(state.joint_velocity))
    jaw = []
    for _ in range(30):
        state = physics.step(shut)
        jaw.append(state.joint_position[-1])
    assert np.all(np.diff(jaw) < 1e-6), "it closes all the way and never turns back"
    assert jaw[-1] == pytest.approx(robot.hand_closed[0], abs=0.01)


@pytest.mark.parametrize(("control", "physics"), [(20, 100), (200, 100), (100, 100), (1000, 20), (30, 50)])
def test_a_period_takes_its_time_whatever_the_frequencies(control, physics):
    engine = MujocoPhysics(load_robot("panda"))
    rates = {"physics_frequency": physics, "control_frequency": control}
    state = engine.reset(ActorConfiguration("panda", (), (), (), 0, **rates))
    target = JointTarget(state.joint_position + 0.01, np.zeros(9))
    for k in range(1, 9):
        state = engine.step(target)
        assert engine.simulated.data.time == pytest.approx(k / control) and float(
            state.time
        ) == pytest.approx(k / control)


# ---- friction ---------------------------------------------------------------------------------------------


def on_a_slope(angle, kind, friction, base, seconds=1.0):
    """Metres that an object slides down a slope, away from the robot."""
    turn = poses.from_rotation_vector(np.array([0.0, angle, 0.0]))
    size = (0.06, 0.05, 0.03) if kind == "box" else (0.06, 0.06, 0.03)
    middle = np.array([3.0, 0.0, 0.5])
    slope = Fixture(
        "slope",
        (*middle.tolist(), *turn.tolist()),
        (Box((0, 0, -0.05, 1, 0, 0, 0), (1.5, 1.5, 0.1), friction=base),),
        (),
    )
    stands = middle + poses.rotate(turn, np.array([0.0, 0.0, size[2] / 2]))
    pose = (*stands.tolist(), *turn.tolist())
    thing = ObjectActor("thing", kind, size, (1.0, 1.0), 0.2, friction, pose, (1.0, 0.0, 0.0))
    physics = MujocoPhysics(load_robot("panda"))
    state = physics.reset(ActorConfiguration("panda", (thing,), (slope,), (), 0))
    target = JointTarget(state.joint_position.copy(), np.zeros_like(state.joint_velocity))
    for _ in range(round(20 * seconds)):
        state = physics.step(target)
    assert physics.hidden().penetration < 0.001
    return float(np.linalg.norm(state.objects[0, :3] - stands))


@pytest.mark.parametrize("kind", ["box", "cylinder"])
@pytest.mark.parametrize(("friction", "base"), [(0.5, 0.7), (0.3, 0.3), (0.9, 0.5)])
def test_an_object_slides_above_the_angle_of_friction_and_stays_below(kind, friction, base):
    mean = (friction + base) / 2
    assert on_a_slope(np.arctan(0.96 * mean), kind, friction, base) < 2e-4
    angle = np.arctan(1.1 * mean)
    free = G * (np.sin(angle) - mean * np.cos(angle)) / 2
    assert 0.8 * free < on_a_slope(angle, kind, friction, base) < 1.5 * free


@pytest.mark.parametrize(("mass", "friction", "holds"), [(0.6, 0.5, True), (6.0, 0.1, False)])
def test_two_fingers_hold_as_much_as_friction_and_force_allow(mass, friction, holds):
    """Fingers press with 18 N each here: friction to the pads is the mean with their 1.2."""
    runner = holding("box", 0.2, engine="mujoco", friction=friction)
    force = runner.pipeline.hidden().hand_force[0] * (friction + 1.2) / 2
    assert (mass * G < 0.9 * force) == holds
    physics, k = runner.pipeline.physics, 0
    before = poses.multiply(poses.inverse(runner.pipeline.state.tool_pose), runner.pipeline.state.objects[0])
    data, body = physics.simulated.data, physics.simulated.world.object_body[k]
    data.xfrc_applied[body, 2] = -mass * G  # as heavy as that, all at once
    for _ in range(20):
        runner.pipeline.step(Command())
    after = poses.multiply(poses.inverse(runner.pipeline.state.tool_pose), runner.pipeline.state.objects[0])
    assert (np.linalg.norm(after[:3] - before[:3]) < 0.001) == holds


def test_what_is_held_does_not_creep():
    runner = holding("cylinder", 0.3, engine="mujoco")
    held = []
    for _ in range(50):
        runner.pipeline.step(Command())
        state = runner.pipeline.state
        held.append(poses.multiply(poses.inverse(state.tool_pose), state.objects[0]))
    assert np.linalg.norm(held[-1][:3] - held[9][:3]) < 5e-5
    assert poses.angle_between(held[-1][3:], held[9][3:]) < 0.002
    assert runner.pipeline.hidden().penetration < 0.001


# ---- forces -----------------------------------------------------------------------------------------------


def test_fingertips_carry_the_weight_by_friction():
    runner = holding("box", 0.2, engine="mujoco")
    for _ in range(10):
        runner.pipeline.step(Command())
    left, right = runner.pipeline.state.tip_force
    assert np.allclose(left + right, [0, 0, -0.2 * G], atol=0.05)


def test_a_press_is_felt_at_the_wrist_as_the_contacts_have_it():
    """The closed fingers press from above on a box that stands on the table."""
    configuration = scene("box", 0.2, friction=0.9).sample(2)
    robot = load_robot("panda")
    kinematics, physics = PinocchioKinematics(robot), MujocoPhysics(robot)
    actor = configuration.objects[0]
    tool = robot.pointing_down(np.array([*actor.pose[:2], actor.pose[2] + actor.size[2] / 2 + 0.03]))
    arm = kinematics.inverse(tool)
    joints = np.concatenate([arm, robot.hand_closed])
    configuration = ActorConfiguration.from_json(
        json.dumps({**json.loads(configuration.to_json()), "joint_position": joints.tolist()})
    )
    state = physics.reset(configuration)
    kinematics.reset(configuration)
    felt = []
    for k in range(50):
        lower = tool - np.array([0, 0, min(0.001 * k, 0.028), 0, 0, 0, 0])
        state = physics.step(kinematics.solve(Command(tool=lower, hand=np.array([1.0])), state))
        force = poses.rotate(state.tool_pose[3:], state.wrench[:3])
        hidden = physics.hidden()
        assert hidden.hand_force[0] == pytest.approx(
            np.linalg.norm(force), abs=0.05 * np.linalg.norm(force) + 0.5
        )
        assert np.allclose(state.tip_force.sum(axis=0), force, atol=0.05 * np.linalg.norm(force) + 0.5)
        felt.append(force[2])
    assert felt[0] == pytest.approx(0.0, abs=0.5) and felt[-1] > 8.0, "the table carries, the fingers press"
    assert abs(felt[-1] - felt[-5]) < 0.05 * felt[-1], "and it stays so"
    assert hidden.support[0, 1] and hidden.penetration < 0.002


# ---- episodes ---------------------------------------------------------------------------------------------


def test_same_seed_same_states_bit_for_bit_in_any_order_of_episodes():
    first = runner_of("pick_and_throw", "mujoco")
    forth = {seed: episode(first, seed) for seed in (11, 12)}
    second = runner_of("pick_and_throw", "mujoco")
    other = load_source("pick_and_place", robot="xarm7_ability")
    between = Runner(other.build(), other.scene, EngineOptions(engines="mujoco"))
    between.begin(1)
    for _ in range(5):
        between.tick()
        between.step(between.context.command)
    back = {seed: episode(second, seed) for seed in (12, 11)}
    assert len(forth[12]) == len(back[12])
    for seed in forth:
        assert_identical(forth[seed], back[seed])


@pytest.mark.parametrize("scenario", ["pick_and_place", "shelf_to_shelf", "pick_and_throw"])
def test_trees_written_for_one_physics_work_in_the_other(scenario):
    successes(runner_of(scenario, "mujoco").run, range(12, 17))


# ---- the machine ------------------------------------------------------------------------------------------


def test_without_mujoco_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(MachineError, match=r"pip install 'bt-tasksim\[mujoco\]'"):
        MujocoPhysics(load_robot("panda"))


def test_a_target_that_is_no_number_is_refused_and_moves_nothing():
    still = Still(scene().sample(0), "mujoco")
    before = still.step(2).joint_position
    bad = JointTarget(np.where(np.arange(9) == 2, np.nan, before), np.zeros(9))
    with pytest.raises(MachineError, match="the joint target is not finite"):
        still.physics.step(bad)
    assert np.abs(still.step().joint_position - before).max() < 1e-6


@pytest.mark.parametrize("blow", ["a speed that is no number", "a force beyond all bounds"])
def test_a_world_that_blew_up_is_an_error_and_does_not_start_anew(tmp_path, monkeypatch, blow):
    """MuJoCo would go on from what it makes of it, and write to the working folder that something was odd."""
    monkeypatch.chdir(tmp_path)
    still = Still(scene().sample(0), "mujoco")
    still.step(2)
    world = still.physics.simulated
    if blow == "a speed that is no number":
        world.data.qvel[3] = np.inf
    else:
        world.data.xfrc_applied[world.world.object_body[0], 0] = 1e13
    with pytest.raises(MachineError, match=r"unstable within 0.1|no longer finite after 0.1"):
        still.step()
    assert not list(tmp_path.iterdir())


def test_it_needs_no_other_simulator_and_no_torch():
    code = (
        "import sys, json;"
        "from bt_tasksim.engines.physics.mujoco import MujocoPhysics;"
        "from bt_tasksim.robot.description import load_robot;"
        "from bt_tasksim.scene.scene import Scene;"
        "p = MujocoPhysics(load_robot('panda'));"
        "p.reset(Scene(objects={'cup': 'on table'}).sample(0)); p.hidden();"
        "print(json.dumps(sorted({'sapien', 'mani_skill', 'torch', 'trimesh', 'scipy'} & set(sys.modules))))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == []
