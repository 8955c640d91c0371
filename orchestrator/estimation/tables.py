"""The curves behind an estimate as CSV, for plots elsewhere and for the report."""

import math
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from orchestrator.estimation.protocol import Estimate
from orchestrator.records.record import Record
from orchestrator.shared.arrays import Array
from orchestrator.shared.inference.normal import NORMAL_95
from orchestrator.shared.output import write_columns


def write_tables(directory: Path, record: Record, estimates: Iterable[Estimate], ratio: float) -> None:
    """Write ``estimate.csv``, ``profile.csv``, ``online.csv`` and ``flanks.csv``, as far as there is data."""
    for estimate in estimates:
        if estimate.method == "maximum_likelihood":
            _write(directory / "estimate.csv", _fit_columns(record, estimate, ratio))
            if math.isfinite(estimate.alpha):
                profile = estimate.curves["profile"]
                _write(directory / "profile.csv", {"alpha": profile.alpha, "drop": profile.drop})
        elif estimate.method == "ekf":
            alpha, deviation = estimate.curves["alpha"], estimate.curves["deviation"]
            low, high = np.maximum(alpha - NORMAL_95 * deviation, 0.0), alpha + NORMAL_95 * deviation
            _write(directory / "online.csv", {"time": record.time, "alpha": alpha, "low": low, "high": high})
        elif estimate.method == "two_encoders":
            _write(directory / "flanks.csv", {name: estimate.curves[name] for name in ("time", "twist", "flank")})


def _fit_columns(record: Record, estimate: Estimate, ratio: float) -> dict[str, Array]:
    """Return record and fit by column name, each of shape (n,): SI units, contact in (-1, 0, 1)."""
    states, errors = estimate.curves["states"], estimate.curves["errors"]
    columns = {"time": record.time, "u": record.u, "theta_m": record.theta_m, "theta_m_fitted": states[:, 0]}
    if record.theta_l is not None:
        offset = estimate.curves["offset"]
        columns |= {"theta_l": record.theta_l, "theta_l_fitted": states[:, 2] + offset}
        columns["twist"] = record.theta_m / ratio - record.theta_l + offset
    columns |= {"twist_fitted": states[:, 0] / ratio - states[:, 2], "contact": estimate.curves["contacts"]}
    return columns | {f"one_step_error_{n}": errors[:, k] for k, n in enumerate(("m", "l")[: errors.shape[1]])}


def _write(path: Path, columns: Mapping[str, Array]) -> None:
    write_columns(path, columns, lambda value: "" if math.isnan(value) else f"{value:.10g}")
