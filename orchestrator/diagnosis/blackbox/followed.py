"""What effects at ports would push along the measured motion: no run of the FMU has to come close to the record first.

A free run of a model that lacks an effect may go astray, most of all where the inputs were recorded in a closed loop.
What effects answer to its motion says little then. Where a port's position is measured, they answer to that instead.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.blackbox.bank import BoxEffect
from orchestrator.diagnosis.blackbox.problem import BoxProblem
from orchestrator.diagnosis.blackbox.whitening import Surrogate
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


def measured_motions(problem: BoxProblem) -> dict[str, Motion]:
    """Return the motion of each port whose position is a column of the record, by its name.

    Args:
        problem: the FMU and the record.

    Returns:
        The motions, speed and acceleration those of a sliding cubic.
    """
    from scipy.signal import savgol_filter

    window, found = problem.settings.screen.window, {}
    for name, port in problem.map.ports.items():
        if port.position in problem.outputs and problem.n >= window:
            y = problem.data.outputs[:, problem.outputs.index(port.position)]
            smooth = [savgol_filter(y, window, 3, deriv=order, delta=problem.h) for order in range(3)]
            # Of a flow, what has passed stands for the position.
            found[name] = Motion(problem.h * np.cumsum(smooth[0]), *smooth[:2]) if port.flow_only else Motion(*smooth)
    return found


def answers(
    problem: BoxProblem, surrogate: Surrogate, motion: Motion, effect: BoxEffect, values: Array, rows: int
) -> Array:
    """Return what an effect at a port changes of the outputs (rows, outputs), by the surrogate, in units of the noise.

    Args:
        problem: the FMU and the record.
        surrogate: of the FMU, from its ports.
        motion: of the port, as measured.
        effect: of the bank.
        values: of its parameters.
        rows: samples.

    Returns:
        The change.
    """
    at = problem.runner.inputs.index(problem.map.ports[effect.place].input)
    q = np.array([*values, *[0.0] * (4 - len(values))])
    effort = _efforts(effect.kind.law, motion.x[:rows], motion.v[:rows], motion.a[:rows], q, problem.h)
    push = -problem.sign.get(effect.place, 1.0) * 0.5 * (effort[:-1] + effort[1:]) / problem.drive([at])[0]
    return np.asarray(surrogate.response(push[:, None], problem.noise_places.index(at))[:, :, 0])


@kept()
def _efforts(law, x, v, a, q, h):  # type: ignore[no-untyped-def]
    """Return the effort against the motion in each sample."""
    found, built = np.zeros(len(x)), 0.0
    for k in range(len(x)):
        if _has_memory(law):
            built = _built_up(law, built, v[k], _distance(law, q[1], q[3]), h)
        found[k] = _resistance(law, x[k], v[k], a[k], built, q[0], q[1], q[2])
    return found
