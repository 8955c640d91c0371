"""Numerical failures as errors of this project."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from orchestrator.errors import ConvergenceError


@contextmanager
def fitting(what: str) -> Iterator[None]:
    """Run fits in a ``with`` block: trial steps may overflow in silence; a singular system is one line for the user.

    Args:
        what: beginning of the error's text, such as "record.csv: no model can be fitted to this record".

    Yields:
        Nothing.

    Raises:
        ConvergenceError: linear algebra failed.
    """
    with np.errstate(all="ignore"):
        try:
            yield
        except np.linalg.LinAlgError as error:
            raise ConvergenceError(f"{what}: {error}") from None
