"""Plots of measured and simulated signals that several pages share."""

from collections.abc import Iterator, Mapping, Sequence

from orchestrator.reporting.model import Cell, Plot, Section, Series, Span
from orchestrator.reporting.source import ResultDocument, numbers

SIGNALS = {
    "theta_m": ("Motor angle", "rad"),
    "theta_l": ("Load angle", "rad"),
    "omega_m": ("Motor speed", "rad/s"),
    "omega_l": ("Load speed", "rad/s"),
    "twist": ("Twist of the shaft", "rad"),
    "u": ("Requested torque", "N.m"),
    "T_m": ("Motor torque", "N.m"),
}
GIVEN = {"u": "requested"}  # what is not measured
MOST_SPANS = 1000
Table = Mapping[str, list[Cell]]
Numbers = Sequence[float | None]


def record_plots(source: ResultDocument, name: str, restarts: Sequence[int] = ()) -> list[Section]:
    """Return plots against ``time`` of a file with measured columns (``theta_m``) and simulated (``theta_m_after``).

    For each signal with simulated columns a plot of simulated minus measured comes first. Empty where there is no
    such file, or no column ``time``.
    """
    table = source.columns(name)
    return list(_plots(table, restarts)) if "time" in table else []


def _plots(table: Table, restarts: Sequence[int]) -> Iterator[Plot]:
    time = numbers(table["time"])
    moments = tuple(Span(t, t, "free run starts anew") for t in (time[row] for row in restarts) if t is not None)
    spans = out_of_contact(time, numbers(table["contact"])) if "contact" in table else ()
    note = "Shaded: the teeth are not in contact." if spans else ""
    for signal, (title, unit) in SIGNALS.items():
        simulated = {_words(c, signal): numbers(v) for c, v in table.items() if c.startswith(f"{signal}_")}
        measured = numbers(table[signal]) if signal in table else None
        found = ({GIVEN.get(signal, "measured"): measured} if measured is not None else {}) | simulated
        if measured is not None and simulated:
            gaps = tuple(Series(name, time, _difference(values, measured)) for name, values in simulated.items())
            yield Plot(f"{title}: simulated minus measured", "time [s]", f"difference [{unit}]", gaps, moments)
        if found:
            curves = tuple(Series(name, time, values) for name, values in found.items())
            yield Plot(
                title, "time [s]", f"{signal} [{unit}]", curves, (*spans, *(moments if simulated else ())), note=note
            )


def _words(column: str, signal: str) -> str:
    return column.removeprefix(f"{signal}_").replace("_", " ")


def _difference(values: Numbers, measured: Numbers) -> list[float | None]:
    return [None if a is None or b is None else a - b for a, b in zip(values, measured, strict=True)]


def out_of_contact(time: Sequence[float | None], contact: Sequence[float | None]) -> tuple[Span, ...]:
    """Return the spans of time in which ``contact`` is zero: the teeth do not touch. At most ``MOST_SPANS``.

    Args:
        time: (n,) [s]; None: unknown.
        contact: (n,) flank of each sample, 0 inside the gap.

    Returns:
        Begin and end of each span [s].
    """
    spans, start = [], None
    for t, c in zip(time, contact, strict=True):
        if t is None:
            continue
        if c == 0.0 and start is None:
            start = t
        elif c != 0.0 and start is not None:
            spans.append(Span(start, t, "not in contact"))
            start = None
    if start is not None and time[-1] is not None:
        spans.append(Span(start, time[-1], "not in contact"))
    return tuple(spans[:MOST_SPANS])
