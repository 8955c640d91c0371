"""The effects of the bank at their places around an FMU: how large signals are there, and what a fit tries."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from orchestrator.diagnosis.fmu.loop import LOOP
from orchestrator.diagnosis.fmu.problem import FmuProblem
from orchestrator.diagnosis.model.interface import CandidateEffect, Values, WaveScan
from orchestrator.effects.effect import PlaceScales
from orchestrator.effects.of_fmus import BANK, CUT, INPUT, OUTPUT, PORT, FmuEffect
from orchestrator.shared.arrays import Array
from orchestrator.shared.inference.noise import rms

FLOWS = ("W", "kW", "m3/s", "m3/h", "l/s", "l/min", "kg/s")
"""Units of inputs that are flows of heat or matter: what they change has no direction of motion, and no cycles."""
OF_MOTION = (
    "coulomb_friction", "stribeck_friction", "directional_friction", "gravity", "ripple", "hysteresis", "added_inertia"
)  # fmt: skip
"""Laws that mean something only against a motion, or a current."""
OF_POSITION = ("spring", "hardening_spring", "gravity", "ripple", "hysteresis")
"""Laws that depend on where a motion has got to: not offered where only a flow is known."""
ANGLES = ("rad", "deg", "")
WINDOW = 7  # samples of the sliding cubic that gives speed and acceleration of a measured motion
LEAST_PHASE = 4.0  # radians of a ripple within the motion, from which it is no spring
MOST_CYCLES = 500
COMBS = 4  # that look for a quantum, one within the other
AT_REST = "at_rest"
"""Name of a value that is not fitted: 1 where a signal was zero before the record, 0 where it had its first value."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Position, speed and acceleration (n,) of a port, in its own units."""

    x: Array
    v: Array
    a: Array


def port_motions(problem: FmuProblem, reads: Array) -> dict[str, Motion]:
    """Return the motion of each port: as measured where its position is a column, else that of a run (n, reads).

    A run of a model that lacks an effect may be far from the record; what the effect answers to is in the record.
    """
    from scipy.signal import savgol_filter

    step, found = problem.h, {}
    for name, port in problem.map.ports.items():
        if port.position in problem.outputs:  # of a flow alone it names the flow
            y = problem.data.outputs[:, problem.outputs.index(port.position)]
            orders = range(2 if port.flow_only else 3)
            slopes = [savgol_filter(y, WINDOW, 3, deriv=order, delta=step) for order in orders]
            found[name] = Motion(step * np.cumsum(slopes[0]), *slopes) if port.flow_only else Motion(*slopes)
            continue
        x = reads[:, problem.runner.reads.index(port.position)]
        v = np.gradient(x, step) if port.velocity is None else reads[:, problem.runner.reads.index(port.velocity)]
        x = step * np.cumsum(v) if port.flow_only else x
        found[name] = Motion(x, v, np.gradient(v, step))
    return found


def efforts_along(motion: Motion, law: int, values: tuple[float, ...], step: float) -> Array:
    """Return the effort (n,) against the motion that a law has in each sample, ``step`` [s] apart."""
    q = np.array([*values, *[0.0] * (4 - len(values))])
    found = np.empty(len(motion.x))
    LOOP.efforts_along(law, motion.x, motion.v, motion.a, q, step, found)
    return found


def find_effects(problem: FmuProblem, nominal: Array) -> list[FmuEffect]:
    """Return every effect that could act, given all that is read of the nominal run (n, reads)."""
    found = []
    h, data = problem.h, problem.data
    for k, name in enumerate(problem.inputs):
        u = data.file_inputs[:, k]
        if float(np.ptp(u)) > 0.0:
            scales = PlaceScales(h / data.factor, rms(u), float(np.max(np.abs(u))), u)
            found += [FmuEffect(row, name, scales) for row in BANK.values() if row.site == INPUT]
    for k, name in enumerate(problem.outputs):
        y = data.outputs[:, k]
        scales = PlaceScales(h, rms(y), float(np.max(np.abs(y))), y, float(problem.noise[k]))
        found += [FmuEffect(row, name, scales) for row in BANK.values() if row.site == OUTPUT]
    for name, motion in port_motions(problem, nominal).items():
        port = problem.map.ports[name]
        effort = float(problem.drive([problem.runner.inputs.index(port.input)])[0])
        angular = problem.units.get(port.position, "") in ANGLES and not port.flow_only
        span = float(np.ptp(motion.x)) or 1.0
        # From two thirds of a cycle within the span to what the samples still follow, half a radian of it apart.
        top = 0.5 * np.pi / max(float(np.quantile(np.abs(motion.v), 0.8)) * h, 1e-300)
        phases = LEAST_PHASE + 0.5 * np.arange(MOST_CYCLES)
        cycles = tuple(float(phase) / span for phase in phases if phase < top * span)
        position, speed, acceleration = (rms(x) or 1.0 for x in (motion.x, motion.v, motion.a))
        scales = PlaceScales(h, effort, effort, motion.x, 0.0, position, span, speed, acceleration, angular,
                              cycles=cycles)  # fmt: skip
        left_out: tuple[str, ...] = OF_MOTION if problem.units.get(port.input) in FLOWS else ()
        left_out += (OF_POSITION if port.flow_only else ()) + (() if angular else ("gravity",))
        rows = [row for row in BANK.values() if row.site == PORT and row.name not in left_out]
        found += [FmuEffect(row, name, scales) for row in rows]
    return [*found, *_of_parameters(problem), *_of_cuts(problem, nominal)]


