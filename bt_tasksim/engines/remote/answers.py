"""What a served engine answers to each kind of request, by its role."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from bt_tasksim.core.world import Command, JointTarget, WorldState
from bt_tasksim.engines.base import (
    Engine,
    KinematicsEngine,
    PhysicsEngine,
    PostProcessEngine,
    RenderingEngine,
)
from bt_tasksim.engines.cameras import check_size
from bt_tasksim.engines.remote.bundles import arrays_of, bundle_of
from bt_tasksim.engines.remote.messages import Message
from bt_tasksim.robot.description import RobotDescription
from bt_tasksim.scene.configuration import ActorConfiguration

Answers = Mapping[str, Callable[[Message], Message]]


def reset(engine: Engine, robot: RobotDescription, configuration: ActorConfiguration) -> Message:
    """Begin an episode of an engine; the reply says what it returned."""
    match engine:
        case PhysicsEngine():
            return Message(0, "state", arrays=arrays_of(engine.reset(configuration)))
        case PostProcessEngine():
            tips = [tip.name for tip in robot.tips]
            engine.reset(configuration, configuration.world_model(tips, robot.opening))
        case KinematicsEngine() | RenderingEngine():
            engine.reset(configuration)
    return Message(0, "done")


def answers_of(engine: Engine) -> Answers:
    """What answers each kind of request within an episode.

    Raises:
        TypeError: The engine has no role that can be served.
    """
    match engine:
        case KinematicsEngine():
            return _kinematics(engine)
        case PhysicsEngine():
            return _physics(engine)
        case RenderingEngine():
            return _rendering(engine)
        case PostProcessEngine():
            return _postprocess(engine)
    raise TypeError(f"{type(engine).__name__} is no engine of a role that can be served")


def _kinematics(engine: KinematicsEngine) -> Answers:
    def solve(request: Message) -> Message:
        command, state = bundle_of(Command, request.arrays), bundle_of(WorldState, request.arrays)
        return Message(0, "target", arrays=arrays_of(engine.solve(command, state)))

    def hand_start(request: Message) -> Message:
        joints = engine.joints_of_hand_start(tuple(request.arrays["start"].tolist()))
        return Message(0, "joints", arrays={"position": joints})

    return {"solve": solve, "hand_start": hand_start}


def _physics(engine: PhysicsEngine) -> Answers:
    def step(request: Message) -> Message:
        return Message(0, "state", arrays=arrays_of(engine.step(bundle_of(JointTarget, request.arrays))))

    def hidden(request: Message) -> Message:
        truth = engine.hidden()
        return Message(0, "no truth") if truth is None else Message(0, "truth", arrays=arrays_of(truth))

    return {"step": step, "hidden": hidden}


def _rendering(engine: RenderingEngine) -> Answers:
    def render(request: Message) -> Message:
        state, fields = bundle_of(WorldState, request.arrays), request.fields
        size = (fields["width"], fields["height"]) if fields["width"] or fields["height"] else None
        if size is not None:
            check_size(size, "the picture that is asked for")
        image = engine.render(state, fields["camera"], depth=fields["depth"], size=size)
        return Message(0, "image", images=(image,))

    return {"render": render}


def _postprocess(engine: PostProcessEngine) -> Answers:
    def cameras(request: Message) -> Message:
        return Message(0, "names", {"names": engine.cameras(request.fields["first"])})

    def observe(request: Message) -> Message:
        images = {image.camera.name: image for image in request.images}
        observation = engine.observe(bundle_of(WorldState, request.arrays), images)
        return Message(0, "observation", {"unseen": engine.unseen()}, arrays_of(observation))

    return {"cameras": cameras, "observe": observe}
