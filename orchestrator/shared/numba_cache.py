"""Functions compiled by numba whose machine code is kept on disk, with a hash: what is damaged is compiled anew.

Numba's own cache (``cache=True``) runs whatever bytes lie there, ends with a traceback where they are cut short, and
refuses to work where no folder can be written.

Machine code is linked by names that end in a number, which numba counts up from one in every process. Code that two
processes have kept of two functions of one name (the predictors of two plants) may have the same number, and a third
process that loads both then runs one in the place of the other: here each process counts from a number of its own.
"""

import contextlib
import hashlib
import itertools
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

from numba import config, njit, types
from numba.core.bytecode import FunctionIdentity
from numba.core.caching import FunctionCache, IndexDataCacheFile, _CacheLocator

from orchestrator.shared.cache import cache_directory
from orchestrator.shared.code_digest import digest_of

UNCOUNTED: dict[str, Any] = {"_nrt": False}
"""Option of functions that make neither arrays nor lists: references to what they are given are not counted.

Counted at each call of each small function, they take several times as long as the equations of a plant.
"""

ALGEBRA: dict[str, Any] = {"fastmath": {"arcp": True, "nsz": True}}
"""Option of equations that run in every stage of every step: a quotient by what a run holds fixed is a product.

Zeros have no sign there. It takes a quarter less time, and the last digit is rounded differently.
"""

_DIGEST = hashlib.sha256().digest_size
FunctionIdentity._unique_ids = itertools.count(int.from_bytes(os.urandom(6), "big"))


def njit_on_disk(**options: Any) -> Callable[[Any], Any]:
    """Return a decorator like ``numba.njit`` that keeps machine code for later processes, where there is a place.

    A function with a closure is kept under a digest of all that it reaches; where that is not known, not at all.
    A call with a number that stands in the source, ``f(x, 0)``, uses the machine code of any other number.
    """

    def decorate(function: Any) -> Any:
        dispatcher = njit(**options)(function)
        template = dispatcher.get_call_template  # of a call in compiled code: numbers in the source are no types
        dispatcher.get_call_template = lambda args, kws: template(tuple(map(types.unliteral, args)), kws)
        # Without a folder that can be written the function is compiled in every process.
        with contextlib.suppress(RuntimeError, OSError):
            if function.__closure__ is None:
                dispatcher._cache = _Cache(function)
            elif digest := digest_of(dispatcher):  # its options count
                dispatcher._cache = _ClosureCache(function, digest)
        return dispatcher

    return decorate


def use_cache_read_only() -> None:
    """Read machine code from beside the sources, where a child process cannot write: what is missing is compiled anew.

    It holds for functions of modules that are imported from then on.
    """
    os.environ.pop("NUMBA_CACHE_DIR", None)
    settings: Any = config
    settings.CACHE_DIR = ""
    locator: Any = _CacheLocator
    locator.ensure_cache_path = lambda self: None


class _Files(IndexDataCacheFile):
    """Index and machine code of one function, each file behind a hash of the version of numba and of its content."""

    def save(self, key: Any, data: Any) -> None:
        """Keep machine code; a full disk only means that it is compiled again."""
        with contextlib.suppress(OSError):
            super().save(key, data)

    def load(self, key: Any) -> Any:
        """Return the machine code for a signature, ``None`` where there is none that is intact."""
        name = self._load_index().get(key)
        return None if name is None else self._intact(self._data_path(name))

    def _load_index(self) -> dict[Any, str]:
        stamp, overloads = self._intact(self._index_path) or (None, {})
        return dict(overloads) if stamp == self._source_stamp else {}

    def _save_index(self, overloads: dict[Any, str]) -> None:
        self._keep(self._index_path, (self._source_stamp, overloads))

    def _save_data(self, name: str, data: Any) -> None:
        self._keep(self._data_path(name), data)

    def _keep(self, path: str, value: Any) -> None:
        body = self._dump(value)
        with self._open_for_write(path) as file:
            file.write(self._digest(body) + body)

    def _intact(self, path: str) -> Any:
        try:
            content = Path(path).read_bytes()
        except OSError:
            return None
        body = content[_DIGEST:]
        return pickle.loads(body) if self._digest(body) == content[:_DIGEST] else None

    def _digest(self, body: bytes) -> bytes:
        return hashlib.sha256(self._version.encode() + body).digest()


class _Cache(FunctionCache):
    """Numba's cache of a function, on files of ours."""

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        stamp = self._impl.locator.get_source_stamp()
        # Another ending than numba's own, and than that of files whose names may meet.
        self._cache_file = _Files(self._cache_path, f"{self._impl.filename_base}.apart", stamp)


class _ClosureCache(_Cache):
    """Of a function made within another one: numba's own key of it differs from process to process."""

    def __init__(self, function: Any, digest: str) -> None:
        super().__init__(function)
        self._cache_path = str(cache_directory("numba") / digest[:20])
        Path(self._cache_path).mkdir(exist_ok=True)
        self._digest = digest
        self._cache_file = _Files(self._cache_path, f"{self._impl.filename_base}.apart", digest)

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        return (sig, codegen.magic_tuple(), self._digest)
