"""What goes wrong between two processes: each time one sentence, in time, and a server that goes on."""

import signal
import socket
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import msgpack
import numpy as np
import pytest
import zmq

from bt_tasksim.core.errors import InputError, LostEngine, MachineError
from bt_tasksim.core.world import Command, JointTarget
from bt_tasksim.engines.base import KinematicsEngine
from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics
from bt_tasksim.engines.remote import memory
from bt_tasksim.engines.remote.address import Address
from bt_tasksim.engines.remote.client import Connection, Limits
from bt_tasksim.engines.remote.engines import RemoteKinematics, RemotePhysics
from bt_tasksim.engines.remote.keys import CLIENT, SERVER, Key, load_key, make_keys
from bt_tasksim.engines.remote.memory import MemoryWatch
from bt_tasksim.engines.remote.messages import Message, decode, encode
from bt_tasksim.engines.remote.schema import REPLIES
from bt_tasksim.engines.remote.server import EngineServer
from bt_tasksim.engines.remote.session import ServedSession
from bt_tasksim.execution.pipelines import EngineOptions
from bt_tasksim.training.evaluation import Job, evaluate

from .conftest import ROOT, hello, served
from .test_messages import damaged

QUICK = Limits(connect=20.0, step=0.5, slow=20.0)
"""A busy machine may take long to start things; what is measured here is the step."""
SLACK = 1.0
"""Seconds more than its limit that an error may take on a busy machine."""


@pytest.fixture(scope="module")
def server(folder):
    with served(folder, "kinematics", "pinocchio") as started:
        yield started


def connect(server, robot, role="kinematics", key=None, limits=QUICK, host="127.0.0.1"):
    connection = Connection(Address(host, server.port), role, robot, key, limits)
    return RemotePhysics(connection) if role == "physics" else RemoteKinematics(connection)


def solves(engine, world, state):
    """The engine does its work."""
    engine.reset(world)
    target = engine.solve(Command(state.tool_pose, np.array([0.5])), state)
    return np.isfinite(target.position).all()


@pytest.fixture
def raw(server):
    """Sends frames as any program could, and reads the replies there are."""
    context = zmq.Context()
    opened = dealer(context, server)
    yield opened
    opened.close(0)
    context.term()


def exchanged(opened, frames):
    opened.send_multipart(frames)
    assert opened.poll(20_000)
    return decode(opened.recv_multipart(), REPLIES, {})


# ---- a server that fails ----------------------------------------------------------------------------------


def test_a_server_killed_in_an_episode_and_started_again(folder, robot, world, state):
    with served(folder, "physics", "sapien") as first:
        engine = connect(first, robot, "physics")
        start = engine.reset(world)
        target = JointTarget(start.joint_position, np.zeros(9))
        engine.step(target)
        first.process.kill()
        first.process.wait()
        began = time.perf_counter()
        with pytest.raises(MachineError, match=r"the physics server at 127\.0\.0\.1:\d+ has gone away"):
            engine.step(target)
        assert time.perf_counter() - began < QUICK.step + SLACK
        with pytest.raises(MachineError, match="has gone away"):
            engine.hidden()
        port = first.port
    with served(folder, "physics", "sapien", port=port):
        with pytest.raises(MachineError, match="has gone away"):
            engine.step(target)  # never goes on in the middle with a server that knows nothing of it
        assert np.array_equal(engine.reset(world).joint_position, start.joint_position)
        assert float(engine.step(target).time) == pytest.approx(0.05)
        engine.close()


def test_a_server_that_hangs(folder, robot, world, state):
    with served(folder, "kinematics", "pinocchio") as server:
        engine = connect(server, robot)
        assert solves(engine, world, state)
        server.signal(signal.SIGSTOP)
        began = time.perf_counter()
        with pytest.raises(MachineError, match=r"did not answer 'solve' within 0\.5 s: it hangs"):
            engine.solve(Command(), state)
        assert QUICK.step <= time.perf_counter() - began < QUICK.step + SLACK
        with pytest.raises(MachineError, match="did not answer 'solve'"):
            engine.solve(Command(), state)
        server.signal(signal.SIGCONT)
        assert solves(engine, world, state), "the late answer is not taken for a new one"
        engine.close()


