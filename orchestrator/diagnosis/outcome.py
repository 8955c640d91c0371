"""What a diagnosis says: plain immutable values, with their form in ``diagnose.json``."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit, Parts
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.search.candidate import Candidate, ForwardStep
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.diagnosis.verdict.remainder import Remainder
from orchestrator.diagnosis.verdict.where import Missing, Place
from orchestrator.plants.description import Plant
from orchestrator.shared.inference.repeats import Repeats
from orchestrator.shared.play import Play
from orchestrator.shared.settings import as_tables
from orchestrator.shared.trust import Trust

Array = NDArray[np.float64]

SCHEMA_VERSION = 2  # of the results in diagnose.json


@dataclass(frozen=True)
class ParameterEstimate:
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
    parameters: dict[str, ParameterEstimate]
    score: float
    runner_up: str
    margin: float
    family: tuple[str, ...] = ()


@dataclass(frozen=True)
class Misfit:
    """The misfit of one signal on held-out data: rms of simulated minus measured of each model in turn."""

    signal: str
    unit: str
    noise: float
    stages: tuple[tuple[str, float], ...]  # ("nominal", rms), ("parameters", rms), ("+ effect", rms), …

    @property
    def before(self) -> float:
        """Return the misfit of the nominal model."""
        return self.stages[0][1]

    @property
    def after(self) -> float:
        """Return the misfit of the final model."""
        return self.stages[-1][1]


@dataclass(frozen=True)
class RecordEvidence:
    """What one of several records says of the common model: its rows, and the misfit on its held-out part."""

    source: str
    rows: int
    misfit: tuple[Misfit, ...]


@dataclass(frozen=True)
class LearnedLaw:
    """A torque that no effect explains, as a curve; never a name.

    Attributes:
        site: where it acts, against the motion (on the shaft: with the elastic torque).
        argument: what it follows, in words.
        argument_unit, unit: of knots and of values.
        knots, values: (k,) the curve: straight lines between them, the last ones go on.
        low, high: (k,) its 95 % band.
        formula: a short one that runs within the band, s being the argument; empty: none does.
        misfit: of each signal on the held-out part, of re-fitted parameters and with the law.
    """

    site: str
    argument: str
    argument_unit: str
    unit: str
    knots: tuple[float, ...]
    values: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    formula: str
    misfit: tuple[Misfit, ...]

    @property
    def shrinks(self) -> float:
        """Return how many times smaller the held-out misfit is with the law, in the signal that gains least."""
        return min(one.before / max(one.after, 1e-300) for one in self.misfit)

    @property
    def words(self) -> str:
        """Return the law in one sentence."""
        text = f"what is left follows the {self.argument} at the {self.site}: a learned law makes the held-out misfit "
        text += f"{self.shrinks:.1f} times smaller"
        return text + (f"; it runs like {self.formula}, s in {self.argument_unit}" if self.formula else "")


@dataclass(frozen=True)
class Workings:
    """What figures and further checks need of how a diagnosis was made."""

    likelihood: RecordLikelihood
    parts: Parts
    base: Fit
    final: Fit
    best: Candidate
    steps: tuple[ForwardStep, ...]
    missing_before: Missing
    missing_after: Missing

    @property
    def plant(self) -> Plant:
        """Return the plant."""
        return self.likelihood.plant

    @property
    def nominal(self) -> Array:
        """Return the parameters of the model as given."""
        return self.likelihood.nominal


@dataclass(frozen=True)
class Diagnosis:
    """The outcome of a diagnosis; see section "JSON" of docs/diagnosis.md."""

    verdict: str
    effects: tuple[Named, ...]
    suspects: tuple[Named, ...]
    nuisances: tuple[Named, ...]
    parameters: dict[str, dict[str, Any]]
    where: tuple[Place, ...]
    misfit: tuple[Misfit, ...]
    remainder: Remainder
    warnings: tuple[str, ...]
    corrected: dict[str, float]
    trust: Trust
    horizons: list[dict[str, Any]]
    analysis: dict[str, Any]
    settings: DiagnosisSettings
    workings: Workings = field(repr=False)
    records: tuple[RecordEvidence, ...] = ()
    repeats: Repeats | None = None
    learned: LearnedLaw | None = None

    @property
    def play(self) -> Play | None:
        """The size of the backlash that was named; None: none was."""
        gap = next((effect for effect in self.effects if effect.name == "backlash"), None)
        if gap is None:
            return None
        return Play(gap.parameters["alpha"].value, self.workings.plant.ratio(self.workings.final.p))

    def as_json(self) -> dict[str, Any]:
        """Return the results for ``diagnose.json`` (``model`` is filled in by the command).

        Returns:
            Plain data.
        """
        return {
            "schema_version": SCHEMA_VERSION,
            "verdict": self.verdict,
            "effects": [_named(effect) for effect in self.effects],
            "play": self.play and self.play.as_json(),
            "nuisances": [_named(nuisance) for nuisance in self.nuisances],
            "parameters": self.parameters,
            "where": [
                {
                    "signal": place.signal,
                    "regime": place.regime,
                    "interval": [*place.interval],
                    "unit": place.unit,
                    "share_of_misfit": place.share,
                }
                for place in self.where
            ],
            "misfit": _misfits(self.misfit),
            "records": [
                {"source": one.source, "rows": one.rows, "misfit": _misfits(one.misfit)} for one in self.records
            ],
            "repeats": self.repeats and {"sources": [*self.repeats.sources], "floor": self.repeats.floor},
            "learned_law": self.learned and _learned(self.learned),
            "horizons": self.horizons,
            "analysis": self.analysis,
            "trust": self.trust.as_json(),
            "model": None,
            "suspects": [_named(effect) for effect in self.suspects],
            "warnings": list(self.warnings),
            "remainder": {
                "explained": min(self.remainder.explained, 1.0),
                "missing_log_likelihood": self.remainder.missing,
                "growth": self.remainder.growth,
                "tails": self.remainder.tails,
                "predictable": [
                    {"site": p.site, "kind": p.kind, "gain": p.gain, "share": p.share}
                    for p in self.remainder.predictable[:5]
                ],
            },
            "settings": as_tables(self.settings),
            "candidates": [_step(step) for step in self.workings.steps],
        }


def _learned(law: LearnedLaw) -> dict[str, Any]:
    return {
        "site": law.site,
        "argument": law.argument,
        "argument_unit": law.argument_unit,
        "unit": law.unit,
        "words": law.words,
        "knots": [*law.knots],
        "values": [*law.values],
        "band": [[*law.low], [*law.high]],
        "formula": law.formula,
        "misfit": _misfits(law.misfit),
        "times_smaller": law.shrinks,
    }


def _misfits(found: tuple[Misfit, ...]) -> dict[str, Any]:
    return {
        misfit.signal: {
            "before": misfit.before,
            "after": misfit.after,
            "noise": misfit.noise,
            "unit": misfit.unit,
            "stages": [{"model": name, "rms": rms} for name, rms in misfit.stages],
        }
        for misfit in found
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


def _step(step: ForwardStep) -> dict[str, Any]:
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
