"""Engines in real processes: each role gives what it gives here, bit for bit, and errors travel."""

import dataclasses

import numpy as np
import pytest
from py_trees.common import Status

from bt_tasksim.core.errors import InputError, MachineError, UnreachableError
from bt_tasksim.core.resources import asset
from bt_tasksim.core.world import Command, JointTarget
from bt_tasksim.engines.base import KinematicsEngine, PhysicsEngine, PostProcessEngine, RenderingEngine
from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics
from bt_tasksim.engines.perception.opencv import CameraPostProcess
from bt_tasksim.engines.pipeline import EnginePipeline
from bt_tasksim.engines.remote.engines import RemotePostProcess, RemoteRendering
from bt_tasksim.execution.pipelines import EngineOptions, build_engine, build_pipeline, result_names
from bt_tasksim.execution.runner import Runner
from bt_tasksim.robot.description import load_robot
from bt_tasksim.training.evaluation import Job, evaluate
from bt_tasksim.trees.load import load_source

from .conftest import served


@pytest.fixture(scope="module")
def physics(folder):
    with served(folder, "physics", "sapien") as server:
        yield server


@pytest.fixture(scope="module")
def kinematics(folder):
    with served(folder, "kinematics", "pinocchio") as server:
        yield server


def connected(role, server, robot):
    return build_engine(role, server.name, robot)


def episode(seed, **options):
    """Every state and observation of an episode, its verdict, and the truth at its end."""
    source = load_source("pick_and_place")
    runner = Runner(source.build(), source.scene, EngineOptions(**options))
    seen = []
    try:
        result = runner.run(seed, record=lambda step: seen.append((step.pipeline.state, step.observation)))
        return seen, result, runner.pipeline.hidden()
    finally:
        runner.close()


@pytest.fixture(scope="module")
def here():
    return {seed: episode(seed) for seed in (4, 5)}


def same(a, b):
    a, b = np.asarray(a), np.asarray(b)
    return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()


def assert_identical(ours, theirs):
    (seen, result, truth), (other, other_result, other_truth) = ours, theirs
    assert len(seen) == len(other) > 80
    for (state, observation), (state_2, observation_2) in zip(seen, other, strict=True):
        for bundle, bundle_2 in ((state, state_2), (observation, observation_2)):
            for name in (f.name for f in dataclasses.fields(bundle)):
                assert same(getattr(bundle, name), getattr(bundle_2, name)), (
                    f"{name} at {float(state.time)} s"
                )
    assert all(same(getattr(truth, f.name), getattr(other_truth, f.name)) for f in dataclasses.fields(truth))
    assert result.status == other_result.status == Status.SUCCESS
    assert result.verdict == other_result.verdict and result.why == other_result.why


@pytest.mark.parametrize("seed", [5, 4])
def test_an_episode_through_served_physics_is_the_same_bit_for_bit(physics, here, seed):
    assert_identical(here[seed], episode(seed, engines=physics.name))


def test_an_episode_through_served_kinematics_is_the_same_bit_for_bit(kinematics, here):
    assert_identical(here[4], episode(4, kinematics=kinematics.name))


def test_an_episode_with_all_but_pictures_served_is_the_same_bit_for_bit(physics, kinematics, here, folder):
    with served(folder, "postprocess", "state") as perception:
        options = {
            "engines": physics.name,
            "kinematics": kinematics.name,
            "perception": perception.name,
        }
        assert_identical(here[5], episode(5, **options))
    assert (physics.said(), kinematics.said(), perception.said()) == ([], [], [])


@pytest.mark.parametrize("drawn", ["", "original"])
def test_the_client_says_how_noisy_a_served_estimate_is(folder, robot, world, state, drawn):
    model = world.world_model([tip.name for tip in robot.tips], robot.opening)
    world = dataclasses.replace(world, noise=drawn)
    seen = {}
    with served(folder, "postprocess", "state") as server:
        for noise in ("none", "fine", "hard"):
            options = EngineOptions(perception=server.name, noise=noise)
            line = build_pipeline(robot, options)
            own = build_engine("postprocess", "state", robot, noise)
            for engine in (line.postprocess, own):
                engine.reset(world, model)
            a, b = line.postprocess.observe(state, {}), own.observe(state, {})
            assert same(a.objects, b.objects)
            seen[noise] = a.objects.tobytes()
            assert result_names(options, line) == ("sapien", f"{server.name} (state, noise {noise})")
            line.close()
    assert len(set(seen.values())) == (1 if drawn else 3), "the world as drawn goes first"


def test_results_say_which_engine_was_behind_an_address(physics):
    job = Job("pick_and_place", options=EngineOptions(engines=physics.name))
    assert evaluate(job, [5]).to_json()["engines"] == f"{physics.name} (sapien)"


def test_an_episode_that_begins_with_the_hand_above_the_object(kinematics, physics):
    world = load_source("grasp_then_pick").scene.sample(2, stage=0)
    assert world.hand_start
    states = []
    for options in ({}, {"kinematics": kinematics.name, "engines": physics.name}):
        source = load_source("grasp_then_pick")
        runner = Runner(source.build(), source.scene, EngineOptions(**options))
        runner.reset(world)
        states.append(runner.pipeline.state)
        runner.close()
    assert same(states[0].joint_position, states[1].joint_position)
    assert not same(states[0].joint_position, np.concatenate([runner.robot.rest, runner.robot.hand_open]))


