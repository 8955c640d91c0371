"""In which stage of a train the gap is, from a measured record."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

from orchestrator.api.estimate import EstimateResult
from orchestrator.api.methods import describe_record
from orchestrator.api.numerics import numeric_errors
from orchestrator.api.records import records_to_fit
from orchestrator.api.sampled import SampledResult
from orchestrator.api.shown import Block, doubts_of
from orchestrator.errors import RecordError, ScenarioError
from orchestrator.estimation.effort import Stop, never
from orchestrator.estimation.protocol import LEVEL
from orchestrator.estimation.settings import DEFAULT_SETTINGS, EstimationSettings
from orchestrator.estimation.stages.location import Location, StageGap
from orchestrator.estimation.stages.location import locate_gap as find_gap
from orchestrator.estimation.stages.problem import GAPS
from orchestrator.estimation.trust import trust_of_location
from orchestrator.plants.known.two_stage_train import TRAIN
from orchestrator.records.model_file import Model
from orchestrator.records.plausibility import check_plausible
from orchestrator.records.record import Record
from orchestrator.shared.arrays import Array
from orchestrator.shared.inference.normal import NORMAL_95
from orchestrator.shared.results import GapFound
from orchestrator.shared.results.estimate import EstimateFound, LocationFound, location_tables
from orchestrator.shared.results.fields import copy_fields
from orchestrator.shared.settings import as_tables, choose_settings
from orchestrator.shared.trust import Trust

METHOD = "two_stages"


@dataclass(frozen=True, repr=False)
class LocationResult(SampledResult):
    """In which stage of a train the gap is, and how large it is in each.

    Attributes:
        record: motor and load angle, and the torque, as they were read.
        model: what it was compared with.
        location: what the fits say.
        settings: the thresholds that were used.
    """

    command: ClassVar[str] = "estimate"
    csv_name: ClassVar[str] = "stages"
    digits: ClassVar[int | None] = 10
    replaces: ClassVar[tuple[str, ...]] = EstimateResult.replaces
    record: Record
    model: Model
    location: Location
    settings: EstimationSettings = DEFAULT_SETTINGS

    @property
    def answers(self) -> tuple[str, ...]:
        """What the record leaves possible, of "1", "2" and "both"; none where it shows no gap."""
        return self.location.answers

    @property
    def stages(self) -> tuple[StageGap, StageGap]:
        """Half-gap of each stage, at its gear's output [rad], with its interval."""
        return self.location.stages

    @property
    def total(self) -> StageGap:
        """Both half-gaps, seen from the load [rad], with their interval."""
        return self.location.total

    @property
    def trust(self) -> Trust:
        """How far the answer can be trusted, with the reasons."""
        return trust_of_location(self.location, self.record, self.model, self.settings)

    @property
    def message(self) -> str:
        """One sentence that says where the gap is."""
        where, low = self.location.answer, self.location.total.interval[1]
        if not self.answers:
            return f"No gap is seen: with 95 % confidence both half-gaps together are below {low:.3g} rad at the load."
        if not self.location.explained:
            return (
                "The model does not explain the record, so that no stage is named: check the units and signs of `u`, "
                "`theta_m` and `theta_l`, and the inertias of the model file."
            )
        if len(self.answers) == 1:
            return f"The gap is in {where}."
        return (
            f"The record leaves open where the gap is: {where}. A torque that reverses often, with a tone near the "
            "intermediate shaft's own frequency, and less noise would tell."
        )

    def blocks(self) -> Sequence[Block]:
        """Return the answer, the sizes and by how much each answer falls behind."""
        r = self.record
        title = f"{r.source}: {r.duration:g} s at {1.0 / r.step:g} Hz, two encoders"
        sizes, ways = location_tables(self._describe())
        doubts = [f"The answer is {self.trust.level.word}: {reason}" for reason in self.trust.reasons]
        shown = replace(sizes, title=title)
        return [*doubts_of([r]), shown, ways, self.message, *doubts]

    def _describe(self) -> LocationFound:
        found = self.location
        stages = {str(n): _gap_found(gap) for n, gap in enumerate(found.stages, start=1)}
        return copy_fields(LocationFound, found, total=_gap_found(found.total), stages=stages)

    def results(self, place: Path | None = None) -> EstimateFound:
        """Return what ``estimate.json`` says, which names nothing of the result's folder."""
        found = self.location
        seen = bool(found.answers)
        deviation = (found.total.interval[1] - found.total.alpha) / NORMAL_95
        return EstimateFound(
            alpha=found.total.alpha,
            standard_error=deviation if seen else None,
            interval=found.total.interval,
            level=LEVEL,
            unit="rad",
            visible=seen,
            message=self.message,
            trust=self.trust.to_result(),
            record=describe_record(self.record),
            method=METHOD,
            location=self._describe(),
            settings=as_tables(self.settings),
        )

    def signals(self) -> Mapping[str, Array]:
        """Return record, fit, twist and flank of each stage, and one-step errors."""
        return self.location.curves


