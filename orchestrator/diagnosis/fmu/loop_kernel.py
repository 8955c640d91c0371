"""Runs of FMUs with effects at their ports and cuts: kernels, which call the FMUs' own functions by address.

A signal that is fed back, or handed from FMU to FMU, is extrapolated to the middle of the coming step: the loop is then
of order two in the step, where the plain value is of order one and looks like physics (a sampled spring is a negative
damper).

In all functions: ``k``: number of the step, from 0; ``step``: its length [s]; ``n``: place of a member; ``fine``:
(n,) means over communication steps; ``before``: value of a signal until the first step; ``constant``: of a lag [s],
positive; ``out``: filled. Tables that :func:`run_loop` explains mean the same everywhere.
"""

from math import exp, isfinite
from typing import Annotated, Any

from orchestrator.building.translation.kernel_arrays import Pairs, Reals, Table, Wholes, WholeTable, scratch
from orchestrator.building.translation.kinds import REAL, WHOLE, ArrayKind
from orchestrator.master.native_calls import (
    ENDED,
    LEFT_EARLY,
    call_reporting_step,
    call_sized_transfer,
    call_step,
    call_transfer,
)
from pyfmu_sources.laws.body import across, built_up, cuts, distance_of, has_memory, resistance

__all__ = ["efforts_along", "lag_input", "lag_output", "limit_rate", "run_loop"]

NEAR = 1e-6  # share of a step within which its end and the time that an FMU came to are one
SET, STEP, GET, AWAY = 1, 2, 3, 4  # the call that failed; AWAY: none did, but an effort ran away
LEAD = 0.5  # share of a step by which what is fed back or handed on is extrapolated

Calls = Annotated[Any, ArrayKind(WHOLE, (None, 5))]
Counts = Annotated[Any, ArrayKind(WHOLE, (None, 2))]
Four = Annotated[Any, ArrayKind(WHOLE, (None, 4))]
Warned = Annotated[Any, ArrayKind(WHOLE, (None, 3))]
Laws = Annotated[Any, ArrayKind(REAL, (None, 6))]
Three = Annotated[Any, ArrayKind(REAL, (None, 3))]
FourReals = Annotated[Any, ArrayKind(REAL, (None, 4))]
Outcome = Annotated[Any, ArrayKind(WHOLE, (4,))]


def lag_input(fine: Reals, step: float, constant: float, before: float, out: Reals) -> None:
    """Fill ``out`` (n,) with a signal behind a lag of first order."""
    decay = exp(-step / constant)
    mean = constant / step * (1.0 - decay)
    x = before
    for k in range(len(fine)):
        gap = x - fine[k]
        out[k] = fine[k] + gap * mean
        x = fine[k] + gap * decay


def limit_rate(fine: Reals, step: float, rate: float, before: float, out: Reals) -> None:
    """Fill ``out`` (n,) with a signal that cannot change by more than ``rate`` a second."""
    x = before
    for k in range(len(fine)):
        gap = fine[k] - x
        time = abs(gap) / rate
        if time >= step:
            end = x + (rate * step if gap > 0.0 else -rate * step)
            out[k] = 0.5 * (x + end)
            x = end
        else:
            out[k] = fine[k] - gap * 0.5 * time / step
            x = fine[k]


def lag_output(rows: Reals, step: float, constant: float, out: Reals) -> None:
    """Fill ``out`` (n,) with samples ``rows`` (n,) behind a lag of first order, straight lines between them."""
    decay = exp(-step / constant)
    out[0] = rows[0]
    for k in range(1, len(rows)):
        slope = (rows[k] - rows[k - 1]) / step
        begin = rows[k - 1] - slope * constant
        out[k] = begin + slope * step + (out[k - 1] - begin) * decay


def efforts_along(law: int, x: Reals, v: Reals, a: Reals, q: Reals, step: float, out: Reals) -> None:
    """Fill ``out`` (n,) with the effort against a motion that a law of ``laws.body`` has in each sample.

    ``x, v, a``: (n,) position, speed, acceleration; ``q``: (4,) parameters of the law.
    """
    built = 0.0
    for k in range(len(x)):
        if has_memory(law):
            built = built_up(law, built, v[k], distance_of(law, q[1], q[3]), step)
        out[k] = resistance(law, x[k], v[k], a[k], built, q[0], q[1], q[2])