def test_no_server(robot):
    with socket.socket() as held:
        held.bind(("127.0.0.1", 0))
        port = held.getsockname()[1]
    began = time.perf_counter()
    with pytest.raises(
        MachineError, match=r"no physics server answers at 127\.0\.0\.1:\d+ within 0\.3 s: start"
    ):
        Connection(Address("127.0.0.1", port), "physics", robot, limits=Limits(connect=0.3))
    assert time.perf_counter() - began < 0.3 + SLACK


@pytest.mark.parametrize("answer", [b"", b"HTTP/1.1 400 Bad Request\r\n\r\n", b"\xff" * 64])
def test_something_else_at_this_port(robot, answer):
    with socket.create_server(("127.0.0.1", 0)) as other:
        other.settimeout(20.0)
        port = other.getsockname()[1]
        client = subprocess.Popen(
            [sys.executable, "-c", CONNECT, str(port)], stderr=subprocess.PIPE, cwd=ROOT
        )
        accepted, _ = other.accept()
        accepted.sendall(answer)
        if answer:
            accepted.shutdown(socket.SHUT_WR)
        said = client.communicate(timeout=60)[1].decode()
        accepted.close()
    assert "LostEngine: " in said
    assert ("is no such server" if answer else "no physics server answers") in said


CONNECT = """
import sys
from bt_tasksim.engines.kinematics.pinocchio import PinocchioKinematics
from bt_tasksim.engines.remote import memory
from bt_tasksim.engines.remote.address import Address
from bt_tasksim.engines.remote.client import Connection, Limits
from bt_tasksim.robot.description import load_robot
Connection(Address("127.0.0.1", int(sys.argv[1])), "physics", load_robot("panda"), limits=Limits(connect=1.0))
"""


@pytest.fixture
def fake(robot):
    """A server that welcomes its client and then answers what it is told to."""
    context = zmq.Context()
    router = context.socket(zmq.ROUTER)
    router.setsockopt(zmq.LINGER, 0)
    port = router.bind_to_random_port("tcp://127.0.0.1")
    replies, stop = [], threading.Event()

    def serve():
        while not stop.is_set():
            if router.poll(20):
                client, *frames = router.recv_multipart()
                number = msgpack.unpackb(frames[0])[1]
                if replies:
                    router.send_multipart([client, *replies.pop(0)(number)])
                else:
                    own = {**_welcome(robot), "engine": "fake", "wants_images": False}
                    router.send_multipart([client, *encode(Message(number, "welcome", own), {})])

    thread = threading.Thread(target=serve)
    thread.start()
    yield port, replies
    stop.set()
    thread.join()
    router.close(0)
    context.term()


def _welcome(robot):
    return decode(hello(robot, "physics"), ["hello"], {}).fields


@pytest.mark.parametrize(
    ("answer", "sentence"),
    [
        (lambda n: [b"\xff\xff"], "answers nonsense: a message's first frame is not msgpack"),
        (lambda n: encode(Message(n, "done"), {}), "answers nonsense: a message of kind 'done' does not"),
        (lambda n: encode(Message(n, "no truth"), {})[:1] * 2, "answers nonsense"),
        (lambda n: encode(Message(n + 1, "no truth"), {}), "did not answer 'hidden' within 0.5 s"),
        (lambda n: encode(Message(0, "notice"), {}), "did not answer 'hidden' within 0.5 s"),
    ],
)  # fmt: skip
def test_a_server_that_answers_nonsense(fake, robot, answer, sentence):
    port, replies = fake
    engine = RemotePhysics(Connection(Address("127.0.0.1", port), "physics", robot, limits=QUICK))
    replies.append(answer)
    with pytest.raises(MachineError, match=sentence):
        engine.hidden()
    assert engine.connection.broken
    with pytest.raises(MachineError, match=sentence):
        engine.hidden()


