"""The gap, with interval, from a measured record."""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import msgspec
import numpy as np

import orchestrator
from orchestrator.api.design import DesignResult
from orchestrator.api.estimable import plausible_records, require_linear
from orchestrator.api.live import live_fitted_model
from orchestrator.api.methods import MethodResult, describe_record, method_entry
from orchestrator.api.numerics import numeric_errors
from orchestrator.api.plotted import PlottedResult
from orchestrator.api.shown import Block, doubts_of
from orchestrator.errors import ConvergenceError, InputError, ScenarioError
from orchestrator.estimation.apply import apply_method, default_method, error_bound
from orchestrator.estimation.effort import Stop, StoppedError, never
from orchestrator.estimation.problem import DRY
from orchestrator.estimation.protocol import FITTED, METHODS, WITHOUT_TORQUE, Estimate, NotApplicableError
from orchestrator.estimation.repeats import in_words, repeats_of
from orchestrator.estimation.settings import DEFAULT_SETTINGS, EstimationSettings
from orchestrator.estimation.tables import write_tables
from orchestrator.estimation.trust import trust_of_estimates
from orchestrator.records.model_file import Model, read_model
from orchestrator.records.model_text import describe_fit, model_text
from orchestrator.records.record import Record
from orchestrator.shared.inference.normal import NORMAL_95
from orchestrator.shared.inference.repeats import Repeats
from orchestrator.shared.play import Play
from orchestrator.shared.results.estimate import EstimateFound, MethodFound, RepeatsFound, methods_table
from orchestrator.shared.settings import as_tables, choose_settings
from orchestrator.shared.trust import Level, Trust

DIAGNOSIS = "diagnosis"  # the row of a corrected model's half-gap, and the folder of its diagnosis


