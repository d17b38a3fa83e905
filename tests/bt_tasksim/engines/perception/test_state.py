"""The estimate without images: the truth with a stated error, fixed to each object."""

import dataclasses

import numpy as np
import pytest

from bt_tasksim.core import poses
from bt_tasksim.core.errors import MachineError
from bt_tasksim.core.world import WorldState
from bt_tasksim.engines.base import PostProcessEngine
from bt_tasksim.engines.perception.noise import NoiseModel, noise_model
from bt_tasksim.engines.perception.state import StatePostProcess
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.scene import Scene

ROBOT = load_robot("panda")
SCENE = Scene(objects={"cup": "on table", "box": "on table"})


def state(configuration, **changes):
    n = len(ROBOT.joints)
    made = WorldState(
        time=np.float64(0.0),
        joint_position=np.concatenate([ROBOT.rest, ROBOT.hand_open]),
        joint_velocity=np.zeros(n),
        joint_effort=np.zeros(n),
        tip_force=np.zeros((2, 3)),
        wrench=np.zeros(6),
        tool_pose=poses.pose([0.5, 0, 0.4]),
        tips=np.zeros((2, 3)),
        objects=np.array([a.pose for a in configuration.objects]),
        velocities=np.zeros((2, 6)),
    )
    return dataclasses.replace(made, **changes)


def engine(noise, seed=0):
    configuration = SCENE.sample(seed)
    made = StatePostProcess(ROBOT, noise if isinstance(noise, NoiseModel) else noise_model(noise))
    made.reset(configuration, configuration.world_model(["left", "right"], 0.08))
    return made, state(configuration), configuration


def test_without_noise_the_estimate_is_the_truth():
    made, now, _ = engine("none")
    assert np.allclose(made.observe(now, {}).objects, now.objects, atol=1e-15)


def test_the_error_at_first_sight_is_the_draw_in_the_base_frame():
    made, now, configuration = engine("fine")
    error = noise_model("fine").draw(configuration.generator("estimate"), 2)
    seen = made.observe(now, {}).objects
    assert np.allclose(seen[:, :3] - now.objects[:, :3], error[:, :3])
    turned = poses.quat_multiply(seen[:, 3:], poses.quat_conjugate(now.objects[:, 3:]))
    assert np.allclose(poses.rotation_vector(turned), poses.rotation_vector(error[:, 3:]))


def test_the_error_then_moves_with_the_object():
    made, now, _ = engine("hard")
    first = made.observe(now, {}).objects
    move = poses.pose([0.1, 0.2, 0.3], poses.from_rotation_vector(np.array([0.4, -0.8, 1.2])))
    moved = made.observe(
        dataclasses.replace(now, objects=poses.multiply(move[None], now.objects)), {}
    ).objects
    assert np.allclose(moved, poses.multiply(move[None], first))


def test_the_seed_alone_decides():
    one, two, other = (engine("fine", seed) for seed in (3, 3, 4))
    assert np.array_equal(one[0].observe(one[1], {}).objects, two[0].observe(two[1], {}).objects)
    gap = [made.observe(now, {}).objects - now.objects for made, now, _ in (one, other)]
    assert not np.allclose(gap[0], gap[1])


def test_a_new_episode_has_a_new_error():
    made, now, _ = engine("fine", 3)
    first = made.observe(now, {}).objects - now.objects
    configuration = SCENE.sample(4)
    made.reset(configuration, configuration.world_model(["left", "right"], 0.08))
    later = state(configuration)
    assert not np.allclose(made.observe(later, {}).objects - later.objects, first)


def test_a_real_robot_has_no_such_state():
    made, now, _ = engine("fine")
    with pytest.raises(MachineError, match="physics engine knows no objects"):
        made.observe(dataclasses.replace(now, objects=None), {})


def test_it_wants_no_images():
    made, *_ = engine("none")
    assert isinstance(made, PostProcessEngine) and made.cameras(True) == () and made.cameras(False) == ()