def test_a_server_of_another_version_that_did_not_look(fake, robot):
    port, replies = fake
    other = {**_welcome(robot), "engine": "fake", "wants_images": False, "version": "9.9"}
    replies.append(lambda n: encode(Message(n, "welcome", other), {}))
    with pytest.raises(InputError, match=r"the server has bt-tasksim '9.9' and the client"):
        Connection(Address("127.0.0.1", port), "physics", robot, limits=QUICK)


@pytest.mark.parametrize(
    ("answer", "sentence"),
    [
        (
            lambda n: [msgpack.packb([2, n, "welcome", "of a new kind"])],
            r"the physics server at 127\.0\.0\.1:\d+: the other side speaks protocol 2, and this one 1: "
            "use the same version of bt-tasksim on both",
        ),
        (
            lambda n: encode(Message(0, "error", {**NO_MISS, "sentence": "a sentence"}), {}),
            r"the physics server at 127\.0\.0\.1:\d+: a sentence",
        ),
    ],
)
def test_a_server_that_speaks_otherwise_is_the_users_affair(fake, robot, answer, sentence):
    port, replies = fake
    replies.append(answer)
    with pytest.raises(InputError, match=f"^{sentence}$"):
        Connection(Address("127.0.0.1", port), "physics", robot, limits=QUICK)


NO_MISS = {"error": "InputError", "distance": 0.0, "angle": 0.0}


def test_a_client_that_speaks_another_protocol_is_told(raw, robot):
    header = msgpack.unpackb(hello(robot, "kinematics")[0])
    reply = exchanged(raw, [msgpack.packb([2, *header[1:]])])
    assert reply.kind == "error" and "speaks protocol 2, and this one 1" in reply.fields["sentence"]


def test_a_joint_target_that_is_no_number_is_an_error_as_it_is_here(fake, robot):
    engine = RemotePhysics(Connection(Address("127.0.0.1", fake[0]), "physics", robot, limits=QUICK))
    with pytest.raises(MachineError, match="cannot be asked to 'step': array 'position' has a number") as e:
        engine.step(JointTarget(np.full(9, np.nan), np.zeros(9)))
    assert type(e.value) is MachineError and not engine.connection.broken, "the server is still there"


def test_episodes_without_their_server_are_not_counted_as_failures(folder):
    with served(folder, "physics", "sapien") as server:
        options = EngineOptions(engines=server.name, connect_timeout=0.5)
        done = []

        def kill_after_the_second(outcome):
            done.append(outcome.success)
            if len(done) == 2:
                server.process.kill()
                server.process.wait()

        with pytest.raises(LostEngine, match=r"the physics server at .* has gone away"):
            evaluate(Job("pick_and_place", options=options), range(4, 9), progress=kill_after_the_second)
    assert done == [True, True]


# ---- clients that fail ------------------------------------------------------------------------------------


def test_a_second_client_is_told_and_the_first_goes_on(server, robot, world, state):
    first = connect(server, robot)
    assert solves(first, world, state)
    with pytest.raises(MachineError, match="the kinematics engine is in use by another client"):
        connect(server, robot)
    assert np.isfinite(first.solve(Command(), state).position).all()
    first.close()
    second = connect(server, robot)
    assert solves(second, world, state)
    second.close()


def test_a_client_that_is_killed_in_an_episode(server, robot, world, state, raw):
    script = f"{HOLD}\nprint('holds', flush=True)\nimport time\ntime.sleep(60)"
    command = [sys.executable, "-c", script, str(server.port), "2"]
    client = subprocess.Popen(command, stdout=subprocess.PIPE, cwd=ROOT)
    assert client.stdout.readline() == b"holds\n"
    with pytest.raises(MachineError, match="in use by another client"):
        connect(server, robot)
    client.kill()
    client.communicate()
    assert exchanged(raw, hello(robot, "kinematics")).kind == "welcome"
    solve = {f: getattr(state, f) for f in state.__slots__}
    reply = exchanged(raw, encode(Message(2, "solve", arrays=solve), {}))
    assert "it has to be reset first" in reply.fields["sentence"], "nothing is left of the episode before"


