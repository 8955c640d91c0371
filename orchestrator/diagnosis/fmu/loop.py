"""What effects do, compiled: in series with inputs and outputs, and at ports and cuts of FMUs that run in a loop.

Inputs are held from sample to sample and come as their means ``fine`` (steps,) over communication steps of length
``step`` [s]; each law returns the means of what arrives: the FMU sees the right mean of a signal that jumps within a
step. Outputs come as samples ``rows`` (n,), ``step`` [s] apart.

In the loop the FMUs' own functions are called by address. A signal that is fed back, or handed from FMU to FMU, is
extrapolated to the middle of the coming step: the loop is then of order two in the step, where the plain value is of
order one and looks like physics (a sampled spring is a negative damper).
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.master.native_calls import call_reporting_step, call_sized_transfer, call_step, call_transfer
from orchestrator.master.protocol import ENDED, LEFT_EARLY
from orchestrator.plants.compiled import compile_module
from orchestrator.shared.numba_cache import njit_on_disk

Array = NDArray[np.float64]

_laws = compile_module("laws.port")
_built_up: Any = _laws.built_up
_has_memory: Any = _laws.has_memory
_distance: Any = _laws.distance_of
_resistance: Any = _laws.resistance
_cuts: Any = _laws.cuts
_across: Any = _laws.across

NEAR = 1e-6
"""Share of a step within which its end and the time that an FMU came to are one."""
SET, STEP, GET, AWAY = 1, 2, 3, 4
"""The call that failed, as ``run_loop`` returns it; ``AWAY``: none did, but an effort ran away."""

LEAD = 0.5
"""Share of a step by which what is fed back or handed on is extrapolated."""


def delay_input(fine: Array, step: float, delay: float, before: float) -> Array:
    """Return a signal that comes ``delay`` [s] later; ``before``: its value until then."""
    if delay <= 0.0:
        return fine
    n, parts = len(fine), min(delay / step, len(fine) + 1.0)
    whole = int(parts)
    share = parts - whole
    past = np.concatenate([np.full(whole + 1, before), fine])
    return np.asarray((1.0 - share) * past[1 : n + 1] + share * past[:n])


@njit_on_disk()
def lag_input(fine: Array, step: float, constant: float, before: float) -> Array:
    """Return a signal behind a lag of first order with a time ``constant`` [s]; ``before``: its value until then."""
    out = np.empty_like(fine)
    if constant <= 0.0:
        return fine.copy()
    decay = np.exp(-step / constant)
    mean = constant / step * (1.0 - decay)
    x = before
    for k in range(len(fine)):
        gap = x - fine[k]
        out[k] = fine[k] + gap * mean
        x = fine[k] + gap * decay
    return out


@njit_on_disk()
def limit_rate(fine: Array, step: float, rate: float, before: float) -> Array:
    """Return a signal that cannot change by more than ``rate`` a second."""
    out = np.empty_like(fine)
    x = before
    for k in range(len(fine)):
        gap = fine[k] - x
        time = abs(gap) / rate
        if time >= step:
            end = x + rate * step * np.sign(gap)
            out[k] = 0.5 * (x + end)
            x = end
        else:
            out[k] = fine[k] - gap * 0.5 * time / step
            x = fine[k]
    return out


def quantise(fine: Array, quantum: float) -> Array:
    """Return a signal in whole steps of ``quantum``."""
    return np.asarray(quantum * np.rint(fine / quantum)) if quantum > 0.0 else fine


def delay_output(rows: Array, step: float, delay: float, m: int = 1) -> Array:
    """Return samples of an output that is read ``delay`` [s] late, by cubics through four of its samples.

    Args:
        m: parts of a sample of the inputs: where it is 3 or more, no cubic reaches beyond a jump of these.
    """
    n = len(rows)
    place = np.clip(np.arange(n) - delay / step, 0.0, n - 1.0)
    first = np.floor(place).astype(int) - 1
    if m >= 3:
        begin = m * np.floor(place / m).astype(int)
        first = np.clip(first, begin, begin + m - 3)
    first = np.clip(first, 0, n - 4)
    t = place - first
    weights = (
        -(t - 1) * (t - 2) * (t - 3) / 6,
        t * (t - 2) * (t - 3) / 2,
        -t * (t - 1) * (t - 3) / 2,
        t * (t - 1) * (t - 2) / 6,
    )
    return np.asarray(sum(w * rows[first + i] for i, w in enumerate(weights)))


@njit_on_disk()
def lag_output(rows: Array, step: float, constant: float) -> Array:
    """Return samples of an output behind a lag of first order, straight lines between its samples."""
    out = rows.copy()
    if constant <= 0.0:
        return out
    decay = np.exp(-step / constant)
    for k in range(1, len(rows)):
        slope = (rows[k] - rows[k - 1]) / step
        start = rows[k - 1] - slope * constant
        out[k] = start + slope * step + (out[k - 1] - start) * decay
    return out


@njit_on_disk()
def _hand_over(k, sent, read, into, outof, wires, gains, passing, passed, fed, handed):  # type: ignore[no-untyped-def]
    """Add to inputs what other FMUs hand to them, extrapolated."""
    now = np.zeros(len(wires))
    for w in range(len(wires)):
        now[w] = read[outof[wires[w, 1]]]
    if k > 1:
        for t in range(len(passing)):
            now[passing[t, 0]] += passed[t] * LEAD * (fed[passing[t, 1], 0] - fed[passing[t, 1], 1])
    for w in range(len(wires)):
        before = handed[w] if k > 0 else now[w]
        sent[into[wires[w, 0]]] += gains[w, 0] * (now[w] + LEAD * (now[w] - before)) + gains[w, 1]
        handed[w] = now[w]


@njit_on_disk()
def _act(k, sent, read, into, outof, ports, laws, last, built, step):  # type: ignore[no-untyped-def]
    """Let the effects at ports and cuts act on the inputs; tell whether all efforts are within their bounds."""
    bounded = True
    for e in range(len(ports)):
        kind, target = ports[e, 1], into[ports[e, 0]]
        x = read[outof[ports[e, 2]]]
        before = last[e, 0] if k > 0 else x
        place = x + LEAD * (x - before)
        last[e, 0] = x
        if _cuts(kind):
            sent[target] = _across(kind, sent[target], place, laws[e, 4], laws[e, 0])
            continue
        if ports[e, 3] >= 0:
            v = read[outof[ports[e, 3]]]
            ahead = LEAD
        else:
            v = (x - before) / step
            ahead = LEAD + 0.5
        known = k > 0 if ports[e, 3] >= 0 else k > 1
        old = last[e, 1] if known else v
        a = (v - old) / step
        middle = v + ahead * (v - old)
        if _has_memory(kind):
            distance = _distance(kind, laws[e, 1], laws[e, 3])
            half = _built_up(kind, built[e], middle, distance, 0.5 * step)
            built[e] = _built_up(kind, built[e], middle, distance, step)
        else:
            half = 0.0
        effort = _resistance(kind, place, middle, a, half, laws[e, 0], laws[e, 1], laws[e, 2])
        bounded = bounded and abs(effort) <= laws[e, 5]
        sent[target] -= laws[e, 4] * effort
        last[e, 1] = v
    return bounded


@njit_on_disk()
def _count_warning(status, warned, n, call, k):  # type: ignore[no-untyped-def]
    """Count a warning of a member, and remember the first; return the status."""
    if status == 1:
        if warned[n, 0] == 0:
            warned[n, 1], warned[n, 2] = call, k
        warned[n, 0] += 1
    return status


@njit_on_disk()
def _transfer(calls, counts, where, n, place):  # type: ignore[no-untyped-def]
    """Set (place 0) or read (1) a member; return the status."""
    function, references, values = calls[n, 1 + 2 * place], where[n, 2 * place], where[n, 2 * place + 1]
    if calls[n, 4] != 0:
        return call_sized_transfer(function, calls[n, 0], references, counts[n, place], values)
    return call_transfer(function, calls[n, 0], references, counts[n, place], values)


@njit_on_disk()
def _advance(calls, reports, n, time, step, k, astray):  # type: ignore[no-untyped-def]
    """Step a member; return the status."""
    if calls[n, 4] == 0:
        return call_step(calls[n, 2], calls[n, 0], time, step)
    reached = reports[n, 8:].view(np.float64)
    reached[0] = time + step
    status = call_reporting_step(calls[n, 2], calls[n, 0], time, step, reports[n].ctypes.data)
    if status > 1:
        return status
    off = abs(reached[0] - (time + step))
    if reports[n, 1] != 0:
        return np.int32(ENDED)
    if reports[n, 0] != 0 or reports[n, 2] != 0 or not np.isfinite(off):
        return np.int32(LEFT_EARLY)
    if off > NEAR * step:
        if astray[n, 0] == 0:
            astray[n, 1] = k
        astray[n, 0] += 1
        astray[n, 2] = max(astray[n, 2], off)
    return status


@njit_on_disk()
def _step(calls, counts, where, reports, time, step, k, warned, astray):  # type: ignore[no-untyped-def]
    """Set, step and read all FMUs; return ``(status, call, member)``."""
    for n in range(len(calls)):
        if counts[n, 0] > 0:
            status = _transfer(calls, counts, where, n, 0)
            if _count_warning(status, warned, n, SET, k) > 1:
                return status, SET, n
    for n in range(len(calls)):
        status = _advance(calls, reports, n, time, step, k, astray)
        if _count_warning(status, warned, n, STEP, k) > 1:
            return status, STEP, n
    for n in range(len(calls)):
        if counts[n, 1] > 0:
            status = _transfer(calls, counts, where, n, 1)
            if _count_warning(status, warned, n, GET, k) > 1:
                return status, GET, n
    return np.int32(0), GET, 0


@njit_on_disk()
def run_loop(  # type: ignore[no-untyped-def]
    calls, counts, where, sent, read, into, outof, table, grid, wires, gains, passing, passed, ports, laws,
    warned, astray, out,
):  # fmt: skip
    """Run one record; return ``(status, call, step, member)``, status at most 1 when all went well.

    Args:
        calls: (members, 5) component, functions that set, step and get, whether they are of FMI 3.0.
        counts: (members, 2) number of inputs, number of variables read.
        where: (members, 4) addresses of references and values of inputs, of references and values of what is read.
        into: (columns,) place of each column of the table in ``sent``.
        table: (steps, columns) values held over each step.
        wires: (wires, 2) column that is fed, variable that feeds it.
        gains: (wires, 2) factor and offset.
        passing: (pairs, 2) a wire whose source depends at once on what another feeds: both places.
        passed: (pairs,) how much. What is read was computed from what was fed, the middle of the step before.
        ports: (effects, 4) input, law, place of the position, place of the speed (-1: differentiated).
        laws: (effects, 6) parameters, direction in which the input pushes, effort from which the run is given up: its
            loop is unstable.
        warned: (members, 3) zeros: number of calls that returned a warning, call and step of the first.
        astray: (members, 3) zeros: number of steps that came to another time than asked, the first, the largest
            difference [s].
        out: (steps + 1, variables read), row 0 the initial values.
    """
    start, step = grid[0], grid[1]
    last, built = np.zeros((len(ports), 2)), np.zeros(len(ports))
    fed, handed = np.zeros((len(wires), 2)), np.zeros(len(wires))
    reports = np.zeros((len(calls), 16), dtype=np.uint8)
    for n in range(len(calls)):
        status = _transfer(calls, counts, where, n, 1)
        if status > 1:
            return status, GET, 0, n
    for i in range(len(outof)):
        out[0, i] = read[outof[i]]
    for k in range(len(table)):
        for i in range(len(into)):
            sent[into[i]] = table[k, i]
        _hand_over(k, sent, read, into, outof, wires, gains, passing, passed, fed, handed)
        if not _act(k, sent, read, into, outof, ports, laws, last, built, step):
            return np.int32(2), AWAY, k, 0
        for w in range(len(wires)):
            fed[w, 1] = fed[w, 0]
            fed[w, 0] = sent[into[wires[w, 0]]]
        status, call, n = _step(calls, counts, where, reports, start + k * step, step, k, warned, astray)
        if status > 1:
            return status, call, k, n
        for i in range(len(outof)):
            out[k + 1, i] = read[outof[i]]
    return np.int32(0), GET, 0, 0
