"""The EMPS benchmark (measured data of a linear axis): its records as CSV, and the figures its authors publish.

Janot, Gautier, Brunot, "Data Set and Reference Models of EMPS", Workshop on Nonlinear System Identification
Benchmarks, 2019. The records are read where they lie and not copied into the project.
"""

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat

Array = NDArray[np.float64]

FOLDER = Path(os.environ.get("EMPS_DATA", str(Path(__file__).resolve().parents[3] / "shared" / "data" / "emps")))
RECORDS = {"estimation": "DATA_EMPS.mat", "test": "DATA_EMPS_PULSES.mat"}


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
