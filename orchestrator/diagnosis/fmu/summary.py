"""A diagnosis of any FMU in words: what is missing around it, how sure, what is left."""

from collections.abc import Iterator

from orchestrator.diagnosis.fmu.result import FmuDiagnosis
from orchestrator.diagnosis.report.summary import grade_reasons, grade_words, headline, sizes_line


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
        yield f"    How sure: {grade_words(effect)}; {grade_reasons(effect)}"
        shares = [f"{100.0 * max(effect.evidence.share, 0.0):.0f} % of the outputs' misfit"]
        if effect.evidence.motion_share == effect.evidence.motion_share:
            shares.append(f"{100.0 * max(effect.evidence.motion_share, 0.0):.0f} % of that on test data")
        yield f"    It explains {' and '.join(shares)}."
    left = " and ".join(f"{100.0 * share:.2g} % of the power of {name}" for name, share in found.left.items())
    strongest = [f"at {one.site} {one.words}" for one in found.remaining[:2]]
    yield f"What is left: {left}; {'; '.join(strongest) if strongest else 'it follows no signal'}."
    for test in found.test:
        parts = [
            f"{one.signal} {one.nominal / one.noise:.3g} -> {one.final / one.noise:.3g} times its noise"
            for one in test.signals
        ]
        rows = f"{test.rows} rows that nothing was fitted to"
        yield f"Test data of {test.source} ({rows}), rms of runs: {'; '.join(parts)}."
