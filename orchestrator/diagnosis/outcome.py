"""What a diagnosis says: plain immutable values, with their form in ``diagnose.json``."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit, Parts
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.search.candidate import Candidate, ForwardStep
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.diagnosis.verdict.remainder import Remainder
from orchestrator.diagnosis.verdict.where import Place
from orchestrator.plants.description import Plant
from orchestrator.shared.inference.repeats import Repeats
from orchestrator.shared.play import Play
from orchestrator.shared.results.diagnose import (
    AnalysisFound,
    DiagnoseFound,
    EffectFound,
    EvidenceFound,
    FloorFound,
    HorizonFound,
    LearnedFound,
    MisfitFound,
    ParameterFound,
    PlaceFound,
    PredictableFound,
    RemainderFound,
    StageFound,
    StepFound,
    TriedFound,
    ValueFound,
)
from orchestrator.shared.settings import as_tables
from orchestrator.shared.trust import Trust

Array = NDArray[np.float64]


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
    def best_before(self) -> float:
        """Return the less of nominal and re-fitted parameters' rms; infinite where the runs of both go astray."""
        return min((rms for _, rms in self.stages[:-1][:2] if math.isfinite(rms)), default=math.inf)

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
class FittedLaw:
    """A learned law inside the predictor.

    Attributes:
        likelihood: of the record, with a plant that has the law.
        p: (parameters,) of the predictor, those of the law and what was fitted beside it among them.
        q: process noise of the filter that guesses initial states.
    """

    likelihood: RecordLikelihood
    p: Array
    q: float


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
        misfit: of each signal on the held-out part, of re-fitted parameters, with the log put right, with the law.
        log: what is put right in the log beside the law, in words; empty: nothing.
        fitted: the model that it is part of.
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
    log: str = ""
    fitted: FittedLaw | None = field(default=None, repr=False, compare=False)

    @property
    def shrinks(self) -> float:
        """Return how many times smaller the held-out misfit is with the law, in the signal that gains least.

        What putting the log right gains, which the law was fitted beside, does not count.
        """
        return min(one.best_before / max(one.after, 1e-300) for one in self.misfit)

    @property
    def words(self) -> str:
        """Return the law in one sentence."""
        text = f"what is left follows the {self.argument} at the {self.site}: a learned law makes the held-out misfit "
        text += f"{self.shrinks:.1f} times smaller"
        text += f"; it runs like {self.formula}, s in {self.argument_unit}" if self.formula else ""
        return text + (f"; in the log beside it: {self.log}" if self.log else "")


@dataclass(frozen=True)
class Workings:
    """What figures and further checks need of how a diagnosis was made."""

    likelihood: RecordLikelihood
    parts: Parts
    base: Fit
    final: Fit
    best: Candidate
    steps: tuple[ForwardStep, ...]

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
    parameters: dict[str, ParameterFound]
    where: tuple[Place, ...]
    misfit: tuple[Misfit, ...]
    remainder: Remainder
    warnings: tuple[str, ...]
    corrected: dict[str, float]
    trust: Trust
    horizons: tuple[HorizonFound, ...]
    analysis: AnalysisFound
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

    def found(self) -> DiagnoseFound:
        """Return the results for ``diagnose.json``, as far as the diagnosis knows them.

        Returns:
            The results without the corrected FMU and what follows from it.
        """
        left = self.remainder
        return DiagnoseFound(
            verdict=self.verdict,
            effects=_named(self.effects),
            play=None if self.play is None else self.play.found(),
            nuisances=_named(self.nuisances),
            parameters=self.parameters,
            where=tuple(PlaceFound(p.signal, p.regime, p.interval, p.unit, p.share) for p in self.where),
            misfit=_misfits(self.misfit),
            records=tuple(EvidenceFound(one.source, one.rows, _misfits(one.misfit)) for one in self.records),
            repeats=None if self.repeats is None else FloorFound(self.repeats.sources, self.repeats.floor),
            learned_law=None if self.learned is None else _learned(self.learned),
            horizons=self.horizons,
            analysis=self.analysis,
            trust=self.trust.found(),
            suspects=_named(self.suspects),
            warnings=self.warnings,
            remainder=RemainderFound(
                explained=min(left.explained, 1.0),
                missing_log_likelihood=left.missing,
                growth=left.growth,
                tails=left.tails,
                predictable=tuple(PredictableFound(p.site, p.kind, p.gain, p.share) for p in left.predictable[:5]),
            ),
            settings=as_tables(self.settings),
            candidates=tuple(step_found(step) for step in self.workings.steps),
        )


def _learned(law: LearnedLaw) -> LearnedFound:
    return LearnedFound(
        site=law.site,
        argument=law.argument,
        argument_unit=law.argument_unit,
        unit=law.unit,
        words=law.words,
        knots=law.knots,
        values=law.values,
        band=(law.low, law.high),
        formula=law.formula,
        misfit=_misfits(law.misfit),
        times_smaller=law.shrinks,
    )


def _misfits(found: tuple[Misfit, ...]) -> dict[str, MisfitFound]:
    return {
        one.signal: MisfitFound(
            one.before, one.after, one.noise, one.unit, tuple(StageFound(name, rms) for name, rms in one.stages)
        )
        for one in found
    }


def _named(effects: tuple[Named, ...]) -> tuple[EffectFound, ...]:
    return tuple(
        EffectFound(
            effect.name,
            effect.site,
            {
                short: ValueFound(e.value, e.standard_error, e.interval, e.unit)
                for short, e in effect.parameters.items()
            },
            effect.score,
            effect.runner_up,
            effect.margin,
            effect.family,
        )
        for effect in effects
    )


def step_found(step: ForwardStep) -> StepFound:
    """Return a step of the search as results have it.

    Args:
        step: of the search.

    Returns:
        Its candidates, best first, with their gains over the model before.
    """
    before = step.before
    tried = tuple(
        TriedFound(
            effect=candidate.effects[-1].label,
            gain=candidate.gain_over(before),
            fitted=candidate.fit.fitted - before.fit.fitted,
            decided=candidate.fit.validated - before.fit.validated,
            process_noise=candidate.fit.q,
        )
        for candidate in step.candidates
    )
    return StepFound(tuple(effect.label for effect in before.effects), step.accepted, tried)
