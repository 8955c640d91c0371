"""Plots of measured and simulated signals that several pages share."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from orchestrator.reporting.model import Kind, Plot, Section, Series, Span
from orchestrator.reporting.source import ResultDocument
from orchestrator.shared.arrays import Array

SIGNALS = {
    "theta_m": ("Motor angle", "rad"),
    "theta_l": ("Load angle", "rad"),
    "omega_m": ("Motor speed", "rad/s"),
    "omega_l": ("Load speed", "rad/s"),
    "twist": ("Twist of the shaft", "rad"),
    "u": ("Requested torque", "N.m"),
    "T_m": ("Motor torque", "N.m"),
}
# The same of an axis that moves in metres.
METRIC = {"rad": "m", "rad/s": "m/s", "N.m": "N", "angle": "position", "torque": "force", "Twist": "Stretch"}
GIVEN = {"u": "requested"}  # what is not measured
RUNS = {  # endings of the columns of simulations
    "fitted": "fitted",
    "before": "model as given",
    "nominal": "model as given",
    "refitted": "with re-fitted parameters",
    "after": "corrected model",
    "corrected": "corrected model",
}
HELD = frozenset({"u"})  # from sample to sample
ERRORS = {"one_step_error_m": "motor encoder", "one_step_error_l": "load encoder"}
MOST_SPANS = 1000
Table = Mapping[str, Array]


def metric_words(text: str, metric: bool) -> str:
    """Return a title or a unit as it is for an axis that moves in metres, where it does."""
    return " ".join(METRIC.get(word, word) for word in text.split()) if metric else text


def signal_plots(
    table: Table, restarts: Sequence[int] = (), metric: bool = False,
    signals: Mapping[str, tuple[str, str]] = SIGNALS, shaded: tuple[Span, ...] = (),
) -> Iterator[Plot]:  # fmt: skip
    """Yield plots against ``time`` of measured columns (``theta_m``) and simulated ones (``theta_m_after``).

    For each signal with simulated columns a plot of simulated minus measured comes first. None without a column
    ``time``. ``metric``: the axis moves in metres. ``signals``: title and unit by column.
    """
    if "time" not in table:
        return
    time = table["time"]
    moments = tuple(Span(float(t), float(t), "free run starts anew") for t in time[list(restarts)] if np.isfinite(t))
    spans = out_of_contact(time, table["contact"]) if "contact" in table else ()
    note = "Shaded: the teeth are not in contact." if spans else ""
    for signal, shown in signals.items():
        title, unit = (metric_words(text, metric) for text in shown)
        simulated = {name: table[f"{signal}_{run}"] for run, name in RUNS.items() if f"{signal}_{run}" in table}
        measured = table.get(signal)
        found = ({GIVEN.get(signal, "measured"): measured} if measured is not None else {}) | simulated
        if measured is not None and simulated:
            gaps = tuple(Series(name, time, values - measured) for name, values in simulated.items())
            yield Plot(
                f"{title}: simulated minus measured", "time [s]", f"difference [{unit}]", gaps, (*shaded, *moments)
            )
        if found:
            kind: Kind = "steps" if signal in HELD else "line"
            curves = tuple(Series(name, time, values, kind) for name, values in found.items())
            label = title if signal in ("twist", title) else f"{title.lower()} {signal}"
            marked = (*shaded, *spans, *(moments if simulated else ()))
            yield Plot(title, "time [s]", f"{label} [{unit}]", curves, marked, note=note)


def measured_and_fitted(source: ResultDocument, name: str) -> list[Section]:
    """Return the plots of a file's signals, and what is left of each encoder one sample ahead where the file has it."""
    table = source.signals(name)
    curves = tuple(Series(label, table["time"], table[name]) for name, label in ERRORS.items() if name in table)
    note = "Measured minus predicted one sample ahead: noise when the model is right."
    errors = [Plot("One-step errors", "time [s]", "error [rad]", curves, note=note)] if curves else []
    return [*signal_plots(table), *errors]


def out_of_contact(time: Array, contact: Array) -> tuple[Span, ...]:
    """Return the spans of time in which ``contact`` is zero: the teeth do not touch. At most ``MOST_SPANS``.

    ``time``: (n,) [s]; NaN: unknown. ``contact``: (n,) flank of each sample, 0 inside the gap.

    Returns:
        Begin and end of each span [s].
    """
    known = np.isfinite(time)
    time, free = time[known], contact[known] == 0.0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], free, [False]]).astype(np.int8)))
    spans = [
        Span(float(time[first]), float(time[min(last, time.size - 1)]), "not in contact")
        for first, last in zip(edges[::2], edges[1::2], strict=True)
    ]
    return tuple(spans[:MOST_SPANS])
