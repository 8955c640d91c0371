"""What a model misses, from a measured record."""

import itertools
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from orchestrator.api.diagnosed import DiagnosisResult
from orchestrator.api.numerics import numeric_errors
from orchestrator.api.records import records_to_fit
from orchestrator.diagnosis import diagnose as diagnosing
from orchestrator.diagnosis.data.records import check_record
from orchestrator.diagnosis.report.misfit_on_test_data import misfit_on_record
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.errors import ScenarioError
from orchestrator.estimation.zeros import set_zeros
from orchestrator.records.model_file import Model, read_model
from orchestrator.records.plausibility import check_plausible
from orchestrator.records.record import Record
from orchestrator.shared.settings import choose_settings

if TYPE_CHECKING:
    from orchestrator.api.any_fmu import FmuDiagnosisResult


@overload
def diagnose(
    record: Record | Path | str | Sequence[Record | Path | str],
    model: Model | Path | str | None = None,
    *,
    validate: Record | Path | str | None = None,
    test: Record | Path | str | None = None,
    settings: DiagnosisSettings | Path | str | None = None,
    search: bool = True,
    effects: Sequence[str] | None = None,
    time_limit: float | None = None,
    progress: Callable[[int, int, str], None] = lambda done, expected, what: None,
) -> DiagnosisResult:
    """Of a model of ours."""


@overload
def diagnose(
    record: Path | str | Sequence[Path | str],
    model: Path | str,
    map: Path | str,
    *,
    validate: Path | str | None = None,
    test: Path | str | None = None,
    settings: DiagnosisSettings | Path | str | None = None,
    search: bool = True,
    effects: Sequence[str] | None = None,
    time_limit: float | None = None,
    progress: Callable[[int, int, str], None] = lambda done, expected, what: None,
) -> "FmuDiagnosisResult":
    """Of an FMU of others."""


def diagnose(
    record: Record | Path | str | Sequence[Record | Path | str],
    model: Model | Path | str | None = None,
    map: Path | str | None = None,  # noqa: A002 - as on the command line
    *,
    validate: Record | Path | str | None = None,
    test: Record | Path | str | None = None,
    settings: DiagnosisSettings | Path | str | None = None,
    search: bool = True,
    effects: Sequence[str] | None = None,
    time_limit: float | None = None,
    progress: Callable[[int, int, str], None] = lambda done, expected, what: None,
) -> "DiagnosisResult | FmuDiagnosisResult":
    """Find out which effects a model misses, with a grade for each, and test it on data that nothing was fitted to.

    Args:
        record: a measured record, or its path; one encoder or two, at least 200 rows. Or several of one machine, which
            then share parameters and effects. Long files come to the rate of their motion.
        model: what it is compared with (default: ``read_model()``), or the path of its TOML file, or the path of any
            co-simulation FMU of FMI 2.0 or 3.0.
        map: with an FMU, the TOML file of columns, uncertain parameters and ports; it runs in a child process.
        validate: another record, or its path, on which the misfit is shown too.
        test: a record, or its path, that is test data as a whole; None: the last part of each record is.
        settings: thresholds, or the path of a TOML file with those that differ from the default.
        search: False: the model is re-fitted and judged as it stands, no effect is looked for.
        effects: labels (``name@site``) of exactly the effects that the fitted model has, whatever they gain; none is
            looked for. Those of the model file that are not among them are left out. None: they are looked for.
        time_limit: seconds after which the search ends with what it has; None: none.
        progress: called with (fits done, 0, what was fitted).

    Returns:
        Verdict, graded effects with intervals, the misfit on test data, and the corrected model.

    Raises:
        RecordError: a record is wrong, nothing moves in it, or nothing drives.
        ScenarioError: the model cannot be compared with this record.
        ConvergenceError: no model can be fitted.
        InputError: the FMU or its map cannot be used.
        SimulationError: the FMU fails again and again.

    Examples:
        >>> found = oc.diagnose("machine.csv", oc.read_model("machine.toml"))
        >>> found.verdict, sorted(effect.name for effect in found.effects)
        ('effects', ['backlash', 'coulomb_friction'])
        >>> oc.diagnose("axis.csv", "axis.fmu", "axis_map.toml").effects[0].name
        'coulomb_friction'
    """
    if effects is not None and not search:
        raise ScenarioError("`effects` must be left out without a search: the given model is then judged", "effects")
    if map is None and isinstance(model, (Path, str)) and Path(model).suffix == ".toml":
        model = read_model(Path(model))
    if map is not None or isinstance(model, (Path, str)):
        options = {"validate": validate, "test": test, "settings": settings, "search": search, "effects": effects,
                   "time_limit": time_limit}  # fmt: skip
        return _of_an_fmu(record, model, map, options, progress)
    model = read_model(None) if model is None else model
    chosen = choose_settings(settings, DiagnosisSettings)
    records = [record] if isinstance(record, (Record, Path, str)) else list(record)
    if not records:
        raise ScenarioError("`record` must be at least one record, but is empty", "record")
    measured, *more = comparable_records(records, model)
    (other,) = (None,) if validate is None else comparable_records([validate], model)
    (tested,) = (None,) if test is None else comparable_records([test], model)
    begun, fits = time.monotonic(), itertools.count(1)
    with numeric_errors(f"{measured.source}: no model can be fitted to this record"):
        found = diagnosing.diagnose(
            [measured, *more], model, chosen, test=tested, search=search, effects=effects, time_limit=time_limit,
            progress=lambda what: progress(next(fits), 0, what),
        )  # fmt: skip
        validated = None if other is None else misfit_on_record(found, other)
    given = {
        "record": measured.source, "model": model.source, "validate": None if other is None else other.source,
        "test": None if tested is None else tested.source,
    }  # fmt: skip
    seconds = time.monotonic() - begun
    return DiagnosisResult(found, measured, validated, seconds, tuple(more), arguments=given)


def _of_an_fmu(
    record: Any, fmu: Any, given: Path | str | None, options: dict[str, Any], progress: Callable[[int, int, str], None]
) -> "FmuDiagnosisResult":
    """Return what records say of an FMU, its arguments checked."""
    if not isinstance(fmu, (Path, str)) or given is None:
        raise ScenarioError("`map` must come with the path of an FMU as `model`, and the path with a `map`", "map")
    several = isinstance(record, Sequence) and not isinstance(record, str)
    records = list(record) if several else [record]
    others = [options[name] for name in ("validate", "test") if options[name] is not None]
    if not records or not all(isinstance(path, (Path, str)) for path in (*records, *others)):
        raise ScenarioError(
            "`record`, `validate` and `test` must be paths with an FMU, but are not", "record", "validate", "test"
        )
    from orchestrator.api.any_fmu import diagnose_fmu  # which takes its time to import

    done = itertools.count()
    return diagnose_fmu(records, fmu, given, progress=lambda what: progress(next(done), 0, what), **options)


def comparable_records(given: Sequence[Record | Path | str], model: Model, **reading: Any) -> list[Record]:
    """Return records that the model can be compared with."""
    records = [set_zeros(record, model) for record in records_to_fit(given, model, holes=True, **reading)]
    for record in records:
        check_record(record)
        check_plausible(max(record.parts_between_holes(), key=lambda part: part.size), model)
    return records
