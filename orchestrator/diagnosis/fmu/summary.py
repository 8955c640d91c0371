"""A diagnosis of any FMU in words: what is missing around it, how sure, what is left."""

from collections.abc import Iterator

from orchestrator.diagnosis.fmu.result import FmuDiagnosis
from orchestrator.diagnosis.report.summary import (
    headline,
    left_percent,
    next_steps,
    percent,
    sizes_line,
    sureness,
    test_words,
)


def summarise_fmu(found: FmuDiagnosis) -> Iterator[str]:
    """Yield the answer of a diagnosis, a sentence or two a line.

    Args:
        found: the diagnosis.

    Yields:
        The verdict; for each effect its size and how sure it is; what is left; the misfit on test data.
    """
    yield headline(found, "FMU")
    for effect in found.effects:
        yield sizes_line(effect)
        yield f"    {sureness(effect)}"
        yield f"    It explains {percent(effect.evidence.share)} of the outputs' misfit{test_words(effect)}."
    left = " and ".join(f"{left_percent(share)} of {name}" for name, share in found.left.items())
    strongest = [f"at {one.site} {one.words}" for one in found.remaining[:2]]
    follows = "; ".join(strongest) if strongest else "it follows no signal"
    yield f"What is left (rms, where the model was fitted): {left}; {follows}."
    for test in found.test:
        parts = [
            f"{one.signal} {one.nominal / one.noise:.3g} -> {one.final / one.noise:.3g} times its noise"
            for one in test.signals
        ]
        rows = f"{test.rows} rows that nothing was fitted to"
        yield f"Test data of {test.source} ({rows}), rms of runs: {'; '.join(parts)}."
    yield from next_steps(found)
