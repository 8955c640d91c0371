"""Runs the command line without what POSIX has: modules, functions and `/proc` are hidden, in children too.

python -m tests.support.without_posix WORD ... [+ WORD ...]    # commands one after the other
"""

import builtins
import io
import os
import sys
from pathlib import Path

MODULES = ("fcntl", "resource", "grp", "pwd", "termios", "tty", "pty", "syslog")
FUNCTIONS = (
    "fork", "forkpty", "getuid", "geteuid", "getgid", "getegid", "killpg", "wait4", "wait3", "pwrite", "pread",
    "posix_fallocate", "sched_getaffinity", "sched_setaffinity", "setsid", "getpgid", "chown",
    "O_NOFOLLOW", "O_NONBLOCK", "O_DIRECTORY",
)  # fmt: skip


def hide() -> None:
    """Hide what only POSIX has from whatever is imported afterwards."""
    import ctypes.util  # noqa: F401 - what libraries use of POSIX by themselves is there already
    import shutil  # noqa: F401
    import subprocess  # noqa: F401
    import tempfile  # noqa: F401

    import platformdirs  # noqa: F401 - asks for the system by its name

    for name in MODULES:
        sys.modules[name] = None  # type: ignore[assignment]
    for name in FUNCTIONS:
        if hasattr(os, name):
            delattr(os, name)

    def hiding(function):
        def call(path, *arguments, **options):
            if isinstance(path, (str, os.PathLike)) and os.fspath(path).startswith("/proc"):
                raise FileNotFoundError(2, "No such file or directory", os.fspath(path))
            return function(path, *arguments, **options)

        return call

    builtins.open = io.open = hiding(io.open)
    for name in ("open", "listdir", "scandir", "stat", "lstat", "readlink", "access"):
        setattr(os, name, hiding(getattr(os, name)))


def main() -> int:
    hide()
    from orchestrator.cli import main as command_line
    from orchestrator.shared.isolation import surroundings

    here = str(Path(__file__).resolve())
    surroundings._PYTHON = (
        f"import runpy; runpy.run_path({here!r})['hide'](); {surroundings._PYTHON}"  # children start afresh
    )
    lines = [words.split("\n") for words in "\n".join(sys.argv[1:]).split("\n+\n")]
    return max(map(command_line, lines))


if __name__ == "__main__":
    sys.exit(main())