HOLD = """
import sys
from bt_tasksim.execution.pipelines import EngineOptions, build_pipeline
from bt_tasksim.robot.description import load_robot
from bt_tasksim.scene.scene import Scene
port, timeout = sys.argv[1:]
options = EngineOptions(kinematics=f"remote:127.0.0.1:{port}", timeout=float(timeout))
line = build_pipeline(load_robot("panda"), options)
line.kinematics.reset(Scene(objects={"cup": "on table"}).sample(0))
"""


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"version": "0.0.1"}, "the client '0.0.1': install the same version on both"),
        ({"robot": "so100"}, "the server's robot is 'panda' and the client's 'so100'"),
        ({"role": "physics"}, "is for 'kinematics', and the client wants 'physics'"),
        ({"digests": {"robot": "0"}}, "the robot's data file is not the same"),
    ],
)
def test_what_differs_is_said_at_connect(raw, robot, changes, sentence):
    reply = exchanged(raw, hello(robot, "kinematics", **changes))
    assert reply.fields["error"] == "InputError" and sentence in reply.fields["sentence"]


def test_hundreds_of_malformed_messages_and_the_server_goes_on(folder, robot, world, state, sizes):
    rng = np.random.default_rng(3)
    good = {f: getattr(state, f) for f in state.__slots__}
    originals = [
        hello(robot, "kinematics"),
        encode(Message(2, "reset", {"configuration": world}), sizes),
        encode(Message(3, "solve", arrays={**good, "tool": state.tool_pose}), sizes),
        encode(Message(4, "hand_start", arrays={"start": np.zeros(4)}), sizes),
    ]
    with served(folder, "kinematics", "pinocchio") as server, zmq.Context() as context:
        raw = dealer(context, server)
        for k in range(600):
            frames = damaged(rng, [bytes(f) for f in originals[k % 4]])
            raw.send_multipart(frames or [b""])
            if raw.poll(5):  # some answers are read, some are left lying
                raw.recv_multipart()
        for garbage in (rng.bytes(500), b"GET / HTTP/1.1\r\n\r\n", GREETING[:20], GREETING + b"\x04\xff"):
            with socket.create_connection(("127.0.0.1", server.port)) as wild:
                wild.sendall(garbage)
        with shaken(server.port) as wild:
            wild.sendall(b"\x02" + (1 << 62).to_bytes(8, "big") + b"\0" * 1000)
        raw.send_multipart([b"\0" * (1 << 21)])  # larger than any message: the connection is cut
        time.sleep(1.1)
        late = dealer(context, server)
        late.send(b"one more")
        engine = connect(server, robot)
        assert solves(engine, world, state)
        engine.close()
        raw.close(0), late.close(0)
        said = server.said()
        assert server.process.poll() is None
    assert all(line.startswith("bt-tasksim: refused: ") and line.isprintable() for line in said)
    assert 10 <= len(said) <= 60, "one sentence each, and a flood is not shown"
    assert any(" more, not shown)" in line for line in said), "but counted"


def dealer(context, server):
    """A socket for whatever anybody may send."""
    opened = context.socket(zmq.DEALER)
    opened.setsockopt(zmq.LINGER, 0)
    opened.connect(f"tcp://127.0.0.1:{server.port}")
    return opened


def shaken(port, buffer=1 << 16):
    """A connection by hand that the server takes for a client's, and which reads only so many bytes ahead."""
    opened = socket.socket()
    opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, buffer)
    opened.settimeout(20.0)
    opened.connect(("127.0.0.1", port))
    opened.sendall(GREETING + READY)
    answer = opened.makefile("rb", buffering=0)
    *_, kind, size = (answer.read(1)[0] for _ in range(64 + 2))  # its greeting, and the head of its READY
    assert kind == 4 and len([answer.read(1) for _ in range(size)]) == size
    return opened


GREETING = bytes([0xFF, 0, 0, 0, 0, 0, 0, 0, 1, 0x7F, 3, 0]) + b"NULL".ljust(20, b"\0") + bytes(32)
READY = bytes([4, 28]) + b"\x05READY\x0bSocket-Type" + (6).to_bytes(4, "big") + b"DEALER"


