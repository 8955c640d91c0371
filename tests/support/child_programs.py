"""What a child of the sandbox may do, by the word in its first argument."""

import os
import sys
import tempfile
import time
from pathlib import Path


def main() -> None:
    globals()[f"_{sys.argv[1]}"]()


def _say(text: str) -> None:
    os.write(1, text.encode() + b"\n")


def _talk() -> None:
    _say("one")
    _say("two")
    os._exit(3)


def _slow() -> None:
    for n in range(4):
        _say(str(n))
        time.sleep(0.4)
    time.sleep(60.0)


def _forever() -> None:
    while True:
        _say("still here")
        time.sleep(0.2)


def _eat() -> None:
    hoard = []
    while True:
        hoard.append(bytes(range(256)) * 40_000)
        time.sleep(0.02)


def _write() -> None:
    try:
        Path("large").write_bytes(bytes(4 << 20))
    except OSError as error:
        _say(str(error.strerror))


def _abort() -> None:
    os.abort()


def _fork() -> None:
    pid = os.fork()
    if pid == 0:
        time.sleep(60.0)
        os._exit(0)
    _say(str(pid))


def _environment() -> None:
    _say(" ".join(os.environ))
    _say(os.pathsep.join(sys.path))
    _say(tempfile.gettempdir())
