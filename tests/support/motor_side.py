"""The motor's half of a drivetrain that is cut at its shaft: equations, and a PythonFMU slave around them.

    J_m theta_m'' + b_m theta_m' = T_m - T_shaft / i,    tau T_m' + T_m = u

Both inputs are held over a step, which is then exact: what is left in a co-simulation is the error of the coupling.
"""

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real

J_M, B_M, RATIO, TAU = 0.4, 0.1, 3.984, 0.05
TERMS = 14


def motor_after(
    theta: float, omega: float, torque: float, u: float, shaft: float, step: float
) -> tuple[float, float, float]:
    """Return angle [rad], speed [rad/s] and torque [N.m] after ``step`` [s], by the Taylor series of the solution."""
    rates = (omega, (torque - shaft / RATIO - B_M * omega) / J_M, (u - torque) / TAU)
    for order in range(1, TERMS):
        a, b, c = (rate * step / order for rate in rates)
        theta, omega, torque = theta + a, omega + b, torque + c
        rates = (b, (c - B_M * b) / J_M, -c / TAU)
    return theta, omega, torque


class MotorSide(Fmi2Slave):
    """The motor with its lag."""

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u = self.T_shaft = self.theta_m = self.omega_m = self.T_m = 0.0
        for name in ("u", "T_shaft"):
            self.register_variable(Real(name, causality=Fmi2Causality.input))
        for name in ("theta_m", "omega_m", "T_m"):
            self.register_variable(Real(name, causality=Fmi2Causality.output, variability=Fmi2Variability.continuous))

    def to_xml(self, model_options=None):
        """Declare that no output depends on an input at the same instant."""
        root = super().to_xml(model_options or {})
        for unknown in root.iter("Unknown"):
            unknown.set("dependencies", "")
        return root

    def do_step(self, current_time, step_size):
        """Take one step."""
        self.theta_m, self.omega_m, self.T_m = motor_after(
            self.theta_m, self.omega_m, self.T_m, self.u, self.T_shaft, step_size
        )
        return True
