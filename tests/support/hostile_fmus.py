"""Hostile FMUs: what they do and where, and what is left of the world around them afterwards."""

import os
import shutil
import socket
import subprocess
import sys
import time
import uuid
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from orchestrator.api.ssp import export_ssp
from tests.support.ball3 import ball_files
from tests.support.c_fmu import IDENTIFIER, fmu_files, write_fmu

ROOT = Path(__file__).parents[2]
ENDS, GOES_ON, EITHER = "ends", "goes on", "either"
"""Whether the run comes to an end by it (exit code 1), does not notice (0), or whichever comes first."""


def _table() -> dict[tuple[str, str], str]:
    places = {
        "exit": "load instantiate setup enter exit set get step terminate",
        "quick_exit": "instantiate step",
        "abort": "load instantiate step terminate",
        "segv": "instantiate get step",
        "hang": "load instantiate exit step terminate",
        "spin": "get step",
        "forge": "instantiate step",
    }
    table = {(place, action): ENDS for action, where in places.items() for place in where.split()}
    # What happens when an instance is freed comes after the results.
    table |= {("free", action): EITHER for action in ("exit", "abort", "segv", "hang")}
    ends = (
        "flood_descriptors nan inf kill_self stop_self close_descriptors replace_descriptors memory disk many_files "
        "deep_folders block_signals"
    )
    table |= {("step", action): ENDS for action in ends.split()}
    refused = (
        "fork_bomb orphan daemon shell exec delete truncate rename chmod write append symlink hard_link "
        "read tcp udp unix kill_parent stop_parent trace_parent chdir fifo limits"
    )
    table |= {("step", action): GOES_ON for action in refused.split()}
    # Text beyond the limit is cut off, and a finding of ``check``.
    return table | {("step", action): EITHER for action in ("threads", "flood_stdout")}


BEHAVIOURS = _table()
LAST_MOMENTS = 60.0  # s, in which what was killed is gone on a busy machine, too
COMMANDS = ("check", "simulate", "sweep", "ssp", "diagnose")
SCENARIO = """
stop = 0.2
record = ["slave.x", "slave.v"]
[master]
algorithm = "jacobi"
step = 0.01
[instances.slave]
fmu = "{fmu}"
parameters = {{ damping = 0.7 }}
[[sources]]
kind = "constant"
to = "slave.force"
value = 0.5
"""
MAP = """
[inputs]
force = { column = "u", hold = "zero" }
[outputs]
x = { column = "x", noise = 1e-4 }
[parameters]
mass = { uncertainty = "5 %" }
[ports.point]
input = "force"
position = "x"
velocity = "v"
[options]
budget = 1
"""
IMPATIENT = """
import sys
from pathlib import Path
seconds = sys.argv.pop(1)
if "diagnose" in sys.argv:
    Path("impatient.toml").write_text(f"[fmu]\\nloading = {seconds}\\npatience = {seconds}\\n")
    sys.argv += ["--settings", "impatient.toml"]
from orchestrator.__main__ import run
run()
"""
"""The seconds that a run may take are settings; their defaults are far more than an idle machine needs."""


def hostile_fmu(
    folder: Path, place: str, action: str, target: str = "-", port: int = 0, at: int = 3, version: str = "2.0"
) -> Path:
    """Write an FMU that does ``action`` in the function ``place``; in ``step``, at its ``at``-th call."""
    files = fmu_files("hostile") if version == "2.0" else ball_files("hostile")
    files |= {"resources/hostile.txt": f"{place} {action} {target} {port} {at}\n".encode()}
    return write_fmu(folder / f"{IDENTIFIER}.fmu", files)


def _sockets_of_one_number() -> tuple[socket.socket, socket.socket]:
    """Return a TCP and a UDP socket of the same port: one that is free for TCP may be taken for UDP."""
    while True:
        tcp = socket.create_server(("127.0.0.1", 0))
        udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            udp.bind(tcp.getsockname())
        except OSError:
            tcp.close()
            udp.close()
            continue
        return tcp, udp


