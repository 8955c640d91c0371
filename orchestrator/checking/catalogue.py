"""All rules of the check, in the order of its stages."""

from orchestrator.checking import check  # noqa: F401 (it imports all that judges)
from orchestrator.checking.dynamic import PROBES
from orchestrator.checking.rules import RULES
from orchestrator.checking.static import STAGES as STATIC_STAGES

STAGES: tuple[str, ...] = (*STATIC_STAGES, "run", "load", "process", *PROBES["3.0"], "interfaces", "path", "afterwards")
"""What has rules, in order; some stages have none."""

_ORDERED = sorted(RULES.items(), key=lambda item: STAGES.index(item[1].stage))
RULES.clear()
RULES.update(_ORDERED)
__all__ = ["RULES", "STAGES"]
