"""The EMPS benchmark (measured data of a linear axis): its records as CSV, and the figures its authors publish.

Janot, Gautier, Brunot, "Data Set and Reference Models of EMPS", Workshop on Nonlinear System Identification
Benchmarks, 2019. The records are read where they lie and not copied into the project.
"""

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.signal import butter, filtfilt

from pyfmu_sources import servo_axis

Array = NDArray[np.float64]

FOLDER = Path(os.environ.get("EMPS_DATA", "../shared/data/emps"))
RECORDS = {"estimation": "DATA_EMPS.mat", "test": "DATA_EMPS_PULSES.mat"}
GAIN = 35.15  # N/V
KP, KV, LARGEST_VOLTAGE = 160.18, 243.45, 10.0
BORDER = 50  # samples at either end that the authors leave out of the force error


def read(which: str) -> dict[str, Array]:
    """Return time [s], position and reference [m] and force [N] of the estimation or the test record."""
    raw = loadmat(FOLDER / RECORDS[which])
    column = {name: np.asarray(raw[name], dtype=float).ravel() for name in ("t", "qm", "qg", "vir")}
    # The test record's pulses [V] are part of its voltage already.
    force = GAIN * column["vir"]
    return {"time": column["t"], "position": column["qm"], "reference": column["qg"], "force": force}


def write_csv(path: Path, which: str) -> None:
    """Write a record as ``diagnose --model emps.toml`` takes it."""
    data = read(which)
    rows = zip(data["time"], data["force"], data["position"], strict=True)
    path.write_text("time,force,position\n" + "".join(f"{t:.6f},{u:.9g},{y:.9g}\n" for t, u, y in rows))
