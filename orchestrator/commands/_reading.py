"""The options with which every command reads measured records."""

import argparse
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orchestrator.errors import ScenarioError
from orchestrator.records.words import RESAMPLING

if TYPE_CHECKING:
    from orchestrator.records.record import Record

FORMATS = "CSV of any dialect, Parquet, MDF, MAT or NumPy"
RATES = (1.0, 1e6)  # Hz
FOR_FITS = "the rate that the motion needs, in records of 40,000 rows or more"


def add_reading_arguments(parser: argparse.ArgumentParser, usual: str, rate_too: str = "") -> None:
    """Add the options; ``usual``: what is read without ``--rate``, ``rate_too``: what else it means to the command."""
    group = parser.add_argument_group("reading of records")
    group.add_argument("--part", metavar="START:END", help="keep this part of each record [s], from its first row on")
    text = "if times are not uniform: treat the samples as uniform, or interpolate (default: decide by the motion)"
    group.add_argument("--resample", choices=RESAMPLING, help=text)
    text = "line of a text file with the column names; 0: none (default: detected)"
    group.add_argument("--header", type=int, metavar="LINE", help=text)
    text = f"reduce to this sample rate with an anti-alias filter (default: {usual})"
    group.add_argument("--rate", type=float, metavar="HZ", help=f"{text}{rate_too}")


def add_settings_argument(parser: argparse.ArgumentParser) -> None:
    """Add ``--settings``."""
    parser.add_argument(
        "--settings", type=Path, metavar="FILE.toml", help="changed thresholds, in the groups of the result"
    )


def reading_of(args: argparse.Namespace) -> dict[str, Any]:
    """Return the options by the names that ``read_record`` has for them."""
    if args.rate is not None and not RATES[0] <= args.rate <= RATES[1]:
        raise ScenarioError(f"`rate` must be between {RATES[0]:g} and {RATES[1]:g}, but is {args.rate:g}", "rate")
    if args.header is not None and args.header < 0:
        raise ScenarioError(f"`header` must be a line from 1 on, or 0, but is {args.header}", "header")
    return {"part": _part(args.part), "resample": args.resample, "rate": args.rate, "header": args.header}


def what_was_read(records: "Iterable[Record]") -> list[str]:
    """Return one line for each record that says what was detected and assumed."""
    return [f"{record.source}: {'; '.join(record.notes)}" for record in records if record.notes]


def tell_rates(records: "Iterable[Record]", asked: float | None) -> None:
    """Say before a fit which records come down to the rate of their motion, where no rate was asked for."""
    for record in records:
        if asked is None and record.averaged > 1:
            rate, whole = 1.0 / record.step, record.averaged / record.step
            said = f"{record.source}: {record.size} rows at {rate:.6g} Hz of {whole:.6g} Hz are fitted: the motion"
            sys.stderr.write(f"{said} shows no more; `--rate {whole:.6g}` takes all\n")


def _part(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    first, colon, last = text.partition(":")
    try:
        start, end = float(first or "0"), float(last or "inf")
    except ValueError:
        start, end = 1.0, 0.0
    if not colon or not 0.0 <= start < end:
        raise ScenarioError(f"`part` must be START:END in seconds, such as 2:30, but is {text!r}", "part")
    return start, end