@dataclass
class World:
    """What a hostile FMU may be after: files, sockets, processes; see ``harm``."""

    folder: Path
    version: str = "2.0"
    mark: str = field(default_factory=lambda: uuid.uuid4().hex)

    def __post_init__(self) -> None:
        for name in ("home", "temporary", "inputs"):
            (self.folder / name).mkdir(parents=True)
        self.precious = self.folder / "home" / "precious"
        self.precious.write_text("mine")
        self.before = self._state()
        self.tcp, self.udp = _sockets_of_one_number()
        self.port = self.tcp.getsockname()[1]
        self.unix = socket.socket(socket.AF_UNIX)
        self.unix_path = f"/tmp/hostile-{self.mark[:12]}"
        self.unix.bind(self.unix_path)
        self.unix.listen()

    def close(self) -> None:
        """Take the sockets down."""
        for server in (self.tcp, self.udp, self.unix):
            server.close()
        Path(self.unix_path).unlink(missing_ok=True)

    def fmu(self, place: str, action: str, at: int = 3) -> Path:
        """Write the FMU, aimed at this world."""
        target = self.unix_path if action == "unix" else str(self.precious)
        return hostile_fmu(self.folder / "inputs", place, action, target, self.port, at, self.version)

    def environment(self) -> dict[str, str]:
        """The environment of a command in this world."""
        own = {"TMPDIR": str(self.folder / "temporary"), "HOSTILE_MARK": self.mark, "PYTHONPATH": str(ROOT)}
        return os.environ | own

    def run(self, words: list[str], limit: float = 600.0) -> tuple[int, str, float]:
        """Run a command, the words after the interpreter; return exit code, standard error and seconds."""
        began = time.monotonic()
        done = subprocess.run(
            [sys.executable, *words], cwd=self.folder, env=self.environment(), text=True, capture_output=True,
            timeout=limit, check=False,
        )  # fmt: skip
        return done.returncode, done.stderr, time.monotonic() - began

    def _state(self) -> tuple[str, int, int]:
        info = self.precious.stat()
        return self.precious.read_text(), info.st_mode, info.st_nlink

    def harm(self) -> list[str]:
        """What has got out, and what is left: empty when all is well."""
        found = []
        try:
            if self._state() != self.before:
                found.append("the user's file was changed")
        except OSError:
            found.append("the user's file is gone")
        for name, server in (("TCP", self.tcp), ("UDP", self.udp), ("Unix", self.unix)):
            server.settimeout(0.0)
            try:
                _ = server.recv(16) if name == "UDP" else server.accept()
                found.append(f"a {name} connection")
            except OSError:
                continue
        found += [f"left in the temporary directory: {p.name}" for p in (self.folder / "temporary").iterdir()]
        found += [f"left process: {p}" for p in self._processes()]
        found += [f"left: {p}" for p in self.folder.glob("**/.partial-*")]
        return found

    def _processes(self) -> list[str]:
        mark = f"HOSTILE_MARK={self.mark}".encode()
        end = time.monotonic() + LAST_MOMENTS
        while True:
            found = []
            for path in Path("/proc").glob("[0-9]*"):
                try:
                    if mark in (path / "environ").read_bytes():
                        found.append((path / "comm").read_text().strip())
                except OSError:
                    continue
            if not found or time.monotonic() > end:
                return found
            time.sleep(0.05)

    def clean(self) -> None:
        """Make room for the next FMU."""
        shutil.rmtree(self.folder / "results", ignore_errors=True)


