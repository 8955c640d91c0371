"""A Python entry point in a child process behind walls, asked over a private channel, killed at a deadline.

    with Jail("package.module:opened", argument, read=[unpacked_fmu]) as jail:
        answer = jail.call(request, Answer, time=30.0)

In the child, ``opened(argument)`` is called once, after the walls are up, and returns the handler; every ``call`` then
runs ``handler(request)``. Arguments and requests are pickled (they go from the trusted to the untrusted side);
answers are plain data and arrays of float64, int64 and bool (see ``wire``), of the type that is asked for: dataclasses
and named tuples too. An ``OrchestratorError`` of the handler is raised again by ``call``, and the child lives on; any
other exception becomes a ``SimulationError``. How else a child ends is a ``ChildError``, which words it for all.

What holds for the child, from before the first foreign byte is loaded:
 - it has a session and process group of its own, no terminal, an environment without secrets, and dies with the
   thread that made the ``Jail``, also when that is killed;
 - limits of time, memory, size and number of files, threads and descriptors (``Limits``);
 - with ``walls`` (the default) and where the kernel can: it reads system libraries, the interpreter, this package, its
   compiled C files and ``read``; it writes in its scratch folder, which is its working and temporary directory; it
   opens no socket, starts no process and sends no signal.
Python code is imported from ``sys.path`` of the parent; of what is not installed, only the top-level packages of the
entry point, of this project and of ``packages`` can be seen.

A call costs about 0.03 ms beyond the time of the handler; what a child imports is what its start takes.
What a child says is a claim: whoever asks checks shapes and ranges, and never runs any of it.
"""

import contextlib
import math
import os
import pickle
import secrets
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from orchestrator import errors
from orchestrator.errors import ChildError, OrchestratorError, OutputError, SimulationError, SlaveError, word_printed
from orchestrator.shared.isolation import wire
from orchestrator.shared.isolation.inmate import ANSWER, NONCE, REFUSAL
from orchestrator.shared.isolation.limits import PATIENCE, Limits, Setup
from orchestrator.shared.isolation.strays import Strays
from orchestrator.shared.isolation.surroundings import code_folders, environment, launch, system_folders
from orchestrator.shared.isolation.walls import Walls, support
from orchestrator.shared.machine_code import machine_code_folder
from orchestrator.shared.operating_system import collect, kill_group, processor_time, processor_wait, resident_memory
from orchestrator.shared.scratch import Scratch, usage

START_LIMIT = 120.0
MOST_BYTES = 256 << 20
_DISK_INTERVAL = 0.5
_LAST_MOMENTS = 2.0
_MOST_GIVEN = 100_000
_Envelope = tuple[bytes, int, msgspec.Raw]
Answer = TypeVar("Answer")
_NAMES = {k: v for k, v in vars(errors).items() if isinstance(v, type) and issubclass(v, OrchestratorError)}


