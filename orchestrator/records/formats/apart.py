"""Readers of binary formats in a child process behind walls.

The C code of the libraries that read MAT, HDF5, Parquet and MDF files trusts what a file says of itself: a damaged file
can end the process, and a hostile one can take it over. So they run where neither matters; what comes back are plain
names, units and arrays, which are checked.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import ChildError, RecordError
from orchestrator.records.formats.source import MAXIMUM_BYTES, MAXIMUM_CHANNELS, Head, RecordSource
from orchestrator.shared.isolation.jail import Answer, Jail
from orchestrator.shared.isolation.limits import Limits

NAMES = {"mat": "MAT", "hdf5": "HDF5", "parquet": "Parquet", "mdf": "MDF"}
# Arrays, their copies on the way, and what a library makes of a file: some times what may be unpacked.
_LIMITS = Limits(time=300.0, memory=8 * MAXIMUM_BYTES, output=2 * MAXIMUM_BYTES, total=3600.0, disk=2 * MAXIMUM_BYTES)


class _Opened(NamedTuple):
    """What an opened file holds; see ``RecordSource``."""

    heads: list[Head]
    dialect: str
    rate: float | None


def reader(argument: tuple[str, str]) -> Callable[[list[int] | None], Any]:
    """Open a file, in the child. Return what answers None with the channels, and places with their values."""
    module, path = argument
    source: RecordSource = import_module(f"orchestrator.records.formats.{module}").open_file(Path(path))

    def answer(places: list[int] | None) -> Any:
        if places is None:
            return _Opened(list(source.heads), source.dialect, source.rate)
        return [_send(values) for values in source.load(places)]

    return answer


@contextmanager
def open_apart(module: str, path: Path) -> Iterator[RecordSource]:
    """Open a file in a child process, which ends with the ``with`` statement."""
    file = path.resolve()
    with Jail(f"{__name__}:reader", (module, str(file)), read=[file], limits=_LIMITS) as jail:
        yield _Apart(jail, NAMES[module], file, path)


class _Apart(RecordSource):
    """A file that a child process has opened."""

    def __init__(self, jail: Jail, kind: str, file: Path, shown: Path) -> None:
        self._jail, self._kind, self._file, self._shown = jail, kind, file, shown
        self.heads, self.dialect, self.rate = self._ask(None, _Opened)
        if len(self.heads) > MAXIMUM_CHANNELS:
            raise self._failure(f"it has {len(self.heads)} channels")

    def load(self, places: Sequence[int]) -> list[NDArray[Any]]:
        found = self._ask(list(places), list[tuple[str, Any]])
        if len(found) != len(places):
            raise self._failure("another number of channels came back")
        return [self._receive(kind, values) for kind, values in found]

    def _ask(self, places: list[int] | None, kind: type[Answer]) -> Answer:
        try:
            return self._jail.call(places, kind, most=2 * MAXIMUM_BYTES)
        except RecordError as error:
            raise RecordError(str(error).replace(str(self._file), str(self._shown))) from None
        except ChildError as error:
            raise self._failure(str(error)) from None

    def _receive(self, kind: str, values: Any) -> NDArray[Any]:
        if isinstance(values, np.ndarray) and values.ndim == 1:
            if kind == "number" and values.dtype == np.float64:
                return values
            if kind == "stamp" and values.dtype == np.int64:
                return values.view("datetime64[ns]")
        raise self._failure("what came back is no column")

    def _failure(self, why: str) -> RecordError:
        cure = "export it again, or as CSV"
        return RecordError(f"{self._shown}: must be a whole {self._kind} file, but cannot be read: {why}; {cure}")


def _send(values: NDArray[Any]) -> tuple[str, NDArray[Any]]:
    if values.dtype.kind == "M":
        return "stamp", np.ascontiguousarray(values.astype("datetime64[ns]")).view(np.int64)
    return "number", np.ascontiguousarray(values, dtype=float)
