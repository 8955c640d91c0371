"""The log of a drive with a gear ratio of 20, as its controller writes it: counts and percent of rated torque."""

import math
from pathlib import Path

import numpy as np

from tests.support.excitations import multisine
from tests.support.independent_plant import make_record

RATED = 12.7  # N.m
COUNTS = (8192, 131_072)
DRIVE = {"J_m": 0.004, "J_l": 1.9, "k": 9000.0, "c": 4.0, "b_m": 0.006, "b_l": 2.0, "i": 20.0, "tau": 0.004}
HALF_GAP = 0.004  # rad, at the load


def write_log(path: Path, seed: int = 7, duration: float = 8.0) -> dict:
    """Write the log and return the truth that made it."""
    rate = 500.0
    u = multisine(np.random.default_rng(seed), round(duration * rate), 1.0 / rate, 4.0, 12.0)
    columns, truth = make_record(
        {"alpha": HALF_GAP}, seed, rate=rate, mismatch=0.0, noise=(3e-4, 2e-5), counts=COUNTS, u=u, linear=DRIVE
    )
    lines = ["Sample,Torque setpoint [%],Motor position [inc],Load position [inc]"]
    for n, (torque, motor, load) in enumerate(zip(columns["u"], columns["theta_m"], columns["theta_l"], strict=True)):
        turns = (round(motor * COUNTS[0] / (2.0 * math.pi)), round(load * COUNTS[1] / (2.0 * math.pi)))
        lines.append(f"{n},{100.0 * torque / RATED:.5f},{turns[0]},{turns[1]}")
    path.write_text("\n".join(lines) + "\n")
    return truth
