"""A Dask cluster of separate processes over TCP on this machine."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

from tests.support.engine_process import ROOT, children

ENVIRONMENT = os.environ | {"PYTHONPATH": str(ROOT), "PYTHONWARNINGS": "ignore"}


class DaskProcesses:
    """A scheduler and workers of one thread each; use as a context manager."""

    def __init__(self, directory: Path, workers: int, options: list[str] | None = None) -> None:
        self._directory = directory
        self._options = options or []
        self._scheduler = self._start("scheduler", ["--host", "127.0.0.1", "--port", "0"])
        self.address = self._address()
        self._workers = [
            self._start(f"worker{i}", [self.address, "--nthreads", "1", "--local-directory", str(directory)])
            for i in range(workers)
        ]

    def __enter__(self) -> "DaskProcesses":
        return self

    def __exit__(self, *_: object) -> None:
        processes = [*self._workers, self._scheduler]
        for process in processes:
            process.terminate()
        for process in processes:
            try:
                process.wait(timeout=2)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def kill_worker(self, index: int) -> None:
        """Kill a worker's working process with SIGKILL; its supervisor starts a new one."""
        for pid in children(self._workers[index].pid):
            if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes():
                os.kill(pid, signal.SIGKILL)

    def kill_scheduler(self) -> None:
        """Kill the scheduler with SIGKILL."""
        self._scheduler.kill()

    def _start(self, name: str, options: list[str]) -> "subprocess.Popen[bytes]":
        kind = name.rstrip("0123456789")
        command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", "--no-dashboard", *self._options, *options]
        with (self._directory / f"{name}.log").open("wb") as log:
            return subprocess.Popen(command, cwd=self._directory, env=ENVIRONMENT, stdout=log, stderr=log)

    def _address(self) -> str:
        while self._scheduler.poll() is None:  # it says where it listens, or ends
            found = re.search(r"Scheduler at:\s+((?:tcp|tls)://\S+)", (self._directory / "scheduler.log").read_text())
            if found:
                return found.group(1)
            time.sleep(0.05)
        raise AssertionError((self._directory / "scheduler.log").read_text())
