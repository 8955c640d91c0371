"""The online estimator run over a whole record: the same source as the FMU ``BacklashEstimator``, compiled."""

import math
from dataclasses import dataclass

import numpy as np

from orchestrator.building.translation.kernels import Kernels
from orchestrator.estimation.filter.innovations import count_traversals
from orchestrator.estimation.problem import measurement_noise
from orchestrator.estimation.protocol import LEVEL, Estimate, NotApplicableError
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record
from orchestrator.shared.arrays import Array
from orchestrator.shared.inference.normal import interval_95
from pyfmu_sources.estimators.backlash_estimator import NoiseSettings

ONLINE = Kernels("orchestrator.estimation.online", checked=True)
UNMEASURED = 1e6  # rad, standard deviation that stands for an encoder that is absent


@dataclass(frozen=True)
class OnlineTrace:
    """The online estimate over time: half-gap and its standard deviation [rad], flank, all (n,)."""

    alpha: Array
    deviation: Array
    contact: Array


def trace(record: Record, model: Model, settings: NoiseSettings | None = None) -> OnlineTrace:
    """Return the online estimate over a record; ``settings`` default to what the record and the model say."""
    p = {name: entry.value for name, entry in model.parameters.items()}
    plant = (p["J_m"], p["J_l"], p["k"], p["c"], p["b_m"], p["b_l"], p["i"], p["tau"])
    load = record.theta_m / p["i"] if record.theta_l is None else record.theta_l
    chosen = settings or default_settings(record, model)
    n = record.size
    alpha, deviation, contact = np.empty(n), np.empty(n), np.empty(n)
    ONLINE.follow(record.u, record.theta_m, load, plant, tuple(chosen), record.step, alpha, deviation, contact)
    return OnlineTrace(alpha, deviation, contact)


def default_settings(record: Record, model: Model) -> NoiseSettings:
    """Return the settings for a record: encoder noise as measured, stiffness as uncertain as the model says."""
    noise_m = measurement_noise(record, model, "theta_m")
    noise_l = UNMEASURED if record.theta_l is None else measurement_noise(record, model, "theta_l")
    stiffness = model.parameters["k"]
    spread = stiffness.standard_deviation / stiffness.value
    lag = model.parameters["tau"]
    return NoiseSettings(
        noise_m=noise_m,
        noise_l=noise_l,
        stiffness_spread=max(spread, 1e-6),
        lag_spread=lag.standard_deviation / lag.value,
    )


def estimate(record: Record, model: Model) -> Estimate:
    """Return the online estimate at the end of the record, with its course in ``curves``."""
    if model.fmu != "Drivetrain":
        raise NotApplicableError("the online estimator needs the model `Drivetrain`")
    run = trace(record, model)
    alpha, error = float(run.alpha[-1]), float(run.deviation[-1])
    if not math.isfinite(alpha):
        raise NotApplicableError("the online estimator diverged on this record")
    settled = error < 0.2 * alpha
    message = "" if settled else "the online estimate has not settled: its standard deviation is above a fifth of it"
    diagnostics = {
        "traversals": count_traversals(run.contact),
        "level": LEVEL,
        "settings": default_settings(record, model)._asdict(),
    }
    curves = {"alpha": run.alpha, "deviation": run.deviation}
    return Estimate("ekf", alpha, error, interval_95(alpha, error, 0.0), settled, message, diagnostics, curves)
