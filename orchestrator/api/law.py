"""The learned law in the corrected FMU: whether it can be there, and what results say of it."""

from dataclasses import replace

import msgspec

from orchestrator.diagnosis.report.law_export import LawRun, law_refusal
from orchestrator.diagnosis.result import Diagnosis
from orchestrator.shared.results.diagnose import LawExportFound, LawRunFound, LearnedFound
from pyfmu_sources.adapters.learned_plant import ON


def request_law(diagnosis: Diagnosis) -> tuple[Diagnosis, bool]:
    """Return a diagnosis of which the law was asked for in the FMU, and whether the FMU can have it."""
    why = law_refusal(diagnosis)
    return (replace(diagnosis, notes=(*diagnosis.notes, why)), False) if why else (diagnosis, True)


def law_words(diagnosis: Diagnosis, run: LawRun | None) -> str:
    """Return in one sentence that the FMU has the law, and what it misses with it."""
    text = f"In the FMU: the corrected FMU has this law, off until its parameter `{ON}` is 1"
    if run is None:
        return text
    unit = diagnosis.test[0].signals[0].unit
    missed = ", ".join(f"{name} by {rms:.4g} {unit}" for name, rms in run.misfit.items())
    return f"{text}; with it on, free runs on the test part miss {missed}"


def law_result(law: LearnedFound | None, run: LawRun | None, unit: str) -> LearnedFound | None:
    """Return the law as ``diagnose.json`` has it, with what the FMU makes of it."""
    if law is None or run is None:
        return law
    runs = tuple(LawRunFound(row, starts) for row, starts in zip(run.rows, run.starts, strict=True))
    return msgspec.structs.replace(law, exported=LawExportFound(ON, dict(run.misfit), unit, run.difference, runs))
