"""Numerical failures as errors of this project."""

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext

import numpy as np
from threadpoolctl import threadpool_limits

from orchestrator.errors import ConvergenceError


@contextmanager
def numeric_errors(what: str) -> Iterator[None]:
    """Run fits in a ``with`` block: trial steps may overflow in silence; a singular system is one line for the user.

    Fits are spread over the cores, and their matrices are small: threads of linear algebra would only be in their way.
    """
    with np.errstate(all="ignore"), _one_thread():
        try:
            yield
        except np.linalg.LinAlgError as error:
            raise ConvergenceError(f"{what}: {error}") from None


def _one_thread() -> AbstractContextManager[object]:
    """Linear algebra on one thread, where the system says which libraries are loaded."""
    try:
        return threadpool_limits(1, user_api="blas")
    except OSError:
        return nullcontext()
