"""The gap on a second record, with nothing fitted to it but initial states."""

from orchestrator.diagnosis.diagnose import held_out_gap
from orchestrator.diagnosis.likelihood import signals_of
from orchestrator.diagnosis.outcome import Diagnosis, Gap
from orchestrator.record import Record


def gap_on(record: Record, diagnosis: Diagnosis) -> tuple[Gap, ...]:
    """Return the gap of each of the diagnosis's models on all of another record."""
    w = diagnosis.workings
    tau = float(w.nominal[w.plant.index("tau")])
    signals = signals_of(record, tau)
    stages = (("nominal", w.nominal), ("parameters", w.base.p), ("final", w.final.p))
    return held_out_gap(w.plant, signals, w.nominal, w.final.q, stages, slice(10, signals.size), diagnosis.gap[0].unit)