def hand_over(
    k: int, sent: Reals, read: Reals, into: Wholes, outof: Wholes, wires: WholeTable, gains: Pairs,
    passing: WholeTable, passed: Reals, handed: FourReals,
) -> None:  # fmt: skip
    """Add to inputs what other FMUs hand to them, extrapolated."""
    for w in range(len(wires)):
        handed[w, 3] = read[outof[wires[w, 1]]]
    if k > 1:
        for t in range(len(passing)):
            by = passing[t, 1]
            handed[passing[t, 0], 3] += passed[t] * LEAD * (handed[by, 0] - handed[by, 1])
    for w in range(len(wires)):
        now = handed[w, 3]
        before = handed[w, 2] if k > 0 else now
        sent[into[wires[w, 0]]] += gains[w, 0] * (now + LEAD * (now - before)) + gains[w, 1]
        handed[w, 2] = now


def act(
    k: int, sent: Reals, read: Reals, into: Wholes, outof: Wholes, ports: Four, laws: Laws, last: Three, step: float
) -> bool:
    """Let the effects at ports and cuts act on the inputs; tell whether all efforts are within their bounds."""
    bounded = True
    for e in range(len(ports)):
        kind = ports[e, 1]
        target = into[ports[e, 0]]
        x = read[outof[ports[e, 2]]]
        before = last[e, 0] if k > 0 else x
        place = x + LEAD * (x - before)
        last[e, 0] = x
        if cuts(kind):
            sent[target] = across(kind, sent[target], place, laws[e, 4], laws[e, 0])
            continue
        measured = ports[e, 3] >= 0
        v = read[outof[ports[e, 3]]] if measured else (x - before) / step
        ahead = LEAD if measured else LEAD + 0.5
        known = k > 0 if measured else k > 1
        old = last[e, 1] if known else v
        a = (v - old) / step
        middle = v + ahead * (v - old)
        half = 0.0
        if has_memory(kind):
            distance = distance_of(kind, laws[e, 1], laws[e, 3])
            half = built_up(kind, last[e, 2], middle, distance, 0.5 * step)
            last[e, 2] = built_up(kind, last[e, 2], middle, distance, step)
        effort = resistance(kind, place, middle, a, half, laws[e, 0], laws[e, 1], laws[e, 2])
        bounded = bounded and abs(effort) <= laws[e, 5]
        sent[target] -= laws[e, 4] * effort
        last[e, 1] = v
    return bounded


def count_warning(status: int, warned: Warned, n: int, call: int, k: int) -> int:
    """Count a warning of a member, and remember the first; return the ``status``. ``call``: the function."""
    if status == 1:
        if warned[n, 0] == 0:
            warned[n, 1], warned[n, 2] = call, k
        warned[n, 0] += 1
    return status


def transfer(calls: Calls, counts: Counts, where: Four, n: int, place: int) -> int:
    """Set (``place`` 0) or read (1) a member; return the status."""
    function = calls[n, 1 + 2 * place]
    references = where[n, 2 * place]
    values = where[n, 2 * place + 1]
    if calls[n, 4] != 0:
        return call_sized_transfer(function, calls[n, 0], references, counts[n, place], values)
    return call_transfer(function, calls[n, 0], references, counts[n, place], values)


def advance(calls: Calls, n: int, time: float, step: float, k: int, astray: Three) -> int:
    """Step a member from ``time`` [s]; return the status."""
    if calls[n, 4] == 0:
        return call_step(calls[n, 2], calls[n, 0], time, step)
    report = scratch(4)
    report[3] = time + step
    status = call_reporting_step(calls[n, 2], calls[n, 0], time, step, report)
    if status > 1:
        return status
    off = abs(report[3] - (time + step))
    if report[1] != 0.0:
        return ENDED
    if report[0] != 0.0 or report[2] != 0.0 or not isfinite(off):
        return LEFT_EARLY
    if off > NEAR * step:
        if astray[n, 0] == 0.0:
            astray[n, 1] = float(k)
        astray[n, 0] += 1.0
        astray[n, 2] = max(astray[n, 2], off)
    return status


