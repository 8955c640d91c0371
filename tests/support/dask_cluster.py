"""A Dask cluster of separate processes over TCP on this machine."""

import contextlib
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

from tests.support.engine_process import ROOT, children
from tests.support.waiting import HANGS, wait_until

ENDS = 10.0  # s
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
                process.wait(timeout=ENDS)
            except subprocess.TimeoutExpired:  # a worker whose scheduler was killed may ask for it for ever
                for pid in (*children(process.pid), process.pid):
                    with contextlib.suppress(OSError):
                        os.kill(pid, signal.SIGKILL)
                process.wait(timeout=HANGS)

    def kill_worker(self, index: int) -> None:
        """Kill a worker's working process with SIGKILL; its supervisor starts a new one."""
        for pid in children(self._workers[index].pid):
            with contextlib.suppress(OSError):  # one that has ended meanwhile
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
        log = self._directory / "scheduler.log"

        def said() -> "re.Match[str] | None":  # it says where it listens, or ends
            ended = self._scheduler.poll() is not None
            found = re.search(r"Scheduler at:\s+((?:tcp|tls)://\S+)", log.read_text())
            assert found or not ended, log.read_text()
            return found

        return str(wait_until(said, log.read_text)[1])
