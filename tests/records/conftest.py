"""Files of binary formats are read in the process of the tests: a child for each would be most of their time."""

import gc
import warnings
from collections.abc import Callable
from types import TracebackType
from typing import Any

import pytest

from orchestrator.errors import OrchestratorError, SimulationError
from orchestrator.records.formats import apart
from orchestrator.shared.isolation import wire

BEHIND_WALLS = ("test_readers_apart.py", "test_unusable_files.py", "test_reports_folder.py", "test_advice.py")
"""Files whose tests read in a child, as users do."""


class Here:
    """Stands for a jail whose child is this process; what comes back goes through the same codec."""

    def __init__(self, entry: str, argument: tuple[str, str], **_: Any) -> None:
        assert entry == "orchestrator.records.formats.apart:reader"
        self._argument = argument
        self._handler: Callable[[Any], Any] | None = None

    def __enter__(self) -> "Here":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        with warnings.catch_warnings(action="ignore"):  # of libraries that leave files open: a child's end closes them
            self._handler = None
            gc.collect()

    def call(self, request: Any, answer: type, most: int) -> Any:
        refused: OrchestratorError
        try:
            with warnings.catch_warnings(action="ignore"):
                self._handler = self._handler or apart.reader(self._argument)
                sent = wire.encode(self._handler(request))
        except OrchestratorError as error:
            refused = error.with_traceback(None)
            refused.__context__ = refused.__cause__ = None  # neither comes from a child
            sent = b""
        except Exception as error:
            refused, sent = SimulationError(f"{type(error).__name__}: {error}"), b""
        if not sent:
            raise refused
        assert len(sent) <= most
        return wire.decode(sent, answer)


@pytest.fixture(autouse=True)
def _reads_here(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if request.path.name not in BEHIND_WALLS:
        monkeypatch.setattr(apart, "Jail", Here)
