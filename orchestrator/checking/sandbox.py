"""A child process with limits, watched while it runs.

The limits keep a broken FMU from taking the machine along. They are no wall against a malicious one: a
library runs with the rights of the user. Look at what `--static` says before you run what you do not trust.
"""

import contextlib
import os
import queue
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

_POSIX = os.name == "posix"
_POLL = 0.05
_LONGEST_LINE = 1 << 20
_PYTHON = "import sys; sys.path.insert(0, {root!r}); import {module} as m; sys.path.remove({root!r}); m.main()"
_SECRET = re.compile(r"TOKEN|SECRET|PASSWORD|PASSWD|CREDENTIAL|PRIVATE|API_?KEY", re.IGNORECASE)


@dataclass(frozen=True)
class Limits:
    """What a child may use.

    Attributes:
        time: seconds without a sign of life.
        memory: resident bytes.
        output: bytes of any one file, and of the printed text.
        total: seconds in all.
    """

    time: float = 20.0
    memory: int = 2048 << 20
    output: int = 8 << 20
    total: float = 600.0


@dataclass(frozen=True)
class Ending:
    """How a child ended.

    Attributes:
        reason: "exit", "signal", "time" or "memory".
        code: exit code or number of the signal.
        left: whether processes of its own were still there afterwards (they are killed).
    """

    reason: str
    code: int
    left: bool

    def describe(self) -> str:
        """The ending of a process that should have gone on."""
        if self.reason == "signal":
            with contextlib.suppress(ValueError):
                return f"the process was ended by {signal.Signals(self.code).name}"
        return f"the process ended with exit code {self.code}"


def run_child(
    module: str, arguments: list[str], folder: Path, limits: Limits, on_line: Callable[[bytes], None]
) -> Ending:
    """Run ``module.main()`` in a child, hand every line of its output to ``on_line``, and clean up after it.

    Args:
        folder: working directory; the child's temporary files go to ``folder/../tmp``.
    """
    root = str(Path(__file__).resolve().parents[2])
    command = [sys.executable, "-I", "-B", "-c", _PYTHON.format(root=root, module=module), *arguments]
    scratch = folder.parent / "tmp"
    scratch.mkdir(exist_ok=True)
    options: dict[str, Any] = {"start_new_session": True, "preexec_fn": _limiter(limits)} if _POSIX else {}
    with subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        bufsize=0,
        stderr=subprocess.DEVNULL,
        cwd=folder,
        env=_environment(scratch),
        **options,
    ) as process:
        try:
            return _watch(process, limits, on_line)
        finally:
            _kill(process)


def _environment(scratch: Path) -> dict[str, str]:
    """The user's environment without what looks like a secret, and with its own temporary folder."""
    kept = {k: v for k, v in os.environ.items() if not _SECRET.search(k) and not k.startswith("PYTHON")}
    return kept | {"TMPDIR": str(scratch), "TEMP": str(scratch), "TMP": str(scratch)}


def _limiter(limits: Limits) -> Callable[[], None]:
    import resource

    # Address space is more than what is resident: libraries reserve far more than they touch.
    pairs = [
        (resource.RLIMIT_AS, 2 * limits.memory + (1 << 30)),
        (resource.RLIMIT_CPU, int(limits.total) + 1),
        (resource.RLIMIT_FSIZE, limits.output),
        (resource.RLIMIT_CORE, 0),
    ]

    def apply() -> None:
        for what, value in pairs:
            _, hard = resource.getrlimit(what)
            soft = value if hard == resource.RLIM_INFINITY else min(value, hard)
            resource.setrlimit(what, (soft, soft))

    return apply


def _watch(process: subprocess.Popen[bytes], limits: Limits, on_line: Callable[[bytes], None]) -> Ending:
    """Take lines until the process ends or breaks a limit; any line is a sign of life."""
    assert process.stdout is not None
    lines: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    # A thread, because Windows cannot wait for a pipe with a time limit.
    reader = threading.Thread(target=_read_lines, args=(process.stdout.fileno(), lines), daemon=True)
    reader.start()
    began = alive = time.monotonic()
    reason = ""
    while not reason:
        ended = _ended(process)
        try:
            on_line(lines.get(timeout=_POLL))
            alive = time.monotonic()
        except queue.Empty:
            if ended:
                break
        now = time.monotonic()
        if now - alive > limits.time or now - began > limits.total:
            reason = "time"
        elif _resident(process.pid) > limits.memory:
            reason = "memory"
    ending = _finish(process, reason, limits)
    reader.join(timeout=1.0)
    while not lines.empty():
        on_line(lines.get())
    return ending


def _read_lines(stream: int, lines: "queue.SimpleQueue[bytes]") -> None:
    pending = b""
    while True:
        try:
            data = os.read(stream, 65536)
        except OSError:  # closed, because somebody outside the group still holds the other end
            return
        if not data:
            return
        *whole, pending = (pending + data).split(b"\n")
        for line in whole:
            lines.put(line)
        pending = pending[:_LONGEST_LINE]


def _ended(process: subprocess.Popen[bytes]) -> bool:
    """Whether the process is over, without collecting it."""
    if not _POSIX:
        return process.poll() is not None
    return os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None


def _finish(process: subprocess.Popen[bytes], reason: str, limits: Limits) -> Ending:
    if not _POSIX:
        if reason:
            process.kill()
        return Ending(reason or "exit", process.wait(), left=False)
    if reason:
        _kill(process)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = code = os.waitstatus_to_exitcode(status)
    if not reason and code < 0:
        reason = "memory" if _peak(usage) > limits.memory else "signal"
    if code == -signal.SIGXCPU:
        reason = "time"
    left = reason in ("", "signal") and _kill(process)
    return Ending(reason or "exit", abs(code), left)


def _peak(usage: Any) -> int:
    """Largest resident memory of an ended child in bytes; 0 when that figure may be this process's own."""
    import resource

    # Linux counts what the child had between fork and exec, which is the memory of its parent.
    own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    unit = 1 if sys.platform == "darwin" else 1024
    return usage.ru_maxrss * unit if usage.ru_maxrss > own else 0


def _kill(process: subprocess.Popen[bytes]) -> bool:
    """Kill whatever is left of the process and its children; whether there was anything."""
    if not _POSIX:
        if process.poll() is None:
            process.kill()
            return True
        return False
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except (ProcessLookupError, PermissionError):
        return False
    return True


def _resident(pid: int) -> int:
    """Resident memory of a process in bytes; 0 where the system does not tell."""
    try:
        with open(f"/proc/{pid}/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, IndexError, ValueError):
        return 0