class Jail:
    """One child process; see the module. Use as a context manager, or call ``close``; one thread at a time.

    Args:
        entry: ``module:function`` that the child calls with ``argument``.
        read: further files and folders that the child may read, such as unpacked FMUs.
        write: further folders that it may change.
        walls: whether the kernel's walls are wanted; without them limits, time and cleaning up remain.
        packages: further top-level packages that the child may import.
        adopt: without a filter of system calls, find processes that leave the child's group, too: this process then
            becomes the parent of its orphaned descendants (Linux).

    Attributes:
        walls: what the kernel enforces, once the child has started; ``None`` when it was not wanted.
        scratch: the child's only writable folder.
    """

    def __init__(
        self,
        entry: str,
        argument: Any = None,
        *,
        read: Sequence[Path] = (),
        write: Sequence[Path] = (),
        limits: Limits | None = None,
        walls: bool = True,
        packages: Sequence[str] = (),
        adopt: bool = False,
    ) -> None:
        self.limits = limits or Limits()
        self.walls: Walls | None = None
        self.started = False
        self._wanted = walls
        self._watched = tuple(write)
        self._given = sum(usage(folder, _MOST_GIVEN)[0] for folder in write)
        self._strays = Strays(adopt and not (walls and support().seccomp))
        self._process: subprocess.Popen[bytes] | None = None
        self._interruption: BaseException | None = None
        self._root = Scratch("jail")
        self._usage_time = 0.0
        self._allowed = math.inf  # s: the limit that was broken
        try:
            self.scratch = self._root.folder("work")
            temporary = self._root.folder("work/tmp")
            code = code_folders(self._root.folder("code"), (entry.partition(":")[0].partition(".")[0], *packages))
            self._born = time.monotonic()
            self._log = tempfile.TemporaryFile(dir=self._root.path)  # noqa: SIM115 - closed with the jail
            ours, theirs = socket.socketpair()
            self._link = ours
            variables = environment(temporary, walls) | self._strays.mark
            with theirs:
                self._process = launch(theirs, self._log, self.scratch if walls else Path.cwd(), variables)
            allowed = (*system_folders(), *code, self._root.path / "code", machine_code_folder(), *read)
            setup = Setup(
                os.getpid(), (str(self._root.path / "code"), *map(os.path.abspath, sys.path)), entry,
                pickle.dumps(argument), self.limits, tuple(map(str, allowed)),
                (str(self.scratch), "/dev/null", *map(str, write)), walls,
            )  # fmt: skip
            self._guard(wire.send, pickle.dumps(setup), self._allow(START_LIMIT))
        except OSError as error:
            self.close()
            raise SimulationError(f"a child process cannot be started: {error.strerror}") from None
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> "Jail":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def start(self, time_limit: float = START_LIMIT) -> None:
        """Wait at most ``time_limit`` [s] until the entry point returned its handler, as ``call`` does by itself."""
        if not self.started:
            self.walls = self._exchange(b"", Walls if self._wanted else type(None), time_limit, 1 << 20)
            self.started = True

    def call(self, request: Any, answer: type[Answer], time: float | None = None, most: int = MOST_BYTES) -> Answer:
        """Return the handler's answer to ``request``.

        Args:
            answer: its type, of msgspec's types and arrays; an answer of another ends the child.
            time: seconds until the child is killed (default: the limit's).
            most: bytes of the answer.
        """
        self.start()
        return self._exchange(pickle.dumps(request), answer, self.limits.time if time is None else time, most)

    @property
    def pid(self) -> int:
        """The child's process."""
        assert self._process is not None
        return self._process.pid

    def resident(self) -> int:
        """Return the child's resident memory in bytes; 0 where the system does not tell."""
        return resident_memory(self.pid)[0]

    def processor_time(self) -> float:
        """Return how long the child has had a processor [s]; 0 where the system does not tell."""
        return processor_time(self.pid)

    def output_size(self) -> int:
        """Return how much the child has printed."""
        return os.fstat(self._log.fileno()).st_size

    def finish(self) -> bool:
        """Let the child end by itself, then kill what is left of it; return whether processes of its own were left."""
        process = self._process
        if process is None:
            return False
        self._link.close()
        if process.returncode is None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                collect(process, _LAST_MOMENTS)
        if process.returncode is None:
            self._kill()
        return kill_group(process) | self._strays.kill()

    def interrupt(self) -> None:
        """Kill the child; may be called by any thread, and a ``call`` under way then raises ``ChildError``."""
        process = self._process
        if process is not None and process.returncode is None:
            process.kill()

    def close(self) -> None:
        """Kill the child and what is left of its process group, and remove its files; harmless when done before."""
        self._kill()
        self._strays.kill()
        for name in ("_link", "_log"):
            stream = getattr(self, name, None)
            if stream is not None:
                stream.close()
        self._root.close()

    # ------------------------------------------------------------------------------------------------------------

    def _exchange(self, body: bytes, answer: type[Answer], limit: float, most: int) -> Answer:
        if self._interruption is not None:  # what cleans up after it must not put another error in its place
            raise self._interruption
        if self._process is None or self._process.returncode is not None:
            raise ChildError("the process has ended before", "exit")
        if wire.is_pending(self._link):
            raise self._forgery_error("it spoke without being asked")
        is_over = self._allow(limit)
        nonce = secrets.token_bytes(NONCE)
        self._guard(wire.send, nonce + body, is_over)
        data = self._guard(lambda link, over, tick: wire.receive(link, most, over, tick), is_over)
        try:
            echo, kind, value = wire.decode(data, _Envelope)
            if kind not in (ANSWER, REFUSAL) or not secrets.compare_digest(echo, nonce):
                raise wire.WireError("its answer belongs to no request")
            if kind == ANSWER:
                found: Answer = wire.decode(value, answer)
                return found
            name, text = wire.decode(value, tuple[str, str])
        except wire.WireError as error:
            raise self._forgery_error(str(error)) from None
        known = _NAMES.get(name)
        if known is None:
            raise SimulationError(f"{name}: {text}".rstrip(": "))
        raise known(text + word_printed(self._read_printed()) if issubclass(known, SlaveError) else text)

    def _allow(self, limit: float) -> Callable[[], bool]:
        """Return whether ``limit`` [s] from now, or the child's total, is over.

        What the child waits for a processor that others have does not count, up to ``PATIENCE`` times either: a busy
        machine is no fault of an FMU. What sleeps or hangs waits for none.
        """
        begin = time.monotonic()
        waited: list[float] = []  # before; asked for at the first look, so that quick calls cost nothing

        def is_over() -> bool:
            now = time.monotonic()
            allowed = ((now - begin, limit, waited), (now - self._born, self.limits.total, [0.0]))
            if not waited and now - begin > wire.SLICE:
                waited.append(processor_wait(self.pid))
            broken = (most for spent, most, before in allowed if spent > most and self._is_spent(spent, most, before))
            self._allowed = next(broken, math.inf)
            return self._allowed < math.inf

        return is_over

    def _is_spent(self, spent: float, most: float, before: Sequence[float]) -> bool:
        idle = processor_wait(self.pid) - before[0] if before else 0.0
        return spent - min(idle, (PATIENCE - 1.0) * most) > most

    def _guard(self, action: Any, *arguments: Any) -> Any:
        """Send or receive; whatever goes wrong there ends the child and becomes an error that says why."""
        try:
            return action(self._link, *arguments, self._tick)
        except wire.LateError:
            self._kill()
            text = f"the process gave no answer within {self._allowed:.3g} s"
            raise ChildError(text, "time", self._allowed) from None
        except wire.ClosedError:
            raise self._end_error() from None
        except wire.WireError as error:
            raise self._forgery_error(str(error)) from None
        except ChildError:
            raise
        except BaseException as error:
            self._interruption = error
            self._kill()
            raise

    def _tick(self) -> None:
        """Look at what the child uses; called every few hundredths of a second."""
        memory, threads = resident_memory(self.pid)
        if memory > self.limits.memory:
            self._kill()
            raise ChildError(f"the process used more than {self.limits.memory >> 20} MiB of memory", "memory")
        if threads > self.limits.threads:
            self._kill()
            raise ChildError(f"the process started more than {self.limits.threads} threads", "threads")
        if time.monotonic() - self._usage_time > _DISK_INTERVAL:
            self._usage_time = time.monotonic()
            counts = [usage(folder, self.limits.entries) for folder in (self.scratch, *self._watched)]
            written = sum(size for size, _ in counts) - self._given
            entries = max(number for _, number in counts)
            if written > self.limits.disk or entries > self.limits.entries:
                self._kill()
                raise ChildError(f"the process wrote more than {self.limits.disk >> 20} MiB of files", "disk")

    def _forgery_error(self, text: str) -> ChildError:
        self._kill()
        return ChildError(f"the process broke the protocol: {text}", "protocol")

    def _end_error(self) -> ChildError:
        """Collect the process and say how it ended."""
        assert self._process is not None
        try:
            peak = collect(self._process, _LAST_MOMENTS)
        except subprocess.TimeoutExpired:
            return self._forgery_error("it hung up")
        code = self._process.returncode
        said = self._read_printed()
        if code == -getattr(signal, "SIGXCPU", 0):
            return ChildError("the process took too much processor time", "time", self.limits.time)
        if code < 0 and peak > self.limits.memory:
            return ChildError(f"the process used more than {self.limits.memory >> 20} MiB of memory", "memory")
        if code < 0:
            with contextlib.suppress(ValueError):
                return ChildError(f"the process was ended by {signal.Signals(-code).name}", "signal", -code, said)
        return ChildError(f"the process ended with exit code {code}", "exit", abs(code), said)

    def _read_printed(self) -> str:
        try:
            self._log.seek(0, os.SEEK_END)
            self._log.seek(max(0, self._log.tell() - 4096))
            lines = self._log.read(4096).decode("utf-8", "replace").strip().splitlines()
        except (OSError, ValueError):
            return ""
        return lines[-1][:300] if lines else ""

    def _kill(self) -> None:
        process = self._process
        if process is not None and process.returncode is None:
            kill_group(process)  # before the process is collected, its number cannot be another's
            process.kill()
            process.wait()


__all__ = ["ChildError", "Jail", "Limits", "OutputError"]
