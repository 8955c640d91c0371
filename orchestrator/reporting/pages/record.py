"""Plots of measured and simulated signals that several pages share."""

from collections.abc import Mapping

from orchestrator.reporting.model import Cell, Plot, Section, Series
from orchestrator.reporting.source import Source, numbers, words

UNITS = {"theta_m": "rad", "theta_l": "rad", "omega_m": "rad/s", "omega_l": "rad/s", "u": "N.m", "T_m": "N.m"}


def record_plots(source: Source, name: str) -> list[Section]:
    """Return one plot against ``time`` for each group of columns that share a first word, ``theta_m_before`` and so on.

    Returns an empty list where there is no such file, or no column ``time``.
    """
    table = source.columns(name)
    if "time" not in table:
        return []
    time = numbers(table["time"])
    return [
        Plot(words(signal), "time [s]", f"{signal} [{UNITS[signal]}]", _series(signal, time, table))
        for signal in UNITS
        if any(_belongs(column, signal) for column in table)
    ]


def _belongs(column: str, signal: str) -> bool:
    return column == signal or column.startswith(f"{signal}_")


def _series(signal: str, time: list[float | None], table: Mapping[str, list[Cell]]) -> tuple[Series, ...]:
    return tuple(
        Series(column.removeprefix(signal).strip("_").replace("_", " ") or "measured", time, numbers(values))
        for column, values in table.items()
        if _belongs(column, signal)
    )
