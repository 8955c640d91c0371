"""A live section as what its script reads: numbers as base64 of their bytes, so that none is rounded."""

import base64
import gzip
import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from markupsafe import Markup

from orchestrator.reporting.model import Live


def live_data(live: Live) -> Markup:
    """Write a live section as JSON. Return text that is safe inside a script element."""
    regulator = live.regulator
    return in_script(
        {
            "module": base64.b64encode(gzip.compress(live.module, mtime=0)).decode(),
            "plan": _pack(live.plan),
            "step": live.step,
            "records": live.records,
            "runs": [
                {"start": run.start, "steps": run.steps, "changes": run.changes, "table": _pack(run.table)}
                for run in live.runs
            ],
            "recorded": [_pack(row) for row in live.recorded],
            "controls": [asdict(control) for control in live.controls],
            "plots": [[{"name": curve.name, "terms": curve.terms} for curve in plot.curves] for plot in live.plots],
            "regulator": None if regulator is None else asdict(regulator),
        }
    )


def in_script(data: Any) -> Markup:
    """Write data as JSON. Return text that is safe inside a script element."""
    text = json.dumps(data, allow_nan=False, ensure_ascii=True, separators=(",", ":"))
    return Markup(text.replace("<", "\\u003c").replace("&", "\\u0026"))


def _pack(values: Sequence[float]) -> str:
    return base64.b64encode(np.asarray(values, dtype="<f8").tobytes()).decode()
