"""A reader of logs that does what a hostile log would have it do, in the place of the workbench's own."""

import os
import socket
import subprocess
from collections.abc import Callable
from pathlib import Path


def reader(folder: str) -> Callable[[tuple[str, str]], dict[str, str]]:
    """Return what tries to reach beyond the log, in the child."""

    def answer(request: tuple[str, str]) -> dict[str, str]:
        name, session = request
        attempts: dict[str, Callable[[], object]] = {
            "own log": lambda: Path(folder, name).read_text(),
            "other log": lambda: Path(session, "others.csv").read_text(),
            "write beside": lambda: Path(session, "new.csv").write_text("3"),
            "write into": lambda: Path(folder, name).write_text("3"),
            "socket": lambda: socket.socket().close(),
            "process": lambda: subprocess.run(["/bin/true"], check=True),
            "signal": lambda: os.kill(os.getppid(), 0),
        }
        return {what: _attempt(act) for what, act in attempts.items()}

    return answer


def _attempt(act: Callable[[], object]) -> str:
    try:
        act()
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return "done"
