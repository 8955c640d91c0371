"""What a diagnosis says: plain immutable values, with their form in ``diagnose.json``."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fitting import Fit, Parts
from orchestrator.diagnosis.likelihood import Likelihood
from orchestrator.diagnosis.plants import Plant
from orchestrator.diagnosis.remainder import Remainder
from orchestrator.diagnosis.search import Candidate, Step
from orchestrator.diagnosis.where import Missing, Place

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Estimate:
    """A value with its standard error, 95 % interval and unit."""

    value: float
    standard_error: float
    interval: tuple[float, float]
    unit: str


@dataclass(frozen=True)
class Named:
    """A named effect.

    Attributes:
        name, site: of the effect.
        parameters: estimate of each parameter, by short name.
        score: gain in penalised log-likelihood when the effect was added.
        runner_up: the next best candidate of that step.
        margin: how much less the runner-up gained.
        family: effects that this record cannot tell from the named one (the named one included), or empty.
    """

    name: str
    site: str
    parameters: dict[str, Estimate]
    score: float
    runner_up: str
    margin: float
    family: tuple[str, ...] = ()


@dataclass(frozen=True)
class Gap:
    """The gap of one signal on held-out data: rms of simulated minus measured of each model in turn."""

    signal: str
    unit: str
    noise: float
    stages: tuple[tuple[str, float], ...]  # ("nominal", rms), ("parameters", rms), ("+ effect", rms), …

    @property
    def before(self) -> float:
        """Return the gap of the nominal model."""
        return self.stages[0][1]

    @property
    def after(self) -> float:
        """Return the gap of the final model."""
        return self.stages[-1][1]


@dataclass(frozen=True)
class Workings:
    """What figures and further checks need of how a diagnosis was made."""

    plant: Plant
    likelihood: Likelihood
    parts: Parts
    nominal: Array
    base: Fit
    final: Fit
    best: Candidate
    steps: tuple[Step, ...]
    missing_before: Missing
    missing_after: Missing


@dataclass(frozen=True)
class Diagnosis:
    """The outcome of a diagnosis; see section "JSON" of docs/diagnosis.md."""

    verdict: str
    effects: tuple[Named, ...]
    suspects: tuple[Named, ...]
    parameters: dict[str, dict[str, Any]]
    where: tuple[Place, ...]
    gap: tuple[Gap, ...]
    remainder: Remainder
    warnings: tuple[str, ...]
    corrected: dict[str, float]
    workings: Workings = field(repr=False)

    def as_json(self) -> dict[str, Any]:
        """Return the results for ``diagnose.json`` (``model`` is filled in by the command)."""
        return {
            "verdict": self.verdict,
            "effects": [_named(effect) for effect in self.effects],
            "parameters": self.parameters,
            "where": [
                {
                    "signal": place.signal,
                    "regime": place.regime,
                    "interval": [*place.interval],
                    "unit": place.unit,
                    "share_of_gap": place.share,
                }
                for place in self.where
            ],
            "gap": {
                gap.signal: {
                    "before": gap.before,
                    "after": gap.after,
                    "noise": gap.noise,
                    "unit": gap.unit,
                    "stages": [{"model": name, "rms": rms} for name, rms in gap.stages],
                }
                for gap in self.gap
            },
            "model": None,
            "suspects": [_named(effect) for effect in self.suspects],
            "warnings": list(self.warnings),
            "remainder": {
                "explained": self.remainder.explained,
                "missing_log_likelihood": self.remainder.missing,
                "growth": self.remainder.growth,
                "predictable": [
                    {"site": p.site, "kind": p.kind, "gain": p.gain, "share": p.share}
                    for p in self.remainder.predictable[:5]
                ],
            },
            "candidates": [_step(step) for step in self.workings.steps],
        }


def _named(effect: Named) -> dict[str, Any]:
    return {
        "name": effect.name,
        "site": effect.site,
        "parameters": {
            short: {"value": e.value, "standard_error": e.standard_error, "interval": [*e.interval], "unit": e.unit}
            for short, e in effect.parameters.items()
        },
        "score": effect.score,
        "runner_up": effect.runner_up,
        "margin": effect.margin,
        "family": list(effect.family),
    }


def _step(step: Step) -> dict[str, Any]:
    return {
        "on_top_of": [effect.label for effect in step.before.effects],
        "accepted": step.accepted,
        "tried": [
            {
                "effect": candidate.effects[-1].label,
                "gain": candidate.gain_over(step.before),
                "fitted": candidate.fit.fitted - step.before.fit.fitted,
                "decided": candidate.fit.validated - step.before.fit.validated,
                "process_noise": candidate.fit.q,
            }
            for candidate in step.candidates
        ],
    }
