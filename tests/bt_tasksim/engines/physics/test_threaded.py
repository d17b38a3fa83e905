"""Worlds in batches: bit by bit those that run alone, whatever stands beside them and whoever steps them."""

import dataclasses
import functools
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields

import numpy as np
import pytest
from physics_cases import PHYSICS, Still, lifted, runner_of, scene

from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.core.world import JointTarget
from bt_tasksim.engines.base import EngineSetup, PhysicsEngine
from bt_tasksim.engines.physics.layout import Layout, wider_support
from bt_tasksim.engines.physics.single import ONE
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.scene import Scene

pytestmark = pytest.mark.physical

ENGINES = ("sapien", "mujoco")
PADDED = {"objects", "velocities", "hand_force", "hand_distance"}


def batch_of(engine, worlds, threads=1, robot="panda"):
    return PHYSICS[engine].batch(load_robot(robot), EngineSetup(engine), worlds, threads)


@dataclasses.dataclass
class Episode:
    """What was drawn, what the drives were told in each period, and what came of it in a world alone."""

    configuration: ActorConfiguration
    targets: list
    states: list
    hidden: list


def alone(engine, configuration, targets):
    batch = batch_of(engine, 1)
    batch.reset(ONE, [configuration])
    states, hidden = [], []
    for target in targets:
        batch.step(JointTarget(target.position[None], target.velocity[None]), ONE)
        states.append(first(batch.state(ONE)))
        hidden.append(first(batch.hidden(ONE)))
    return Episode(configuration, targets, states, hidden)


def first(bundle):
    return type(bundle)(**{field.name: getattr(bundle, field.name)[0] for field in fields(bundle)})


@functools.cache
def episodes(engine):
    """Real ones: a grasp and a put-down, a throw, a blow that knocks the thing away, a fall, three things."""
    out = []
    for scenario, seed in (("pick_and_place", 3), ("pick_and_throw", 2), ("pick_and_place_recovering", 1)):
        runner, told = runner_of(scenario, engine), []
        physics = runner.pipeline.physics
        reset, step = physics.reset, physics.step
        physics.reset = lambda configuration, told=told, reset=reset: (
            told.append(configuration),
            reset(configuration),
        )[1]
        physics.step = lambda target, told=told, step=step: (told.append(target), step(target))[1]
        runner.run(seed)
        out.append(alone(engine, told[0], told[1:]))
    still = Still(lifted(scene("cylinder").sample(1), 0.1, (0.4, 1.2, 0.0)), engine)
    falling = lifted(scene("cylinder").sample(1), 0.1, (0.4, 1.2, 0.0))
    out.append(alone(engine, falling, [still.target] * 50))
    three = Scene(objects={"box": "on table", "cylinder": "on table", "cup": "on table"}).sample(3)
    out.append(alone(engine, three, out[0].targets))
    return out


def assert_row(got, row, expected):
    """One row of a batch is what a world alone reports, and padding behind it."""
    n = len(expected.objects)
    for name in (field.name for field in fields(expected)):
        found, wanted = getattr(got, name)[row], getattr(expected, name)
        if name in PADDED:
            assert np.isnan(found[n:]).all(), name
            found = found[:n]
        elif name == "support":
            most = found.shape[0]
            assert not found[n:].any() and not found[:, n:most].any()
            assert not found[:, most + wanted.shape[1] - n :].any()
            found = np.concatenate([found[:n, :n], found[:n, most : most + wanted.shape[1] - n]], axis=1)
        assert found.shape == wanted.shape and found.dtype == wanted.dtype, name
        assert np.array_equal(found, wanted), f"{name} at {float(expected.time):.2f} s"


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("worlds", "threads"), [(1, 1), (2, 2), (20, 2)])
def test_a_world_is_the_same_bits_in_any_company_and_order_with_any_number_of_threads(
    engine, worlds, threads
):
    known, rng = episodes(engine), np.random.default_rng(worlds)
    batch = batch_of(engine, worlds, threads)
    shown = np.arange(worlds) % len(known) if worlds > 2 else np.array([2, 1])[:worlds]
    at = np.zeros(worlds, int)
    batch.reset(np.arange(worlds), [known[k].configuration for k in shown])
    for _ in range(50 if worlds > 2 else 220):
        rows = rng.permutation(worlds)[: max(1, worlds - int(rng.integers(3)))]
        now = [(known[shown[row]], at[row]) for row in rows]
        position = np.array([known.targets[k].position for known, k in now])
        velocity = np.array([known.targets[k].velocity for known, k in now])
        batch.step(JointTarget(position, velocity), rows)
        assert not any(batch.errors)
        state, hidden = batch.state(rows), batch.hidden(rows)
        for k, (episode, period) in enumerate(now):
            assert_row(state, k, episode.states[period])
            assert_row(hidden, k, episode.hidden[period])
        at[rows] += 1
        over = np.array([row for row in rows if at[row] == len(known[shown[row]].targets)], int)
        shown[over], at[over] = (shown[over] + 1) % len(known), 0
        batch.reset(over, [known[shown[row]].configuration for row in over])
    batch.close()


