"""The evaluation channel of the twin: set a world, inject a fault, read the truth. JSON lines over TCP.

It has nothing to do with ROS: trees, policies and engines never see it. The node answers between two steps.
A client's first line is a secret that the twin's starter and its node share: any page in a browser of this
machine may post to a port of it, but does not know that line.
"""

from __future__ import annotations

import hmac
import json
import queue
import socket
import threading
from collections.abc import Callable
from dataclasses import fields
from typing import Any

import numpy as np

from bt_tasksim.core.errors import MachineError
from bt_tasksim.core.world import Hidden
from bt_tasksim.scene.configuration import ActorConfiguration
from bt_tasksim.scene.success import Overlap

LONGEST = 4_000_000
"""Bytes of a line."""
SECRET = "BT_TASKSIM_TWIN_SECRET"
"""Environment variable that hands on the secret; a command line is seen by everybody."""
GREETING = 5.0
"""Seconds within which a client says the secret."""


class EvaluationServer:
    """Listens on this machine; questions wait until `answer` is called.

    Args:
        port: Its port; 0 for a free one.
        secret: The first line of every client that is listened to.

    Attributes:
        port: The port.
    """

    def __init__(self, port: int, secret: str) -> None:
        if len(secret) < 16:
            raise ValueError("a secret of the evaluation channel has at least 16 characters")
        self._secret = secret.encode()
        self._listening = socket.create_server(("127.0.0.1", port))
        self.port = int(self._listening.getsockname()[1])
        self._questions: queue.SimpleQueue[tuple[dict[str, Any], socket.socket]] = queue.SimpleQueue()
        threading.Thread(target=self._accept, daemon=True).start()

    def answer(self, how: Callable[[dict[str, Any]], dict[str, Any]]) -> None:
        """Answer every question that has come.

        Args:
            how: Takes a question and gives the answer, both plain data; ValueError and RuntimeError become
                the answer ``{"error": sentence}``.
        """
        while True:
            try:
                question, peer = self._questions.get_nowait()
            except queue.Empty:
                return
            try:
                said = how(question)
            except (ValueError, RuntimeError) as error:
                said = {"error": str(error)}
            try:
                peer.sendall(json.dumps(said).encode() + b"\n")
            except OSError:
                peer.close()

    def _accept(self) -> None:
        while True:
            try:
                peer = self._listening.accept()[0]
            except OSError:
                return
            threading.Thread(target=self._read, args=(peer,), daemon=True).start()

    def _read(self, peer: socket.socket) -> None:
        """Questions of one client that knows the secret, until it goes away."""
        try:
            with peer, peer.makefile("rb") as lines:
                peer.settimeout(GREETING)
                if not hmac.compare_digest(lines.readline(len(self._secret) + 2).strip(), self._secret):
                    return
                peer.settimeout(None)
                while line := lines.readline(LONGEST):
                    try:
                        question = json.loads(line)
                        if not isinstance(question, dict):
                            raise ValueError
                    except (ValueError, RecursionError):
                        peer.sendall(b'{"error": "a question is a JSON object on one line"}\n')
                        continue
                    self._questions.put((question, peer))
        except OSError:
            return

    def close(self) -> None:
        """Listen no more."""
        self._listening.close()


class EvaluationClient:
    """The other side, for benchmarks and tests.

    Args:
        port: Port of the twin's evaluation channel, on this machine.
        secret: The twin's, see `EvaluationServer`.

    Raises:
        MachineError: There is no twin.
    """

    def __init__(self, port: int, secret: str) -> None:
        try:
            self._socket = socket.create_connection(("127.0.0.1", port), 30.0)
            self._socket.sendall(secret.encode() + b"\n")
        except OSError as error:
            raise MachineError(f"no twin answers at evaluation port {port}: {error}") from error
        self._lines = self._socket.makefile("rb")

    def ask(self, **question: Any) -> dict[str, Any]:
        """Ask, and wait for the answer.

        Raises:
            MachineError: The twin is gone, or says that the question is no good.
        """
        try:
            self._socket.sendall(json.dumps(question).encode() + b"\n")
            line = self._lines.readline()
            if not line:
                raise OSError("it has closed the connection")
            answer: dict[str, Any] = json.loads(line)
        except (OSError, ValueError) as error:
            raise MachineError(f"the twin does not answer: {error}") from error
        if "error" in answer:
            raise MachineError(f"the twin: {answer['error']}")
        return answer

    def load(self, configuration: ActorConfiguration, seed: int = 0) -> None:
        """Make a world anew; factors and noise follow from the seed."""
        self.ask(do="load", configuration=configuration.to_json(), seed=seed)

    def truth(self) -> tuple[Hidden, Overlap | None]:
        """The physics state, and the two bodies that overlapped most."""
        answer = self.ask(do="truth")
        pair = answer["deepest_pair"]
        hidden = Hidden(**{f.name: np.asarray(answer[f.name]) for f in fields(Hidden)})
        return hidden, None if pair is None else tuple(pair)

    def tell(self) -> dict[str, Any]:
        """See `Cell.tell`."""
        return self.ask(do="tell")

    def fault(self, name: str) -> None:
        """Inject a fault, or note the moment of one that happens elsewhere."""
        self.ask(do="fault", name=name)

    def close(self) -> None:
        """Disconnect."""
        self._lines.close()
        self._socket.close()


def hidden_to_json(hidden: Hidden) -> dict[str, Any]:
    """In plain data; infinite distances are written as JavaScript does, which Python reads."""
    return {f.name: np.asarray(getattr(hidden, f.name)).tolist() for f in fields(Hidden)}
