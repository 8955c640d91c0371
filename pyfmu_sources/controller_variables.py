"""What every state feedback of the drivetrain takes: reference and estimate as inputs, gains as parameters."""

INPUTS = (
    ("reference", "rad", "Wanted load angle"),
    ("reference_speed", "rad/s", "Wanted load speed"),
    ("theta_m_hat", "rad", "Estimated motor angle"),
    ("omega_m_hat", "rad/s", "Estimated motor speed"),
    ("theta_l_hat", "rad", "Estimated load angle"),
    ("omega_l_hat", "rad/s", "Estimated load speed"),
    ("T_l_hat", "N.m", "Estimated load torque"),
    ("T_m_hat", "N.m", "Estimated motor torque"),
)
GAINS = (
    ("K[1]", "N.m/rad", "Gain of the motor angle"),
    ("K[2]", "N.m.s/rad", "Gain of the motor speed"),
    ("K[3]", "N.m/rad", "Gain of the load angle"),
    ("K[4]", "N.m.s/rad", "Gain of the load speed"),
    ("K[5]", "1", "Gain of the motor torque"),
)
