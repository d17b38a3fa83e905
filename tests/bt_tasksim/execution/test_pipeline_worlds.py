"""Worlds of one: a pipeline behind the interface of batches, the same to the last bit."""

import dataclasses

import numpy as np
import pytest

from bt_tasksim.concept_nodes import Wait
from bt_tasksim.core.errors import InputError, MachineError, UnreachableError
from bt_tasksim.execution.pipeline_worlds import PipelineWorlds, worlds_for
from bt_tasksim.execution.pipelines import EngineOptions, build_pipeline
from bt_tasksim.execution.worlds import FIELDS, BatchWorlds
from bt_tasksim.robot.description import load_robot
from bt_tasksim.trees.load import load_source

ONE = np.array([0])
SOURCE = load_source("grasp_then_pick")
ROBOT = load_robot("panda")


def arrays(bundle):
    return [np.asarray(getattr(bundle, field.name)) for field in dataclasses.fields(bundle)]


def observed(seen):
    return [np.asarray(getattr(seen, name)) for name in FIELDS]


def test_it_is_a_batch_of_one():
    drawn = SOURCE.scene.sample(3, "training", 1)
    some = (
        worlds_for(ROBOT, EngineOptions(), 1, 1),
        PipelineWorlds(ROBOT, build_pipeline(ROBOT, EngineOptions())),
    )
    assert isinstance(some[0], BatchWorlds)
    found = []
    for worlds in some:
        worlds.reset(ONE, [drawn])
        assert worlds.errors(ONE) == {} and worlds.count == 1
        found.append([observed(worlds.observe(ONE))])
        tool = worlds.observation.tool_pose.copy()
        far = tool + np.array([9.0, 0, 0, 0, 0, 0, 0])
        for target, hand in (
            (tool, None),
            (None, np.array([[0.5]])),
            (far, None),
            (np.full((1, 7), np.nan), None),
        ):
            missed = worlds.step(target, hand, ONE)
            assert [(miss.row, type(miss.error)) for miss in missed] == [(0, UnreachableError)] * (
                target is far
            )
            found[-1].append(
                [*observed(worlds.observe(ONE)), *arrays(worlds.hidden()), *arrays(worlds.hidden(ONE))]
            )
        assert worlds.errors(ONE) == {}
        worlds.close()
    for one, other in zip(*found, strict=True):
        assert all(a.shape == b.shape and np.array_equal(a, b) for a, b in zip(one, other, strict=True))


def test_a_batch_may_begin_with_some_of_its_worlds():
    """And hands that begin somewhere are placed as in a world of one, though all at once."""
    drawn = {row: SOURCE.scene.sample(row, "training", 1) for row in (0, 2, 3)}
    assert all(world.hand_start for world in drawn.values())
    batch = worlds_for(ROBOT, EngineOptions(), 4, 1)
    expected = {}
    for row, world in drawn.items():
        one = PipelineWorlds(ROBOT, build_pipeline(ROBOT, EngineOptions()))
        one.reset(ONE, [world])
        assert one.errors(ONE) == {}
        expected[row] = observed(one.observe(ONE))
        one.close()
    for rows in ([0, 2], [3]):
        batch.reset(np.array(rows), [drawn[row] for row in rows])
        assert batch.errors(np.array(rows)) == {}
        found = observed(batch.observe(np.array(rows)))
        assert all(len(array) == 4 for array in found)
        for row in rows:
            assert all(
                np.array_equal(a[row], b[0], equal_nan=True)
                for a, b in zip(found, expected[row], strict=True)
            )
    batch.close()


def test_engines_without_a_batch_have_one_world():
    options = EngineOptions(perception="camera")
    worlds = worlds_for(ROBOT, options, 1, 1)
    assert isinstance(worlds, PipelineWorlds) and worlds.source(SOURCE.scene) is SOURCE.scene
    worlds.close()
    with pytest.raises(InputError, match="pictures"):
        worlds_for(ROBOT, options, 2, 1)


def test_a_world_that_fails_says_so_until_it_begins_anew(toy, monkeypatch):
    drawn, pipeline, error = (
        SOURCE.scene.sample(3, "training", 1),
        toy(Wait(1.0)).world,
        MachineError("stopped"),
    )

    def fail(*arguments):
        raise error

    worlds = PipelineWorlds(ROBOT, pipeline)
    with monkeypatch.context() as patch:
        patch.setattr(pipeline, "reset", fail)
        worlds.reset(ONE, [drawn])
        assert worlds.errors(ONE) == {0: error}
    worlds.reset(ONE, [drawn])
    assert worlds.errors(ONE) == {} and worlds.hidden() is None
    monkeypatch.setattr(pipeline, "step", fail)
    assert worlds.step(None, None, ONE) == [] and worlds.errors(ONE) == {0: error}
