"""How far a part is taken to be open: as it is seen where it is sensed, else as the hand has left it."""

import dataclasses

import numpy as np
import pytest

from bt_tasksim.core import poses
from bt_tasksim.core.joints import Joints
from bt_tasksim.core.world import WorldState
from bt_tasksim.engines.perception.noise import NoiseModel, noise_model
from bt_tasksim.engines.perception.state import StatePostProcess
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import FixtureSpec

ROBOT = load_robot("panda")
FAR = np.array([0.2, 0.3, 0.6])


class Robot:
    """Looks at a drawer or door that is open by a value, with its fingertips somewhere."""

    def __init__(self, fixture="drawer", sensed=False, noise="none", drawn=0.0, **parameters):
        spec = FixtureSpec(fixture, sensed=sensed, parameters={"value": drawn, **parameters})
        self.world = Scene(fixtures=[spec]).sample(0)
        self.joint = Joints.of([self.world.objects[0].joint])
        noise = noise if isinstance(noise, NoiseModel) else noise_model(noise)
        self.engine = StatePostProcess(ROBOT, noise)
        self.engine.reset(self.world, self.world.world_model(["left", "right"], 0.08))
        self.time = 0.0

    def pose(self, value):
        return self.joint.pose(np.array([float(value)]))[0]

    def grasp(self, value):
        grip = self.world.objects[0].grasps[0]
        return poses.transform(self.pose(value), np.array(grip.point))

    def sees(self, value, at=FAR, force=0.0, shut=False, apart=0.016, push=(0.0, 0.0, 0.0)):
        """The value that it takes the part to have."""
        pose = np.full(7, np.nan) if value is None else self.pose(value)
        hand = ROBOT.hand_closed if shut else ROBOT.hand_open
        state = WorldState(
            time=np.float64(self.time),
            joint_position=np.concatenate([ROBOT.rest, hand]),
            joint_velocity=np.zeros(9),
            joint_effort=np.zeros(9),
            tip_force=np.full((2, 3), force),
            wrench=np.concatenate([np.array(push), np.zeros(3)]),
            tool_pose=poses.pose(np.array(at)),
            tips=np.array([at, at]) + np.array([[0, 0, apart / 2], [0, 0, -apart / 2]]),
            objects=pose[None],
            velocities=np.zeros((1, 6)),
        )
        self.time += 0.05
        seen = self.engine.observe(state, {}).objects[0]
        return float(self.joint.value(seen[None])[0]) if np.isfinite(seen).all() else None


def test_what_is_sensed_is_seen():
    robot = Robot(sensed=True)
    assert [robot.sees(v) for v in (0.0, 0.1, 0.05)] == pytest.approx([0.0, 0.1, 0.05], abs=1e-9)


def test_what_is_seen_with_an_error_is_brought_onto_its_joint():
    robot = Robot(fixture="door", sensed=True, noise="fine")
    for value in (0.0, 0.7, 1.2):
        found = robot.sees(value)
        assert found is not None and abs(found - value) < 0.1


def test_what_is_not_sensed_stays_where_it_was_at_the_beginning():
    robot = Robot(drawn=0.05)
    assert robot.sees(0.05) == pytest.approx(0.05)
    assert robot.sees(0.15) == robot.sees(0.2) == pytest.approx(0.05)


def test_what_nobody_tracks_is_where_the_scene_says():
    robot = Robot(drawn=0.07)
    assert robot.sees(None) == pytest.approx(0.07)
    assert Robot(drawn=0.07, sensed=True).sees(None) is None


@pytest.mark.parametrize(("fixture", "way"), [("drawer", 0.1), ("door", 0.6)])
def test_it_goes_along_with_fingers_that_hold_its_handle(fixture, way):
    robot = Robot(fixture=fixture)
    robot.sees(0.0)
    for value in np.linspace(0.0, way, 9):
        found = robot.sees(0.0, robot.grasp(value), force=1.0)
    assert found == pytest.approx(way, abs=1e-6)
    for value in np.linspace(way, way / 2, 9):  # in a soft hand, which does not open: not felt, and held
        found = robot.sees(0.0, robot.grasp(value), force=0.0)
    assert found == pytest.approx(way / 2, abs=1e-6)
    for value in np.linspace(way / 2, 0.0, 9):  # let go: it stays
        found = robot.sees(0.0, robot.grasp(value), force=0.0, apart=0.05)
    assert found == pytest.approx(way / 2, abs=1e-6)


