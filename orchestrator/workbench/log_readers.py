"""Processes behind walls that read the session's logs for the page: one a log, and one that waits warm for the next.

A process sees the one log that it reads and no other file of the session: what a hostile log makes of its reader learns
nothing of others.
"""

import asyncio
import contextlib
import os
import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeVar

from orchestrator.errors import ChildError, OrchestratorError, RecordError
from orchestrator.records.formats.source import MAXIMUM_BYTES
from orchestrator.shared.isolation.jail import Jail
from orchestrator.shared.isolation.limits import Limits
from orchestrator.shared.scratch import Scratch
from orchestrator.workbench.settings import WorkbenchSettings

ENTRY = "orchestrator.workbench.curves:reader"
SPARE_AFTER = 3.0  # s after a log was opened: its first curves go first
Answer = TypeVar("Answer")


class LogReaders:
    """The readers of a session; for the event loop. A thread of their own asks them, one request after the other.

    Args:
        folder: the session's directory, in which each reader gets a folder of its own with its log.
    """

    def __init__(self, folder: Path, settings: WorkbenchSettings) -> None:
        self._folder, self._settings = folder, settings
        # Readers end with the thread that made them. The one that prepares the next keeps nobody waiting.
        self._thread, self._maker = ThreadPoolExecutor(1, "logs"), ThreadPoolExecutor(1, "next-log")
        self._open: dict[Path, _Reader] = {}
        self._spare: _Reader | None = None
        self._coming: _Reader | None = None
        self._closed = False

    def warm(self) -> None:
        """Start the process that waits for the next log."""
        if not self._closed:
            self._maker.submit(self._prepare)

    async def ask(self, log: Path, asked: Any, answer: type[Answer]) -> Answer:
        """Return what the reader of a log answers; it is started where there is none.

        Raises:
            RecordError: the log cannot be read.
        """
        loop, fresh = asyncio.get_running_loop(), log not in self._open
        try:
            return await loop.run_in_executor(self._thread, self._ask, log, asked, answer)
        finally:
            if fresh:
                loop.call_later(SPARE_AFTER, self.warm)

    def close(self) -> None:
        """End all of them."""
        self._closed = True
        for one in (*self._open.values(), *filter(None, [self._spare, self._coming])):
            one.jail.interrupt()
        self._maker.shutdown()
        self._thread.submit(self._free)
        self._thread.shutdown()

    def _ask(self, log: Path, asked: Any, answer: type[Answer]) -> Answer:
        one = self._open.pop(log, None)
        if one is None:
            one, self._spare = self._spare or _Reader(self._folder, self._settings), None
            one.give(log)
        self._open[log] = one
        while len(self._open) > self._settings.logs_open:
            self._open.pop(next(iter(self._open))).close()
        try:
            return one.jail.call((log.name, asked), answer, self._settings.answer_seconds)
        except ChildError as error:
            self._open.pop(log).close()
            raise RecordError(f"{log.name}: cannot be read: {error}") from None

    def _prepare(self) -> None:
        with contextlib.suppress(OrchestratorError):  # who asks for a log next is told
            if self._spare is None and not self._closed:
                spare = self._coming = _Reader(self._folder, self._settings)
                try:
                    spare.jail.start()
                except BaseException:
                    spare.close()
                    raise
                self._spare, self._coming = spare, None

    def _free(self) -> None:
        for one in (*self._open.values(), *filter(None, [self._spare])):
            one.close()


class _Reader:
    """A process, and the folder that it may read."""

    def __init__(self, folder: Path, settings: WorkbenchSettings) -> None:
        self._scratch = Scratch("log", folder)
        self.inbox = self._scratch.path
        limits = Limits(settings.answer_seconds, 8 * MAXIMUM_BYTES, total=float("inf"))
        try:
            self.jail = Jail(ENTRY, str(self.inbox), read=[self.inbox], limits=limits)
        except BaseException:
            self._scratch.close()
            raise

    def give(self, log: Path) -> None:
        """Lay a log into the folder: the file itself under a second name, where the file system has such."""
        try:
            os.link(log, self.inbox / log.name)
        except OSError:
            shutil.copyfile(log, self.inbox / log.name)

    def close(self) -> None:
        """End the process and remove its folder."""
        self.jail.close()
        self._scratch.close()
