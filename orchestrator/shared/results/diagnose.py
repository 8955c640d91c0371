"""What ``diagnose.json`` holds of a model of ours; section "JSON" of docs/diagnosis.md says what each word means."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import msgspec

from orchestrator.shared.results import Interval, LiveFound, ResultData, Sizes, TrustFound
from orchestrator.shared.results.fields import Display, ReportTable, TableColumn, displays, fields_table


class ValueFound(msgspec.Struct, frozen=True):
    """A value with its standard error and 95 % interval, in ``unit``."""

    value: float | None
    standard_error: float | None = None
    interval: Interval | None = None
    unit: str | None = None


class ParameterFound(msgspec.Struct, frozen=True):
    """The same of a parameter of the model, beside its nominal value."""

    nominal: Annotated[float | None, Display("nominal", digits=6)] = None
    value: Annotated[float | None, Display("value", digits=6)] = None
    standard_error: Annotated[float | None, Display("standard error", digits=3)] = None
    interval: Annotated[Interval | None, Display("95 % from", digits=6, to="to")] = None
    unit: Annotated[str | None, Display("unit")] = None


class ExplainedFound(msgspec.Struct, frozen=True):
    """Shares that an effect explains: of the missing torque, of the motion's misfit and of the torque on test data."""

    torque: float | None = None
    motion: float | None = None
    test_torque: float | None = None


class MissingTorqueFound(msgspec.Struct, frozen=True):
    """The torque that is missing without an effect, over the signal that its law follows, and what of it is the law's.

    ``spread`` is the standard deviation within bins of the signal, None over the time. None within: a wide gap.
    """

    x_label: str
    y_label: str
    x: tuple[float | None, ...]
    missing: tuple[float | None, ...]
    law: tuple[float | None, ...]
    spread: tuple[float | None, ...] | None = None


class EffectFound(msgspec.Struct, frozen=True):
    """An effect that the model lacks.

    ``grade`` is certain, likely or possible; ``lowered_by`` names the rules that lowered it. ``gain`` is the share of
    the squared error of blocks left out that it takes, ``t`` that gain over its standard error. ``family`` are
    effects that this record does not tell from it, ``block_values`` what each block by itself says of a parameter.
    ``in_model``: the corrected model has it. ``missing_torque``: what its figure shows.
    """

    name: str
    site: str
    grade: str
    parameters: dict[str, ValueFound]
    explains: ExplainedFound = ExplainedFound()
    gain: float | None = None
    t: float | None = None
    family: tuple[str, ...] = ()
    lowered_by: tuple[str, ...] = ()
    block_values: dict[str, tuple[float | None, ...]] = {}
    in_model: bool = True
    missing_torque: MissingTorqueFound | None = None


class NuisanceFound(msgspec.Struct, frozen=True):
    """A property of the log."""

    name: str
    grade: str
    parameters: dict[str, ValueFound]


class SignalMisfitFound(msgspec.Struct, frozen=True):
    """Rms of free runs against one signal: of the model as given, re-fitted, and with its effects."""

    nominal: Annotated[float | None, Display("model as given")]
    parameters: Annotated[float | None, Display("with re-fitted parameters")]
    final: Annotated[float | None, Display("with the effects")]
    noise: Annotated[float | None, Display("noise")]
    unit: Annotated[str, Display("unit")]


class TestFound(msgspec.Struct, frozen=True):
    """Test data of one record: the misfit of each signal, and whether the final model does worse than re-fitted values.

    ``r_squared`` is of the final model's free runs; ``torque_left`` the share of torque that each of the three models
    leaves.
    """

    __test__ = False

    source: str
    rows: int
    misfit: dict[str, SignalMisfitFound]
    worse: bool
    r_squared: dict[str, float | None] = {}
    torque_left: dict[str, float | None] = {}


TEST = "Root mean square of free runs minus measured, on data that nothing was fitted to and nothing was chosen by."


def misfit_table(title: str, test: TestFound, signals: Mapping[str, str] | None = None) -> ReportTable:
    """Return the misfit of each signal on test data, from model to model. ``signals``: words for their names."""
    worse = " The final model does worse than re-fitted parameters." if test.worse else ""
    named = {(signals or {}).get(name, name): misfit for name, misfit in test.misfit.items()}
    table = fields_table(title, named, f"{TEST} {test.rows} rows.{worse}", "signal", SignalMisfitFound)
    return table.with_column(TableColumn("R² of the free runs"), [test.r_squared.get(name) for name in test.misfit])


def misfit_tables(
    tests: Sequence[TestFound], other: TestFound | None = None, signals: Mapping[str, str] | None = None
) -> list[ReportTable]:
    """Return the misfit of each test and on another record, without what no signal has."""
    titled = [(f"Misfit on test data of {test.source}", test) for test in tests]
    titled += [] if other is None else [(f"Misfit on the other record, {other.source}", other)]
    return [misfit_table(title, test, signals).without_empty_columns() for title, test in titled]