@pytest.mark.parametrize("half", ["a frame of two", "a part of a frame"])
def test_half_a_message_holds_nobody_up(server, robot, world, state, half):
    part = hello(robot, "kinematics")[0][:200]
    begun = b"\x01" + bytes([200]) if half == "a frame of two" else b"\x00" + bytes([255])
    with shaken(server.port) as wild:
        wild.sendall(begun + part)
        time.sleep(0.2)
        engine = connect(server, robot)
        assert solves(engine, world, state)
        engine.close()


class Slow(KinematicsEngine):
    """Kinematics that takes its time: `busy` says in what, and it goes on when `go` is set."""

    def __init__(self, robot, busy=""):
        self.engine, self.busy, self.go, self.began = PinocchioKinematics(robot), busy, threading.Event(), 0

    def reset(self, configuration):
        self.wait("reset")
        self.engine.reset(configuration)

    def solve(self, command, state):
        self.wait("solve")
        return self.engine.solve(command, state)

    def wait(self, what):
        if what == self.busy:
            self.began += 1
            self.go.wait(30.0)


@contextmanager
def serving(engine, robot, key=None, **limits):
    """A server of kinematics in a thread, and the sentences of what it refuses."""
    said, stop = [], threading.Event()
    session = ServedSession(
        engine, "kinematics", "slow", robot, watch=MemoryWatch(own=limits.pop("own", 1 << 30))
    )
    server = EngineServer(session, Address("127.0.0.1", 0), key, said.append, **limits)
    thread = threading.Thread(target=server.serve, args=(stop.is_set,))
    thread.start()
    try:
        yield server.address, said
    finally:
        stop.set()
        thread.join()
        server.close()


def until(true, seconds=30.0):
    deadline = time.monotonic() + seconds
    while not true() and time.monotonic() < deadline:
        time.sleep(0.02)
    return true()


@contextmanager
def flooding(port):
    """A program that sends 2 GiB of frames without a last one, if it may: the tests that ran before in this
    process may have left it hundreds of MiB that the first of them fill without its growing."""
    script = f"PORT, GREETING, READY = {port}, {GREETING}, {READY}\n{FLOOD}"
    flood = subprocess.Popen([sys.executable, "-c", script], stderr=subprocess.DEVNULL)
    try:
        yield
    finally:
        flood.kill()
        flood.wait()


FLOOD = """
import socket, time
frame = b"\\x03" + (1 << 19).to_bytes(8, "big") + bytes(1 << 19)  # another one follows, it says
with socket.create_connection(("127.0.0.1", PORT)) as wild:
    wild.sendall(GREETING + READY)
    for _ in range(4000):
        wild.sendall(frame)
    time.sleep(60)
"""
CUT = "messages without end, 64 MiB of them: all connections were cut"


def test_a_message_without_end_is_cut_off(robot, world, state):
    """Frames that never end fill no more than the memory that they may have."""
    with serving(PinocchioKinematics(robot), robot, memory=64 << 20) as (address, said):
        with flooding(address.port):
            assert until(lambda: said)
        assert said[0] == CUT
        engine = RemoteKinematics(Connection(address, "kinematics", robot, limits=QUICK))
        assert solves(engine, world, state)
        engine.close()


@pytest.mark.parametrize("busy", ["reset", "solve"])
def test_a_message_without_end_is_cut_off_while_the_engine_works(robot, world, state, busy):
    """However long that takes: what comes meanwhile is not the engine's."""
    slow = Slow(robot)
    limits = Limits(connect=20.0, step=60.0, slow=60.0)
    with serving(slow, robot, memory=64 << 20, own=64 << 20) as (address, said):
        engine = RemoteKinematics(Connection(address, "kinematics", robot, limits=limits))
        assert solves(engine, world, state)
        slow.busy = busy
        with ThreadPoolExecutor() as pool, flooding(address.port):
            asked = pool.submit(solves, engine, world, state)
            cut = until(lambda: said, 20.0)
            slow.go.set()
            assert cut and said[0] == CUT
            with pytest.raises(LostEngine, match="has gone away"):
                asked.result()
        slow.busy = ""
        assert solves(engine, world, state), "and it listens again"
        engine.close()


