"""The reference experiments of our FMUs, computed without them: where ``data/*_reference.csv`` comes from.

python -m tools.reference_runs

The plant's is the event-located solution of :mod:`tests.support.reference_plant`; controller and estimator are their
defining formulas in matrix form. The files are written anew; a test holds them to what is computed here and to what
the FMUs do.
"""

import csv
import io
import json
import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from orchestrator.building.reference_files import DATA, PARAMETERS
from orchestrator.building.starts import SAMPLE_TIME, STATE_WEIGHTS, STORED, TORQUE_WEIGHT, default_starts
from orchestrator.plants.design import (
    DrivetrainValues,
    design_estimator,
    design_regulator,
    five_state_model,
    six_state_model,
)
from tests.support.reference_plant import ReferencePlant, first_flank, reference_sample
from tools import refuse_arguments

Array = NDArray[np.float64]
HALF_GAP = PARAMETERS["Drivetrain"]["alpha"]
PLANT_STEP = 1e-2
SAMPLE = 1e-3
TORQUE_LIMIT = 300.0
PROCESS_NOISE = (0.0, 0.0, 0.0, 1e-2, 10.0, 400.0)
ENCODER_NOISE = 1e-4

Row = dict[str, float]


def reference_run(class_name: str) -> list[Row]:
    """Return the rows of an experiment: time, the inputs held until the next row, and the outputs."""
    run = {"Drivetrain": _plant, "LqrController": _controller, "KalmanEstimator": _estimator}
    return run[class_name]()


def _plant() -> list[Row]:
    plant = ReferencePlant(alpha=HALF_GAP)
    x, rows = np.zeros(6), []
    flank = first_flank(plant, x)
    for n in range(201):
        time = n * PLANT_STEP
        u = 40.0 * math.copysign(1.0, math.sin(2.0 * math.pi * 0.9 * time + 0.3)) + 10.0 * math.sin(9.0 * time)
        T_l = 6.0 if time >= 1.2 else 0.0
        wound = x[0] / plant.i - x[2] - flank * plant.alpha
        shaft = plant.k * wound + plant.c * (x[1] / plant.i - x[3]) if flank else 0.0
        outputs = dict(zip(("theta_m", "omega_m", "theta_l", "omega_l", "T_m"), map(float, x[:5]), strict=True))
        rows.append({"time": time, "u": u, "T_l": T_l, **outputs, "T_shaft": float(shaft), "contact": float(flank)})
        x, flank = reference_sample(plant, x, flank, u, T_l, PLANT_STEP, 1e-12, 1e-14)
    return rows


def _controller() -> list[Row]:
    starts = default_starts("LqrController")
    gains = np.array([starts[f"K[{n}]"] for n in range(1, 6)])
    rows: list[Row] = []
    held: Row = {}
    for n in range(501):
        time = n * SAMPLE
        inputs = {
            "reference": 0.5 * (1.0 - math.cos(12.0 * time)),
            "reference_speed": 6.0 * math.sin(12.0 * time),
            "theta_m_hat": 1.9 * (1.0 - math.cos(12.0 * time - 0.2)),
            "omega_m_hat": 23.0 * math.sin(12.0 * time - 0.2),
            "theta_l_hat": 0.48 * (1.0 - math.cos(12.0 * time - 0.25)),
            "omega_l_hat": 5.8 * math.sin(12.0 * time - 0.25),
            "T_l_hat": 20.0 * time,
            "T_m_hat": 60.0 * math.sin(25.0 * time),
        }
        # A sample is computed at the end of a step from the inputs that were held over it.
        rows.append({"time": time, **inputs, "u": _request(held or inputs, gains, starts)})
        held = inputs
    return rows


def _request(inputs: Row, gains: Array, starts: Mapping[str, float]) -> float:
    estimate = np.array([inputs[f"{name}_hat"] for name in ("theta_m", "omega_m", "theta_l", "omega_l", "T_m")])
    i, T_l = starts["i"], inputs["T_l_hat"]
    angle, speed = inputs["reference"], inputs["reference_speed"]
    wanted = np.array([i * (angle + T_l * starts["compliance"]), i * speed, angle, speed, T_l / i])
    request = float(T_l / i - gains @ (estimate - wanted))
    return float(np.clip(request, -starts["u_max"], starts["u_max"]))


def _estimator() -> list[Row]:
    starts = default_starts("KalmanEstimator")
    A = np.array([[starts[f"A_d[{r},{c}]"] for c in range(1, 7)] for r in range(1, 7)])
    B = np.array([starts[f"B_d[{r}]"] for r in range(1, 7)])
    K = np.array([[starts[f"K_f[{r},{c}]"] for c in (1, 2)] for r in range(1, 7)])
    weight = np.array([[starts["S_inv[1,1]"], starts["S_inv[1,2]"]], [starts["S_inv[1,2]"], starts["S_inv[2,2]"]]])
    C = np.array([[1.0, 0, 0, 0, 0, 0], [0, 0, 1.0, 0, 0, 0]])
    names = [f"{name}_hat" for name in ("theta_m", "omega_m", "theta_l", "omega_l", "T_l", "T_m")]
    x, e, rows = np.zeros(6), np.zeros(2), []
    for n in range(501):
        time = n * SAMPLE
        u = 30.0 * math.sin(15.0 * time)
        y = np.array([0.2 * (1.0 - math.cos(10.0 * time)), 0.0502 * (1.0 - math.cos(10.0 * time - 0.02))])
        innovations = {"innovation_m": e[0], "innovation_l": e[1], "innovation_squared": e @ weight @ e}
        outputs = {name: float(value) for name, value in {**dict(zip(names, x, strict=True)), **innovations}.items()}
        rows.append({"time": time, "u": u, "theta_m": float(y[0]), "theta_l": float(y[1]), **outputs})
        predicted = A @ x + B * u
        e = y - C @ predicted
        x = predicted + K @ e
    return rows


def _as_csv(rows: list[Row]) -> bytes:
    """Return rows as CSV with fifteen digits."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(rows[0])
    writer.writerows([f"{value:.15g}" for value in row.values()] for row in rows)
    return text.getvalue().encode("ascii")


def design_starts() -> dict[str, dict[str, float]]:
    """Return the start values as this machine designs them, by class name, to twelve digits."""
    controller = _design_controller()
    designs = {"LqrController": controller, "KalmanEstimator": _design_estimator(), "BacklashCompensator": controller}
    return {name: {key: float(f"{value:.12g}") for key, value in values.items()} for name, values in designs.items()}


def _design_controller() -> dict[str, float]:
    values = DrivetrainValues()
    regulator = design_regulator(five_state_model(values), np.diag(STATE_WEIGHTS), TORQUE_WEIGHT, SAMPLE_TIME)
    gains = {f"K[{n}]": gain for n, gain in enumerate(regulator.gains, start=1)}
    return gains | {"i": values.i, "compliance": 1.0 / values.k, "u_max": TORQUE_LIMIT, "sample_time": SAMPLE_TIME}


def _design_estimator() -> dict[str, float]:
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


def main() -> None:
    """Write the files, the start values first: the runs use them."""
    STORED.write_text(json.dumps(design_starts(), indent=1) + "\n", encoding="ascii")
    for name in PARAMETERS:
        (DATA / f"{name}_reference.csv").write_bytes(_as_csv(reference_run(name)))


if __name__ == "__main__":
    refuse_arguments(__doc__)
    main()
