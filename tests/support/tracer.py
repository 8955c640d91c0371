"""What a process behind walls really did to files and network, as ``strace`` saw it."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from orchestrator.shared.isolation.surroundings import system_folders
from orchestrator.shared.machine_code import machine_code_folder
from tests.support.waiting import HANGS

ROOT = Path(__file__).parents[2]
_LINE = re.compile(r"^(\d+) +(\w+)\((.*)\) += (-?\d+|0x[0-9a-f]+)(?:<([^>]*)>)?")
_RESUMED = re.compile(r"^\d+ +<\.\.\. \w+ resumed>(.*)", re.DOTALL)
_PATH = re.compile(r'(?:(AT_FDCWD|\d+)<([^>]*)>, )?"((?:[^"\\]|\\.)*)"')
_OPENS = ("open", "openat", "openat2", "creat")
_CHANGES = (
    "unlink", "unlinkat", "rename", "renameat", "renameat2", "rmdir", "mkdir", "mkdirat", "truncate", "link", "linkat",
    "symlink", "symlinkat", "chmod", "fchmod", "fchmodat", "chown", "lchown", "fchownat", "mknod", "mknodat",
    "utimensat", "setxattr",
)  # fmt: skip
_NETWORK = ("connect", "sendto", "sendmsg", "bind")
_WRITES = re.compile(r"O_WRONLY|O_RDWR|O_CREAT|O_TRUNC|O_APPEND")


@dataclass
class Trace:
    """What succeeded in the children after their walls were up, outside of where they may.

    Attributes:
        children: number of processes that put up walls.
        calls: number of calls looked at.
        read, changed, sent: what got through.
    """

    children: int = 0
    calls: int = 0
    read: list[str] = field(default_factory=list)
    changed: list[str] = field(default_factory=list)
    sent: list[str] = field(default_factory=list)


def available() -> bool:
    """Whether processes can be traced here."""
    tool = shutil.which("strace")
    return bool(tool) and subprocess.run([str(tool), "-o", "/dev/null", "true"], check=False).returncode == 0


def traced(words: list[str], folder: Path, environment: dict[str, str]) -> Trace:
    """Run a command under the tracer.

    Args:
        words: what the interpreter is called with.
        folder: where it runs.
        environment: with ``TMPDIR``, below which scratch folders lie.
    """
    log = folder / "trace"
    calls = ",".join((*_OPENS, *_CHANGES, *_NETWORK, "prctl", "chdir"))
    options = ["-f", "-qq", "-y", "-s", "4096", "-o", str(log), "-e", f"trace={calls}"]
    command = ["strace", *options, sys.executable, *words]
    subprocess.run(command, cwd=folder, env=environment, capture_output=True, check=False, timeout=HANGS)
    with log.open(encoding="utf-8", errors="replace") as stream:
        return _read(stream, Path(environment["TMPDIR"]))


def _read(lines: Iterable[str], temporary: Path) -> Trace:
    system = [str(p) for p in system_folders()] + [os.path.realpath(p) for p in system_folders()]
    own = (ROOT / "orchestrator", ROOT / "pyfmu_sources", machine_code_folder(), temporary / "backlash-cosim-")
    readable = (*system, *map(str, own))
    writable = (str(temporary / "backlash-cosim-"), "/dev/null")
    trace, enclosed = Trace(), set[str]()
    folders: dict[str, str] = {}  # of each process; it begins in its scratch folder
    for line in _whole(lines):
        found = _LINE.match(line)
        if found is None:
            continue
        pid, call, arguments, result, where = found.groups()
        if call == "prctl":
            if "PR_SET_SECCOMP" in arguments and result == "0":
                enclosed.add(pid)
            continue
        if pid not in enclosed:
            continue
        trace.calls += 1
        if result.startswith("-"):
            continue
        here = folders.get(pid, writable[0])
        if call == "chdir":
            folders[pid] = _paths(arguments, here)[0]
        elif call in _NETWORK:
            if "socket:" not in arguments.partition(",")[0] or call in ("connect", "bind"):
                trace.sent.append(line.strip())
        elif call in _OPENS:
            path = where or ""
            if _WRITES.search(arguments) and not path.startswith(writable):
                trace.changed.append(line.strip())
            elif not path.startswith((*readable, *writable, f"/proc/{pid}")):
                trace.read.append(line.strip())
        elif not all(p.startswith(writable) for p in _paths(arguments, here)[call.startswith("symlink") :]):
            trace.changed.append(line.strip())
    trace.children = len(enclosed)
    return trace


def _whole(lines: Iterable[str]) -> Iterable[str]:
    """The lines, those put together that the tracer has parted because another process came between."""
    begun: dict[str, str] = {}
    for line in lines:
        pid = line.partition(" ")[0]
        if line.rstrip().endswith("<unfinished ...>"):
            begun[pid] = line.rstrip().removesuffix("<unfinished ...>").rstrip()
        elif resumed := _RESUMED.match(line):
            yield begun.pop(pid, pid) + resumed.group(1)
        else:
            yield line


def _paths(arguments: str, here: str) -> list[str]:
    """Absolute paths in the arguments of a call of a process that is in ``here``."""
    return [os.path.normpath(os.path.join(folder or here, name)) for _, folder, name in _PATH.findall(arguments)]