def locate_gap(
    record: Record | Path | str,
    model: Model,
    *,
    time_limit: float = math.inf,
    settings: EstimationSettings | Path | str | None = None,
    progress: Callable[[str, str, float], None] = lambda work, stage, share: None,
    stop: Stop = never,
) -> LocationResult:
    """Find out in which stage of a train of two stages the gap is.

    Args:
        record: a measured record with torque, motor and load angle, or its path: a long file comes to the rate of its
            motion.
        model: of a ``TwoStageTrain``, as ``read_model`` returns it.
        time_limit: [s], after which the fit is given up (default: never).
        settings: thresholds, or the path of a TOML file with those that differ from the default.
        progress: called with the piece of work, its stage, and the share that is behind.
        stop: asked again and again: a text ends the work without a result.

    Returns:
        The answer, which is a set where the record does not tell, and the half-gaps with intervals.

    Raises:
        RecordError: the record is wrong, lacks a column, or does not fit the model at all.
        ScenarioError: the model is of another plant, or states what is fitted.
        ConvergenceError: no fit is found, or not within the time limit.

    Examples:
        >>> found = oc.locate_gap("train.csv", oc.read_model("train.toml"))
        >>> found.answers, found.message
        (('2',), 'The gap is in stage 2.')
    """
    chosen = choose_settings(settings, EstimationSettings)
    require_train(model)
    measured = complete_record(record, model)
    with numeric_errors(f"{measured.source}: no train can be fitted to this record"):
        found = find_gap(measured, model, chosen, time_limit, lambda stage, share: progress(METHOD, stage, share), stop)
    given = {"record": measured.source, "model": model.source, "method": METHOD}
    return LocationResult(measured, model, found, chosen, arguments=given)


def complete_record(record: Record | Path | str, model: Model, **reading: Any) -> Record:
    """Return a record that has all that a train needs and can be one of it."""
    (measured,) = records_to_fit([record], model, **reading)
    if measured.theta_l is None:
        raise RecordError(
            f"{measured.source}: column `theta_l` must be there to tell in which stage the gap is, but is not: log the "
            "load's angle, or name its column by `[columns.theta_l] name = ...` in the model file"
        )
    check_plausible(measured, model)
    return measured


def require_train(model: Model) -> None:
    """Refuse models of other plants, and those that state what is fitted."""
    if model.fmu != TRAIN:
        raise ScenarioError(f"{model.source}: `fmu` must be {TRAIN} to have two stages, but is {model.fmu}", "fmu")
    for name, entry in model.parameters.items():
        plain = name in model.plant.linear or name in ("i_1", "i_2", *GAPS)
        default = next(row.default for row in model.plant.table if row.name == name)
        if not plain and (entry.value != default or entry.uncertainty > 0.0):
            raise ScenarioError(
                f"{model.source}: `{name}` must be left out for `estimate`, which fits friction, lateness and zeros "
                f"itself, but is {entry.value:g}",
                name,
            )


def _gap_found(gap: StageGap) -> GapFound:
    return GapFound(gap.alpha if math.isfinite(gap.alpha) else None, *gap.interval)
