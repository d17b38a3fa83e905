"""What a served engine answers, without sockets: owners, episodes, roles, and errors of every kind."""

import contextlib
import dataclasses

import numpy as np
import pytest

from bt_tasksim.core.errors import InputError, LostEngine, MachineError, NoWayError, UnreachableError
from bt_tasksim.core.world import JointTarget
from bt_tasksim.engines.base import PhysicsEngine
from bt_tasksim.engines.physics.sapien import SapienPhysics
from bt_tasksim.engines.remote.configurations import for_sending
from bt_tasksim.engines.remote.handshake import identity, mismatch
from bt_tasksim.engines.remote.messages import BadMessageError, Message, decode, encode
from bt_tasksim.engines.remote.schema import REPLIES, sizes_of
from bt_tasksim.engines.remote.session import ServedSession, error_of, plain_sentence
from bt_tasksim.robot.description import load_robot

from .conftest import hello
from .test_messages import damaged

ME, YOU = b"me", b"you"


class Arm(PhysicsEngine):
    """Physics that does as it is told."""

    def __init__(self, state):
        self.state, self.error, self.truth, self.resets = state, None, None, 0

    def reset(self, configuration):
        self.resets += 1
        self.configuration = configuration
        return self.state

    def step(self, target):
        if self.error is not None:
            raise self.error
        return dataclasses.replace(self.state, joint_position=target.position)

    def hidden(self):
        return self.truth


class Stage:
    """A session, and what is said to it."""

    def __init__(self, state, robot, world):
        self.arm, self.robot, self.world, self.refused = Arm(state), robot, world, []
        self.session = ServedSession(self.arm, "physics", "arm", robot, refused=self.refused.append)
        self.there = True

    def frames(self, frames, client=ME):
        reply = self.session.answer(client, frames, lambda owner: self.there)
        return decode(reply, REPLIES, sizes_of(self.robot, self.world))

    def say(self, kind, client=ME, number=5, **content):
        message = Message(number, kind, **content)
        return self.frames(encode(message, sizes_of(self.robot, self.world)), client)

    def hello(self, client=ME, **changes):
        return self.frames(hello(self.robot, "physics", **changes), client)

    def reset(self, client=ME):
        sent = {"configuration": for_sending(self.world, self.robot)}
        return self.say("reset", client, fields=sent)

    def step(self, client=ME):
        return self.say("step", client, arrays={"position": np.ones(9), "velocity": np.zeros(9)})


@pytest.fixture
def stage(state, robot, world):
    return Stage(state, robot, world)


def sentence(reply):
    assert reply.kind == "error"
    return reply.fields["sentence"]


def test_an_episode(stage):
    welcome = stage.hello()
    assert welcome.kind == "welcome" and welcome.fields["engine"] == "arm"
    reply = stage.reset()
    assert reply.kind == "state" and reply.number == 5
    assert stage.arm.configuration.robot == str(stage.robot.source), "this side's own file"
    assert np.array_equal(stage.step().arrays["joint_position"], np.ones(9))
    assert stage.say("hidden").kind == "no truth"
    assert stage.refused == []


def test_nothing_without_hello_and_nothing_before_reset(stage):
    assert "has to say 'hello' first" in sentence(stage.step())
    stage.hello()
    assert "it has to be reset first" in sentence(stage.step())
    assert "it has to be reset first" in sentence(stage.say("hidden"))
    assert len(stage.refused) == 3


def test_one_client_at_a_time(stage):
    stage.hello(), stage.reset()
    taken = stage.hello(YOU)
    assert "in use by another client" in sentence(taken) and type(error_of(taken)) is LostEngine
    assert "does not own" in sentence(stage.step(YOU)) and "does not own" in sentence(stage.reset(YOU))
    assert stage.arm.resets == 1 and stage.step().kind == "state", "the owner goes on undisturbed"
    stage.there = False
    assert stage.hello(YOU).kind == "welcome"
    assert "it has to be reset first" in sentence(stage.step(YOU)), "the next client begins fresh"
    taken = stage.step(ME)
    assert "another client has taken its place" in sentence(taken) and type(error_of(taken)) is LostEngine


def test_hello_again_begins_anew(stage):
    stage.hello(), stage.reset()
    assert stage.hello().kind == "welcome"
    assert "it has to be reset first" in sentence(stage.step())


@pytest.mark.parametrize(
    ("error", "kind", "said"),
    [
        (InputError("a sentence"), InputError, "a sentence"),
        (MachineError("a sentence"), MachineError, "a sentence"),
        (NoWayError("no way"), MachineError, "no way"),
        (LostEngine("a sentence"), LostEngine, "a sentence"),
        (UnreachableError("misses", 0.12, 0.5), UnreachableError, "misses"),
        (UnreachableError("misses", np.inf, 0.5), UnreachableError, "misses"),
        (UnreachableError("misses", np.nan, 0.5), UnreachableError, "misses"),
        (ZeroDivisionError("oh"), MachineError, "the physics engine 'arm' raised ZeroDivisionError: oh"),
        (KeyError("x\n\x1b[2J" + "y" * 9999), MachineError, "raised KeyError: "),
        (RuntimeError(), MachineError, "raised RuntimeError: "),
    ],
)
def test_errors_come_back_as_the_same_kind(stage, error, kind, said):
    stage.hello(), stage.reset()
    stage.arm.error = error
    back = error_of(stage.step())
    assert type(back) is kind and said.strip() in str(back) and str(back).isprintable()
    if isinstance(error, UnreachableError):
        assert (back.distance, back.angle) == (
            0.12 if error.distance == 0.12 else 1e9,
            0.5,
        ) and not stage.refused
    stage.arm.error = None
    known = type(error).__module__ == "bt_tasksim.core.errors"
    after = stage.step()
    assert after.kind == "state" if known else "it has to be reset first" in sentence(after)
    assert stage.reset().kind == "state"


