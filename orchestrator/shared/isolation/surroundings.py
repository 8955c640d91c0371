"""What a child process is started with: command, environment, and the files that every Python needs."""

import importlib.util
import os
import re
import socket
import subprocess
import sys
import sysconfig
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from orchestrator import errors
from orchestrator.shared.machine_code import VARIABLE, machine_code_folder
from orchestrator.shared.operating_system import link

_PYTHON = (
    "import sys; sys.path.insert(0, sys.argv[2]); from orchestrator.shared.isolation import inmate; "
    "sys.path.pop(0); inmate.main()"
)
_SECRET = re.compile(r"TOKEN|SECRET|PASSWORD|PASSWD|CREDENTIAL|PRIVATE|API_?KEY|SESSION|COOKIE|AUTH", re.IGNORECASE)
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_OURS = ("orchestrator", "pyfmu_sources")
_SYSTEM = (
    "/lib", "/lib32", "/lib64", "/usr/lib", "/usr/lib32", "/usr/lib64", "/usr/local/lib", "/usr/share/zoneinfo",
    "/etc/ld.so.cache", "/etc/localtime", "/dev/null", "/dev/zero", "/dev/random", "/dev/urandom", "/proc/cpuinfo",
    "/proc/meminfo", "/proc/sys/vm/overcommit_memory", "/sys/devices/system/cpu", "/sys/devices/system/node",
)  # fmt: skip


def launch(theirs: socket.socket, log: Any, folder: Path, environment: dict[str, str]) -> "subprocess.Popen[bytes]":
    """Start the child with its end of the socket pair, in a session of its own."""
    root = str(Path(errors.__file__).resolve().parents[1])
    command = [sys.executable, "-I", "-B", "-c", _PYTHON, str(theirs.fileno()), root]
    options: dict[str, Any] = {"stdout": log, "stderr": log, "cwd": folder, "env": environment}
    if sys.platform == "win32":  # where sockets are not inherited but shared with a process that is there
        process = subprocess.Popen(command, stdin=subprocess.PIPE, **options)
        assert process.stdin is not None
        with process.stdin as stream:
            stream.write(theirs.share(process.pid))
        return process
    options |= {"stdin": subprocess.DEVNULL, "pass_fds": [theirs.fileno()], "start_new_session": True}
    return subprocess.Popen(command, **options)


def environment(temporary: Path, walls: bool) -> dict[str, str]:
    """The child's environment: one thread per library, its own temporary folder; behind walls no secrets, no home."""
    own = dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(temporary))
    if not walls:
        return dict.fromkeys(_ONE_THREAD, "1") | dict(os.environ) | own
    kept = {k: v for k, v in os.environ.items() if not _SECRET.search(k) and not k.startswith("PYTHON")}
    own |= dict.fromkeys(("HOME", "XDG_CACHE_HOME"), str(temporary))
    own[VARIABLE] = str(machine_code_folder())
    return kept | own | dict.fromkeys(_ONE_THREAD, "1")


def system_folders() -> set[Path]:
    """Libraries of the system, and all of the interpreter that runs this. Return folders that a child may read."""
    found = {Path(p) for p in _SYSTEM}
    # A prefix that is no folder of its own, as `/` of some containers, would open everything.
    prefixes = {sys.prefix, sys.base_prefix, sys.exec_prefix, sys.base_exec_prefix}
    found |= {Path(p) for p in prefixes if len(Path(p).parts) > 1 and Path(p) not in Path.home().parents}
    found -= {Path.home()}
    found |= {Path(p) for k, p in sysconfig.get_paths().items() if k in ("stdlib", "platstdlib", "purelib", "platlib")}
    found |= {Path(p) for p in sys.path if Path(p).name in ("site-packages", "dist-packages")}
    return found | {Path(sys.executable).resolve().parent}


def code_folders(shadow: Path, packages: Sequence[str]) -> list[Path]:
    """Link the packages from ``shadow`` and return where they are, so that nothing beside them has to be readable."""
    found = []
    for name in dict.fromkeys((*_OURS, *packages)):
        spec = importlib.util.find_spec(name)
        if spec is None:
            continue
        places = list(spec.submodule_search_locations or ())
        place = Path(places[0] if places else spec.origin or "")
        if place.exists():
            link(shadow / place.name, place)
            found.append(place)
    return found
