"""Observations of many worlds, of unlike objects: each as if it were alone, bit by bit, in any order."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
import pytest

from bt_tasksim.core import poses
from bt_tasksim.core.poses import Array, host
from bt_tasksim.core.world import Observation, WorldState
from bt_tasksim.engines.perception.noise import noise_model
from bt_tasksim.engines.perception.state import BatchState, StatePostProcess
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.scene import Scene
from tests.array_libraries import LIBRARIES, single

ROBOT = load_robot("panda")
SCENES = [
    Scene(objects={"cup": "on table", "box": "on table"}),
    Scene(objects={"box": "on table"}),
    Scene(objects={"superellipsoid": "on table", "diamond": "on table", "cylinder": "on table"}),
    Scene(),
]
WORLDS, STEPS, FINE = 65, 3, noise_model("fine")
FIELDS = [field.name for field in dataclasses.fields(Observation)]


@cache
def story() -> tuple[list[ActorConfiguration], list[WorldState]]:
    """The worlds, and their states at some instants, in which objects and tool move."""
    worlds = [SCENES[i % 4].sample(i) for i in range(WORLDS)]
    most = max(len(w.objects) for w in worlds)
    objects = np.full((WORLDS, most, 7), np.nan)
    for i, world in enumerate(worlds):
        for j, actor in enumerate(world.objects):
            objects[i, j] = actor.pose
    rng, n = np.random.default_rng(0), len(ROBOT.joints)
    states = []
    for step in range(STEPS):
        tool = np.tile(poses.pose([0.5, 0.0, 0.1]), (WORLDS, 1))
        tool[:, :3] += rng.normal(scale=0.02, size=(WORLDS, 3))
        tool[:, 3:] = poses.from_rotation_vector(rng.normal(scale=0.3, size=(WORLDS, 3)))
        move = poses.pose([0.01, 0.0, 0.02], poses.from_rotation_vector(np.array([0.1, 0.0, 0.2])))
        objects = poses.multiply(np.broadcast_to(move, objects.shape), objects)
        states.append(
            WorldState(
                time=np.full(WORLDS, 0.05 * step),
                joint_position=rng.uniform(0.0, 0.04, (WORLDS, n)),
                joint_velocity=rng.normal(size=(WORLDS, n)),
                joint_effort=rng.normal(size=(WORLDS, n)),
                tip_force=rng.normal(scale=0.15, size=(WORLDS, 2, 3)),
                wrench=rng.normal(size=(WORLDS, 6)),
                tool_pose=tool,
                tips=tool[:, None, :3] + rng.normal(scale=0.05, size=(WORLDS, 2, 3)),
                objects=objects,
            )
        )
    return worlds, states


def rows_of(state: WorldState, rows: Sequence[int] | int, most: int | None = None) -> WorldState:
    parts = {f.name: getattr(state, f.name) for f in dataclasses.fields(state)}
    picked = {name: None if part is None else part[rows] for name, part in parts.items()}
    picked["objects"] = picked["objects"][..., :most, :]
    return WorldState(**picked)


def seen(worlds: Sequence[int]) -> list[dict[str, Array]]:
    configurations, states = story()
    batch = BatchState(ROBOT, len(worlds), FINE)
    batch.reset(range(len(worlds)), [configurations[i] for i in worlds])
    most = max(len(configurations[i].objects) for i in worlds)
    found = [batch.observe(rows_of(state, list(worlds), most)) for state in states]
    return [{name: getattr(one, name) for name in FIELDS} for one in found]


@cache
def together() -> list[dict[str, Array]]:
    return seen(range(WORLDS))


def check(found: dict[str, Array], expected: dict[str, Array], rows: Sequence[int]) -> None:
    for name in FIELDS:
        want = expected[name][list(rows)]
        if name == "objects":
            want = want[:, : found[name].shape[1]]
        np.testing.assert_array_equal(found[name], want, err_msg=name)


@pytest.mark.parametrize(
    "worlds",
    [[0], [3], [2, 1], [63, 3, 8], list(range(64)), np.random.default_rng(1).permutation(WORLDS).tolist()],
)
def test_a_world_does_not_feel_its_neighbours(worlds: list[int]) -> None:
    for found, expected in zip(seen(worlds), together(), strict=True):
        check(found, expected, worlds)


def test_one_world_is_the_case_of_one() -> None:
    configurations, states = story()
    for world in range(5):
        engine = StatePostProcess(ROBOT, FINE)
        engine.reset(configurations[world], configurations[world].world_model(["left", "right"], 0.08))
        for state, expected in zip(states, together(), strict=True):
            n = len(configurations[world].objects)
            found = engine.observe(rows_of(state, world, n), {})
            check({name: np.asarray(getattr(found, name))[None] for name in FIELDS}, expected, [world])


def test_the_drawn_errors_are_those_of_the_seeds() -> None:
    configurations, states = story()
    for i, world in enumerate(configurations):
        n = len(world.objects)
        error = FINE.draw(world.generator("estimate"), n)
        gap = together()[0]["objects"][i, :n, :3] - states[0].objects[i, :n, :3]
        np.testing.assert_allclose(gap, error[:, :3], atol=1e-12)
        assert np.isnan(together()[0]["objects"][i, n:]).all()


def test_worlds_without_objects_see_none() -> None:
    last = together()[-1]
    empty = [i for i in range(WORLDS) if i % 4 == 3]
    np.testing.assert_array_equal(last["contact_points"][empty], last["tips"][empty])
    assert not last["motion"][empty].any()
    assert np.isfinite(last["contact_points"]).all() and np.isfinite(last["motion"]).all()
    assert last["motion"][0].any() and not together()[0]["motion"].any()


def test_worlds_are_asked_apart_and_begin_anew() -> None:
    """Rows of their own, and what is looked at late is what it was then."""
    configurations, states = story()
    batch = BatchState(ROBOT, 4, FINE)
    batch.reset(range(4), configurations[:4])
    kept: list[tuple[Observation, int, list[int]]] = []
    for step, rows in ((0, [0, 1]), (0, [3, 2]), (1, [2, 0]), (1, [1]), (2, [1, 2, 0])):
        kept.append((batch.observe(rows_of(states[step], rows), np.array(rows)), step, rows))
    batch.reset([1], [configurations[5]])
    anew = batch.observe(rows_of(states[0], [5]), np.array([1]))
    for found, step, rows in [*kept, (anew, 0, [5])]:
        check({name: getattr(found, name) for name in FIELDS}, together()[step], rows)


@pytest.mark.parametrize("library", [*LIBRARIES, "float32"])
def test_every_library_and_device_sees_the_same_and_single_precision_stays_so(library: str) -> None:
    put, tolerance = LIBRARIES.get(library, single), 2e-3 if library == "float32" else 1e-9
    configurations, states = story()
    like, batch = put(np.zeros(1)), BatchState(ROBOT, WORLDS, FINE)
    batch.reset(range(WORLDS), configurations)
    few = [7, 1, 2]
    for state, expected in zip(states, together(), strict=True):
        found = batch.observe(changed(state, put))
        again = batch.observe(changed(rows_of(state, few), put), np.array(few))
        for name in FIELDS:
            for seen, rows in ((found, slice(None)), (again, few)):
                value = getattr(seen, name)
                assert type(value) is type(like) and value.device == like.device, name
                numbers, want = host(value), expected[name][rows]
                assert numbers.dtype == (want.dtype if want.dtype == bool else host(like).dtype), name
                if name != "motion" or seen is found:  # the few have been seen at this instant already
                    np.testing.assert_allclose(numbers, want, atol=tolerance, rtol=1e-4, err_msg=name)


def changed(state: WorldState, put: Callable[[Array], Array]) -> WorldState:
    parts = {f.name: getattr(state, f.name) for f in dataclasses.fields(state)}
    return WorldState(**{name: None if part is None else put(part) for name, part in parts.items()})
