"""Small worlds and ways of stepping them that the tests of physics engines share."""

from __future__ import annotations

import dataclasses

import numpy as np
from py_trees.common import Status

from bt_tasksim.concept.context import one_world
from bt_tasksim.concept_nodes import Grasp, Pick
from bt_tasksim.core import poses
from bt_tasksim.core.world import JointTarget
from bt_tasksim.engines.physics.mujoco import MujocoPhysics
from bt_tasksim.engines.physics.sapien import SapienPhysics
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.execution.runner import Runner
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.scene import Scene
from bt_tasksim.scene.specs import ObjectSpec
from bt_tasksim.trees import sequence
from bt_tasksim.trees.load import load_source

G = 9.81
PHYSICS = {"sapien": SapienPhysics, "mujoco": MujocoPhysics}


def scene(kind="box", mass=0.2, friction=0.7, **settings):
    spec = ObjectSpec(
        kinds=(kind,),
        on="table",
        centre=(0.0, -0.14),
        area=(0.03, 0.03),
        mass=(mass, mass),
        friction=(friction, friction),
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

    def __init__(self, configuration, engine="sapien"):
        self.physics = PHYSICS[engine](load_robot(configuration.robot))
        self.state = self.physics.reset(configuration)
        self.target = JointTarget(self.state.joint_position.copy(), np.zeros_like(self.state.joint_velocity))

    def step(self, n=1):
        for _ in range(n):
            self.state = self.physics.step(self.target)
        return self.state


def holding(kind="box", mass=0.2, engine="sapien", **settings):
    """A runner at the instant at which the object hangs in the hand, in the first draw in which it does."""
    tree = sequence("lift", Grasp("thing"), Pick("thing", distance=0.1))
    runner = Runner(tree, scene(kind, mass, **settings), EngineOptions(engines=engine, noise="none"))
    why = []
    for seed in range(5):
        runner.begin(seed)
        for _ in range(400):
            runner.tick()
            if tree.status != Status.RUNNING:
                break
            runner.context.advance(one_world(runner.pipeline.step(runner.context.command)))
        if tree.status == Status.SUCCESS:
            return runner
        why.append(tree.tip().feedback_message)
    raise AssertionError(why)


def episode(runner, seed):
    """All states of an episode."""
    states = []
    runner.begin(seed)
    while True:
        runner.tick()
        states.append(runner.pipeline.state)
        if runner.tree.status != Status.RUNNING:
            return states
        runner.context.advance(one_world(runner.pipeline.step(runner.context.command)))


def runner_of(scenario, engine="sapien"):
    source = load_source(scenario)
    return Runner(source.build(), source.scene, EngineOptions(engines=engine))


def assert_identical(a, b):
    assert len(a) == len(b) > 80
    for x, y in zip(a, b, strict=True):
        for name in x.__slots__:
            assert np.array_equal(getattr(x, name), getattr(y, name)), f"{name} at {float(x.time):.2f} s"