def test_an_engine_that_gives_nan_is_an_error(stage):
    stage.hello(), stage.reset()
    reply = stage.say("step", arrays={"position": np.ones(9), "velocity": np.zeros(9)})
    assert reply.kind == "state"
    stage.arm.state = dataclasses.replace(stage.arm.state, wrench=np.full(6, np.nan))
    reply = stage.step()
    assert reply.fields["error"] == "MachineError"
    assert "'arm' has gone astray: array 'wrench' has a number in it that is not finite" in sentence(reply)
    assert "it has to be reset first" in sentence(stage.step())


def test_a_world_that_cannot_be_built_leaves_no_episode(stage):
    stage.hello(), stage.reset()
    sent = {"configuration": dataclasses.replace(for_sending(stage.world, stage.robot), physics_frequency=0)}
    assert "frequencies lie between" in sentence(stage.say("reset", fields=sent))
    assert "it has to be reset first" in sentence(stage.step())


def test_requests_of_another_role_do_not_belong_here(stage):
    stage.hello(), stage.reset()
    assert "'cameras' does not belong here" in sentence(stage.say("cameras", fields={"first": True}))


def test_nonsense_is_answered_with_the_number_that_could_be_read(stage):
    stage.hello(), stage.reset()
    assert stage.frames([b"\xff\xff"]).number == 0
    frames = encode(Message(77, "step", arrays={"position": np.ones(9), "velocity": np.ones(9)}), {})
    reply = stage.frames(frames[:-1])
    assert reply.number == 77 and "announces 2 arrays and has 1" in sentence(reply)
    assert stage.step().kind == "state" and len(stage.refused) == 2


def test_ten_thousand_malformed_messages_move_nothing(robot, world, sizes):
    """From the owner itself, in an episode; afterwards the robot goes on as one that was left in peace."""
    rng, calls = np.random.default_rng(5), []

    class Counted(SapienPhysics):
        def reset(self, configuration):
            calls.append("reset")
            return super().reset(configuration)

        def step(self, target):
            calls.append("step")
            return super().step(target)

    session = ServedSession(Counted(robot), "physics", "sapien", robot)

    def answer(frames):
        return decode(session.answer(ME, frames, lambda owner: True), REPLIES, sizes)

    sent = {"configuration": for_sending(world, robot)}
    start = np.concatenate([robot.rest, robot.hand_open])
    step = encode(Message(3, "step", arrays={"position": start + 0.05, "velocity": np.zeros(9)}), sizes)
    originals = [
        hello(robot, "physics"),
        encode(Message(2, "reset", sent), sizes),
        step,
        encode(Message(4, "hidden"), sizes),
    ]
    assert answer(originals[0]).kind == "welcome" and answer(originals[1]).kind == "state"
    kinds, malformed = ("hello", "reset", "step", "hidden"), 0
    while malformed < 10_000:
        frames = damaged(rng, [bytes(f) for f in originals[malformed % 4]])
        with contextlib.suppress(BadMessageError):
            decode(frames, kinds, sizes)
            continue  # the damage has left a good message
        malformed += 1
        reply = answer(frames)
        assert reply.kind == "error" and reply.fields["sentence"]
    assert calls == ["reset"]
    alone = SapienPhysics(robot)
    alone.reset(world)
    expected = alone.step(JointTarget(start + 0.05, np.zeros(9)))
    moved = answer(step)
    assert all(np.array_equal(moved.arrays[name], getattr(expected, name)) for name in moved.arrays)


# ---- what differs -----------------------------------------------------------------------------------------


def test_what_differs_is_said(stage, robot):
    assert "'rendering'" in sentence(stage.frames(hello(robot, "rendering")))
    said = sentence(stage.hello(version="0.0.1"))
    assert "the client '0.0.1': install the same version on both" in said
    other = load_robot("xarm7_ability")
    said = sentence(stage.frames(hello(other, "physics")))
    assert "the server's robot is 'panda' and the client's 'xarm7_ability'" in said and "--robot" in said
    own = dict(identity("physics", robot).digests)
    for name, what in (
        ("robot", "data file is not"),
        ("urdf", "URDF file is not"),
        ("layouts", "messages out is not"),
        ("odd", "'odd' is not"),
    ):
        assert what in sentence(stage.hello(digests={**own, name: "0"}))
    assert "data file is not" in sentence(stage.hello(digests={}))
    assert stage.session.owner is None


def test_a_changed_robot_is_another_one(robot):
    own = identity("physics", robot)
    assert mismatch(own, identity("physics", load_robot("panda"))) == ""
    for change in (
        {"arm_velocity": robot.arm_velocity * (1 + 1e-15)},
        {"solver_iterations": 16},
        {"tips": robot.tips[::-1]},
    ):
        other = identity("physics", dataclasses.replace(robot, **change))
        assert "the robot's data file is not the same" in mismatch(own, other)
    moved = dataclasses.replace(robot, source=robot.source.with_name("elsewhere.yaml"))
    assert mismatch(own, identity("physics", moved)) == "", "where the file lies makes no difference"


def test_sentences_are_one_printable_line():
    assert plain_sentence("a\nb\t c\x1b[2J") == "a b c [2J"
    assert len(plain_sentence("x" * 10_000)) == 2000
