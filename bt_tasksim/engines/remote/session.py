"""What a served engine does with a message, without any socket: who owns it, what it is asked, what it says.

One client at a time owns the engine. It says ``hello`` first, then begins each episode with ``reset``; a
client that takes over begins with nothing of the one before. Whatever comes, there is one reply, and an
error of the engine travels as the same kind of error with its sentence.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from pathlib import Path

from bt_tasksim.core.errors import BtTasksimError, InputError, LostEngine, MachineError, UnreachableError
from bt_tasksim.engines.base import Engine, PostProcessEngine
from bt_tasksim.engines.remote.answers import answers_of, reset
from bt_tasksim.engines.remote.configurations import as_received
from bt_tasksim.engines.remote.handshake import Identity, identity, mismatch
from bt_tasksim.engines.remote.memory import MemoryWatch
from bt_tasksim.engines.remote.messages import BadMessageError, Message, decode, encode
from bt_tasksim.engines.remote.plain import LARGEST, LONGEST_TEXT
from bt_tasksim.engines.remote.schema import Frame, sizes_of
from bt_tasksim.robot.description import RobotDescription

ERRORS: tuple[type[BtTasksimError], ...] = (UnreachableError, InputError, LostEngine, MachineError)
"""Errors that travel by name, those of a narrower kind first."""


class ServedSession:
    """An engine, its owner and its episode.

    Args:
        engine: The engine.
        role: Its role, see `bt_tasksim.engines.base.ROLES`.
        name: Its name, for sentences.
        robot: The robot it is for.
        objects: Folder of mesh files, besides the bundled ones.
        refused: Called with one sentence for each message that was refused.
        watch: Learns what memory the engine needs for its worlds.
    """

    def __init__(
        self,
        engine: Engine,
        role: str,
        name: str,
        robot: RobotDescription,
        objects: Path | None = None,
        refused: Callable[[str], None] = lambda sentence: None,
        watch: MemoryWatch | None = None,
    ) -> None:
        self.watch = watch or MemoryWatch()
        self.engine, self.role, self.name, self.robot, self.objects = engine, role, name, robot, objects
        self.owner: bytes | None = None
        self.identity = identity(role, robot)
        self._refused = refused
        self._answers = answers_of(engine)
        self._kinds = ("hello", "reset", *self._answers)
        self._in_episode = False
        self._sizes = sizes_of(robot)

    def answer(self, client: bytes, frames: Sequence[Frame], there: Callable[[bytes], bool]) -> list[Frame]:
        """The frames of the reply to a client's message.

        Args:
            client: Who sent it, as the socket names it.
            frames: The message.
            there: Says whether a client is still connected.
        """
        number = 0
        try:
            request = decode(frames, self._kinds, self._sizes)
            number = request.number
            reply = self._reply(client, request, there)
            return self._encoded(dataclasses.replace(reply, number=number))
        except BadMessageError as error:
            return self._error(error, error.number, refused=True)
        except UnreachableError as error:
            return self._error(error, number)
        except BtTasksimError as error:
            return self._error(error, number, refused=True)
        except Exception as error:
            self._in_episode = False  # nobody knows what state the engine is in
            sentence = f"the {self.role} engine '{self.name}' raised {type(error).__name__}: {error}"
            return self._error(MachineError(sentence), number, refused=True)

    def _encoded(self, reply: Message) -> list[Frame]:
        try:
            return encode(reply, self._sizes)
        except InputError as error:  # such as NaN, after which nothing of the episode is worth anything
            self._in_episode = False
            raise MachineError(f"the {self.role} engine '{self.name}' has gone astray: {error}") from error

    def notice(self) -> list[Frame]:
        """The frames of a message that answers nothing."""
        return encode(Message(0, "notice"), {})

    def _leave(self) -> None:
        self._in_episode = False
        self._sizes = sizes_of(self.robot)

    def _reply(self, client: bytes, request: Message, there: Callable[[bytes], bool]) -> Message:
        if request.kind == "hello":
            return self._hello(client, request, there)
        if client != self.owner:
            raise LostEngine(
                f"this client does not own the {self.role} engine: it has to say 'hello' first, or another "
                "client has taken its place"
            )
        if request.kind == "reset":
            return self._reset(request)
        if not self._in_episode:
            raise MachineError(f"there is no episode in the {self.role} engine: it has to be reset first")
        return self._answers[request.kind](request)

    def _hello(self, client: bytes, request: Message, there: Callable[[bytes], bool]) -> Message:
        wanted = Identity(**request.fields)
        if why := mismatch(self.identity, wanted):
            raise InputError(why)
        if self.owner is not None and self.owner != client and there(self.owner):
            raise LostEngine(
                f"the {self.role} engine is in use by another client; it is free again when that one ends"
            )
        self.owner = client
        self._leave()
        images = isinstance(self.engine, PostProcessEngine) and self.engine.wants_images
        about = {**dataclasses.asdict(self.identity), "engine": self.name, "wants_images": images}
        return Message(0, "welcome", about)

    def _reset(self, request: Message) -> Message:
        self._leave()
        configuration = as_received(request.fields["configuration"], self.robot, self.objects)
        with self.watch.own():
            reply = reset(self.engine, self.robot, configuration)
        self._sizes = sizes_of(self.robot, configuration)
        self._in_episode = True
        return reply

    def _error(self, error: BtTasksimError, number: int, refused: bool = False) -> list[Frame]:
        sentence = plain_sentence(str(error))
        if refused:
            self._refused(sentence)
        kind = next((k for k in ERRORS if isinstance(error, k)), MachineError)
        miss = {name: _bounded(getattr(error, name, 0.0)) for name in ("distance", "angle")}
        fields = {"error": kind.__name__, "sentence": sentence, **miss}
        return encode(Message(number, "error", fields), {})


def error_of(reply: Message) -> BtTasksimError:
    """The error in a reply of kind ``error``, to be raised on the client's side."""
    name, sentence = reply.fields["error"], reply.fields["sentence"]
    if name == UnreachableError.__name__:
        return UnreachableError(sentence, reply.fields["distance"], reply.fields["angle"])
    return {kind.__name__: kind for kind in ERRORS}.get(name, MachineError)(sentence)


def _bounded(value: float) -> float:
    return float(value) if abs(value) <= LARGEST else LARGEST  # no comparison with NaN holds


def plain_sentence(text: str) -> str:
    """Text on one line, without what a terminal would obey, and no longer than a message may hold."""
    line = "".join(c if c.isprintable() else " " for c in " ".join(text.split()))
    return line if len(line) <= LONGEST_TEXT else f"{line[: LONGEST_TEXT - 3]}..."
