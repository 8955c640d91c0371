"""Default gains of the controllers' and the estimator's FMUs, so that each runs alone in any tool.

They are the design of the default experiment: thesis values, 1 ms. The designed values are stored, not computed at
every build: the linear algebra libraries of two machines differ by up to 3e-8 in a gain, which would show in the FMUs'
bytes. ``python -m orchestrator.building.reference_runs`` writes them anew; a test compares them with the design.
"""

import json
from pathlib import Path

STORED = Path(__file__).parent / "data" / "default_starts.json"

SAMPLE_TIME = 1e-3
TORQUE_LIMIT = 300.0
STATE_WEIGHTS = (10.0, 50.0, 1.0, 1.0, 0.01)
TORQUE_WEIGHT = 2e-3
PROCESS_NOISE = (0.0, 0.0, 0.0, 1e-2, 10.0, 400.0)
ENCODER_NOISE = 1e-4


def default_starts(class_name: str) -> dict[str, float]:
    """Return the stored start values that are designed rather than written down: those of three FMUs, else none."""
    stored: dict[str, dict[str, float]] = json.loads(STORED.read_text(encoding="ascii"))
    return stored.get(class_name, {})


def design_starts() -> dict[str, dict[str, float]]:
    """Return the start values as this machine designs them, by class name, to twelve digits."""
    controller = _controller()
    designs = {"LqrController": controller, "KalmanEstimator": _estimator(), "BacklashCompensator": controller}
    return {name: {key: float(f"{value:.12g}") for key, value in values.items()} for name, values in designs.items()}


# Most builds find the stored values and need no numpy, hence the imports in the functions.


def _controller() -> dict[str, float]:
    import numpy as np

    from orchestrator.plants.design import DrivetrainValues, design_regulator, five_state_model

    values = DrivetrainValues()
    regulator = design_regulator(five_state_model(values), np.diag(STATE_WEIGHTS), TORQUE_WEIGHT, SAMPLE_TIME)
    gains = {f"K[{n}]": gain for n, gain in enumerate(regulator.gains, start=1)}
    return gains | {"i": values.i, "compliance": 1.0 / values.k, "u_max": TORQUE_LIMIT, "sample_time": SAMPLE_TIME}


def _estimator() -> dict[str, float]:
    import numpy as np

    from orchestrator.plants.design import DrivetrainValues, design_estimator, six_state_model

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
