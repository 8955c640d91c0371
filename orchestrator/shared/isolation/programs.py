"""A program of the system that reads files of others, such as a compiler: run to its end behind walls.

The walls are those of a child of ``jail``, but for two: it may start the programs that it is made of, and it reads the
folders that are listed in place of the interpreter's. Standard library alone: the child imports this before its walls
are up.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

from orchestrator.shared.isolation.limits import Limits
from orchestrator.shared.isolation.walls import enclose, follow_parent, limit_process
from orchestrator.shared.operating_system import kill_group

_ROOT = Path(__file__).resolve().parents[3]
_PYTHON = (
    "import sys; sys.path.insert(0, sys.argv[1]); from orchestrator.shared.isolation import programs; programs.main()"
)


def run_program(
    command: Sequence[str], folder: Path, read: Sequence[Path], environment: Mapping[str, str], limits: Limits,
    walls: bool = True,
) -> tuple[int, str] | None:  # fmt: skip
    """Run a program in ``folder``, which it may read and write, with the other folders that it may read.

    Returns:
        Its exit code, negative for a signal, and what it said; None where it takes longer than ``limits.time`` [s].

    Raises:
        OSError: it cannot be started.
    """
    setup = [os.getpid(), asdict(limits), [*map(str, read)], [str(folder), "/dev/null"], walls, command]
    words = [sys.executable, "-I", "-B", "-c", _PYTHON, str(_ROOT), json.dumps(setup)]
    with tempfile.TemporaryFile() as log:
        process = subprocess.Popen(
            words, stdin=subprocess.DEVNULL, stdout=log, stderr=log, cwd=folder, env=dict(environment),
            start_new_session=sys.platform != "win32",
        )  # fmt: skip
        try:
            code = process.wait(limits.time)
        except BaseException as error:
            kill_group(process)
            process.kill()
            process.wait()
            if isinstance(error, subprocess.TimeoutExpired):
                return None
            raise
        log.seek(0)
        return code, log.read(limits.output).decode("utf-8", "replace")


def main() -> None:
    """Put up the walls of the setup in the second argument, and become its program."""
    parent, limits, read, write, walls, command = json.loads(sys.argv[2])
    follow_parent(parent)
    limit_process(Limits(**limits))
    if walls:
        enclose(tuple(read), tuple(write), programs=True)
    os.execv(command[0], command)