def test_out_of_reach_comes_back_with_its_distance(kinematics, robot, world, state):
    line = build_pipeline(robot, EngineOptions(kinematics=kinematics.name))
    errors = []
    far = Command(np.array([2.0, 0.0, 0.3, 0.0, 1.0, 0.0, 0.0]))
    for engine in (line.kinematics, PinocchioKinematics(robot)):
        engine.reset(world)
        with pytest.raises(UnreachableError) as error:
            engine.solve(far, state)
        errors.append((str(error.value), error.value.distance, error.value.angle))
        stay = engine.solve(Command(state.tool_pose, np.array([0.5])), state)
        errors.append(stay.position.tobytes())
    assert errors[:2] == errors[2:] and errors[0][1] > 0.5, "and the engine goes on"
    line.close()


def test_served_perception_sees_in_pictures_what_it_sees_here(folder, robot, world, state, image):
    model = world.world_model([tip.name for tip in robot.tips], robot.opening)
    with served(folder, "postprocess", "camera") as server:
        remote = connected("postprocess", server, robot)
        assert remote.wants_images and remote.served_name == "camera"
        own = CameraPostProcess(robot)
        for engine in (remote, own):
            engine.reset(world, model)
        assert remote.cameras(True) == own.cameras(True) == ("scene", "scene_right")
        for k in range(3):
            now = dataclasses.replace(state, time=np.float64(0.05 * k))
            images = {"scene": image} if k == 0 else {}
            a, b = remote.observe(now, images), own.observe(now, images)
            assert all(same(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(a))
            assert remote.unseen() == own.unseen() and remote.cameras(False) == own.cameras(False)
        assert "camera 'scene' shows" in remote.unseen()["cup"]
        with pytest.raises(InputError, match="takes the world's own model"):
            remote.reset(world, dataclasses.replace(model, control_period=0.1))
        remote.close()


def test_pictures_drawn_there_are_those_drawn_here(folder, world, state):
    """With a robot of one's own, from a file."""
    file = folder / "mine.yaml"
    file.write_text(asset("robots", "panda.yaml").read_text().replace("cameras: {}\n", SMALL_CAMERA))
    robot = load_robot(str(file))
    world = dataclasses.replace(world, robot=str(file))
    try:
        own = build_engine("rendering", "sapien", robot)
    except MachineError as error:
        pytest.skip(f"no pictures on this machine: {error}")
    with served(folder, "rendering", "sapien", "--robot", file) as server:
        remote = connected("rendering", server, robot)
        for engine in (own, remote):
            engine.reset(world)
        a, b = (engine.render(state, "small", depth=True) for engine in (own, remote))
        assert same(a.colour, b.colour) and same(a.depth, b.depth) and np.ptp(a.colour) > 100
        assert a.camera.name == b.camera.name and same(a.camera.matrix, b.camera.matrix)
        assert remote.render(state, "small").depth is None
        with pytest.raises(InputError, match=r"unknown camera 'scenes'; did you mean 'scene'\?"):
            remote.render(state, "scenes")
        remote.close()
    own.close()


SMALL_CAMERA = """
cameras:
  small: {position: [0.05, 0.95, 1.25], look_at: [0.53, -0.05, 0.27], size: [160, 120]}
"""


def test_served_engines_play_their_roles(physics, kinematics, robot):
    a, b = connected("physics", physics, robot), connected("kinematics", kinematics, robot)
    assert isinstance(a, PhysicsEngine) and isinstance(b, KinematicsEngine)
    assert issubclass(RemoteRendering, RenderingEngine)
    assert issubclass(RemotePostProcess, PostProcessEngine)
    EnginePipeline(b, a, a).close()
    assert a.connection.broken and b.connection.broken
    with pytest.raises(MachineError, match="is closed"):
        a.hidden()


def test_states_are_not_overwritten_by_later_steps(physics, robot, world):
    engine = connected("physics", physics, robot)
    kept = engine.reset(world)
    copy = {f.name: np.copy(getattr(kept, f.name)) for f in dataclasses.fields(kept)}
    target = JointTarget(kept.joint_position + 0.02, np.zeros(9))
    for _ in range(5):
        engine.step(target)
    assert all(np.array_equal(getattr(kept, name), value) for name, value in copy.items())
    engine.close()


def test_what_another_robot_wants_is_refused(physics):
    with pytest.raises(InputError, match=r"server's robot is 'panda' and the client's 'xarm7_ability'"):
        build_pipeline(load_robot("xarm7_ability"), EngineOptions(engines=physics.name))
    with pytest.raises(InputError, match="this server's engine is for 'physics', and the client wants"):
        build_pipeline(load_robot("panda"), EngineOptions(kinematics=physics.name))


def test_a_pipeline_that_cannot_be_built_holds_no_engine(physics, robot):
    """The physics engine is free again, though the rendering engine was not to be had."""
    nowhere = EngineOptions(engines=physics.name, rendering=True, renderer=physics.name)
    with pytest.raises(InputError, match="is for 'physics', and the client wants 'rendering'"):
        build_pipeline(robot, nowhere)
    build_pipeline(robot, EngineOptions(engines=physics.name)).close()
