"""What estimators of the drivetrain measure and give, and state feedbacks take: reference, estimate, gains."""

from .fmu_variables import FmuVariable

MEASURED = (
    FmuVariable("u", "input", "N.m", 0.0, "Requested motor torque, held since the last sample", nominal=100.0),
    FmuVariable("theta_m", "input", "rad", 0.0, "Measured motor angle"),
    FmuVariable("theta_l", "input", "rad", 0.0, "Measured load angle"),
)
ENCODERS = {"encoder": {"motor": "theta_m", "load": "theta_l"}}
ESTIMATED = (
    ("theta_m_hat", "rad", "motor angle"),
    ("omega_m_hat", "rad/s", "motor speed"),
    ("theta_l_hat", "rad", "load angle"),
    ("omega_l_hat", "rad/s", "load speed"),
    ("T_l_hat", "N.m", "load torque"),
    ("T_m_hat", "N.m", "motor torque"),
)
INPUTS = (
    ("reference", "rad", "Wanted load angle"),
    ("reference_speed", "rad/s", "Wanted load speed"),
    *((name, unit, f"Estimated {text}") for name, unit, text in ESTIMATED),
)
GAINS = (
    ("K[1]", "N.m/rad", "Gain of the motor angle"),
    ("K[2]", "N.m.s/rad", "Gain of the motor speed"),
    ("K[3]", "N.m/rad", "Gain of the load angle"),
    ("K[4]", "N.m.s/rad", "Gain of the load speed"),
    ("K[5]", "1", "Gain of the motor torque"),
)