def _of_parameters(problem: FmuProblem) -> list[FmuEffect]:
    """Return what may change the parameters that can be changed within a run."""
    found = []
    for u in (u for u in problem.map.uncertain if u.name in problem.map.tunable):
        clock = problem.data.time - problem.data.time[0]
        followed = [("parameter_drift", "", clock)]
        followed += [("parameter_dependence", name, problem.data.signals[:, k])
                     for k, name in enumerate(problem.map.signals)]  # fmt: skip
        for kind, name, signal in followed:
            if (span := float(np.ptp(signal))) > 0.0:
                scales = PlaceScales(problem.h, u.standard_deviation, u.standard_deviation, signal, span=span)
                found.append(FmuEffect(BANK[kind], u.name, scales, signal=name))
    return found


def _of_cuts(problem: FmuProblem, nominal: Array) -> list[FmuEffect]:
    """Return what may lie in the connections between FMUs; the direction of an effort is seen in the nominal run."""
    found: list[FmuEffect] = []
    reads = problem.runner.reads
    for name, cut in problem.map.cuts.items():
        wire = next(c for c in problem.runner.system.connections if c.target == cut.input)
        near = wire.factor * nominal[:, reads.index(wire.source)] + wire.offset
        span = float(np.ptp(near)) or 1.0
        size = 0.01 * span
        if cut.far is not None:
            twist = near - nominal[:, reads.index(cut.far)]
            size = float(np.std(twist)) or size
            scales = PlaceScales(problem.h, size, span, near, span=span)
            found.append(FmuEffect(BANK["backlash"], name, scales))
        if cut.effort is not None:
            effort = nominal[:, reads.index(cut.effort)]
            if cut.far is not None:
                problem.sign[name] = -1.0 if float(np.mean(effort * twist)) < 0.0 else 1.0
            scales = PlaceScales(problem.h, size, span, near, span=span, effort=rms(effort) or 1.0)
            found.append(FmuEffect(BANK["compliance"], name, scales))
    return found


def candidate_effects(
    effects: Sequence[FmuEffect], motions: Mapping[str, Motion], through: Callable[[str, Array], Array], linear: bool
) -> dict[str, CandidateEffect]:
    """Return effects as the analysis sees them, by label.

    Args:
        motions: of the ports, over whose positions ripples repeat.
        through: port, gradient (outputs, n) by the residuals -> gradient (n,) by the effort at the port.
        linear: responses of the FMU are the same all along the record.
    """
    timing = [effect.label for effect in effects if effect.row.kind == "timing"]
    found = {}
    for effect in effects:
        row, label, names = effect.row, effect.label, tuple(effect.row.parameters)
        amplitudes = tuple(names.index(name) for name in row.amplitudes)
        flag = (1.0,) if effect.remembers else ()
        starts, small = _starts(effect, linear), row.scales(effect.scales)
        excludes = [other for other in timing if row.kind == "timing" and other != label]
        excludes += [o.label for o in effects if o.row.contains == row.name and o.place == effect.place]
        found[label] = CandidateEffect(
            label=label, kind=row.kind, values=(*names, *(AT_REST for _ in flag)),
            scales=(*(small[name] for name in names), *flag),
            starts=tuple((*start, *past) for start, past in product(starts, ((0.0,), (1.0,)) if flag else ((),))),
            amplitudes=amplitudes, fitted=tuple(range(len(names))), sizes=amplitudes or (0,),
            lower=(*effect.lower, *(0.0 for _ in flag)), positive=() if row.signed else amplitudes,
            wave=_wave_scan(effect, motions, through) if row.name == "ripple" else None,
            comb=COMBS if row.kind == "resolution" else 0,
            contains=(f"{row.contains}@{effect.place}",) if row.contains else (), excludes=tuple(excludes),
        )  # fmt: skip
    return found


def _starts(effect: FmuEffect, linear: bool) -> list[Values]:
    """Return values to try; those in which the response is linear are zero, and found by regression."""
    row, given = effect.row, effect.row.starts(effect.scales)
    starts = list(product(*(given.get(name, (0.0,)) for name in row.parameters)))
    scanned = [(value,) for value in row.scan(effect.scales)] if linear else []
    return list(dict.fromkeys([*starts, *scanned]))


def _wave_scan(
    effect: FmuEffect, motions: Mapping[str, Motion], through: Callable[[str, Array], Array]
) -> WaveScan:  # fmt: skip
    place, cycles = effect.place, np.array(effect.scales.cycles)
    return WaveScan(motions[place].x, 0, len(effect.row.parameters) - 1, cycles, lambda g: through(place, g))


def effect_units(problem: FmuProblem, effect: FmuEffect) -> dict[str, str]:
    """Return the units of an effect's values, at the place where it acts."""
    unit_of, place = problem.units, effect.place
    if effect.row.site == PORT:
        port = problem.map.ports[place]
        flow = unit_of.get(port.position, "")
        names = {"effort": unit_of.get(port.input, ""), "flow": f"({flow or '1'}.s)" if port.flow_only else flow}
    elif effect.row.site == CUT:
        cut = problem.map.cuts[place]
        names = {"effort": unit_of.get(cut.effort or "", ""), "flow": unit_of.get(cut.input, "")}
    else:
        unit = unit_of.get(place, "")
        names = {"effort": unit, "flow": unit, "signal": effect.signal}
    found = {}
    for parameter, general in effect.row.parameters.items():
        shown = general
        for key, name in names.items():
            shown = shown.replace(key, name or "1")
        found[parameter] = shown
    return found
