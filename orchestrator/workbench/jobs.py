"""Jobs: each is the command itself in a process of its own, in the session's directory; Stop is Ctrl-C."""

import asyncio
import contextlib
import json
import os
import shlex
import signal
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import orchestrator
from orchestrator.errors import InputError
from orchestrator.plain_text import plain_text
from orchestrator.shared.operating_system import KILLED, command_options, signal_group
from orchestrator.shared.output import write_whole
from orchestrator.workbench.session import SessionFolder
from orchestrator.workbench.settings import WorkbenchSettings

PROGRAM = "backlash-cosim"  # as it is called on a command line
JOB_FILE, OUTPUT_FILE = "job.json", "output.txt"
STOPPED = (130, 143, 129)  # exit codes after Ctrl-C, SIGTERM and SIGHUP


@dataclass
class Job:
    """A command that was started.

    Attributes:
        name: of its folder of results, such as ``estimate-3``.
        words: the command line behind the program's name.
        asked: ``inputs`` and ``options`` as the page asked for it.
        state: "waiting", "running", "done", "failed" or "stopped"; "ended" where the server went first.
        stage, share, left: as ``--progress json`` tells them; ``told``: when it did [s since 1970].
        messages: what it wrote to standard error besides.
        begun, ended: seconds since 1970, ``ended`` 0.0 while it runs.
        stops: how often it was asked to stop.
    """

    name: str
    command: str
    words: tuple[str, ...]
    folder: Path
    asked: Mapping[str, Any] = field(default_factory=dict)
    state: str = "waiting"
    stage: str = ""
    share: float | None = None
    left: float | None = None
    told: float = 0.0
    exit_code: int | None = None
    messages: list[str] = field(default_factory=list)
    begun: float = 0.0
    ended: float = 0.0
    stops: int = 0
    process: "asyncio.subprocess.Process | None" = None

    def is_over(self) -> bool:
        """Return whether it has ended."""
        return self.state not in ("waiting", "running")

    def as_plain(self) -> dict[str, Any]:
        """Return what a page and ``job.json`` say of it."""
        own = ("words", "folder", "process")  # of the server alone
        plain = {one.name: getattr(self, one.name) for one in fields(self) if one.name not in own}
        found = () if not self.is_over() else (*self.folder.glob("*"), *self.folder.glob("diagnosis/*"))
        files = sorted(path.relative_to(self.folder).as_posix() for path in found if _is_result(path))
        return {**plain, "line": shlex.join([PROGRAM, *self.words]), "files": list(files)}


def _is_result(path: Path) -> bool:
    return path.is_file() and not path.is_symlink() and not path.name.startswith(".") and path.name != JOB_FILE


