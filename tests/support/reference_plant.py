"""An independent solution of the drivetrain, which shares no code with the FMU: the truth that tests compare with.

Each smooth mode is integrated by SciPy's DOP853 with terminal events; the equations are written out again, as a
matrix differential equation of ``(theta_m, omega_m, theta_l, omega_l, T_m, z)`` with ``z`` the shaft's own twist.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from orchestrator.errors import SimulationError
from orchestrator.plants.design import DrivetrainValues

Array = NDArray[np.float64]
MAX_EVENTS_PER_SAMPLE = 1000


@dataclass(frozen=True)
class ReferencePlant(DrivetrainValues):
    """The drivetrain's physical values, SI units, ``alpha`` the half-gap at the load [rad]."""

    alpha: float = 0.0
    model: str = "dead_zone"

    def matrix(self, touching: bool) -> Array:
        """Return A of ``x' = A x + B (u, T_l, offset)``, 5 x 5, of one mode (eq. 3.5 without T_l)."""
        k, c = (self.k, self.c) if touching else (0.0, 0.0)
        i, J_m, J_l = self.i, self.J_m, self.J_l
        return np.array(
            [
                [0, 1, 0, 0, 0],
                [-k / (J_m * i**2), -(c / i**2 + self.b_m) / J_m, k / (J_m * i), c / (J_m * i), 1 / J_m],
                [0, 0, 0, 1, 0],
                [k / (J_l * i), c / (J_l * i), -k / J_l, -(c + self.b_l) / J_l, 0],
                [0, 0, 0, 0, -1 / self.tau],
            ]
        )

    def inputs(self, touching: bool) -> Array:
        """Return B, 5 x 3, for ``(u, T_l, offset)``; ``offset`` is the flank's angle [rad]."""
        k = self.k if touching else 0.0
        return np.array(
            [
                [0, 0, 0],
                [0, 0, k / (self.J_m * self.i)],
                [0, 0, 0],
                [0, -1 / self.J_l, -k / self.J_l],
                [1 / self.tau, 0, 0],
            ]
        )


def first_flank(plant: ReferencePlant, x: Array) -> int:
    """Return the flank (-1, 1; 0: in the gap) at which a state starts, motor's angle [rad] first, load's third."""
    if plant.alpha == 0.0:
        return 1
    wound = x[0] / plant.i - x[2]
    return int(np.sign(wound)) if abs(wound) > plant.alpha else 0


def reference_sample(
    plant: ReferencePlant, x: Array, flank: int, u: float, T_l: float, h: float, rtol: float, atol: float
) -> tuple[Array, int]:
    """Return state (``(theta_m, omega_m, theta_l, omega_l, T_m)`` and the shaft's own twist) and flank after ``h``.

    Args:
        x: state at the start, 6 values.
        flank: which flank is in contact: -1, 0 or 1.
        u: requested torque [N.m], held.
        T_l: torque on the load [N.m], held.
        h: length [s].
    """
    time = 0.0
    for _ in range(MAX_EVENTS_PER_SAMPLE):
        slope = _slope(plant, flank, u, T_l)
        events = _events(plant, flank)
        run = solve_ivp(slope, (time, h), x, method="DOP853", rtol=rtol, atol=atol, events=events)
        if run.status < 0:
            raise SimulationError(f"reference solution failed: {run.message}")
        x = run.y[:, -1].copy()
        if run.status == 0:
            return x, flank
        time = float(run.t[-1])
        which = next(k for k, hits in enumerate(run.t_events) if len(hits))
        x, flank = _cross(plant, x, flank, which)
    raise SimulationError("reference solution chatters at the edge of the gap")


def _slope(plant: ReferencePlant, flank: int, u: float, T_l: float) -> Callable[[float, Array], Array]:
    A = plant.matrix(touching=flank != 0)
    drive = plant.inputs(touching=flank != 0) @ (u, T_l, flank * plant.alpha)
    unwinding = plant.k / plant.c if plant.model == "nordin" and plant.c > 0.0 and flank == 0 else 0.0

    def slope(_time: float, x: Array) -> Array:
        return np.append(A @ x[:5] + drive, -unwinding * x[5])

    return slope


def _events(plant: ReferencePlant, flank: int) -> list[Callable[[float, Array], float]]:
    if plant.alpha == 0.0:
        return []
    i, alpha, nordin = plant.i, plant.alpha, plant.model == "nordin"

    def wound(x: Array) -> float:
        return float(x[0] / i - x[2])

    def torque(_time: float, x: Array) -> float:
        return plant.k * (wound(x) - flank * alpha) + plant.c * float(x[1] / i - x[3])

    def leaves(_time: float, x: Array) -> float:
        return wound(x) - flank * alpha

    def reaches_front(_time: float, x: Array) -> float:
        return wound(x) - float(x[5]) - alpha

    def reaches_back(_time: float, x: Array) -> float:
        return wound(x) - float(x[5]) + alpha

    if flank == 0:
        reaches_front.direction, reaches_back.direction = 1.0, -1.0  # type: ignore[attr-defined]
        chosen = [reaches_front, reaches_back]
    else:
        chosen = [torque if nordin else leaves]
        chosen[0].direction = -float(flank)  # type: ignore[attr-defined]
    for event in chosen:
        event.terminal = True  # type: ignore[attr-defined]
    return list(chosen)


def _cross(plant: ReferencePlant, x: Array, flank: int, which: int) -> tuple[Array, int]:
    x = x.copy()
    if flank == 0:
        x[5] = 0.0
        return x, 1 if which == 0 else -1
    x[5] = x[0] / plant.i - x[2] - flank * plant.alpha if plant.model == "nordin" and plant.c > 0.0 else 0.0
    return x, 0
