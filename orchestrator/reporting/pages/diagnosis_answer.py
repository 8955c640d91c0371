"""What a page of a diagnosis says first: what is missing, how sure, how large, what it is worth, what to do next."""

from collections.abc import Mapping, Sequence

from orchestrator.effects.words import place_words
from orchestrator.reporting.model import Plot, Section, Series, Span, Text
from orchestrator.reporting.pages.diagnosis_tables import label_words
from orchestrator.reporting.quantities import interval_words
from orchestrator.reporting.source import words
from orchestrator.shared.arrays import Array
from orchestrator.shared.results.diagnose import EffectFound, NuisanceFound, SignalMisfitFound, TestFound, ValueFound
from orchestrator.shared.results.fields import Cell, ReportTable, TableColumn

SIGNALS = {"theta_m": "motor angle", "theta_l": "load angle"}
SIZES = {"alpha": "half-gap"}
NEXT = "Next"
AS_GIVEN, CORRECTED = "model as given", "corrected model"


def headline(summary: Sequence[str]) -> str:
    """Return the verdict's sentence out of a summary, without the verdict's word; empty where there is none."""
    return summary[0].partition(". ")[2] if summary else ""


def answer_table(
    effects: Sequence[EffectFound], tests: Sequence[TestFound], nuisances: Sequence[NuisanceFound] = ()
) -> list[Section]:
    """Return a table of what is missing, how sure and how large, above it how far the misfit goes down."""
    rows: list[tuple[Cell, ...]] = [
        (
            place_words(e.name, e.site), e.grade, _sizes(e.parameters),
            ", ".join(label_words(label) for label in e.family) or "none",
        )
        for e in effects
    ]  # fmt: skip
    rows += [(f"{words(n.name)} (in the log)", n.grade, _sizes(n.parameters), None) for n in nuisances]
    columns = tuple(TableColumn(name) for name in ("effect", "how sure", "how large", "not told apart from"))
    said = _misfits(tests)
    if not rows:
        return [Text("Misfit on test data", (said,))] if said else []
    return [ReportTable("What is missing", columns, tuple(rows), said)]


def _misfits(tests: Sequence[TestFound]) -> str:
    """Return how far the misfit on test data goes down, in sentences."""
    said = [_misfit_sentence(signal, one) for signal, one in tests[0].misfit.items()] if tests else []
    said += ["The corrected model does worse than re-fitted parameters."] if tests and tests[0].worse else []
    return " ".join(filter(None, said))


def worth_on_test_data(
    tests: Sequence[TestFound], table: Mapping[str, Array], runs: tuple[str, str], restarts: Sequence[int] = ()
) -> list[Section]:
    """Return what the corrected model is worth: the misfit of the signal that it betters most, over the test time.

    Args:
        tests: misfits on test data; the first is that of ``table``.
        table: ``time`` [s], measured signals, and simulated ones by the endings of their names.
        runs: endings of the columns of the model as given and of the corrected one.
        restarts: rows from which free runs start anew.
    """
    if not tests or not tests[0].misfit:
        return []
    name, misfit = max(tests[0].misfit.items(), key=lambda item: _share(item[1]))
    columns = [f"{name}_{ending}" for ending in runs]
    if "time" not in table or name not in table or not any(column in table for column in columns):
        return []
    time = table["time"]
    series = tuple(
        Series(label, time, table[column] - table[name])
        for label, column in zip((AS_GIVEN, CORRECTED), columns, strict=True)
        if column in table
    )
    moments = tuple(Span(float(time[row]), float(time[row]), "free run starts anew") for row in restarts)
    label = f"error of the {SIGNALS.get(name, name)} [{misfit.unit or '1'}]"
    return [Plot("What the corrected model is worth on test data", "time [s]", label, series, moments)]


def next_steps(summary: Sequence[str], more: str = "") -> list[Section]:
    """Return what to do next, as the summary says it."""
    steps = [line.strip().removeprefix(NEXT).lstrip(":, ") for line in summary if line.strip().startswith(NEXT)]
    lines = tuple(f"{step[:1].upper()}{step[1:]}" for step in steps) + ((more,) if more else ())
    return [Text("What to do next", lines)] if lines else []


def in_words(summary: Sequence[str]) -> list[Section]:
    """Return the rest of a summary."""
    lines = tuple(line.strip() for line in summary[1:] if not line.strip().startswith(NEXT))
    return [Text("In words", lines)] if lines else []


def quantity(p: ValueFound) -> str:
    """Return a value with its interval and unit."""
    if p.value is None:
        return "unknown"
    unit = "" if p.unit in (None, "1") else f" {p.unit}"
    low, high = p.interval or (None, None)
    if low is not None and high is not None:
        value, lower, upper = interval_words(p.value, low, high)
        return f"{value}{unit} (95 %: {lower} to {upper})"
    error = f" ± {p.standard_error:.2g}" if p.standard_error is not None else ""
    return f"{p.value:.5g}{error}{unit}"


def _sizes(parameters: Mapping[str, ValueFound]) -> str:
    return "; ".join(f"{SIZES.get(name, words(name))} {quantity(p)}" for name, p in parameters.items())


def _share(misfit: SignalMisfitFound) -> float:
    """Return how many times smaller the misfit has become."""
    return 0.0 if misfit.nominal is None or not misfit.final else misfit.nominal / misfit.final


def _misfit_sentence(signal: str, g: SignalMisfitFound) -> str:
    if g.nominal is None or g.final is None:
        return ""
    unit = "" if g.unit in (None, "1") else f" {g.unit}"
    ratio = _share(g)
    times = f", {f'{ratio:.0f}' if ratio >= 10.0 else f'{ratio:.2g}'} times less" if ratio > 1.05 else ""
    noise = f"; the noise is {g.noise:.3g}{unit}" if g.noise is not None else ""
    name = SIGNALS.get(signal, signal)
    return f"The rms misfit of the {name} goes from {g.nominal:.3g} to {g.final:.3g}{unit}{times}{noise}."
