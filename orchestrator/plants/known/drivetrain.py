"""Motor with lag, gear with backlash, elastic shaft, load: the FMU ``Drivetrain``."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.effects.of_logs import EARLY_TORQUE, LATE_LOAD, LEAD, SAMPLED, SAMPLED_TORQUE, SHIFT
from orchestrator.effects.of_plants import DRIVETRAIN_BANK, PRESLIDING, build_up_distance
from orchestrator.plants.description import Body, CompiledEquations, Drive, Plant, Resonance, Shaft
from orchestrator.shared.cores import cache_once
from pyfmu_sources import equations as dt
from pyfmu_sources.backlash_models import GRADUAL, MODELS
from pyfmu_sources.bristles import unloaded_l, unloaded_m
from pyfmu_sources.parameter_rows import BIG

Array = NDArray[np.float64]

SETTING_IN = 4.0  # distances over which the damping of teeth sets in, after which it is all there
NUISANCES = ("presliding.motor", "presliding.load", "contact.onset")

SELDOM = (
    "alpha", "backlash_model", "contact_", "restitution", "effects.impact_damping", "effects.gear_eccentricity",
    "effects.varying_", "effects.periodic_friction", "effects.load_dependent_friction", "effects.extra_resonance",
    "effects.spring_load", "effects.end_stop", "effects.torque_ripple.second", "effects.torque_ripple.third",
)  # fmt: skip
"""How names of parameters begin that few models need, and that take as long as all others together."""


def refusal(values: Mapping[str, float]) -> str:
    """Return why a drivetrain's backlash model cannot be diagnosed: the analysis is elastic."""
    chosen = MODELS[int(values["backlash_model"])]
    if chosen.predicted:
        return ""
    *others, last = (model.name for model in MODELS if model.predicted)
    return f"`backlash_model` must be {', '.join(others)} or {last} for a diagnosis, but is {chosen.name}"


@cache_once
def _whole() -> Any:
    """Return ``whole(x, u)``, compiled: the state of the FMU's equations.

    The analysis bends its own bristles, gets a filtered request, and its last state is the shaft's memory.
    """
    from numba import njit

    from orchestrator.shared.numba_cache import ALGEBRA, UNCOUNTED

    @njit(error_model="numpy", **ALGEBRA, **UNCOUNTED)
    def whole(x: Any, u: float) -> Any:
        return (x[0], x[1], x[2], x[3], x[4], x[5], x[6], 0.0, 0.0, 0.0, x[7], u)

    return whole


def _dry() -> tuple[Any, Any]:
    """Return the compiled levels of dry friction, and those to which distances of presliding belong."""
    from numba import njit

    from orchestrator.plants.compiled import compile_module
    from orchestrator.plants.sample import named_of
    from orchestrator.shared.numba_cache import ALGEBRA, UNCOUNTED

    source, bristles, whole = compile_module("equations"), compile_module("bristles"), _whole()
    twist, contact_of, elastic, lever_arm = source.twist, source.contact_of, source.elastic_torque, source.lever_arm
    friction_m, friction_l, rest_m, rest_l = source.friction_m, source.friction_l, bristles.rest_m, bristles.rest_l
    named = named_of(dt.DrivetrainParameters)

    @njit(error_model="numpy", **ALGEBRA, **UNCOUNTED)
    def friction(x: Any, values: Any) -> Any:
        p, full, shaft = named(values), whole(x, 0.0), 0.0
        if p.load_dependent_friction_motor_coefficient + p.load_dependent_friction_load_coefficient > 0.0:
            contact = contact_of(twist(full, p), p.alpha) if p.alpha > 0.0 else 1
            shaft = elastic(full, contact, p)
        return friction_m(full, shaft * lever_arm(full, p), p), friction_l(full, shaft, p)

    @njit(error_model="numpy", **ALGEBRA, **UNCOUNTED)
    def rest_levels(values: Any) -> Any:
        p = named(values)
        at_motor, at_load = rest_m(p), rest_l(p)
        wavy = (p.periodic_friction_motor_amplitude, p.periodic_friction_load_amplitude)
        levels = (at_motor if at_motor > 0.0 else abs(wavy[0]), at_load if at_load > 0.0 else abs(wavy[1]))
        loaded = (p.load_dependent_friction_motor_coefficient, p.load_dependent_friction_load_coefficient)
        varies = (loaded[0] != 0.0 or wavy[0] != 0.0, loaded[1] != 0.0 or wavy[1] != 0.0)
        return levels, varies

    return friction, rest_levels


