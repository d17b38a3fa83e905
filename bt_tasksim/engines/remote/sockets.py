"""What the sockets of both sides have in common."""

from __future__ import annotations

from collections.abc import Sequence

import zmq

from bt_tasksim.engines.remote.keys import Key
from bt_tasksim.engines.remote.schema import LARGEST_HEADER, LARGEST_SIDE, Frame

HEARTBEAT = (2000, 8000)
"""Milliseconds between signs of life, and without one until a peer counts as gone (a pulled cable)."""
QUEUE = 16
"""Messages that may wait in a socket."""
_PICTURES = 7 * LARGEST_SIDE * LARGEST_SIDE


def prepare(socket: zmq.Socket[bytes], key: Key | None, pictures: bool, server: bool) -> None:
    """Set what has to be set before a socket connects or is bound.

    Args:
        socket: The socket.
        key: This side's key, for an encrypted connection; None for an open one.
        pictures: Frames with pictures may come in; else none is larger than `LARGEST_HEADER`.
        server: This is the side that clients connect to.
    """
    socket.setsockopt(zmq.LINGER, 0)
    socket.setsockopt(zmq.IPV6, 1)
    socket.setsockopt(zmq.RCVHWM, QUEUE)
    socket.setsockopt(zmq.SNDHWM, QUEUE)
    socket.setsockopt(zmq.MAXMSGSIZE, _PICTURES if pictures else LARGEST_HEADER)
    socket.setsockopt(zmq.HEARTBEAT_IVL, HEARTBEAT[0])
    socket.setsockopt(zmq.HEARTBEAT_TIMEOUT, HEARTBEAT[1])
    if key is None:
        return
    socket.curve_publickey, socket.curve_secretkey = key.public, key.secret
    if server:
        socket.curve_server = True
        socket.setsockopt_string(zmq.ZAP_DOMAIN, "engines")
    else:
        socket.curve_serverkey = key.peer


def end(
    context: zmq.Context[zmq.Socket[bytes]], socket: zmq.Socket[bytes], *others: zmq.Socket[bytes]
) -> None:
    """Close sockets and their context, without waiting for any peer.

    Called through `weakref.finalize`, which keeps them together until then: a context that is collected
    before its sockets waits for them for ever.
    """
    if context.closed:
        return
    socket.disable_monitor()
    for each in (socket, *others):
        each.close(0)
    context.term()  # which a socket in another thread sees, and closes


def send(socket: zmq.Socket[bytes], frames: Sequence[Frame], flags: int = 0) -> None:
    """Send frames as one message; views of large arrays go without a copy."""
    last = len(frames) - 1
    for i, frame in enumerate(frames):
        socket.send(frame, flags | (zmq.SNDMORE if i < last else 0), copy=isinstance(frame, bytes))


def receive(socket: zmq.Socket[bytes], pictures: bool) -> Sequence[Frame]:
    """The frames of a waiting message: buffers that share ZeroMQ's memory where there are pictures in it.

    Small frames are copied, which is quicker.
    """
    if not pictures:
        return socket.recv_multipart(zmq.NOBLOCK)
    return [frame.buffer for frame in socket.recv_multipart(zmq.NOBLOCK, copy=False)]
