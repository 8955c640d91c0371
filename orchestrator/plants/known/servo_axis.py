"""One inertia, or mass, behind the lag of its drive: the FMU ``ServoAxis``."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.effects.of_logs import EARLY_TORQUE, LEAD, SAMPLED, SAMPLED_TORQUE
from orchestrator.effects.of_plants import DRIVETRAIN_BANK, PRESLIDING, build_up_distance
from orchestrator.plants.description import Body, CompiledEquations, Drive, Plant
from orchestrator.shared.cores import cache_once
from pyfmu_sources import axis_equations as ap
from pyfmu_sources.axis_equations import breakaway_torque
from pyfmu_sources.parameter_rows import BIG

Array = NDArray[np.float64]

# Not searched: a spring and a varying inertia. Without a second encoder they take up what an imperfect law of dry
# friction leaves; the FMU has them.
_SHARED = ("coulomb_friction@motor", "stribeck_friction@motor", "input_delay@actuator", "torque_saturation@actuator",
           "torque_ripple@motor", "load_torque@load", "gravity_load@load", "quadratic_drag@load",
           "drive_filter@actuator", "directional_friction@motor", "rate_limit@actuator", "lower_end_stop@load",
           "upper_end_stop@load")  # fmt: skip

SERVO_AXIS_BANK = tuple(effect for effect in DRIVETRAIN_BANK if effect.label in _SHARED)


@cache_once
def stage() -> CompiledEquations:
    """Return the compiled equations."""
    from numba import njit

    from orchestrator.plants.compiled import compile_module
    from orchestrator.plants.sample import named_of, travel_bound
    from orchestrator.shared.numba_cache import ALGEBRA, UNCOUNTED, njit_on_disk

    source = compile_module("servo_axis")
    rates, level, breakaway = source.rates, source.friction, compile_module("axis_equations").breakaway_torque
    named, end, far = named_of(ap.AxisParameters), ap.COUNT, BIG

    @njit(error_model="numpy", **ALGEBRA, **UNCOUNTED)
    def friction(x: Any, values: Any) -> Any:
        return level((x[0], x[1], x[4], 0.0, 0.0), named(values)), 0.0

    @njit(error_model="numpy", **ALGEBRA, **UNCOUNTED)
    def rest_levels(values: Any) -> Any:
        p = named(values)
        at_rest, wavy = breakaway(p), p.periodic_friction_motor_amplitude
        return (at_rest if at_rest > 0.0 else abs(wavy), 0.0), (wavy != 0.0, False)

    @njit(error_model="numpy", **ALGEBRA, **UNCOUNTED)
    def flanks(values: Any) -> Any:
        p = named(values)
        return p.end_stop_lower > -far or p.end_stop_upper < far

    @njit(error_model="numpy", **ALGEBRA, **UNCOUNTED)
    def meets(x: Any, rate: Any, values: Any, h: float) -> Any:
        p, way = named(values), travel_bound(x[1], rate[1], h)
        return abs(x[0] - p.end_stop_lower) < way or abs(x[0] - p.end_stop_upper) < way

    @njit_on_disk(error_model="numpy", **ALGEBRA, **UNCOUNTED)
    def smooth_stage(x: Any, signs: Any, values: Any, u: float) -> Any:
        speed, acceleration, lag, _, _ = rates((x[0], x[1], x[4], 0.0, u), signs[0], named(values), u, 0.0)
        return (speed, acceleration, 0.0, 0.0, lag, 0.0, 0.0, 0.0)

    return CompiledEquations(friction, smooth_stage, (end, end), rest_levels, flanks, meets)


@cache_once
def runner() -> Any:
    """Return the compiled, event-located simulation."""
    from orchestrator.plants.compiled import compile_module
    from orchestrator.plants.sample import run_with_record
    from orchestrator.shared.numba_cache import njit_on_disk

    source = compile_module("servo_axis")
    advance, initial_mode, begin = source.advance, source.initial_mode, source.start

    @njit_on_disk(nogil=True)
    def run(start: Any, values: Array, p: Any, early: Array, late: Array, first: float, h: float, out: Array) -> None:
        x = begin(start[0], start[1], start[4], p)
        x = (x[0], x[1], x[2], x[3], start[8])
        mode = initial_mode(x, p, early[0])
        for n in range(out.shape[0]):
            out[n, 0], out[n, 1] = x[0], 0.0
            if first > 1e-9:
                x, mode = advance(x, mode, p, early[n], 0.0, first)
            x, mode = advance(x, mode, p, late[n], 0.0, h - first)

    return run_with_record(ap.AxisParameters, run)


def _fmu_parameters(p: Array) -> Array:
    """Return the FMU's own parameters of a model (n,): the fitted distance of friction included."""
    own = ap.AxisParameters._make(p[: ap.COUNT])
    if breakaway_torque(own) > 0.0:
        distance = build_up_distance(own.presliding_motor_distance, float(p[ap.COUNT]))
        own = own._replace(presliding_motor_distance=distance)
    return np.array(own)


PLANT = Plant(
    name="ServoAxis",
    table=ap.PARAMETERS,
    linear=("J", "b", "tau"),
    states=(0, 1, 4),
    bodies=(Body("motor", angle=0, speed=1, inertia="J", encoder="theta_m", viscous="b"),),
    drive=Drive(
        4,
        "tau",
        "effects.input_delay.delay",
        "effects.torque_saturation.limit",
        "effects.drive_filter.time_constant",
        "effects.rate_limit.rate",
    ),
    starts={0: "theta_m_start", 1: "omega_m_start", 4: "T_m_start"},
    offsets=("effects.sensor_offset.motor.offset",),
    nuisances=(PRESLIDING._replace(name="presliding.motor"), LEAD, SAMPLED),
    bank=(*SERVO_AXIS_BANK, EARLY_TORQUE, SAMPLED_TORQUE),
    stage=stage,
    runner=runner,
    realised=_fmu_parameters,
)
