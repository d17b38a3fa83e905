"""Which keys may come in: ZeroMQ's authentication protocol, rfc.zeromq.org/spec/27."""

from __future__ import annotations

import threading
from collections.abc import Callable

import zmq
from zmq.utils import z85

from bt_tasksim.engines.remote.keys import Key

_ZAP = "inproc://zeromq.zap.01"


class KeyAuthenticator:
    """Lets the holders of one key in, in a thread of its own: clients connect while the engine works.

    It must be there before its context's server socket is bound: where nobody answers, every key comes in.
    It ends with the context.

    Args:
        context: The context of the socket that is guarded.
        key: The server's key.
        refused: Called with one sentence, in that thread, for each client that is not let in.
    """

    def __init__(
        self, context: zmq.Context[zmq.Socket[bytes]], key: Key, refused: Callable[[str], None]
    ) -> None:
        self._socket, self._peer, self._refused = context.socket(zmq.REP), z85.decode(key.peer), refused
        self._socket.bind(_ZAP)
        threading.Thread(target=self._answer, name="authentication", daemon=True).start()

    def _answer(self) -> None:
        try:
            while True:
                asked = self._socket.recv_multipart()
                version, request, mechanism, credentials = asked[0], asked[1], asked[5], asked[6:]
                allowed = mechanism == b"CURVE" and credentials == [self._peer]
                status, text = (b"200", b"OK") if allowed else (b"400", b"this key is not known here")
                self._socket.send_multipart([version, request, status, text, b"", b""])
                if not allowed:
                    self._refused("a client with an unknown key")
        except zmq.ContextTerminated:
            pass
        finally:
            self._socket.close(0)