def _flanks() -> tuple[Any, Any]:
    """Return, compiled, whether a model has teeth or end stops that meet, and whether any may within a time."""
    from numba import njit

    from orchestrator.plants.compiled import compile_module
    from orchestrator.plants.sample import named_of, travel_bound
    from orchestrator.shared.numba_cache import ALGEBRA, UNCOUNTED

    source, whole = compile_module("equations"), _whole()
    twist, twist_slope = source.twist, source.twist_slope
    named, onset_at, far = named_of(dt.DrivetrainParameters), dt.COUNT + 2, BIG

    @njit(error_model="numpy", **ALGEBRA, **UNCOUNTED)
    def flanks(values: Any) -> Any:
        p = named(values)
        return p.alpha > 0.0 or p.end_stop_lower > -far or p.end_stop_upper < far

    @njit(error_model="numpy", **ALGEBRA, **UNCOUNTED)
    def meets(x: Any, rate: Any, values: Any, h: float) -> Any:
        p = named(values)
        way = travel_bound(x[3], rate[3], h)
        if abs(x[2] - p.end_stop_lower) < way or abs(x[2] - p.end_stop_upper) < way:
            return True
        if p.alpha == 0.0:
            return False
        full = whole(x, 0.0)
        slope = twist_slope(full, p)
        depth = abs(twist(full, p)) - p.alpha
        way = travel_bound(x[1] * slope - x[3], rate[1] * slope - rate[3], h)
        return -way < depth < way + SETTING_IN * math.exp(values[onset_at])

    return flanks, meets


@cache_once
def _stage() -> CompiledEquations:
    """Return the compiled equations, with the damping of teeth that meet growing with their penetration."""
    from orchestrator.plants.compiled import compile_module
    from orchestrator.plants.sample import named_of
    from orchestrator.shared.numba_cache import ALGEBRA, UNCOUNTED, njit_on_disk

    source, whole = compile_module("equations"), _whole()
    rates, twist, contact_of = source.rates, source.twist, source.contact_of
    twist_rate, lever_arm = source.twist_rate, source.lever_arm
    named, end, onset_at = named_of(dt.DrivetrainParameters), dt.COUNT, dt.COUNT + 2
    friction, rest = _dry()

    @njit_on_disk(error_model="numpy", **ALGEBRA, **UNCOUNTED)
    def smooth_stage(x: Any, signs: Any, values: Any, u: float) -> Any:
        p, full = named(values), whole(x, u)
        angle = twist(full, p)
        contact = contact_of(angle, p.alpha) if p.alpha > 0.0 else 1
        r = rates(full, contact, signs[0], signs[1], p, u, 0.0)
        motor, load = 0.0, 0.0
        if p.alpha > 0.0 and contact != 0 and p.impact_damping_depth == 0.0:
            depth = abs(angle) - p.alpha
            lacking = p.c * twist_rate(full, p) * math.exp(-depth / math.exp(values[onset_at]))
            motor, load = lacking * lever_arm(full, p) / p.J_m, lacking / p.J_l
        lag = (u - x[4]) / p.tau
        return (r[0], r[1] + motor, r[2], r[3] - load, lag, r[5], r[6], r[10])

    return CompiledEquations(friction, smooth_stage, (end, end + 1), rest, *_flanks())