def torque_tables(tests: Sequence[TestFound]) -> list[ReportTable]:
    """Return the share of the torque that each model leaves; nothing where it is not known."""
    titles = [display.label for display in list(displays(SignalMisfitFound).values())[:3]]
    columns = (TableColumn("on"), *(TableColumn(title, "%") for title in titles))
    names = ("nominal", "parameters", "final")
    rows = tuple((t.source, *(percent(t.torque_left.get(name)) for name in names)) for t in tests if t.torque_left)
    note = "Rms of the torque that the measured motion needs and the model does not explain, over that of the drive."
    return [ReportTable("Torque that is left", columns, rows, note)] if rows else []


def percent(share: float | None) -> float | None:
    """Return a share in percent; None where it is not known."""
    return None if share is None else 100.0 * share


TAKES = "error on blocks left out that it removes"


class DependenceFound(msgspec.Struct, frozen=True):
    """What is left follows a signal: its share, its gain on blocks left out with the paired error, and a formula."""

    site: Annotated[str, Display("at")]
    argument: Annotated[str, Display("follows")]
    share: Annotated[float | None, Display("share", "%", 3, factor=100.0)]
    gain: Annotated[float | None, Display(TAKES, "%", 3, factor=100.0)]
    t: Annotated[float | None, Display("over its uncertainty", digits=3)]
    formula: Annotated[str, Display("like")] = ""


class RemainingFound(msgspec.Struct, frozen=True):
    """What no effect explains: the share of the torque's power that is left by body, and what it follows."""

    torque: dict[str, float | None] = {}
    follows: tuple[DependenceFound, ...] = ()


class LearnedFound(msgspec.Struct, frozen=True):
    """A learned law: knots and values with the 95 % band (its low and its high ends), and what it is worth.

    ``gain`` is the share of the squared error of blocks left out that it takes.
    """

    site: str
    argument: str
    argument_unit: str
    unit: str
    words: str
    knots: tuple[float, ...]
    values: tuple[float | None, ...]
    band: tuple[tuple[float | None, ...], tuple[float | None, ...]]
    formula: str
    gain: float | None
    t: float | None


class AnalysisFound(msgspec.Struct, frozen=True):
    """A record as it was analysed: rate [Hz], rows, rows of the file for each, and the band of each body [Hz]."""

    source: Annotated[str, Display("record")]
    rate: Annotated[float, Display("rate", "Hz")]
    rows: Annotated[int, Display("rows")]
    rows_of_the_file: Annotated[int, Display("rows of the file for each")]
    band: Annotated[dict[str, float], Display("band", "Hz", 3)]


class TriedFound(msgspec.Struct, frozen=True):
    """An effect that was tried: its gain on blocks left out, and that gain over its standard error."""

    effect: str
    gain: float | None
    t: float | None


class StepFound(msgspec.Struct, frozen=True):
    """A step of the search: the effects before it, the one that was taken ("": none), and all that were tried."""

    on_top_of: tuple[str, ...]
    taken: str
    tried: tuple[TriedFound, ...]


class LibraryFound(msgspec.Struct, frozen=True):
    """An effect that the record can show, in words, and whether the corrected model has it."""

    words: str
    in_model: bool


class DifferenceFound(msgspec.Struct, frozen=True):
    """The corrected FMU against the compiled equations."""

    largest_difference_from_compiled: float | None = None
    unit: str = ""


class AnyDiagnosisFound(ResultData, frozen=True, kw_only=True):
    """What any diagnosis says; ``library``: by label (``name@site``) each effect that the record can show."""

    verdict: str
    trust: TrustFound | None = None
    effects: tuple[EffectFound, ...] = ()
    parameters: dict[str, ParameterFound] = msgspec.field(default_factory=dict)
    test: tuple[TestFound, ...] = ()
    validation: TestFound | None = None
    notes: tuple[str, ...] = ()
    settings: dict[str, Any] = msgspec.field(default_factory=dict)
    candidates: tuple[StepFound, ...] = ()
    library: dict[str, LibraryFound] = msgspec.field(default_factory=dict)
    model: str | None = None
    summary: tuple[str, ...] = ()
    seconds: float | None = None


class DiagnoseFound(AnyDiagnosisFound, frozen=True, kw_only=True):
    """``diagnose``: graded effects, the corrected model, what is left, and how it was found."""

    schema_version: int = 4
    play: Sizes | None = None
    nuisances: tuple[NuisanceFound, ...] = ()
    remaining: RemainingFound = RemainingFound()
    learned_law: LearnedFound | None = None
    analysis: tuple[AnalysisFound, ...] = ()
    cosimulation: DifferenceFound = DifferenceFound()
    live: LiveFound | None = None
    angle_unit: str = "rad"
