"""Where effects could act around an FMU, and how large the signals there are."""

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fmu.bank import (
    BANK,
    INPUT,
    OUTPUT,
    PORT,
    BoxEffect,
    Surroundings,
)
from orchestrator.diagnosis.fmu.motion import port_motions
from orchestrator.diagnosis.fmu.problem import BoxProblem

FLOWS = ("W", "kW", "m3/s", "m3/h", "l/s", "l/min", "kg/s")
"""Units of inputs that are flows of heat or matter: what they change has no direction of motion, and no cycles."""

OF_MOTION = (
    "coulomb_friction", "stribeck_friction", "directional_friction", "gravity", "ripple", "hysteresis", "added_inertia"
)  # fmt: skip
"""Laws that mean something only against a motion, or a current."""

OF_POSITION = ("spring", "hardening_spring", "gravity", "ripple", "hysteresis")
"""Laws that depend on where a motion has got to: not offered where only a flow is known."""

Array = NDArray[np.float64]

ANGLES = ("rad", "deg", "")


def effects_of(problem: BoxProblem, nominal: Array) -> list[BoxEffect]:
    """Return every effect that could act, given all that is read of the nominal run (n, reads)."""
    found = []
    h, runner, own = problem.h, problem.runner, problem.settings.place
    motions = port_motions(problem, nominal)
    for k, name in enumerate(problem.inputs):
        u = problem.data.driven[:, k]
        if float(np.ptp(u)) == 0.0:
            continue
        scene = Surroundings(h / problem.data.factor, _rms(u), float(np.max(np.abs(u))), u)
        found += [BoxEffect(kind, name, scene) for kind in BANK.values() if kind.where == INPUT]
    for k, name in enumerate(problem.outputs):
        y = problem.data.outputs[:, k]
        scene = Surroundings(h, _rms(y), float(np.max(np.abs(y))), y, float(problem.noise[k]))
        found += [BoxEffect(kind, name, scene) for kind in BANK.values() if kind.where == OUTPUT]
    for name, port in problem.map.ports.items():
        motion = motions[name]
        x, v = motion.x, motion.v
        effort = float(problem.drive([runner.inputs.index(port.input)])[0])
        angular = problem.units.get(port.position, "") in ANGLES and not port.flow_only
        a = _rms(motion.a)
        span = float(np.ptp(x)) or 1.0
        # From two thirds of a cycle within the span to what the samples still follow, half a radian of it apart.
        top = 0.5 * np.pi / max(float(np.quantile(np.abs(v), 0.8)) * h, 1e-300)
        phases = own.least_phase + 0.5 * np.arange(own.most_cycles)
        cycles = tuple(float(phase) / span for phase in phases if phase < top * span)
        scene = Surroundings(
            h,
            effort,
            effort,
            x,
            0.0,
            _rms(x) or 1.0,
            span,
            _rms(v) or 1.0,
            a or 1.0,
            angular,
            cycles=cycles,
            once=own.once,
            long=own.long,
        )
        left_out: tuple[str, ...] = OF_MOTION if problem.units.get(port.input) in FLOWS else ()
        left_out += OF_POSITION if port.flow_only else ()
        kinds = [k for k in BANK.values() if k.where == PORT and (angular or not k.angular)]
        kinds = [k for k in kinds if k.name not in left_out]
        found += [BoxEffect(kind, name, scene) for kind in kinds]
    return [*found, *_of_parameters(problem), *_of_cuts(problem, nominal)]


def _of_parameters(problem: BoxProblem) -> list[BoxEffect]:
    """Return what may change the parameters that can be changed within a run."""
    found, h = [], problem.h
    for u in (u for u in problem.map.uncertain if u.name in problem.map.tunable):
        clock = problem.data.time - problem.data.time[0]
        scene = Surroundings(h, u.standard_deviation, u.standard_deviation, clock, span=float(clock[-1]))
        found.append(BoxEffect(BANK["parameter_drift"], u.name, scene))
        for k, name in enumerate(problem.map.signals):
            signal = problem.data.signals[:, k]
            if (span := float(np.ptp(signal))) > 0.0:
                scene = Surroundings(h, u.standard_deviation, u.standard_deviation, signal, span=span)
                found.append(BoxEffect(BANK["parameter_dependence"], u.name, scene, signal=name))
    return found


def _of_cuts(problem: BoxProblem, nominal: Array) -> list[BoxEffect]:
    """Return what may lie in the connections between FMUs; the direction of an effort is seen in the nominal run."""
    found: list[BoxEffect] = []
    reads = problem.runner.reads
    for name, cut in problem.map.cuts.items():
        wire = next(c for c in problem.runner.subject.connections if c.target == cut.input)
        near = wire.factor * nominal[:, reads.index(wire.source)] + wire.offset
        span = float(np.ptp(near)) or 1.0
        size = 0.01 * span
        if cut.far is not None:
            twist = near - nominal[:, reads.index(cut.far)]
            size = float(np.std(twist)) or size
            scene = Surroundings(problem.h, size, span, near, span=span)
            found.append(BoxEffect(BANK["backlash"], name, scene))
        if cut.effort is not None:
            effort = nominal[:, reads.index(cut.effort)]
            if cut.far is not None:
                problem.sign[name] = -1.0 if float(np.mean(effort * twist)) < 0.0 else 1.0
            scene = Surroundings(problem.h, size, span, near, span=span, effort=_rms(effort) or 1.0)
            found.append(BoxEffect(BANK["compliance"], name, scene))
    return found


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
