"""A first fit over growing parts of a record, for an FMU that is not linear.

A free run that has left the record does not say how to come back: the part over which it keeps close is fitted first.
"""

from dataclasses import replace

from orchestrator.diagnosis.fmu.residual_model import FmuResiduals
from orchestrator.diagnosis.inference.fitting import fit_model
from orchestrator.diagnosis.inference.problem import FitProblem
from orchestrator.diagnosis.inference.whitening import band_only
from orchestrator.diagnosis.model.interface import ModelPoint
from orchestrator.diagnosis.settings import FitSettings

PARTS = (1 / 16, 1 / 8, 1 / 4, 3 / 8, 1 / 2, 5 / 8, 3 / 4, 7 / 8, 1.0)
ITERATIONS = 8  # of each part: a motion that is hardly to be foretold converges slowly


def grow_fit(model: FmuResiduals, settings: FitSettings) -> ModelPoint | None:
    """Return values that bring free runs close to the record, residuals in units of the outputs' noise."""
    if model.is_linear:
        return None
    plain = band_only(model, settings)
    white = replace(plain, weights=plain.weights / model.problem.noise[:, None])
    point = FitProblem((model,), (white,), settings).start
    for part in PARTS:
        active = white.active.copy()
        active[:, white.rows > part * model.size] = 0.0
        point = fit_model(FitProblem((model,), (replace(white, active=active),), settings), point, ITERATIONS).point
    return point