def test_what_worlds_take_is_the_engines_own_up_to_a_bound(monkeypatch):
    size = [100]
    monkeypatch.setattr(memory, "resident", lambda: size[0])
    watch = MemoryWatch(own=50)
    size[0] = 130
    assert watch.strange() == 30
    with watch.own():
        size[0] = 145
        assert watch.strange() < 0
        size[0] = 160
        assert watch.strange() == 10, "while a world is built, more than any engine may take"
    assert watch.strange() == 10
    with watch.own():
        size[0] = 120
    assert watch.strange() == 0, "what it needs now, not what it has needed once"
    size[0] = 140
    watch.renew()
    assert watch.strange() == 0


def test_a_client_that_never_reads_holds_nobody_up(robot, world, state, monkeypatch):
    """It asks until neither its own buffers nor the server's take a further answer."""
    sent, send = [], EngineServer._send
    monkeypatch.setattr(EngineServer, "_send", lambda *given: sent.append(send(*given)) or sent[-1])
    with serving(PinocchioKinematics(robot), robot) as (address, _), shaken(address.port, 4096) as deaf:
        for _ in range(200):
            deaf.sendall(b"\x00\x01\xff" * 500)
            if False in sent:
                break
        assert until(lambda: False in sent)
        engine = RemoteKinematics(Connection(address, "kinematics", robot, limits=QUICK))
        assert solves(engine, world, state)
        engine.close()


# ---- keys -------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def keys(folder):
    return make_keys(folder / "engine.key")


@pytest.fixture(scope="module")
def locked(folder, keys):
    """Open to every address of this machine, for the holders of the key."""
    words = ("--key", keys[0], "--address", "0.0.0.0")
    with served(folder, "kinematics", "pinocchio", *words) as started:
        yield started


def test_the_right_key_opens(locked, keys, robot, world, state):
    assert locked.line.startswith("serving kinematics 'pinocchio' for panda at 0.0.0.0:")
    assert locked.line.endswith("(encrypted, for the holders of the client's key)")
    engine = connect(locked, robot, key=load_key(keys[1], CLIENT))
    assert solves(engine, world, state)
    engine.close()


def test_without_the_key_nothing_opens(locked, keys, folder, robot, world, state):
    right = load_key(keys[1], CLIENT)
    stranger = Key(*zmq.curve_keypair(), right.peer)  # knows the server, and is not known to it
    elsewhere = Key(right.public, right.secret, zmq.curve_keypair()[0])  # is known, to another server
    limits = Limits(connect=5.0)
    for key, sentence in (
        (None, r"broke off: it wants a key \(--key FILE\), or is no such server"),
        (stranger, "broke off: it has another key, or none, or is no such server"),
        (elsewhere, "broke off: it has another key, or none, or is no such server"),
    ):
        began = time.perf_counter()
        with pytest.raises(MachineError, match=sentence):
            connect(locked, robot, key=key, limits=limits)
        assert time.perf_counter() - began < limits.connect + SLACK
    engine = connect(locked, robot, key=right)
    assert solves(engine, world, state)
    engine.close()
    said = "\n".join(locked.said())
    assert "refused: a client with an unknown key" in said and "has not the right key" in said


def test_a_key_opens_while_the_engine_works(keys, robot, world):
    right, slow = load_key(keys[1], CLIENT), Slow(robot, busy="reset")
    with serving(slow, robot, load_key(keys[0], SERVER)) as (address, said), ThreadPoolExecutor() as pool:
        first = RemoteKinematics(Connection(address, "kinematics", robot, right, Limits()))
        asked = pool.submit(first.reset, world)
        assert until(lambda: slow.began)
        with pytest.raises(LostEngine, match="did not answer 'hello' within 2 s: it hangs, or is too slow"):
            Connection(address, "kinematics", robot, right, Limits(connect=2.0))
        stranger = Key(*zmq.curve_keypair(), right.peer)
        with pytest.raises(LostEngine, match="broke off: it has another key"):
            Connection(address, "kinematics", robot, stranger, Limits(connect=5.0))
        slow.go.set()
        asked.result()
        first.close()
        assert "a client with an unknown key" in said