@pytest.mark.parametrize(("fixture", "off"), [("drawer", 0.008), ("door", 0.05)])
@pytest.mark.parametrize("stopped", [True, False])
def test_a_stop_that_the_hand_feels_says_where_it_stands(fixture, off, stopped):
    robot = Robot(fixture=fixture)
    robot.sees(4 * off)
    for value in np.linspace(4 * off, off, 9):
        robot.sees(0.0, robot.grasp(value), force=1.0)
    at, ahead = robot.grasp(off), robot.grasp(off - 1e-3) - robot.grasp(off)
    for newtons in np.linspace(0.0, 12.0, 7):  # of the part on the hand, against its way, or along it
        push = -ahead / np.linalg.norm(ahead) * newtons * (1.0 if stopped else -1.0)
        found = robot.sees(0.0, at, force=1.0, push=push)
    assert found == pytest.approx(0.0 if stopped else off, abs=1e-6)


def test_what_rubs_or_is_far_from_its_stop_is_not_taken_to_be_stopped():
    robot = Robot(friction=5.0)
    robot.sees(0.1)
    for k, value in enumerate(np.linspace(0.1, 0.004, 49)):  # 5 N all the way, and more every now and then
        found = robot.sees(
            0.0, robot.grasp(value), force=1.0, push=np.array([-5.0 - 3.0 * (k % 2), 0.0, 0.0])
        )
    assert found == pytest.approx(0.004, abs=1e-6)
    for newtons in np.linspace(5.0, 10.0, 9):  # what sticks takes some more before it goes on
        found = robot.sees(0.0, robot.grasp(0.004), force=1.0, push=np.array([-newtons, 0.0, 0.0]))
    assert found == pytest.approx(0.004, abs=1e-6)
    robot = Robot()
    robot.sees(0.1)
    for newtons in np.linspace(0.0, 30.0, 9):
        found = robot.sees(0.0, robot.grasp(0.1), force=1.0, push=np.array([-newtons, 0.0, 0.0]))
    assert found == pytest.approx(0.1, abs=1e-6)


def test_it_stays_where_fingers_slip_off_it_and_close_on_one_another():
    robot = Robot()
    robot.sees(0.0)
    for value in (0.0, 0.01, 0.02):
        robot.sees(0.0, robot.grasp(value), force=1.0)
    robot.sees(0.0, robot.grasp(0.02), force=0.0, apart=0.005)  # for an instant they touch nothing
    for value in (0.03, 0.05, 0.1):
        found = robot.sees(0.0, robot.grasp(value), force=1.0, apart=0.002)
    assert found == pytest.approx(0.02, abs=1e-6)
    robot.sees(0.0, robot.grasp(0.02), apart=0.05)
    for value in (0.02, 0.03, 0.04):  # taken again
        found = robot.sees(0.0, robot.grasp(value), force=1.0)
    assert found == pytest.approx(0.04, abs=1e-6)


def test_fingers_elsewhere_move_nothing():
    robot = Robot()
    robot.sees(0.0)
    for x in np.linspace(0.0, 0.1, 5):
        found = robot.sees(0.0, robot.grasp(0.0) + np.array([-x, 0.1, 0.1]), force=1.0)
    assert found == 0.0


def test_it_goes_no_farther_than_its_limits():
    robot = Robot(opens=0.2)
    robot.sees(0.0)
    for x in np.linspace(0.0, 0.4, 30):
        found = robot.sees(0.0, robot.grasp(0.0) + np.array([-x, 0.0, 0.0]) * (x < 0.02), force=1.0)
    assert 0.0 <= found <= 0.2


@pytest.mark.parametrize("shut", [True, False])
def test_a_fist_pushes_it_and_an_open_hand_does_not(shut):
    robot = Robot(drawn=0.15, height=0.13)
    robot.sees(0.15)
    front = robot.grasp(0.15) + np.array([0.032, 0.08, 0.04])  # on the front, beside the handle
    for x in np.linspace(0.0, 0.1, 9):
        found = robot.sees(0.15, front + np.array([x, 0.0, 0.0]), force=1.0, shut=shut)
    assert found == pytest.approx(0.05 if shut else 0.15, abs=0.003)


def test_episodes_do_not_remember():
    robot = Robot()
    robot.sees(0.1)
    robot.engine.reset(robot.world, robot.world.world_model(["left", "right"], 0.08))
    assert robot.sees(0.02) == pytest.approx(0.02)
    assert dataclasses.replace(robot.world).objects[0].joint.sensed is False
