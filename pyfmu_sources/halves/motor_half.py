"""The motor's half of a drivetrain that is cut at its gear: a lag and an inertia.

    J_m theta_m'' + b_m theta_m' = T_m - T_shaft / i,    tau T_m' + T_m = u

With the inputs held the solution is a power series; a step is cut so that the series reaches the last bit.

In all functions: ``u``: requested torque [N.m]; ``T_shaft``: torque of the shaft on the load [N.m].
"""

from typing import NamedTuple


class MotorParameters(NamedTuple):
    """Inertia [kg.m2], friction [N.m.s/rad], gear ratio and time constant [s]."""

    J_m: float
    b_m: float
    i: float
    tau: float


Parameters = MotorParameters
State = tuple[float, float, float]
Outputs = tuple[float, float, float]

TERMS = 20


def rates_and_outputs(x: State, p: Parameters, u: float, T_shaft: float) -> tuple[State, Outputs]:
    """Return the derivatives, and the outputs theta_m, omega_m and T_m."""
    acceleration = (x[2] - T_shaft / p.i - p.b_m * x[1]) / p.J_m
    return ((x[1], acceleration, (u - x[2]) / p.tau), (x[0], x[1], x[2]))


def advance(x: State, p: Parameters, u: float, T_shaft: float, h: float) -> State:
    """Return the state after ``h`` [s] with the inputs held."""
    count = 1 + int(h * (p.b_m / p.J_m + 1.0 / p.tau))
    step = h / count
    for _ in range(count):
        r, _outputs = rates_and_outputs(x, p, u, T_shaft)
        for n in range(1, TERMS):
            f = step / n
            a, b, c = f * r[0], f * r[1], f * r[2]
            x = (x[0] + a, x[1] + b, x[2] + c)
            r = (b, (c - p.b_m * b) / p.J_m, -c / p.tau)
    return x
