"""A diagnosis of any FMU in words: what is missing around it, how sure, what is left."""

from collections.abc import Iterator

from orchestrator.diagnosis.fmu.result import FmuDiagnosis
from orchestrator.diagnosis.report.summary import CERTAINTY, effect_words, grade_reasons, listed
from orchestrator.diagnosis.selection.grading import Grade


def summarise_fmu(found: FmuDiagnosis) -> Iterator[str]:
    """Yield the answer of a diagnosis, a sentence or two a line.

    Args:
        found: the diagnosis.

    Yields:
        The verdict; for each effect its size and how sure it is; what is left; the misfit on test data.
    """
    yield headline(found)
    for effect in found.effects:
        sizes = [
            f"{name.replace('_', ' ')} {e.value:.5g} +- {e.standard_error:.2g} {e.unit}".removesuffix(" 1").rstrip()
            for name, e in effect.parameters.items()
        ]
        words = effect_words(effect.label)
        yield f"  {words[:1].upper()}{words[1:]}: {', '.join(sizes)}"
        yield f"    How sure: {CERTAINTY[effect.grade]}; {grade_reasons(effect)}"
        shares = [f"{100.0 * max(effect.evidence.share, 0.0):.0f} % of the outputs' misfit"]
        if effect.motion_share == effect.motion_share:
            shares.append(f"{100.0 * max(effect.motion_share, 0.0):.0f} % of that on test data")
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


def headline(found: FmuDiagnosis) -> str:
    """Return the verdict in one sentence.

    Args:
        found: the diagnosis.

    Returns:
        The sentence.
    """
    if found.verdict == "none":
        return "Verdict: none. Nothing is missing: the FMU explains the record."
    if found.verdict == "parameters":
        return "Verdict: parameters. Nothing is missing: the FMU explains the record once its values are re-fitted."
    if found.verdict == "effects":
        return f"Verdict: effects. The FMU lacks {listed([one.label for one in found.graded(Grade.LIKELY)])}."
    text = "Verdict: unknown. The FMU misses something, and no effect of the library is likely."
    return text + (f" Possible: {listed([one.label for one in found.effects])}." if found.effects else "")
