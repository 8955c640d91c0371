"""Motor and load, coupled by a shaft with backlash, as two mock slaves; and the same as one event-located solution.

Each slave solves its own equations exactly for inputs that are held: what is left is the error of the coupling.
"""

import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from orchestrator.master.signals import Signal, Sine, Square
from orchestrator.master.system import Connection, Instance, Source, System
from tests.support.mock_slave import instance, model, variable

J_M, J_L, K, C, B_M, B_L, RATIO, TAU = 0.4, 5.6, 3300.0, 1.0, 0.1, 1.0, 3.984, 0.05
TORQUE = Square(amplitude=40.0, period=0.8)
TERMS = 14

MOTOR = model(
    "Motor",
    variable("u", "input"),
    variable("T_shaft", "input"),
    variable("theta_m", "output"),
    variable("omega_m", "output"),
)
LOAD = model(
    "Load",
    variable("theta_m", "input"),
    variable("omega_m", "input"),
    variable("alpha", "parameter"),
    variable("T_shaft", "output"),
    variable("theta_l", "output"),
    variable("omega_l", "output"),
    feedthrough={"T_shaft": ("theta_m", "omega_m")},
)


def taylor(rates: Callable[[NDArray[np.float64]], NDArray[np.float64]], x: NDArray[np.float64], h: float) -> Any:
    """Advance ``x' = A x + b`` by its Taylor series; ``rates(x)`` is linear in ``x`` with the last entry 1."""
    total, term = x.copy(), x.copy()
    for order in range(1, TERMS):
        term = rates(term) * (h / order)
        total = total + term
    return total


def motor_step(v: dict[str, Any], time: float, step: float) -> None:
    load, u = v["T_shaft"] / RATIO, v["u"]
    matrix = np.array(
        [
            [0.0, 1.0, 0.0, 0.0],
            [0.0, -B_M / J_M, 1.0 / J_M, -load / J_M],
            [0.0, 0.0, -1.0 / TAU, u / TAU],
            [0.0, 0.0, 0.0, 0.0],
        ]
    )
    x = taylor(lambda y: matrix @ y, np.array([v["theta_m"], v["omega_m"], v.get("T_m", 0.0), 1.0]), step)
    v["theta_m"], v["omega_m"], v["T_m"] = float(x[0]), float(x[1]), float(x[2])


def torque(twist: float, rate: float, alpha: float) -> float:
    if abs(twist) <= alpha:
        return 0.0
    return K * (twist - math.copysign(alpha, twist)) + C * rate


def load_step(v: dict[str, Any], time: float, step: float) -> None:
    theta_m, omega_m, alpha = v["theta_m"] / RATIO, v["omega_m"] / RATIO, v["alpha"]
    x, left = np.array([v["theta_l"], v["omega_l"], 1.0]), step
    while left > 0.0:
        twist = theta_m - x[0]
        contact = 0 if abs(twist) < alpha else int(math.copysign(1, twist))
        if abs(abs(twist) - alpha) < 1e-15:
            contact = int(math.copysign(1, twist)) if -x[1] * twist > 0 else 0
        on = 1.0 if contact or alpha == 0.0 else 0.0
        rest = K * (theta_m - contact * alpha) + C * omega_m
        matrix = np.array([[0.0, 1.0, 0.0], [-on * K / J_L, -(on * C + B_L) / J_L, on * rest / J_L], [0.0, 0.0, 0.0]])
        h = left
        end = taylor(lambda y, m=matrix: m @ y, x, h)
        if alpha > 0.0 and _crosses(theta_m - end[0], alpha, contact):
            low, high = 0.0, left
            for _ in range(60):
                h = 0.5 * (low + high)
                end = taylor(lambda y, m=matrix: m @ y, x, h)
                low, high = (low, h) if _crosses(theta_m - end[0], alpha, contact) else (h, high)
            h = high
            end = taylor(lambda y, m=matrix: m @ y, x, h)
        x, left = end, left - h
    v["theta_l"], v["omega_l"] = float(x[0]), float(x[1])


def _crosses(twist: float, alpha: float, contact: int) -> bool:
    return abs(twist) > alpha if contact == 0 else contact * twist < alpha


def load_outputs(v: dict[str, Any]) -> None:
    rate = v["omega_m"] / RATIO - v["omega_l"]
    v["T_shaft"] = torque(v["theta_m"] / RATIO - v["theta_l"], rate, v["alpha"])


def loop(alpha: float = 0.0, signal: Signal = TORQUE) -> System:
    """Return the continuous loop of the two slaves."""
    instances: tuple[Instance, ...] = (
        instance("motor", MOTOR, motor_step),
        instance("load", LOAD, load_step, load_outputs, alpha=alpha),
    )
    connections = (
        Connection("motor.theta_m", "load.theta_m"),
        Connection("motor.omega_m", "load.omega_m"),
        Connection("load.T_shaft", "motor.T_shaft"),
    )
    return System(instances, connections, (Source("motor.u", signal),))


def solution(times: NDArray[np.float64], alpha: float, signal: Signal = TORQUE) -> NDArray[np.float64]:
    """Return theta_m and theta_l at ``times`` [rad], shape (2, n): one smooth mode after the other, rtol 1e-12."""
    knots = [0.0, *signal.breaks(0.0, float(times[-1])), float(times[-1])]
    x, found = np.zeros(5), np.zeros((2, len(times)))
    contact = 2 if alpha == 0.0 else 0
    for begin, end in itertools.pairwise(knots):
        now = begin
        while now < end:
            answer = solve_ivp(
                _rates,
                (now, end),
                x,
                method="DOP853",
                rtol=1e-12,
                atol=1e-14,
                max_step=2e-3,  # a brief contact must not hide within one step
                dense_output=True,
                events=None if contact == 2 else _events(contact),
                args=(signal, 0.5 * (begin + end), alpha, contact),
            )
            inside = (times >= now) & (times <= answer.t[-1])
            if inside.any():
                found[:, inside] = answer.sol(times[inside])[[0, 2]]
            now, x = float(answer.t[-1]), answer.y[:, -1]
            if answer.status == 1:
                contact = (1 if len(answer.t_events[0]) else -1) if contact == 0 else 0
    return found


def _rates(t: float, x: NDArray[np.float64], signal: Signal, middle: float, alpha: float, contact: int) -> list[float]:
    u = float(signal.sample(np.array([t if isinstance(signal, Sine) else middle]))[0])
    twist, rate = x[0] / RATIO - x[2], x[1] / RATIO - x[3]
    shaft = 0.0 if contact == 0 else K * (twist - (0 if contact == 2 else contact) * alpha) + C * rate
    return [x[1], (x[4] - shaft / RATIO - B_M * x[1]) / J_M, x[3], (shaft - B_L * x[3]) / J_L, (u - x[4]) / TAU]


def _events(contact: int) -> list[Any]:
    def edge(side: int) -> Any:
        def event(t: float, x: NDArray[np.float64], signal: Signal, middle: float, alpha: float, mode: int) -> float:
            return float(side * (x[0] / RATIO - x[2]) - alpha)

        event.terminal = True  # type: ignore[attr-defined]
        event.direction = 1 if contact == 0 else -1  # type: ignore[attr-defined]
        return event

    return [edge(1), edge(-1)] if contact == 0 else [edge(contact)]
