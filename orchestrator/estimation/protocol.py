"""What every estimator takes and gives.

Call order: :func:`orchestrator.records.record.read_record`,
:func:`orchestrator.records.model_file.read_model`, then any estimator of
:data:`METHODS` by :func:`estimator`.
"""

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from orchestrator.errors import ConvergenceError, OrchestratorError

METHODS = {
    "maximum_likelihood": "joint fit of gap, parameters, initial state and noise; profile-likelihood interval",
    "ekf": "online estimator (Gaussian sum of extended Kalman filters), as in the FMU BacklashEstimator",
    "speed_difference": "integral of the speed difference over a traversal of the gap",
    "torque_pulse": "torque pulses, or the quasi-stationary twist against torque",
    "operating_data": "width of the twist's hysteresis in normal closed-loop data",
    "two_encoders": "two flanks in the load's angle against the motor's; needs no torque",
}
FITTED = "maximum_likelihood"
WITHOUT_TORQUE = "two_encoders"  # the method of records that have none
LEVEL = 0.95
DEFAULT_SIZE = 0.005  # rad, the half-gap that an experiment is designed for where no estimate says one


class TimeLimitError(ConvergenceError):
    """An estimate did not come to its end within the time that it was given."""


class NotApplicableError(OrchestratorError):
    """The record lacks what a method needs; the text says what. Not the user's mistake."""


@dataclass(frozen=True)
class Estimate:
    """A half-gap with everything that is said about it.

    Attributes:
        method: key of ``METHODS``.
        alpha: half gap, load side [rad]; NaN where the gap cannot be seen.
        standard_error: [rad]; infinite when the record says nothing about the gap.
        interval: 95 % interval [rad]; its lower end is 0.0 when no gap is compatible with the record.
        visible: whether the record shows a gap at all.
        message: one sentence for the user; empty when there is nothing to add.
        diagnostics: numbers and short texts for ``estimate.json``.
        curves: arrays for the plots, by name.
    """

    method: str
    alpha: float
    standard_error: float
    interval: tuple[float, float]
    visible: bool = True
    message: str = ""
    diagnostics: Mapping[str, Any] = field(default_factory=dict)
    curves: Mapping[str, Any] = field(default_factory=dict, repr=False)


def estimator(name: str) -> Callable[..., Estimate]:
    """Return the estimator called ``name``, a key of ``METHODS``; only its module is imported.

    Args:
        name: one of `METHODS`.

    Returns:
        Its function of a record, a model, and the options that :mod:`orchestrator.estimation.apply` names. It raises a
        `NotApplicableError` where the record lacks what the method needs.
    """
    module = importlib.import_module(f"orchestrator.estimation.methods.{name}")
    function: Callable[..., Estimate] = module.estimate
    return function
