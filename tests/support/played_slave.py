"""Inputs played to a Python slave by itself, without an FMU around it."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pyfmu_sources.adapters.slave_base import SlaveBase


def play(
    slave: SlaveBase,
    start: Mapping[str, Any],
    inputs: Sequence[str],
    values: np.ndarray,
    outputs: Sequence[str],
    h: float,
) -> np.ndarray:
    """Return the outputs at each sample, shape (samples, outputs), of inputs that are set at the end of each step.

    Args:
        start: parameters by name.
        values: of the inputs, shape (samples, inputs); the first row is that of the initialisation.
        h: step [s].
    """
    references = {variable.name: n for n, variable in enumerate(slave.table)}
    ins, outs = ([references[name] for name in names] for names in (inputs, outputs))
    slave.set_real([references[name] for name in start], [float(value) for value in start.values()])
    slave.set_real(ins, values[0].tolist())
    slave.setup_experiment(0.0)
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    rows = [slave.get_real(outs)]
    for n, row in enumerate(values[1:]):
        slave.set_real(ins, row.tolist())
        assert slave.do_step(n * h, h)
        rows.append(slave.get_real(outs))
    assert not slave.log_queue
    return np.array(rows)
