"""What a diagnosis leaves at the motor, and what it follows: for ``diagnose.json`` and for the terminal."""

from collections.abc import Iterator, Sequence

from orchestrator.api.shown import Block, table
from orchestrator.diagnosis.outcome import Diagnosis
from orchestrator.diagnosis.verdict.evidence import Term
from orchestrator.shared.results.diagnose import TermFound


def described_term(term: Term, diagnosis: Diagnosis) -> TermFound:
    """Return one of them as ``diagnose.json`` has it.

    Args:
        term: what is left.
        diagnosis: whose unit of position decides between N.m and N.

    Returns:
        Name, period, size and gain, with their units.
    """
    metric = diagnosis.misfit[0].unit == "m"
    return TermFound(
        name=term.name,
        period=None if term.period is None else 1e3 * term.period if metric else term.period,
        period_unit="mm" if metric else "rad",
        size=term.size,
        unit="N" if metric else "N.m",
        gain=term.gain,
        level=term.level,
        sure=term.sure,
    )


def also_seen(terms: Sequence[TermFound]) -> Iterator[Block]:
    """Yield the table of what the final model leaves that chance does not explain.

    Args:
        terms: as ``described_term`` gives them.

    Yields:
        The table, if any term is sure.
    """
    rows = [
        [
            term.name,
            "" if term.period is None else f"{term.period:.4g} {term.period_unit}",
            f"{term.size:.3g} {term.unit}",
            f"{term.gain:.0f}",
            f"{term.gain / term.level:.0f}",
        ]
        for term in terms
        if term.sure
    ]
    if rows:
        columns = ("what", "period", "size", "gain", "times that of any period")
        yield table("Also seen at the motor, and not added to the model", columns, rows)


def of_each_record(diagnosis: Diagnosis) -> Iterator[Block]:
    """Yield the table of what each of several records says of the common model.

    Args:
        diagnosis: of the records.

    Yields:
        The table, where there are several, with the floor that repeats of one experiment set.
    """
    floor = diagnosis.repeats.floor if diagnosis.repeats else {}
    rows = [
        [
            one.source,
            misfit.signal,
            f"{misfit.before:.4g}",
            f"{misfit.after:.4g}",
            f"{misfit.noise:.4g}",
            f"{floor[misfit.signal]:.4g}" if misfit.signal in floor else "",
        ]
        for one in diagnosis.records
        for misfit in one.misfit
    ]
    if rows:
        unit = diagnosis.misfit[0].unit
        head = ("record", "signal", f"before [{unit}]", "after", "noise", "repeats")
        yield table("Misfit of each record on its held-out part, one model for all", head, rows)
