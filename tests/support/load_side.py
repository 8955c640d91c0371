"""The load's half of a drivetrain that is cut at its shaft: equations, and a PythonFMU slave around them.

    J_l theta_l'' + b_l theta_l' = T_shaft
    T_shaft = k (d -+ alpha) + c d'  beyond the gap,  0 within,    d = theta_m / i - theta_l

Both inputs are held over a step; contact is located within it, so that the step is exact for them.
"""

import math

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

J_L, K, C, B_L, RATIO = 5.6, 3300.0, 1.0, 1.0, 3.984
TERMS = 14
EDGE = 1e-15
"""Twist [rad] from the edge of the gap within which the relative speed says whether the teeth touch."""


def shaft_torque(theta_m: float, omega_m: float, theta_l: float, omega_l: float, alpha: float) -> float:
    """Return the torque [N.m] at the load."""
    twist = theta_m / RATIO - theta_l
    if abs(twist) <= alpha:
        return 0.0
    return K * (twist - math.copysign(alpha, twist)) + C * (omega_m / RATIO - omega_l)


def _smooth(theta: float, omega: float, contact: float, rest: float, step: float) -> tuple[float, float]:
    """Advance within one mode; ``rest`` is the torque that theta_m, omega_m and the gap contribute."""
    rates = (omega, (contact * (rest - K * theta - C * omega) - B_L * omega) / J_L)
    for order in range(1, TERMS):
        a, b = rates[0] * step / order, rates[1] * step / order
        theta, omega = theta + a, omega + b
        rates = (b, (-contact * (K * a + C * b) - B_L * b) / J_L)
    return theta, omega


def _leaves(twist: float, alpha: float, side: int) -> bool:
    return abs(twist) > alpha if side == 0 else side * twist < alpha


def load_after(
    theta: float, omega: float, theta_m: float, omega_m: float, alpha: float, step: float
) -> tuple[float, float]:
    """Return angle [rad] and speed [rad/s] after ``step`` [s]."""
    held, left = theta_m / RATIO, step
    while left > 0.0:
        twist = held - theta
        side = 0 if abs(twist) < alpha else int(math.copysign(1, twist))
        if abs(abs(twist) - alpha) < EDGE:
            side = int(math.copysign(1, twist)) if -omega * twist > 0 else 0
        contact = 1.0 if side or alpha == 0.0 else 0.0
        rest = K * (held - side * alpha) + C * omega_m / RATIO
        h = left
        end = _smooth(theta, omega, contact, rest, h)
        if alpha > 0.0 and _leaves(held - end[0], alpha, side):
            low, high = 0.0, left
            for _ in range(60):
                h = 0.5 * (low + high)
                outside = _leaves(held - _smooth(theta, omega, contact, rest, h)[0], alpha, side)
                low, high = (low, h) if outside else (h, high)
            h = high
            end = _smooth(theta, omega, contact, rest, h)
        (theta, omega), left = end, left - h
    return theta, omega


class LoadSide(Fmi2Slave):
    """The load with the shaft and its gap."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.theta_m = self.omega_m = self.alpha = self.theta_l = self.omega_l = 0.0
        self.register_variable(Real("theta_m", causality=Fmi2Causality.input))
        self.register_variable(Real("omega_m", causality=Fmi2Causality.input))
        self.register_variable(Real("alpha", causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable))
        for name in ("theta_l", "omega_l"):
            self.register_variable(Real(name, causality=Fmi2Causality.output, variability=Fmi2Variability.continuous))
        torque = Real(
            "T_shaft",
            causality=Fmi2Causality.output,
            variability=Fmi2Variability.continuous,
            getter=lambda: shaft_torque(self.theta_m, self.omega_m, self.theta_l, self.omega_l, self.alpha),
        )
        self.register_variable(torque)

    def to_xml(self, model_options=None):
        """Declare that only the torque depends on inputs at the same instant."""
        root = super().to_xml(model_options or {})
        names = [variable.get("name") for variable in root.iter("ScalarVariable")]
        for unknown in root.iter("Unknown"):
            direct = names[int(unknown.get("index")) - 1] == "T_shaft"
            inputs = " ".join(str(names.index(name) + 1) for name in ("theta_m", "omega_m"))
            unknown.set("dependencies", inputs if direct else "")
        return root

    def do_step(self, current_time, step_size):
        """Take one step."""
        self.theta_l, self.omega_l = load_after(
            self.theta_l, self.omega_l, self.theta_m, self.omega_m, self.alpha, step_size
        )
        return True
