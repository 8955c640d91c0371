"""The inner loop of a black box: the FMU's own functions called by address, effects at its ports between them.

The signal that is fed back is extrapolated to the middle of the coming step: feedback is then of order two in the
step, where the plain value is of order one and looks like physics (a sampled spring is a negative damper).
"""

from typing import Any

import numpy as np

from orchestrator.master.native_calls import call_step, call_transfer
from orchestrator.plants.compiled import compiled
from orchestrator.shared.numba_cache import kept

_laws = compiled("port_laws")
_built_up: Any = _laws.built_up
_has_memory: Any = _laws.has_memory
_distance: Any = _laws.distance_of
_resistance: Any = _laws.resistance

SET, STEP, GET = 1, 2, 3
"""The call that failed, as ``run_loop`` returns it."""


@kept()
def run_loop(calls, counts, where, sent, read, table, grid, ports, sign, q, lead, out):  # type: ignore[no-untyped-def]
    """Run one record; return ``(status, call, step)``, status at most 1 when all went well.

    Args:
        calls: component, fmi2SetReal, fmi2DoStep, fmi2GetReal.
        counts: number of inputs, number of variables read.
        where: addresses of references and values of inputs, of references and values of what is read.
        sent, read: the buffers at those addresses.
        table: (steps, inputs) values held over each step.
        grid: start time, step, steps per row of ``out``.
        ports: (effects, 4) input, law, place of the position, place of the speed (-1: differentiated).
        sign: (effects,) direction in which the input pushes.
        q: (effects, 4) parameters.
        lead: steps by which the fed-back signal is extrapolated.
        out: (rows, variables read), row 0 the initial values.
    """
    start, step, per_row = grid[0], grid[1], int(grid[2])
    effects = len(ports)
    last = np.zeros((effects, 3))
    built = np.zeros(effects)
    status = call_transfer(calls[3], calls[0], where[2], counts[1], where[3])
    if status > 1:
        return status, GET, 0
    out[0] = read
    for k in range(len(table)):
        for i in range(counts[0]):
            sent[i] = table[k, i]
        for e in range(effects):
            kind = ports[e, 1]
            x = read[ports[e, 2]]
            before = last[e, 0] if k > 0 else x
            if ports[e, 3] >= 0:
                v = read[ports[e, 3]]
                ahead = lead
            else:
                v = (x - before) / step
                ahead = lead + 0.5
            known = k > 0 if ports[e, 3] >= 0 else k > 1
            old = last[e, 1] if known else v
            a = (v - old) / step
            middle = v + ahead * (v - old)
            place = x + lead * (x - before)
            if _has_memory(kind):
                distance = _distance(kind, q[e, 1], q[e, 3])
                half = _built_up(kind, built[e], middle, distance, 0.5 * step)
                built[e] = _built_up(kind, built[e], middle, distance, step)
            else:
                half = 0.0
            force = _resistance(kind, place, middle, a, half, q[e, 0], q[e, 1], q[e, 2])
            sent[ports[e, 0]] -= sign[e] * force
            last[e, 0] = x
            last[e, 1] = v
        status = call_transfer(calls[1], calls[0], where[0], counts[0], where[1])
        if status > 1:
            return status, SET, k
        status = call_step(calls[2], calls[0], start + k * step, step)
        if status > 1:
            return status, STEP, k
        status = call_transfer(calls[3], calls[0], where[2], counts[1], where[3])
        if status > 1:
            return status, GET, k
        if (k + 1) % per_row == 0:
            out[(k + 1) // per_row] = read
    return np.int32(0), GET, 0
