"""Do no harm: whether named effects predict held-out data worse than nominal or re-fitted parameters do."""

from collections.abc import Mapping, Sequence
from typing import Any

from orchestrator.diagnosis.outcome import Diagnosis


def harmed(found: Diagnosis) -> dict[str, float]:
    """Return signal -> held-out misfit with the named effects over the better one without, where it is larger.

    Args:
        found: the diagnosis.

    Returns:
        Ratios above 1; empty where nothing gets larger, or nothing is named.
    """
    ratios = {one.signal: one.after / one.best_before for one in found.misfit if found.effects}
    return {name: ratio for name, ratio in ratios.items() if ratio > 1.0}


def counted(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the count of rows with harm in words; each row has ``named``, ``verdict`` and ``harm``."""
    named = [row for row in rows if row.get("named") and row["verdict"] == "effects"]
    larger = [max(row["harm"].values()) for row in named if row["harm"]]
    text = f"harm: the held-out misfit is larger with what is named in {len(larger)} of {len(named)} records"
    return text + (f", at most {100.0 * (max(larger) - 1.0):.1f} %" if larger else "")
