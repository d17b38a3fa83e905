"""The pipeline: the order of its engines, what a part that nobody wrote keeps, and when images are drawn."""

import numpy as np
import pytest

from bt_tasksim.core.errors import MachineError
from bt_tasksim.core.world import Command
from bt_tasksim.engines.base import KinematicsEngine, PhysicsEngine, PostProcessEngine, RenderingEngine
from bt_tasksim.engines.images import CameraModel, Image
from bt_tasksim.engines.pipeline import EnginePipeline
from bt_tasksim.execution.pipelines import EngineOptions, build_pipeline
from bt_tasksim.robot.description import load_robot

CAMERA = CameraModel("front", 4, 3, np.eye(3), np.array([0, 0, 1.0, 1, 0, 0, 0]))


class Engines(KinematicsEngine, PhysicsEngine, RenderingEngine, PostProcessEngine):
    """All four roles in one, which note what is asked of them."""

    def __init__(self, wants=()):
        self.calls, self.wants, self.solved, self.n = [], wants, [], 0
        self.curious = False

    def reset(self, configuration, model=None):
        self.calls.append("reset")
        return "state 0"

    def solve(self, command, state):
        self.calls.append("kinematics")
        self.solved.append((command, state))
        return "target"

    def step(self, target):
        assert target == "target"
        self.calls.append("physics")
        self.n += 1
        return f"state {self.n}"

    def hidden(self):
        return "hidden"

    def render(self, state, camera, *, depth=False, size=None):
        self.calls.append(f"rendering {camera} of {state}{' with depth' if depth else ''}")
        return Image(CAMERA, np.zeros((3, 4, 3), np.uint8), None)

    def cameras(self, first):
        return tuple(self.wants) if first or self.curious else ()

    def observe(self, state, images):
        self.calls.append("post-process")
        return state, sorted(images)


class Robot(Engines):
    """Of which a run begins when everything is ready."""

    def begin(self):
        self.calls.append("begin")
        return "state at the begin"


def test_a_robots_time_begins_after_the_first_look():
    robot = Robot(wants=["front"])
    pipeline = EnginePipeline(robot, robot, robot, robot)
    assert pipeline.reset(None, None) == ("state at the begin", [])
    looked = robot.calls.index("rendering front of state 0 with depth")
    assert robot.calls[looked:] == [robot.calls[looked], "post-process", "begin", "post-process"]
    assert pipeline.state == "state at the begin"


@pytest.fixture
def engines():
    return Engines(wants=["front"])


@pytest.fixture
def pipeline(engines):
    line = EnginePipeline(engines, engines, engines, engines)
    line.reset(None, None)
    engines.calls.clear()
    return line


def test_the_order_is_kinematics_physics_rendering_post_process(engines, pipeline):
    engines.curious = True
    observation = pipeline.step(Command(tool=np.zeros(7)))
    assert engines.calls == ["kinematics", "physics", "rendering front of state 1 with depth", "post-process"]
    assert observation == ("state 1", ["front"])
    assert engines.solved[0][1] == "state 0", "kinematics starts from the state before"


def test_images_are_drawn_only_when_asked_for(engines, pipeline):
    assert pipeline.step(Command())[1] == []
    assert "rendering" not in " ".join(engines.calls)
    pipeline.render("front")
    assert engines.calls[-1] == "rendering front of state 1"


def test_the_first_observation_has_what_perception_needs(engines):
    assert EnginePipeline(engines, engines, engines, engines).reset(None, None) == ("state 0", ["front"])


def test_a_part_that_nobody_wrote_keeps_its_last_target(engines, pipeline):
    tool, hand = np.arange(7.0), np.array([0.7])
    pipeline.step(Command(tool=tool))
    pipeline.step(Command(hand=hand))
    pipeline.step(Command())
    given = [command for command, _ in engines.solved]
    assert given[0].tool is tool and given[0].hand is None
    assert given[1].tool is tool and given[1].hand is hand
    assert given[2].tool is tool and given[2].hand is hand
    pipeline.reset(None, None)
    pipeline.step(Command())
    assert engines.solved[-1][0] == Command(), "an episode forgets the targets of the one before"


def test_what_cannot_be_is_said(engines):
    line = EnginePipeline(engines, engines, engines)
    with pytest.raises(RuntimeError, match="stepped before it was reset"):
        line.step(Command())
    with pytest.raises(RuntimeError, match="nothing can be drawn"):
        line.render("front")
    assert line.hidden() == "hidden"


def test_close_reaches_every_engine_that_can(engines):
    closed = []

    class Closing(Engines):
        def close(self):
            closed.append(self)

    a, b = Closing(), Closing()
    EnginePipeline(a, engines, b).close()
    assert closed == [a, b]


def test_what_an_engine_does_not_write_has_a_default():
    class Perception(PostProcessEngine):
        def reset(self, configuration, model): ...
        def observe(self, state, images):
            return state

    class Physics(PhysicsEngine):
        def reset(self, configuration):
            return "state"

        def step(self, target):
            return "next"

    class Kinematics(KinematicsEngine):
        def solve(self, command, state):
            return "target"

    line = EnginePipeline(Kinematics(), Physics(), Perception())
    assert line.reset(None, None) == "state" and line.step(Command()) == "next"
    assert line.hidden() is None and line.unseen() == {} and line.served == {}
    assert not line.real and line.hold_delivered
    line.stop("the run is over")
    line.close()
    with pytest.raises(MachineError, match="Kinematics cannot tell with which joints"):
        line.kinematics.joints_of_hand_start((0.5, 0.0, 0.2, 0.0))
    with pytest.raises(TypeError, match="abstract"):
        PhysicsEngine()


def test_the_bundled_engines_play_their_roles():
    line = build_pipeline(load_robot("panda"), EngineOptions())
    assert isinstance(line.kinematics, KinematicsEngine) and isinstance(line.physics, PhysicsEngine)
    assert isinstance(line.postprocess, PostProcessEngine) and line.rendering is None
    assert not isinstance(line.physics, KinematicsEngine)
    assert isinstance(Engines(), RenderingEngine)


def test_another_physics_engine_fits_in():
    """A physics engine without dynamics: joints are where they are told to be."""
    from bt_tasksim.concept_nodes import Release
    from bt_tasksim.execution.runner import Runner
    from bt_tasksim.scene.scene import Scene

    robot = load_robot("panda")
    line = build_pipeline(robot, EngineOptions())
    sapien = line.physics

    class Ideal(PhysicsEngine):
        def reset(self, configuration):
            import dataclasses

            import pinocchio

            self.replace, self.model = dataclasses.replace, pinocchio.buildModelFromUrdf(str(robot.urdf))
            self.data, self.pin = self.model.createData(), pinocchio
            self.state = sapien.reset(configuration)
            return self.state

        def step(self, target):
            self.pin.framesForwardKinematics(self.model, self.data, target.position)
            pose = self.data.oMf[self.model.getFrameId(robot.tool_link)]
            q = self.pin.SE3ToXYZQUAT(pose)
            self.state = self.replace(
                self.state,
                time=self.state.time + 0.05,
                joint_position=target.position,
                joint_velocity=target.velocity,
                tool_pose=q[[0, 1, 2, 6, 3, 4, 5]],
            )
            return self.state

    line.physics = Ideal()
    result = Runner(Release("cup", retreat=0.1), Scene(objects={"cup": "on table"}), pipeline=line).run(0)
    assert result.status.name == "SUCCESS", result.why
    assert result.verdict is None
