"""Programs that are run for their result, such as compilers: none outlives the work that it was started for.

Standard library alone: the package is built with it.
"""

import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from orchestrator.shared.operating_system import kill_group, signal_group

_PATIENCE = 2.0  # s to clean up: a compiler removes its temporary files


def run_tool(
    command: Sequence[str], folder: Path | None = None, environment: Mapping[str, str] | None = None, given: str = ""
) -> "subprocess.CompletedProcess[str]":
    """Run a program and return its exit code and what it said.

    If anything ends the wait, as Ctrl-C and SIGTERM do, the program and all that it has started is ended too.
    ``folder``: in which it runs; ``environment``: of the program (default: of this process); ``given``: text that the
    program reads, after which its input ends.
    """
    process = subprocess.Popen(
        command, cwd=folder, env=environment, text=True, errors="replace", start_new_session=sys.platform != "win32",
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    with process:
        try:
            out, told = process.communicate(given)
        except BaseException:
            signal_group(process.pid, signal.SIGTERM)
            try:
                process.communicate(timeout=_PATIENCE)
            except subprocess.TimeoutExpired:
                if not kill_group(process):
                    process.kill()
            raise
    return subprocess.CompletedProcess(command, process.returncode, out, told)