@pytest.mark.parametrize("engine", ENGINES)
def test_the_episodes_compared_have_in_them_what_can_differ(engine):
    grasp, throw, blow, fall, three = episodes(engine)
    assert max(hidden.hand_force[0] for hidden in grasp.hidden) > 5.0
    assert blow.configuration.disturbance is not None
    speeds = [np.abs(state.velocities).max() for state in fall.states]
    assert max(speeds) > 1.0 > speeds[-1]
    assert any(not hidden.support.any() for hidden in throw.hidden), "it flies or is held"
    assert len(three.configuration.objects) == 3


@pytest.mark.parametrize("engine", ENGINES)
def test_a_world_with_more_objects_widens_the_arrays_and_changes_no_other(engine):
    grasp, *_, three = episodes(engine)
    batch = batch_of(engine, 2)
    batch.reset(np.array([0]), [grasp.configuration])
    target = grasp.targets[0]
    batch.step(JointTarget(target.position[None], target.velocity[None]), np.array([0]))
    assert batch.state(np.array([0])).objects.shape == (1, 1, 7)
    batch.reset(np.array([1]), [three.configuration])
    assert batch.state(np.array([0, 1])).objects.shape == (2, 3, 7)
    assert_row(batch.state(np.array([0])), 0, grasp.states[0])
    assert_row(batch.hidden(np.array([0])), 0, grasp.hidden[0])


@pytest.mark.parametrize("engine", ENGINES)
def test_where_all_worlds_begin_anew_nothing_is_left_of_what_was(engine):
    grasp, *_, three = episodes(engine)
    batch, row = batch_of(engine, 1), np.array([0])
    for episode, objects in ((three, 3), (grasp, 1), (three, 3)):
        batch.reset(row, [episode.configuration])
        target = episode.targets[0]
        batch.step(JointTarget(target.position[None], target.velocity[None]), row)
        assert batch.state(row).objects.shape == (1, objects, 7)
        n_bodies = objects + len(episode.configuration.fixtures)
        assert batch.hidden(row).support.shape == (1, objects, n_bodies)
        assert_row(batch.state(row), 0, episode.states[0])
        assert_row(batch.hidden(row), 0, episode.hidden[0])


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("threads", [1, 2])
def test_a_target_that_is_no_number_fails_its_world_alone(engine, threads):
    grasp, throw, *_ = episodes(engine)
    batch, rows = batch_of(engine, 3, threads), np.array([2, 0, 1])
    batch.reset(rows, [grasp.configuration, throw.configuration, grasp.configuration])
    for k in range(6):
        told = [grasp.targets[k], throw.targets[k], grasp.targets[k]]
        position, velocity = (np.array([getattr(t, name) for t in told]) for name in ("position", "velocity"))
        if k == 3:
            position[2, 4] = np.nan
        batch.step(JointTarget(position, velocity), rows)
        state = batch.state(rows)
        assert_row(state, 0, grasp.states[k])
        assert_row(state, 1, throw.states[k])
        assert_row(state, 2, grasp.states[min(k, 2)])
    assert [error is None for error in batch.errors] == [True, False, True]
    assert isinstance(batch.errors[1], MachineError) and "not finite" in str(batch.errors[1])
    batch.reset(np.array([1]), [throw.configuration])
    target = throw.targets[0]
    batch.step(JointTarget(target.position[None], target.velocity[None]), np.array([1]))
    assert batch.errors[1] is None
    assert_row(batch.state(np.array([1])), 0, throw.states[0])