def step_all(
    calls: Calls, counts: Counts, where: Four, time: float, step: float, k: int, warned: Warned, astray: Three,
    outcome: Outcome,
) -> bool:  # fmt: skip
    """Set, step and read all FMUs; tell whether all went well, else note ``(status, call, step, member)``."""
    for n in range(len(calls)):
        if counts[n, 0] > 0:
            status = count_warning(transfer(calls, counts, where, n, 0), warned, n, SET, k)
            if status > 1:
                return note(status, SET, k, n, outcome)
    for n in range(len(calls)):
        status = count_warning(advance(calls, n, time, step, k, astray), warned, n, STEP, k)
        if status > 1:
            return note(status, STEP, k, n, outcome)
    for n in range(len(calls)):
        if counts[n, 1] > 0:
            status = count_warning(transfer(calls, counts, where, n, 1), warned, n, GET, k)
            if status > 1:
                return note(status, GET, k, n, outcome)
    return True


def note(status: int, call: int, k: int, n: int, outcome: Outcome) -> bool:
    """Note what ended a run: ``status`` of a ``call``. Return that it has not gone well."""
    outcome[0], outcome[1], outcome[2], outcome[3] = status, call, k, n
    return False


def run_loop(
    calls: Calls, counts: Counts, where: Four, sent: Reals, read: Reals, into: Wholes, outof: Wholes, table: Table,
    start: float, step: float, wires: WholeTable, gains: Pairs, passing: WholeTable, passed: Reals, ports: Four,
    laws: Laws, last: Three, handed: FourReals, warned: Warned, astray: Three, outcome: Outcome, out: Table,
) -> None:  # fmt: skip
    """Run one record.

    Args:
        calls: (members, 5) component, functions that set, step and get, whether they are of FMI 3.0.
        counts: (members, 2) number of inputs, number of variables read.
        where: (members, 4) addresses of references and values of inputs, of references and values of what is read.
        sent: values of all inputs.
        read: values of all that is read.
        into: (columns,) place of each column of the table in ``sent``.
        outof: (variables read,) place of each in ``read``.
        table: (steps, columns) values held over each step.
        start: time at which the first step begins [s].
        wires: (wires, 2) column that is fed, variable that feeds it.
        gains: (wires, 2) factor and offset.
        passing: (pairs, 2) a wire whose source depends at once on what another feeds: both places.
        passed: (pairs,) how much. What is read was computed from what was fed, the middle of the step before.
        ports: (effects, 4) input, law, place of the position, place of the speed (-1: differentiated).
        laws: (effects, 6) parameters, direction in which the input pushes, effort from which the run is given up: its
            loop is unstable.
        last: (effects, 3) zeros: position and speed of the step before, what has built up.
        handed: (wires, 4) zeros: what was fed, in this step and the one before, what was handed on, what is now.
        warned: (members, 3) zeros: number of calls that returned a warning, call and step of the first.
        astray: (members, 3) zeros: number of steps that came to another time than asked, the first, the largest
            difference [s].
        outcome: (4,) filled: status, at most 1 when all went well; call, step, member.
        out: (steps + 1, variables read) filled, row 0 the initial values.
    """
    outcome[0], outcome[1], outcome[2], outcome[3] = 0, GET, 0, 0
    for n in range(len(calls)):
        status = transfer(calls, counts, where, n, 1)
        if status > 1:
            outcome[0], outcome[3] = status, n
            return
    for i in range(len(outof)):
        out[0, i] = read[outof[i]]
    for k in range(len(table)):
        for i in range(len(into)):
            sent[into[i]] = table[k, i]
        hand_over(k, sent, read, into, outof, wires, gains, passing, passed, handed)
        if not act(k, sent, read, into, outof, ports, laws, last, step):
            outcome[0], outcome[1], outcome[2] = 2, AWAY, k
            return
        for w in range(len(wires)):
            handed[w, 1] = handed[w, 0]
            handed[w, 0] = sent[into[wires[w, 0]]]
        if not step_all(calls, counts, where, start + k * step, step, k, warned, astray, outcome):
            return
        for i in range(len(outof)):
            out[k + 1, i] = read[outof[i]]
