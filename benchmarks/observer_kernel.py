"""One sample of one filter of the backlash estimator, in C."""

from typing import Annotated, Any

from orchestrator.building.translation.kernel_arrays import Reals
from orchestrator.building.translation.kinds import REAL, ArrayKind
from pyfmu_sources.estimators.backlash_estimator import SIZE, Filter, correct, predict

__all__ = ["observe"]

Eight = Annotated[Any, ArrayKind(REAL, (8,))]
Nine = Annotated[Any, ArrayKind(REAL, (9,))]


def observe(
    state: Reals, model: Eight, settings: Nine, u: float, theta_m: float, theta_l: float, step: float, first: bool
) -> None:  # fmt: skip
    """Predict, but not at the ``first`` sample, and correct a filter in place."""
    m = tuple(model[n] for n in range(8))
    s = tuple(settings[n] for n in range(9))
    f: Filter = [0.0] * SIZE
    for n in range(SIZE):
        f[n] = state[n]
    if not first:
        predict(f, m, u, step, s)
    correct(f, 0, theta_m, s[0] * s[0])
    correct(f, 2, theta_l, s[1] * s[1])
    for n in range(SIZE):
        state[n] = f[n]
