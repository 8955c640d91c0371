"""Default gains of the controllers' and the estimator's FMUs, so that each runs alone in any tool.

They are the design of the default experiment: thesis values, 1 ms. The designed values are stored, not computed at
every build: the linear algebra libraries of two machines differ by up to 3e-8 in a gain, which would show in the FMUs'
bytes. ``python -m tools.reference_runs`` writes them anew; a test compares them with the design.
"""

import json
from pathlib import Path

STORED = Path(__file__).parent / "data" / "default_starts.json"

SAMPLE_TIME = 1e-3
STATE_WEIGHTS = (10.0, 50.0, 1.0, 1.0, 0.01)
TORQUE_WEIGHT = 2e-3


def default_starts(class_name: str) -> dict[str, float]:
    """Return the stored start values that are designed rather than written down: those of three FMUs, else none."""
    stored: dict[str, dict[str, float]] = json.loads(STORED.read_text(encoding="ascii"))
    return stored.get(class_name, {})
