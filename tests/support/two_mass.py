"""Motor and load, coupled by a shaft with backlash, as two mock slaves; and the same as one event-located solution.

Each slave solves its own equations exactly for inputs that are held: what is left is the error of the coupling.
"""

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from orchestrator.master.signals import Signal, Sine, Square
from orchestrator.master.system import Connection, Instance, SignalSource, System
from tests.support.load_side import B_L, J_L, C, K, load_after, shaft_torque
from tests.support.mock_slave import instance, model, variable
from tests.support.motor_side import B_M, J_M, RATIO, TAU, motor_after

TORQUE = Square(amplitude=40.0, period=0.8)

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


def motor_step(v: dict[str, Any], time: float, step: float) -> None:
    v["theta_m"], v["omega_m"], v["T_m"] = motor_after(
        v["theta_m"], v["omega_m"], v.get("T_m", 0.0), v["u"], v["T_shaft"], step
    )


def load_step(v: dict[str, Any], time: float, step: float) -> None:
    v["theta_l"], v["omega_l"] = load_after(v["theta_l"], v["omega_l"], v["theta_m"], v["omega_m"], v["alpha"], step)


def load_outputs(v: dict[str, Any]) -> None:
    v["T_shaft"] = shaft_torque(v["theta_m"], v["omega_m"], v["theta_l"], v["omega_l"], v["alpha"])


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
    return System(instances, connections, (SignalSource("motor.u", signal),))


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