def test_a_key_where_none_is_wanted(server, keys, robot):
    with pytest.raises(MachineError, match="broke off: it has another key, or none, or is no such server"):
        connect(server, robot, key=load_key(keys[1], CLIENT), limits=Limits(connect=5.0))


def test_another_machine_is_not_spoken_to_without_a_key(robot):
    with pytest.raises(InputError, match=r"192\.0\.2\.1:5599 is on another machine: give the client's key"):
        Connection(Address("192.0.2.1", 5599), "physics", robot)


# ---- the command line -------------------------------------------------------------------------------------


def command(*words, **settings):
    whole = [sys.executable, "-m", "bt_tasksim.cli", *map(str, words)]
    return subprocess.Popen(
        whole, cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, **settings
    )


def refused(*words):
    process = command(*words)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 2 and out == "" and err.count("\n") == 1, err
    return err


def test_no_other_machine_is_let_in_without_a_key():
    for address in ("0.0.0.0", "192.0.2.1", "::"):
        said = refused("serve-engine", "physics", "sapien", "--address", address)
        assert f"bt-tasksim: {address} can be reached by other machines" in said and "--key FILE" in said


def test_unknown_roles_and_engines_are_refused(folder, keys):
    assert "did you mean 'physics'?" in refused("serve-engine", "physic", "sapien")
    assert "unknown physics engine 'sapiens'; did you mean 'sapien'?" in refused(
        "serve-engine", "physics", "sapiens"
    )
    assert "is the client's key, and this is the server" in refused(
        "serve-engine", "physics", "sapien", "--key", keys[1]
    )
    assert "exists and may be a key in use" in refused("new-key", keys[0])
    assert "no folder" in refused("serve-engine", "physics", "sapien", "--objects", folder / "none")


def test_a_port_that_is_taken(server):
    process = command("serve-engine", "kinematics", "pinocchio", "--port", server.port)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 1
    assert err.startswith(f"bt-tasksim: cannot listen at 127.0.0.1:{server.port}: Address already in use")


def test_an_interrupt_ends_a_server_at_once(folder):
    with served(folder, "kinematics", "pinocchio") as server:
        began = time.perf_counter()
        server.signal(signal.SIGINT)
        assert server.process.wait(timeout=20) == 130
        assert time.perf_counter() - began < 2.0
        assert server.said() == ["interrupted"]


def test_an_interrupt_ends_a_client_that_waits(folder):
    script = f"{HOLD}\nprint('holds', flush=True)\nwhile True: line.kinematics.joints_of_hand_start(START)"
    script = script.replace("START", "(0.4, 0.0, 0.3, 0.0)")
    with served(folder, "kinematics", "pinocchio") as server:
        words = [sys.executable, "-c", script, str(server.port), "60"]
        client = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=ROOT)
        assert client.stdout.readline() == b"holds\n"
        server.signal(signal.SIGSTOP)
        time.sleep(0.5)  # it waits for an answer now
        assert client.poll() is None
        began = time.perf_counter()
        client.send_signal(signal.SIGINT)
        err = client.communicate(timeout=20)[1].decode()
        assert client.returncode == -signal.SIGINT and err.strip().endswith("KeyboardInterrupt")
        assert "_exchange" in err and time.perf_counter() - began < 2.0


def test_an_evaluation_over_a_server_that_is_not_there_is_one_sentence():
    words = ("--episodes", "1", "--engines", "remote:127.0.0.1:1", "--connect-timeout", "0.5")
    process = command("evaluate", "pick_and_place", *words)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 1 and err.count("\n") == 1
    assert err.startswith("bt-tasksim: no physics server answers at 127.0.0.1:1 within 0.5 s: start one")
    said = refused("evaluate", "pick_and_place", "--workers", 2, "--engines", "remote:127.0.0.1:1")
    assert "serves one client at a time" in said
