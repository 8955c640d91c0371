"""The child's side of a jail: reads its setup, puts up the walls, then calls the entry point and answers requests.

Until the walls are up, only the standard library and this room's light modules are imported.
"""

import contextlib
import ctypes
import os
import pickle
import socket
import struct
import sys
from importlib import import_module
from typing import Any

from orchestrator.shared.isolation.limits import Setup
from orchestrator.shared.isolation.walls import Walls, enclose, follow_parent, limit_process

_LENGTH = struct.Struct(">Q")
ANSWER, REFUSAL = 0, 1
NONCE = 16


def main() -> None:
    """Serve the parent at the other end of the descriptor in the first argument, until it hangs up."""
    if sys.platform == "win32":
        link = socket.fromshare(sys.stdin.buffer.read())
    else:
        link = socket.socket(fileno=int(sys.argv[1]))
    setup = pickle.loads(_first(link))
    assert isinstance(setup, Setup)
    follow_parent(setup.parent)
    sys.path[:] = setup.path
    limit_process(setup.limits)
    _serve(link, setup, enclose(setup.read, setup.write) if setup.walls else None)
    os._exit(0)  # threads or exit handlers of what was loaded must not keep the process alive


def _first(link: socket.socket) -> bytes:
    (length,) = _LENGTH.unpack(link.recv(_LENGTH.size, socket.MSG_WAITALL))
    data = b""
    while len(data) < length:
        piece = link.recv(length - len(data))
        if not piece:
            os._exit(1)
        data += piece
    return data


def _serve(link: socket.socket, setup: Setup, walls: Walls | None) -> None:
    """Open the entry point, then answer one request after the other."""
    from orchestrator.shared.isolation import wire

    link.setblocking(True)
    handler: Any = None
    while True:
        try:
            frame = wire.receive(link, sys.maxsize)
        except wire.ClosedError:
            return
        nonce, body = frame[:NONCE], frame[NONCE:]
        try:
            if handler is None:
                handler, value = _open(setup), walls
            else:
                value = handler(pickle.loads(body))
            message = wire.encode([nonce, ANSWER, value])
        except BaseException as error:  # what was loaded may even call sys.exit
            _flush_printed()
            message = wire.encode([nonce, REFUSAL, [type(error).__name__, _text(error)]])
        wire.send(link, message)
        if handler is None:
            return


def _open(setup: Setup) -> Any:
    module, _, function = setup.entry.partition(":")
    entry = import_module(module)
    return getattr(entry, function)(pickle.loads(setup.argument))


def _flush_printed() -> None:
    """Write what was printed, by C as well, to where the parent can read it."""
    with contextlib.suppress(Exception):
        sys.stdout.flush()
    if sys.platform != "win32":
        ctypes.CDLL(None).fflush(None)


def _text(error: BaseException) -> str:
    try:
        return " ".join(str(error).split())[:2000]
    except Exception:
        return ""