@dataclass(frozen=True, repr=False)
class EstimateResult(PlottedResult):
    """The half-gap at the load; of several methods, that of the first that applies.

    Attributes:
        record: the measured record, as the methods used it.
        model: what it was compared with.
        methods: what each method says.
        diagnosis: what the model misses, where it does not explain the record; else None.
        more: further records of the same machine, fitted together with the first.
        repeats: what records with the same torque differ by, or None.
        settings: the thresholds that were used.
        undiagnosed: why no diagnosis followed although the model does not explain the record; else empty.
        plan: an experiment that would show the gap better, which is shown and written with the estimate; or None.
    """

    command: ClassVar[str] = "estimate"
    replaces: ClassVar[tuple[str, ...]] = (
        "estimate.png",
        f"{DIAGNOSIS}/diagnose.png",
    )
    record: Record
    model: Model
    methods: tuple[MethodResult, ...]
    diagnosis: "orchestrator.DiagnosisResult | None" = None
    more: tuple[Record, ...] = ()
    repeats: Repeats | None = None
    settings: EstimationSettings = DEFAULT_SETTINGS
    undiagnosed: str = ""
    plan: DesignResult | None = None

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """The estimates of the methods that apply."""
        return tuple(m.estimate for m in self.methods if m.estimate is not None)

    @property
    def best(self) -> Estimate:
        """The estimate of the first method that applies.

        Raises:
            NotApplicableError: no method gives a gap for this record.
        """
        if not self.estimates:
            raise NotApplicableError("; ".join(f"{m.method}: {m.reason}" for m in self.methods))
        return self.estimates[0]

    @property
    def alpha(self) -> float:
        """Half-gap [rad] at the load; NaN where the gap cannot be seen."""
        return self.best.alpha

    @property
    def standard_error(self) -> float:
        """Standard error of ``alpha`` [rad]."""
        return self.best.standard_error

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of ``alpha`` [rad]; from 0.0 where no gap is compatible with the record."""
        return self.best.interval

    @property
    def visible(self) -> bool:
        """Whether the record shows a gap at all."""
        return self.best.visible

    @property
    def message(self) -> str:
        """One sentence on the estimate; empty when there is nothing to add."""
        return self.best.message

    @property
    def trust(self) -> Trust:
        """How far the answer can be trusted, with the reasons; red where no method applies."""
        found = next((m.trust for m in self.methods if m.trust is not None), None)
        return found or Trust(Level.RED, ("no method can be applied to this record",))

    def _ratio(self, estimate: Estimate) -> float:
        return float(
            estimate.diagnostics.get("parameters", {}).get("i", {}).get("value", self.model.parameters["i"].value)
        )

    def _play(self) -> Play:
        """Return the best half-gap with the gear ratio that was fitted beside it."""
        corrected = None if self.diagnosis is None else self.diagnosis.play
        return corrected or Play(self.alpha, self._ratio(self.best))

    def blocks(self) -> Sequence[Block]:
        r = self.record
        encoders = "one encoder" if r.theta_l is None else "two encoders"
        title = f"{r.source}: {r.duration:g} s at {1.0 / r.step:g} Hz, {encoders}"
        title += "".join(f"; with {other.source}, {other.duration:g} s" for other in self.more)
        messages = [f"{e.method}: {e.message}" for e in self.estimates if e.message]
        doubts = [
            f"{m.method} is {m.trust.level.word}: {reason}"
            for m in self.methods
            if m.trust is not None and m.estimate is not None
            for reason in m.trust.reasons
            if reason not in m.estimate.message
        ]
        those = "records" if self.more else "record"
        missing: list[str] = []
        if self.diagnosis is not None:
            missing = [f"The model does not explain the {those}; the diagnosis:", *self.diagnosis.summary()]
        elif self.undiagnosed:
            missing = [f"The model does not explain the {those}; no diagnosis: {self.undiagnosed}"]
        methods = methods_table(title, {m.method: method_entry(m) for m in self.methods})
        unfit = [f"{m.method} does not apply: {m.reason}" for m in self.methods if m.estimate is None]
        sizes = [f"{self.best.method}: {self._play()}"] if self.estimates and self.best.visible else []
        floor = [] if self.repeats is None else [f"{in_words(self.repeats)}{_compare_diagnosis(self.estimates)}"]
        warnings = doubts_of((r, *self.more))
        planned = () if self.plan is None else self.plan.blocks()
        told = (*messages, *doubts, *unfit, *missing, *planned)
        return [*warnings, methods, *sizes, *self._friction(), *floor, *told]

    def _friction(self) -> list[str]:
        """Return the dry friction that the fit found, in a line, unless a diagnosis says it."""
        fitted = {} if not self.estimates or self.diagnosis else self.best.diagnostics.get("parameters", {})
        said = [
            f"{found['value']:.4g} N.m at the {name.split('.')[2]} (standard error {found['standard_error']:.2g})"
            for name in DRY
            if (found := fitted.get(name))
        ]
        return [f"{self.best.method}: dry friction {', '.join(said)}"] if said else []

    def results(self, place: Path | None = None) -> EstimateFound:
        entries = {m.method: method_entry(m) for m in self.methods}
        r, repeats = self.record, self.repeats
        fit = next((e for e in self.estimates if e.method == "maximum_likelihood"), None)
        best = entries[self.best.method] if self.estimates else MethodFound()
        answer = msgspec.structs.asdict(best) | {"trust": self.trust.to_result()}
        return EstimateFound(
            **answer,
            record=describe_record(r),
            estimates=entries,
            more_records=tuple(describe_record(other) for other in self.more) or None,
            repeats=None if repeats is None else RepeatsFound(repeats.sources, repeats.floor),
            method=self.best.method if self.estimates else None,
            play=self._play().to_result() if self.estimates and math.isfinite(self.alpha) else None,
            live=None if fit is None or r.n_missing or not math.isfinite(fit.alpha) else live_fitted_model(r, fit),
            diagnosis=None if self.diagnosis is None else self.diagnosis.results((place or Path()) / DIAGNOSIS),
            undiagnosed=self.undiagnosed or None,
            design=None if self.plan is None else self.plan.entries(),
            settings=as_tables(self.settings),
        )

    def write(
        self, folder: Path, place: Path, arguments: Mapping[str, Any] | None = None, pictures: bool = False
    ) -> None:
        """Write data, ``estimate.json``, ``report.html`` and the diagnosis into a folder that exists."""
        if self.diagnosis is not None:
            (folder / DIAGNOSIS).mkdir()
            self.diagnosis.write(folder / DIAGNOSIS, place / DIAGNOSIS, pictures=pictures)
        super().write(folder, place, arguments, pictures)

    def write_data(self, folder: Path) -> None:
        """Write a table of curves for each method that has some, and the plan."""
        if self.plan is not None:
            self.plan.write_data(folder)
        for estimate in self.estimates:
            if estimate.method == "ekf":
                write_tables(folder, self.record, [estimate], self.model.parameters["i"].value)
            elif estimate.method in ("maximum_likelihood", WITHOUT_TORQUE):
                write_tables(folder, self.record, [estimate], self._ratio(estimate))
        if self.diagnosis is None and self.visible_fit is not None:
            (folder / "corrected.toml").write_text(self._corrected_model(self.visible_fit), encoding="utf-8")

    @property
    def visible_fit(self) -> Estimate | None:
        """The fit of all parameters, where it shows a gap."""
        return next((e for e in self.estimates if e.method == FITTED and e.visible), None)

    @property
    def can_compensate(self) -> bool:
        """Whether `compensate` takes the fitted model."""
        if self.diagnosis is not None:
            return self.diagnosis.can_compensate
        both = self.record.theta_l is not None
        return both and self.visible_fit is not None and self.trust.level is not Level.RED

    def _corrected_model(self, fit: Estimate) -> str:
        """Return the model file of the fitted values, with their joint covariance."""
        fitted, model = fit.diagnostics["parameters"], self.model
        kept = [(n, name) for n, name in enumerate(fitted) if name in model.parameters]
        values = {name: float(fitted[name]["value"]) for _, name in kept}
        places = [n for n, _ in kept]
        covariance = fit.curves["covariance"][np.ix_(places, places)]
        half = dict(zip(values, NORMAL_95 * np.sqrt(np.diag(covariance)), strict=True))
        stated = [name for name in model.parameters if name in {*model.plant.linear, *model.stated, *values}]
        table = {name: (values.get(name, model.parameters[name].value), float(half.get(name, 0.0))) for name in stated}
        noise = fit.diagnostics["measurement_noise"]
        return model_text(model, table, describe_fit(self.record, model, "none", self.trust, noise, values, covariance))


def estimate(
    record: Record | Path | str | Sequence[Record | Path | str],
    model: Model | None = None,
    *,
    method: str | None = None,
    motor_only: bool = False,
    time_limit: float = math.inf,
    diagnose: bool = True,
    settings: EstimationSettings | Path | str | None = None,
    progress: Callable[[str, str, float], None] = lambda work, stage, share: None,
    stop: Callable[[], str] = never,
) -> EstimateResult:
    """Estimate the half-gap of a machine from a measured record.

    Args:
        record: a measured record, or its path; several of one machine are fitted together. Long files come to the
            rate of their motion; a ``Record`` stays as it is.
        model: what it is compared with (default: ``read_model()``).
        method: a key of ``METHODS``, such as "maximum_likelihood" or "ekf", or "all" (default: "maximum_likelihood",
            or "two_encoders" where a record has no torque).
        motor_only: leave the load encoder out.
        time_limit: [s], after which ``maximum_likelihood`` gives up (default: never).
        diagnose: where ``maximum_likelihood`` shows that the model does not explain the records, find what it misses
            and give the half-gap of the corrected model, one for all records. This takes some ten seconds more.
        settings: thresholds, or the path of a TOML file with those that differ from the default.
        progress: called with the piece of work (a method, or "diagnosis"), its stage, and the share that is behind.
        stop: asked again and again: a text ends ``maximum_likelihood`` with what it has, and a diagnosis without
            anything; the result says the text. An empty text lets them go on.

    Returns:
        The half-gap with standard error and interval, and what each method says.

    Raises:
        RecordError: the record is wrong, or does not fit the model at all.
        ScenarioError: there is no such method, or the model has effects that estimators would not see.
        ConvergenceError: a method finds no solution, or not within the time limit.

    Examples:
        >>> gap = oc.estimate("machine.csv", oc.read_model("machine.toml"))
        >>> gap.interval[0] < gap.alpha < gap.interval[1]
        True
    """
    model = read_model(None) if model is None else model
    chosen = choose_settings(settings, EstimationSettings)
    if method is not None and method != "all" and method not in METHODS:
        raise ScenarioError(f"`method` must be one of {', '.join(METHODS)}, all, but is {method!r}", "method")
    require_linear(model)
    given_records = [record] if isinstance(record, (Record, Path, str)) else list(record)
    if not given_records:
        raise ScenarioError("`record` must be at least one record, but is none", "record")
    measured, *more = plausible_records(given_records, model, motor_only)
    if any((other.theta_l is None) != (measured.theta_l is None) for other in more):
        raise ScenarioError("`record` must be records with the same encoders, or `motor_only`", "record", "motor_only")
    method = method or default_method([measured, *more])
    options = {"time_limit": time_limit, "settings": chosen, "stop": stop}
    found: list[MethodResult] = []
    for name in METHODS if method == "all" else (method,):
        begun = time.perf_counter()
        try:
            with numeric_errors(f"{measured.source}: `{name}` finds no solution for this record"):
                progress(name, name.replace("_", " "), 0.0)
                fitted = apply_method(name, [measured, *more], model, options | {"report": partial(progress, name)})
                bound = error_bound(measured, model, [*(m.estimate for m in found if m.estimate is not None), fitted])
        except NotApplicableError as error:
            found.append(MethodResult(name, None, math.inf, time.perf_counter() - begun, str(error)))
        else:
            found.append(MethodResult(name, fitted, bound, time.perf_counter() - begun))
    trust = trust_of_estimates([m.estimate for m in found if m.estimate is not None], model, chosen.trust)
    judged = tuple(replace(m, trust=trust.get(m.method)) for m in found)
    given = {"record": measured.source, "model": model.source, "method": method, "motor_only": motor_only}
    missing, why = None, ""
    if diagnose and _is_unexplained(judged):
        progress(DIAGNOSIS, "diagnosing", 0.0)
        missing, why = _try_diagnosis([measured, *more], model, partial(progress, DIAGNOSIS), stop)
    first: tuple[MethodResult, ...] = ()
    if missing is not None and missing.gap is not None:
        first = (MethodResult(DIAGNOSIS, missing.gap, math.inf, missing.seconds, trust=missing.trust),)
    methods, repeats = (*first, *judged), repeats_of([measured, *more])
    return EstimateResult(measured, model, methods, missing, tuple(more), repeats, chosen, why, arguments=given)


def _compare_diagnosis(estimates: Sequence[Estimate]) -> str:
    """Return the encoders' noise as the likelihood fitted it, to be read beside the floor of repeats."""
    noise = next((e.diagnostics["measurement_noise"] for e in estimates if e.method == FITTED), None)
    return "" if noise is None else f"; the encoders' noise as fitted: {' and '.join(f'{x:.3g}' for x in noise)} rad"


def _is_unexplained(methods: Sequence[MethodResult]) -> bool:
    """Return whether the fit of all parameters shows that the model does not explain the record."""
    fit = next((m for m in methods if m.method == FITTED and m.estimate is not None), None)
    if fit is None or fit.estimate is None or fit.trust is None:
        return False
    return bool(fit.estimate.diagnostics["lacking"]) or fit.trust.level is Level.RED


def _try_diagnosis(
    records: Sequence[Record], model: Model, report: Callable[[str, float], None], stop: Stop
) -> "tuple[orchestrator.DiagnosisResult | None, str]":
    """Return what the model misses; or None, and why these records cannot be diagnosed."""

    def progress(done: int, most: int, what: str) -> None:
        report(f"fitted {what}", done / most if most else 0.0)
        ask()

    def ask() -> None:
        if why := stop():
            raise StoppedError(f"it was ended before it was done ({why})")

    try:
        ask()
        return orchestrator.diagnose(records, model, progress=progress), ""
    except (InputError, ConvergenceError) as error:
        return None, str(error)
    except KeyboardInterrupt:
        if not stop():
            raise
        return None, stop()
