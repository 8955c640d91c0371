"""Numerical failures as errors of this project."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from threadpoolctl import threadpool_limits

from orchestrator.errors import ConvergenceError


@contextmanager
def fitting(what: str) -> Iterator[None]:
    """Run fits in a ``with`` block: trial steps may overflow in silence; a singular system is one line for the user.

    Fits are spread over the cores, and their matrices are small: threads of linear algebra would only be in their way.

    Args:
        what: beginning of the error's text, such as "record.csv: no model can be fitted to this record".

    Yields:
        Nothing.

    Raises:
        ConvergenceError: linear algebra failed.
    """
    with np.errstate(all="ignore"), threadpool_limits(1, user_api="blas"):
        try:
            yield
        except np.linalg.LinAlgError as error:
            raise ConvergenceError(f"{what}: {error}") from None
