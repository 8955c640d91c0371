"""The EMPS benchmark (measured data of a linear axis): its records as CSV, and the figures its authors publish.

Janot, Gautier, Brunot, "Data Set and Reference Models of EMPS", Workshop on Nonlinear System Identification
Benchmarks, 2019. The records are read where they lie and not copied into the project.
"""

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.signal import butter, decimate, filtfilt

from pyfmu_sources import servo_axis_parameters as sa

Array = NDArray[np.float64]

FOLDER = Path(os.environ.get("EMPS_DATA", str(Path(__file__).resolve().parents[3] / "shared" / "data" / "emps")))
RECORDS = {"estimation": "DATA_EMPS.mat", "test": "DATA_EMPS_PULSES.mat"}
STEP = 1e-3  # s
CUT_OFF = 100.0  # Hz, the authors' zero-phase Butterworth filter of order 4
DECIMATION = 10
BORDER = 50  # samples at either end that the authors leave out


def available() -> bool:
    """Tell whether the records are there."""
    return all((FOLDER / name).exists() for name in RECORDS.values())


def read(which: str) -> dict[str, Array]:
    """Return time [s], position and reference [m] and force [N]; the test record's pulses are in its force already."""
    raw = loadmat(FOLDER / RECORDS[which])
    column = {name: np.asarray(raw[name], dtype=float).ravel() for name in ("t", "qm", "qg", "vir")}
    force = float(raw["gtau"].item()) * column["vir"]
    return {"time": column["t"], "position": column["qm"], "reference": column["qg"], "force": force}


def write_csv(path: Path, which: str) -> None:
    """Write a record as ``diagnose --model emps.toml`` takes it."""
    data = read(which)
    rows = zip(data["time"], data["force"], data["position"], strict=True)
    path.write_text("time,force,position\n" + "".join(f"{t:.6f},{u:.9g},{y:.9g}\n" for t, u, y in rows))


def force_error(p: Array, which: str) -> float:
    """Return the relative error of the inverse model's force, filtered and decimated as the authors do."""
    data = read(which)
    b, a = butter(4, CUT_OFF * 2.0 * STEP)
    speed = np.gradient(filtfilt(b, a, data["position"]), STEP)
    acceleration = np.gradient(speed, STEP)
    force = p[sa.P_J] * acceleration + p[sa.P_B] * speed + p[sa.P_COULOMB] * np.sign(speed) + p[sa.P_LOAD_TORQUE]
    force = force + p[sa.P_DIRECTION] * np.abs(speed)
    force = force - p[sa.P_RIPPLE] * np.sin(p[sa.P_RIPPLE_N] * data["position"] + p[sa.P_RIPPLE_PHASE])
    inside = slice(BORDER, -BORDER)
    model, measured = (decimate(f[inside], DECIMATION, zero_phase=True) for f in (force, data["force"]))
    return float(np.linalg.norm(measured - model) / np.linalg.norm(measured))


def r_squared(simulated: Array, measured: Array) -> float:
    """Return the coefficient of determination."""
    return 1.0 - float(np.sum((simulated - measured) ** 2) / np.sum((measured - measured.mean()) ** 2))
