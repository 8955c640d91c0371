"""A workbench in a process of its own, and requests to it as any program could send them."""

import http.client
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tests.support.waiting import HANGS, wait_until

ROOT = Path(__file__).resolve().parents[2]
TABLE = {"content-type": "application/json"}


@dataclass
class Served:
    """A running workbench: its process, port, token and directory."""

    process: "subprocess.Popen[str]"
    port: int
    token: str
    folder: Path

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}/{self.token}/"

    def ask(self, method: str, path: str, body: Any = None, headers: dict[str, str] | None = None) -> tuple[int, Any]:
        """Return status and answer; a table goes as JSON, bytes as they are; ``path`` is below the token."""
        return self.ask_raw(method, f"/{self.token}/{path}", body, headers)

    def ask_raw(self, method: str, path: str, body: Any = None, headers: Any = None) -> tuple[int, Any]:
        """As ``ask``, with a whole path."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=HANGS)
        given = dict(headers or {})
        if isinstance(body, (dict, list)):
            given, body = {**TABLE, **given}, json.dumps(body)
        try:
            connection.request(method, path, body, given)
            answer = connection.getresponse()
            content = answer.read()
        finally:
            connection.close()
        kind = answer.getheader("content-type") or ""
        return answer.status, json.loads(content) if "json" in kind else content

    def upload(self, path: Path, name: str | None = None) -> str:
        """Upload a file and return what the workbench calls it."""
        status, found = self.ask("PUT", f"upload/{name or path.name}", path.read_bytes())
        assert status == 201, found
        return found["file"]

    def job(self, name: str) -> dict[str, Any]:
        """Return what the workbench says of a job; nothing of one that was not started."""
        return next((job for job in self.ask("GET", "state")[1]["jobs"] if job["name"] == name), {})

    def start(self, command: str, inputs: list[str], **options: Any) -> str:
        """Start a job and return its name."""
        status, job = self.ask("POST", "jobs", {"command": command, "inputs": inputs, "options": options})
        assert status == 201, job
        return job["name"]

    def wait(self, name: str, until: Any = lambda job: job["state"] not in ("waiting", "running")) -> dict[str, Any]:
        """Wait for a job, which a page may not have started yet."""
        job: dict[str, Any] = {}

        def is_there() -> Any:
            job.update(self.job(name))
            return job and until(job)

        wait_until(is_there, lambda: job, pause=0.05)
        return job


@contextmanager
def workbench(
    folder: Path, *words: str, environment: Mapping[str, str] | None = None, module: str = "orchestrator"
) -> Iterator[Served]:
    """Serve a directory; the server ends with the ``with`` statement.

    Args:
        environment: further variables.
        module: that runs the command line.
    """
    command = [sys.executable, "-m", module, "workbench", "--no-browser", "--out", str(folder), *words]
    paths = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    variables = {**os.environ, **(environment or {}), "PYTHONPATH": paths}
    process = subprocess.Popen(
        command, cwd=folder.parent, env=variables, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        assert process.stdout is not None
        said = process.stdout.readline()
        found = re.search(r"http://127\.0\.0\.1:(\d+)/([^/]+)/", said)
        assert found is not None, said + process.stderr.read()  # type: ignore[union-attr]
        yield Served(process, int(found.group(1)), found.group(2), folder)
    finally:
        if process.poll() is None:
            process.terminate()
        process.communicate(timeout=HANGS)


def drive_log(path: Path, rows: int = 3000, unknown: str = "Achse B [deg]", said: str = "Export of a drive") -> Path:
    """Write the log of a simulated drive in amperes and degrees; its second encoder has a name that nobody knows.

    Ratio 10, torque constant 0.5 N.m/A, half-gap 5 mrad and dry friction of 0.05 N.m at the motor; 500 Hz.
    """
    step, inner = 0.002, 20
    time = np.arange(rows) * step
    rng = np.random.default_rng(3)
    tones = [(0.31, 1.1), (0.77, 0.9), (1.9, 0.8), (3.3, 0.6)]
    current = sum(a * np.sin(2 * np.pi * f * time + p) for (f, a), p in zip(tones, rng.uniform(0, 6, 4), strict=True))
    motor = load = speed_m = speed_l = 0.0
    angles = np.empty((rows, 2))
    for n in range(rows):
        angles[n] = motor, load
        for _ in range(inner):
            twist = motor / 10.0 - load
            bent = np.sign(twist) * max(abs(twist) - 0.005, 0.0)
            shaft = (800.0 * bent + 0.8 * (speed_m / 10.0 - speed_l)) if bent else 0.0
            torque = 0.5 * current[n] - 0.05 * np.tanh(speed_m / 0.01) - 0.004 * speed_m - shaft / 10.0
            speed_m += step / inner * torque / 0.003
            speed_l += step / inner * (shaft - 0.3 * speed_l) / 0.25
            motor += step / inner * speed_m
            load += step / inner * speed_l
    degrees = np.rad2deg(angles) + rng.normal(0.0, (0.01, 0.003), (rows, 2))
    lines = [said, "Device;D7", f"Time [ms];Current setpoint [A];Motor position [deg];{unknown}"]
    table = np.column_stack([time * 1e3, current, degrees])
    path.write_text("\n".join([*lines, *(f"{t:.0f};{u:.4f};{m:.4f};{q:.4f}" for t, u, m, q in table)]) + "\n")
    return path