def command(world: World, kind: str, fmu: Path, time_limit: float) -> list[str]:
    """What the interpreter is called with so that ``kind``, one of ``COMMANDS``, runs ``fmu`` in ``world``."""
    start, inputs = ["-m", "orchestrator"], world.folder / "inputs"
    limits = ["--out", "results", "--time-limit", f"{time_limit:g}", "--memory-limit", "400"]
    if kind == "check":
        return [*start, "check", str(fmu), *limits]
    if kind == "diagnose":
        (inputs / "map.toml").write_text(MAP)
        _record(inputs / "record.csv")
        words = ["diagnose", "inputs/record.csv", "--fmu", str(fmu), "--map", "inputs/map.toml", "--out", "results"]
        return ["-c", IMPATIENT, f"{time_limit:g}", *words]
    scenario = inputs / "scenario.toml"
    scenario.write_text(SCENARIO.format(fmu=fmu.name))
    if kind == "ssp":
        export_ssp(inputs / "slave.ssp", scenario)
        return [*start, "ssp", "run", str(inputs / "slave.ssp"), *limits]
    words = [*start, kind, "--scenario", str(scenario), *limits]
    return [*words, "--vary", "slave.stiffness=30,40", "--workers", "1"] if kind == "sweep" else words


def _record(path: Path) -> None:
    """Write what a mass on a spring with dry friction does under a force of two sines, with noise."""
    time, x, v = 0.02 * np.arange(150), 0.1, 0.0
    force = 3.0 * np.sin(2.0 * time) + 2.0 * np.sin(5.3 * time)
    noise = 1e-4 * np.random.default_rng(1).standard_normal(len(time))
    lines = ["time,u,x"]
    for k, t in enumerate(time):
        lines.append(f"{t:.3f},{force[k]:.9g},{x + noise[k]:.9g}")
        for _ in range(20):
            v += 1e-3 * (force[k] - 40.0 * x - 0.8 * v - 0.3 * np.sign(v))
            x += 1e-3 * v
    path.write_text("\n".join(lines) + "\n")


def verdict(world: World, kind: str, place: str, action: str, time_limit: float, at: int = 3) -> list[str]:
    """Run one behaviour under one command; return what went wrong: empty when it was contained."""
    code, errors, seconds = world.run(command(world, kind, world.fmu(place, action, at), time_limit))
    wrong = world.harm()
    expected = BEHAVIOURS[place, action]
    if kind == "diagnose" and (action == "memory" or place == "terminate"):
        expected = EITHER  # it allows more memory, and needs nothing of what comes after the runs
    if kind == "check" and expected == GOES_ON:
        expected = EITHER  # what an FMU does to its surroundings may be a finding
    lines = [line for line in errors.splitlines() if line.strip()]
    if code not in {ENDS: {1}, GOES_ON: {0}, EITHER: {0, 1}}[expected]:
        wrong.append(f"exit code {code}: {errors[-300:]}")
    if "Traceback" in errors or len(lines) > 1:
        wrong.append(f"more than a line: {errors[-300:]}")
    if kind in NAMING and code and not (lines and lines[0].startswith("error:") and _named(lines[0])):
        wrong.append(f"the FMU is not named: {errors[-300:]}")
    results = world.folder / "results"
    if code == 0 and not (results / f"{kind}.json").exists():
        wrong.append("exit code 0 without a result")
    if code and kind in NAMING and results.exists():
        wrong.append("a result of a run that failed")
    if seconds > 300.0 + 8.0 * time_limit:  # far more than a busy machine takes, far less than what hangs
        wrong.append(f"took {seconds:.0f} s")
    if action == "read" and kind in ("simulate", "ssp") and "42.0" in (results / f"{kind}.csv").read_text():
        wrong.append("the user's file was read")
    world.clean()
    return wrong


NAMING = ("simulate", "ssp", "diagnose")
"""Commands that say on standard error what an FMU did; the others say so in their results."""


def _named(line: str) -> bool:
    """Whether a line names the FMU, the SSP file that it is in or, of a result that is not finite, its output."""
    return any(name in line for name in (IDENTIFIER, "slave.x", "slave.ssp"))