@cache_once
def _runner() -> Any:
    """Return the compiled, event-located simulation."""
    from orchestrator.plants.compiled import compile_module
    from orchestrator.plants.sample import run_with_record
    from orchestrator.shared.numba_cache import njit_on_disk

    source = compile_module("drivetrain")
    advance, initial_mode, step_table, consistent, has_nonlinear_effect = (
        source.advance, source.initial_mode, source.step_table, source.consistent_start, source.has_nonlinear_effect,
    )  # fmt: skip

    @njit_on_disk(nogil=True)
    def run(start: Any, values: Array, p: Any, early: Array, late: Array, first: float, h: float, out: Array) -> None:
        x = consistent((start[0], start[1], start[2], start[3], start[4], start[5], start[6], 0.0), p)
        x = (x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8], x[9], start[7], start[8])
        mode = initial_mode(x, p)
        nonlinear = has_nonlinear_effect(values)
        whole = step_table(p, h, nonlinear)
        before = step_table(p, max(first, 1e-9), nonlinear)
        after = step_table(p, max(h - first, 1e-9), nonlinear)
        for n in range(out.shape[0]):
            out[n, 0], out[n, 1] = x[0], x[2]
            if first <= 1e-9:
                x, mode = advance(x, mode, p, late[n], 0.0, h, whole)
            else:
                x, mode = advance(x, mode, p, early[n], 0.0, first, before)
                x, mode = advance(x, mode, p, late[n], 0.0, h - first, after)

    return run_with_record(dt.DrivetrainParameters, run)


def fmu_parameters(p: Array) -> Array:
    """Return the FMU's own parameters of a model (n,): fitted distances of friction and contact included.

    Args:
        p: the parameters of the analysis, (n,).
    """
    own = dt.DrivetrainParameters._make(p[: dt.COUNT])
    gap = own.alpha if int(own.backlash_model) in GRADUAL else 0.0
    ons = (unloaded_m(own), unloaded_l(own), gap)
    fields = ("presliding_motor_distance", "presliding_load_distance", "impact_damping_depth")
    for field, on, fitted in zip(fields, ons, p[dt.COUNT : dt.COUNT + len(fields)], strict=True):
        if on > 0.0:
            own = own._replace(**{field: build_up_distance(getattr(own, field), float(fitted))})
    return np.array(own)


PLANT = Plant(
    name="Drivetrain",
    table=dt.PARAMETERS,
    linear=("J_m", "J_l", "k", "c", "b_m", "b_l", "i", "tau"),
    spread=0.05,
    states=(0, 1, 2, 3, 4),
    bodies=(
        Body("motor", angle=0, speed=1, inertia="J_m", encoder="theta_m", viscous="b_m"),
        Body("load", angle=2, speed=3, inertia="J_l", encoder="theta_l", geared=True, viscous="b_l"),
    ),
    shaft=Shaft(stiffness="k", ratio="i", gap="alpha"),
    drive=Drive(
        4,
        "tau",
        "effects.input_delay.delay",
        "effects.torque_saturation.limit",
        "effects.drive_filter.time_constant",
        "effects.rate_limit.rate",
    ),
    resonance=Resonance("effects.extra_resonance.inertia", "effects.extra_resonance.frequency"),
    followers=((5, 2), (6, 3)),
    starts={0: "theta_m_start", 1: "omega_m_start", 2: "theta_l_start", 3: "omega_l_start", 4: "T_m_start"},
    offsets=("effects.sensor_offset.motor.offset", "effects.sensor_offset.load.offset"),
    nuisances=(*(PRESLIDING._replace(name=name) for name in NUISANCES), LEAD, SHIFT, SAMPLED),
    enumerations=("backlash_model",),
    bank=(*DRIVETRAIN_BANK, EARLY_TORQUE, LATE_LOAD, SAMPLED_TORQUE),
    stage=_stage,
    runner=_runner,
    refused=refusal,
    realised=fmu_parameters,
    seldom=tuple(entry.name for entry in dt.PARAMETERS if entry.name.startswith(SELDOM)),
)
