"""Default gains of the controller's and the estimator's FMU, so that each runs alone in any tool.

They are the design of the default experiment: thesis values, 1 ms. Twelve digits are kept, so that the linear
algebra library of a machine does not show in the bytes of its FMUs.
"""

SAMPLE_TIME = 1e-3
TORQUE_LIMIT = 300.0
STATE_WEIGHTS = (10.0, 50.0, 1.0, 1.0, 0.01)
TORQUE_WEIGHT = 2e-3
PROCESS_NOISE = (0.0, 0.0, 0.0, 1e-2, 10.0, 400.0)
ENCODER_NOISE = 1e-4


def default_starts(class_name: str) -> dict[str, float]:
    """Return the start values that are designed rather than written down: those of two FMUs, else none."""
    if class_name == "LqrController":
        values = _controller()
    elif class_name == "KalmanEstimator":
        values = _estimator()
    else:
        return {}
    return {name: float(f"{value:.12g}") for name, value in values.items()}


# python-control takes a second to import and only two of the FMUs need it, hence the imports in the functions.


def _controller() -> dict[str, float]:
    import numpy as np

    from orchestrator.design import DrivetrainValues, design_regulator, five_state_model

    values = DrivetrainValues()
    regulator = design_regulator(five_state_model(values), np.diag(STATE_WEIGHTS), TORQUE_WEIGHT, SAMPLE_TIME)
    gains = {f"K[{n}]": gain for n, gain in enumerate(regulator.gains, start=1)}
    return gains | {
        "i": values.i,
        "compliance": 1.0 / values.k,
        "u_max": TORQUE_LIMIT,
        "sample_time": SAMPLE_TIME,
    }


def _estimator() -> dict[str, float]:
    import numpy as np

    from orchestrator.design import DrivetrainValues, design_estimator, six_state_model

    variances = np.full(2, ENCODER_NOISE**2)
    e = design_estimator(six_state_model(DrivetrainValues()), np.array(PROCESS_NOISE), variances, SAMPLE_TIME)
    entries: dict[str, float] = {"sample_time": SAMPLE_TIME}
    for r in range(6):
        entries |= {f"A_d[{r + 1},{c + 1}]": float(e.A[r, c]) for c in range(6)}
        entries |= {f"B_d[{r + 1}]": float(e.B[r])}
        entries |= {f"K_f[{r + 1},{c + 1}]": float(e.L[r, c]) for c in range(2)}
    inverse = e.S_inverse
    return entries | {
        "S_inv[1,1]": float(inverse[0, 0]),
        "S_inv[1,2]": float(inverse[0, 1]),
        "S_inv[2,2]": float(inverse[1, 1]),
    }