@pytest.mark.parametrize("engine", ENGINES)
def test_a_world_that_blows_up_fails_alone(engine, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    grasp, *_ = episodes(engine)
    batch, rows = batch_of(engine, 2), np.arange(2)
    batch.reset(rows, [grasp.configuration] * 2)
    for k in range(4):
        if k == 2:
            blow_up(engine, batch.simulated[0])
        target = grasp.targets[k]
        batch.step(JointTarget(np.array([target.position] * 2), np.array([target.velocity] * 2)), rows)
        assert_row(batch.state(rows), 0, grasp.states[min(k, 1)])
        assert_row(batch.state(rows), 1, grasp.states[k])
    assert isinstance(batch.errors[0], MachineError) and batch.errors[1] is None
    assert "no longer finite" in str(batch.errors[0]) or "unstable" in str(batch.errors[0])
    assert not list(tmp_path.iterdir()), "nothing is written where the user stands"


def blow_up(engine, world):
    if engine == "sapien":
        world.world.objects[0].set_linear_velocity([np.nan, 0.0, 0.0])
    else:
        world.data.qvel[3] = np.inf


@pytest.mark.parametrize("engine", ENGINES)
def test_a_world_alone_whose_target_was_refused_goes_on(engine):
    still = Still(scene().sample(0), engine)
    before = still.step(2).joint_position
    for _ in range(2):
        with pytest.raises(MachineError, match="the joint target is not finite"):
            still.physics.step(JointTarget(np.full(9, np.inf), np.zeros(9)))
    assert np.abs(still.step().joint_position - before).max() < 1e-5


def test_an_engine_without_batches_says_so():
    class Alone(PhysicsEngine):
        def reset(self, configuration): ...

        def step(self, target): ...

    with pytest.raises(InputError, match="alone"):
        Alone.batch(load_robot("panda"), EngineSetup("alone"), 2, 1)


def test_objects_and_fixtures_have_their_columns():
    layout = Layout(np.array([1, 0, 2]), objects=2, fixtures=2)
    assert np.array_equal(
        layout.padded([1.0, 2.0, 3.0]), [[1, np.nan], [np.nan, np.nan], [2, 3]], equal_nan=True
    )
    assert Layout(np.array([0]), 1, 0).padded([], 7).shape == (1, 1, 7)
    support = layout.support([{(0, 1), (0, 2)}, set(), {(0, 1), (1, 2)}])
    assert {tuple(found) for found in np.argwhere(support).tolist()} == {
        (0, 0, 2),
        (0, 0, 3),
        (2, 0, 1),
        (2, 1, 2),
    }
    alone = Layout(np.array([1]), objects=1, fixtures=2).support([{(0, 1), (0, 2)}])
    assert np.array_equal(wider_support(alone, 1, layout.objects, layout.fixtures), support[:1])


@pytest.mark.parametrize("engine", ENGINES)
def test_a_world_that_cannot_be_built_fails_alone(engine, monkeypatch):
    grasp, throw, *_ = episodes(engine)
    batch, rows = batch_of(engine, 2), np.arange(2)
    build = batch._build

    def refusing(row, configuration, start):
        if configuration is throw.configuration:
            raise InputError("no such mesh")
        return build(row, configuration, start)

    monkeypatch.setattr(batch, "_build", refusing)
    batch.reset(rows, [throw.configuration, grasp.configuration])
    target = grasp.targets[0]
    batch.step(JointTarget(np.array([target.position] * 2), np.array([target.velocity] * 2)), rows)
    assert [str(error) for error in batch.errors] == ["no such mesh", "None"]
    assert_row(batch.state(rows), 1, grasp.states[0])
    batch.reset(np.array([0]), [grasp.configuration])
    assert batch.errors == [None, None]


@pytest.mark.parametrize("engine", ENGINES)
def test_worlds_of_two_robots_that_threads_build_at_once_are_those_built_alone(engine):
    """SAPIEN's defaults for new bodies, such as the solver's iterations by robot, are global."""

    def first_steps(robot):
        batch, rows = batch_of(engine, 4, threads=2, robot=robot), np.arange(4)
        out = []
        for seed in range(3):
            batch.reset(rows, [scene(robot=robot).sample(seed)] * 4)
            still = batch.state(rows).joint_position
            for _ in range(3):
                batch.step(JointTarget(still + 0.02, np.zeros_like(still)), rows)
            out.append(batch.state(rows).joint_position)
        return np.array(out)

    robots = ("panda", "xarm7_ability")
    alone = [first_steps(robot) for robot in robots]
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(first_steps, robots))
    for one, two in zip(alone, together, strict=True):
        assert np.array_equal(one, two)
