"""The motion at ports as it was measured, and the efforts that laws there have along a motion."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fmu.problem import BoxProblem
from orchestrator.plants.compiled import compiled
from orchestrator.shared.numba_cache import kept

Array = NDArray[np.float64]

_laws = compiled("port_laws")
_built_up: Any = _laws.built_up
_has_memory: Any = _laws.has_memory
_distance: Any = _laws.distance_of
_resistance: Any = _laws.resistance


@dataclass(frozen=True, eq=False)
class Motion:
    """Position, speed and acceleration (n,) of a port, in its own units."""

    x: Array
    v: Array
    a: Array


def port_motions(problem: BoxProblem, reads: Array) -> dict[str, Motion]:
    """Return the motion of each port: as measured where its position is a column of the record, else that of a run.

    A run of a model that lacks an effect may be far from the record; what the effect answers to is in the record.

    Args:
        reads: (n, reads) all that is read of a run.
    """
    from scipy.signal import savgol_filter

    window, step, found = problem.settings.response.window, problem.h, {}
    for name, port in problem.map.ports.items():
        if port.flow_only and port.velocity in problem.outputs:
            y = problem.data.outputs[:, problem.outputs.index(port.velocity)]
            flow, slope = (savgol_filter(y, window, 3, deriv=order, delta=step) for order in range(2))
            found[name] = Motion(step * np.cumsum(flow), flow, slope)
            continue
        if port.position in problem.outputs:
            y = problem.data.outputs[:, problem.outputs.index(port.position)]
            found[name] = Motion(*(savgol_filter(y, window, 3, deriv=order, delta=step) for order in range(3)))
            continue
        x = reads[:, problem.runner.reads.index(port.position)]
        v = np.gradient(x, step) if port.velocity is None else reads[:, problem.runner.reads.index(port.velocity)]
        x = step * np.cumsum(v) if port.flow_only else x
        found[name] = Motion(x, v, np.gradient(v, step))
    return found


def efforts_along(motion: Motion, law: int, values: tuple[float, ...], step: float) -> Array:
    """Return the effort (n,) against the motion that a law has in each sample.

    Args:
        step: sample time [s].
    """
    q = np.array([*values, *[0.0] * (4 - len(values))])
    return np.asarray(_efforts(law, motion.x, motion.v, motion.a, q, step))


@kept()
def _efforts(law, x, v, a, q, h):  # type: ignore[no-untyped-def]
    """Return the effort against the motion in each sample."""
    found, built = np.zeros(len(x)), 0.0
    for k in range(len(x)):
        if _has_memory(law):
            built = _built_up(law, built, v[k], _distance(law, q[1], q[3]), h)
        found[k] = _resistance(law, x[k], v[k], a[k], built, q[0], q[1], q[2])
    return found