class Jobs:
    """The jobs of a session; for one thread, that of the event loop."""

    def __init__(self, session: SessionFolder, settings: WorkbenchSettings) -> None:
        self._session, self._settings = session, settings
        self._room = asyncio.Semaphore(settings.jobs_at_once)
        self._tasks: set[asyncio.Task[None]] = set()
        self.all: dict[str, Job] = {job.name: job for job in _of_earlier_servers(session)}

    def start(self, command: str, words: Sequence[str], asked: Mapping[str, Any] | None = None) -> Job:
        """Start a command; its results go into a folder of its own."""
        folder = self._session.reserve_result(command)
        line = (*words, "--progress", "json", "--out", self._session.reference_of(folder))
        job = Job(folder.name, command, line, folder, asked or {}, begun=time.time())
        self.all[job.name] = job
        self._write(job)
        task = asyncio.get_running_loop().create_task(self._run(job))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return job

    def stop(self, name: str) -> Job:
        """Ask a job to stop as Ctrl-C does; at the third time it is killed.

        Raises:
            InputError: there is no such job.
        """
        job = self.named(name)
        if not job.is_over():
            job.stops += 1
            if job.process is not None:
                signal_group(job.process.pid, signal.SIGINT if job.stops < 3 else KILLED)
        return job

    async def remove(self, name: str) -> None:
        """Remove a job that has ended, and its results.

        Raises:
            InputError: there is no such job, or it has not ended.
        """
        job = self.named(name)
        if not job.is_over():
            raise InputError(f"`job` must have ended before it is removed, but {name} is {job.state}: stop it first")
        await asyncio.to_thread(self._session.remove_result, job.folder.name)
        self.all.pop(name, None)

    def named(self, name: Any) -> Job:
        """Return a job.

        Raises:
            InputError: there is no such job.
        """
        job = self.all.get(name) if isinstance(name, str) else None
        if job is None:
            raise InputError(f"`job` must be one of this session, but is {str(name)[:60]!r}")
        return job

    async def close(self) -> None:
        """Stop all jobs, and wait until they have cleaned up."""
        for job in self.all.values():
            if not job.is_over():
                self.stop(job.name)
        if self._tasks:
            _, late = await asyncio.wait(self._tasks, timeout=self._settings.stop_seconds)
            for job in self.all.values():
                if not job.is_over() and job.process is not None:
                    signal_group(job.process.pid, KILLED)
            if late:
                await asyncio.wait(late, timeout=self._settings.stop_seconds)

    async def _run(self, job: Job) -> None:
        async with self._room:
            if job.stops:
                job.state, job.exit_code = "stopped", STOPPED[0]
            else:
                await self._watch(job)
        job.ended, job.process = time.time(), None
        self._write(job)

    async def _watch(self, job: Job) -> None:
        """Run the process of a job to its end."""
        with (job.folder / OUTPUT_FILE).open("wb") as output:
            try:
                job.process = await _spawn(job.words, self._session.folder, output.fileno())
            except OSError as error:
                job.state, job.messages = "failed", [f"error: the command cannot be started: {error.strerror}"]
                return
        job.state = "running"
        if job.stops:  # asked while it was being started
            signal_group(job.process.pid, signal.SIGINT)
        assert job.process.stderr is not None
        rest = b""
        while chunk := await job.process.stderr.read(65536):
            *lines, rest = (rest + chunk).split(b"\n")
            rest = rest[: self._settings.longest_message]
            for line in lines:
                self._hear(job, line)
        self._hear(job, rest)
        code = await job.process.wait()
        signal_group(job.process.pid, KILLED)  # whatever of its group is left
        job.exit_code = code if code >= 0 else 128 - code
        stopped = job.exit_code in STOPPED or (job.stops > 0 and code != 0)
        job.state = "stopped" if stopped else "done" if _is_complete(job) else "failed"
        job.share = 1.0 if job.state == "done" else job.share

    def _hear(self, job: Job, line: bytes) -> None:
        """Take a line of standard error: progress, or words."""
        text = line.decode("utf-8", "replace").strip()
        if text.startswith("{"):
            with contextlib.suppress(ValueError, TypeError, AttributeError):
                told = json.loads(text)
                job.stage, job.share, job.left = str(told["stage"])[:200], _share(told["share"]), _share(told["left"])
                job.told = time.time()
                return
        if text:
            job.messages.append(plain_text(text[: self._settings.longest_message]))
            del job.messages[: -self._settings.messages]

    def _write(self, job: Job) -> None:
        with contextlib.suppress(OSError):  # a full disk: the job itself says so
            content = {**job.as_plain(), "words": job.words}
            write_whole(job.folder / JOB_FILE, json.dumps(content, indent=1) + "\n")


def _share(value: Any) -> float | None:
    return None if value is None else float(value)


def _is_complete(job: Job) -> bool:
    """Return whether a command has done its work; 1 is what a check says that found problems."""
    return job.exit_code == 0 or (job.exit_code == 1 and (job.folder / f"{job.command}.json").is_file())


def _of_earlier_servers(session: SessionFolder) -> list[Job]:
    """Return the jobs that are noted in the session's directory, the oldest first."""
    found = []
    for note in session.results.glob(f"[!.]*/{JOB_FILE}"):
        try:
            said = json.loads(note.read_text(encoding="utf-8"))
            job = Job(
                note.parent.name, str(said["command"]), tuple(map(str, said["words"])), note.parent,
                dict(said.get("asked", {})), str(said["state"]), exit_code=said["exit_code"],
                messages=[str(text) for text in said["messages"]], begun=float(said["begun"]),
                ended=float(said["ended"]),
            )  # fmt: skip
        except (OSError, ValueError, TypeError, KeyError):
            continue
        if not job.is_over():
            whole = (job.folder / f"{job.command}.json").is_file()
            job.state = "done" if whole else "ended"
            if not whole:
                job.messages.append("the workbench ended before this job did, which left no results")
        found.append(job)
    return sorted(found, key=lambda job: job.begun)


async def _spawn(words: Sequence[str], folder: Path, output: int) -> "asyncio.subprocess.Process":
    """Start a command in a process group of its own, which gets Ctrl-C when the server dies."""
    home = str(Path(orchestrator.__file__).parents[1])
    paths = [home, *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))]
    return await asyncio.create_subprocess_exec(
        sys.executable, "-P", "-m", "orchestrator", *words,
        cwd=folder, stdin=asyncio.subprocess.DEVNULL, stdout=output, stderr=asyncio.subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(dict.fromkeys(paths))},
        **command_options(),
    )  # fmt: skip
