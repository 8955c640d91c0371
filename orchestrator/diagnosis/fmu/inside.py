"""The child's side of a black box: opens the FMU behind the walls, and runs batches of it."""

import os
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fmu.wire import Batch, Load
from orchestrator.errors import OrchestratorError

Array = NDArray[np.float64]
Answer = list[Any]
"""Results (an array, or None), reasons, seconds, and remarks: instance, text and count."""


def opened(request: Load) -> Callable[[Batch], Answer]:
    """Return what runs batches of the FMUs that ``request`` names.

    Returns:
        Called with a batch, it gives results, reasons of failures and the time taken [s].
    """
    _use_compiled()
    from orchestrator.diagnosis.fmu.binding import Box

    box = Box(request)

    def run(batch: Batch) -> Answer:
        begun = time.monotonic()
        results: list[Array | None] = []
        reasons: list[str] = []
        for job in batch.jobs:
            rows: Array | None = None
            reason = ""
            try:
                rows = box.run(job, batch)
                if not np.all(np.isfinite(rows)):
                    rows, reason = None, "it returned values that are not finite"
            except OrchestratorError as error:
                reason = " ".join(str(error).split())
            results.append(rows)
            reasons.append(reason)
        remarks = [[r.instance, r.text, r.count] for r in box.take_remarks()]
        return [results, reasons, time.monotonic() - begun, remarks]

    return run


def _use_compiled() -> None:
    """Read machine code from beside the sources, which cannot be written here; what is missing is compiled anew."""
    os.environ.pop("NUMBA_CACHE_DIR", None)
    import numba
    from numba.core import caching

    config: Any = numba.config
    locator: Any = caching._CacheLocator
    cache: Any = caching.Cache
    config.CACHE_DIR = ""
    locator.ensure_cache_path = lambda self: None
    save = cache.save_overload

    def quietly(self: Any, *arguments: Any) -> None:
        try:
            save(self, *arguments)
        except OSError:
            return

    cache.save_overload = quietly
