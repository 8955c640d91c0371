"""What a child of a jail does, by the name of the request."""

import ctypes
import os
import socket
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.errors import ScenarioError, SlaveError


def opened(argument: Any) -> Callable[[Any], Any]:
    return lambda request: globals()[f"_{request[0]}"](argument, *request[1:])


def _echo(argument: Any, value: Any) -> Any:
    return [argument, value]


def _array(_: Any, n: int) -> Any:
    return np.arange(n, dtype=float).reshape(2, -1)


def _refuse(_: Any) -> None:
    raise ScenarioError("`it` must be right, but is wrong")


def _print(_: Any) -> None:
    print("no licence")
    raise SlaveError("it returned Error")


def _fail(_: Any) -> None:
    raise KeyError("odd")


def _leave(_: Any, code: int) -> None:
    os._exit(code)


def _abort(_: Any) -> None:
    os.abort()


def _sleep(_: Any, seconds: float) -> None:
    time.sleep(seconds)


def _eat(_: Any) -> None:
    hoard = []
    while True:
        hoard.append(bytes(range(256)) * 40_000)
        time.sleep(0.01)


def _fill(_: Any) -> None:
    for n in range(1000):
        Path(f"file{n}").write_bytes(bytes(1 << 20))
        time.sleep(0.01)
    time.sleep(60.0)


def _deep(_: Any) -> None:
    for _n in range(3000):
        os.mkdir("d", 0o700)
        os.chdir("d")
    os.mkdir("closed", 0)
    os._exit(0)


def _threads(_: Any) -> None:
    for _n in range(20):
        threading.Thread(target=time.sleep, args=(60.0,), daemon=True).start()
    time.sleep(60.0)


def _forge(_: Any, data: bytes) -> None:
    for descriptor in range(3, 64):
        try:
            os.write(descriptor, data)
        except OSError:
            continue
    time.sleep(60.0)


def _flood(_: Any) -> None:
    for descriptor in range(3, 64):
        try:
            while True:
                os.write(descriptor, (1 << 40).to_bytes(8, "big") + bytes(1 << 16))
        except OSError:
            continue


def _early(_: Any) -> str:
    threading.Timer(0.05, lambda: os.write(int(sys.argv[1]), b"\x00" * 64)).start()
    return "first"


def _attempt(_: Any, what: str, *words: str) -> str:
    """Try what must be refused; "done", or the error's name."""
    try:
        _ATTEMPTS[what](*words)
    except OSError as error:
        return type(error).__name__
    return "done"


def _daemon(_: Any) -> int:
    """Start a process that leaves group, session and parent; return its number."""
    ours, theirs = os.pipe()
    if os.fork() == 0:
        os.setsid()
        daemon = os.fork()
        if daemon == 0:
            time.sleep(600.0)
        os.write(theirs, str(daemon).encode())
        os._exit(0)
    os.wait()
    return int(os.read(ours, 32))


def _environment(_: Any) -> Any:
    return [list(os.environ), sys.path, tempfile.gettempdir(), os.getcwd(), os.getsid(0) == os.getpid()]


def _libc(name: str, *arguments: Any) -> None:
    library = ctypes.CDLL(None, use_errno=True)
    if getattr(library, name)(*arguments) < 0:
        raise OSError(ctypes.get_errno(), name)


_ATTEMPTS: dict[str, Callable[..., Any]] = {
    "read": lambda path: Path(path).read_bytes(),
    "list": os.listdir,
    "write": lambda path: Path(path).write_bytes(b"x"),
    "delete": os.unlink,
    "truncate": lambda path: os.truncate(path, 0),
    "chmod": lambda path: os.chmod(path, 0),
    "rename": lambda path: os.rename(path, "stolen"),
    "link": lambda path: os.link(path, "link"),
    "symlink": lambda path: (os.symlink(path, "soft"), Path("soft").read_bytes()),
    "utime": lambda path: os.utime(path, (0, 0)),
    "fork": lambda: os._exit(0) if os.fork() == 0 else os.wait(),
    "posix_spawn": lambda: os.posix_spawn("/bin/true", ["true"], {}),
    "exec": lambda: os.execv("/bin/true", ["true"]),
    "tcp": lambda port: socket.create_connection(("127.0.0.1", int(port)), 2.0),
    "udp": lambda: socket.socket(socket.AF_INET, socket.SOCK_DGRAM).sendto(b"x", ("127.0.0.1", 9)),
    "unix": lambda: socket.socket(socket.AF_UNIX),
    "signal": lambda pid: os.kill(int(pid), 0),
    "ptrace": lambda pid: _libc("ptrace", 16, int(pid), 0, 0),
    "death": lambda: _libc("prctl", 1, 0, 0, 0, 0),
    "limits": lambda: __import__("resource").setrlimit(4, (1, 1)),
    "shm": lambda: _libc("shmget", 0x1234, 4096, 0o1600),
    "thread": lambda: threading.Thread(target=int).start(),
    "scratch": lambda: (Path("mine").write_text("x"), Path("mine").unlink(), os.makedirs("a/b"), os.rename("a", "c")),
}
