"""The effects that plants may lack, one row each, which says on which plants it stands.

``docs/extending.md`` walks through an example.
"""

import math
from collections.abc import Callable, Mapping

import numpy as np

from orchestrator.effects import of_bodies, of_logs
from orchestrator.effects.effect import BOTH_PLANTS, DRIVETRAIN, Effect, SignalScales, rms
from orchestrator.effects.of_logs import is_within, longest_lag, longest_time, times
from pyfmu_sources.laws.parameter_rows import BIG, Parameter

# Of the analysis alone: logarithm [rad] of the distance over which dry friction builds up, or of the penetration over
# which the damping of teeth in contact does.
PRESLIDING = Parameter("presliding", "1", math.log(1e-5), math.log(1e-9), 0.0, "Logarithm of a build-up distance")

# Shorter distances [rad] than an encoder sees are left out of the FMU, where they would only cost time.
SHORTEST = 1e-7

DEEPEST_STOP = 0.2  # of the travel that lies beyond an end stop: what begins further in is a spring
MOST_BEHIND = 0.5  # of the rows in which a torque may be behind its request for a limit of its rate
LEAST_COULOMB = 0.2  # of the breakaway torque that is left at speed: friction that vanishes there is no Stribeck curve
ANY_DISTANCE = 3.0  # deviation of the logarithm of a build-up distance about the encoder's resolution: twenty times
SMALL_LOGARITHM = 0.05  # step of its derivative
LEAST_CYCLES = 1.5  # of a wave within the travel: what comes round less often is told from no spring


def build_up_distance(stated: float, fitted: float) -> float:
    """Return the build-up distance [rad] that the FMU gets: the fitted one, or as stated where none was fitted.

    Args:
        stated: distance in the model's own parameters [rad]; 0: none.
    """
    if fitted == PRESLIDING.default:
        return stated
    distance = math.exp(fitted)
    return distance if distance >= SHORTEST else 0.0


def group(effect: str, *names: str) -> dict[str, str]:
    """Return short name -> name in the table of an effect's parameters."""
    return {name.rpartition(".")[2]: f"effects.{effect}.{name}" for name in names}


# A body of the axis is its motor.
_PLANTS = {"motor": BOTH_PLANTS, "load": (DRIVETRAIN,)}


def _largest_torque(scales: SignalScales, site: str) -> float:
    return float(np.abs(scales.requests).max()) * (1.0 if site == "motor" else scales.ratio)


def _dry_friction(site: str) -> tuple[Effect, Effect, Effect]:
    """Return the rows of Coulomb's, Stribeck's and load-dependent friction at a body."""

    def small(scales: SignalScales) -> float:
        return 0.01 * scales.torque_at(site)

    def distance(scales: SignalScales) -> float:
        return math.log(scales.resolutions[site])

    def build_up(scales: SignalScales) -> dict[str, tuple[float, float]]:
        return {"presliding": (distance(scales), ANY_DISTANCE)}

    def speeds(scales: SignalScales) -> tuple[float, ...]:
        return tuple(share * scales.rms_speed(site) for share in (0.05, 0.15, 0.4))

    unreported = {"presliding": f"presliding.{site}"}
    coulomb = Effect(
        "coulomb_friction", site, "friction", group("coulomb_friction", f"{site}.torque"), "torque",
        lambda s: {"torque": small(s), "presliding": SMALL_LOGARITHM}, lambda s: {"presliding": (distance(s),)},
        ("torque",), signed=False, priors=build_up, unreported=unreported,
        possible=lambda v, s: v["torque"] < _largest_torque(s, site), against="speed",
        motion="a constant torque against the direction of motion; at a reversal the axis sticks", plants=_PLANTS[site],
    )  # fmt: skip
    stribeck = Effect(
        "stribeck_friction", site, "friction",
        group("stribeck_friction", f"{site}.coulomb", f"{site}.breakaway", f"{site}.stribeck_speed"), "breakaway",
        lambda s: {"coulomb": small(s), "breakaway": small(s), "stribeck_speed": 0.05 * s.rms_speed(site),
                   "presliding": SMALL_LOGARITHM},
        lambda s: {"stribeck_speed": speeds(s), "presliding": (distance(s),)}, ("coulomb", "breakaway"), signed=False,
        bounds=lambda s: {"stribeck_speed": (0.005 * s.rms_speed(site), math.inf)}, priors=build_up,
        unreported=unreported,
        possible=lambda v, s: 1.02 * v["coulomb"] < v["breakaway"] < 1.5 * _largest_torque(s, site)
        and v["coulomb"] > LEAST_COULOMB * v["breakaway"]
        and v["stribeck_speed"] > 0.01 * s.rms_speed(site),
        contains="coulomb_friction", against="speed",
        motion="a torque against the direction of motion, largest at very low speed: stick-slip",
        plants=_PLANTS[site],
    )  # fmt: skip
    loaded = Effect(
        "load_dependent_friction", site, "friction", group("load_dependent_friction", f"{site}.coefficient"),
        "coefficient", lambda s: {"coefficient": 0.01, "presliding": SMALL_LOGARITHM},
        lambda s: {"presliding": (distance(s),)}, ("coefficient",), signed=False,
        bounds=lambda s: {"coefficient": (0.0, 0.9)}, priors=build_up, unreported=unreported,
        possible=lambda v, s: v["coefficient"] < 0.5, against="speed",
        motion="a torque against the direction of motion, in proportion to the transmitted torque: lower efficiency",
    )  # fmt: skip
    return coulomb, stribeck, loaded


def _directional_friction(site: str) -> Effect:
    return Effect(
        "directional_friction", site, "speed", group("directional_friction", f"{site}.difference"), "difference",
        lambda s: {"difference": 0.01 * s.torque_at(site) / s.rms_speed(site)}, amplitudes=("difference",),
        possible=lambda v, s: abs(v["difference"]) <= v["viscous"], against="speed",
        motion="the axis is braked more in one direction than in the other", plants=_PLANTS[site],
    )  # fmt: skip


def _timing(name: str, parameter: str, top: Callable[[SignalScales], float], motion: str) -> Effect:
    return Effect(
        name, "actuator", "timing", group(name, parameter), parameter, lambda s: {parameter: 0.3 * s.step},
        lambda s: {parameter: times(s, top(s))}, bounds=lambda s: {parameter: (0.0, top(s))},
        possible=lambda v, s: is_within(v[parameter], s, top(s)), takes_drive=True, motion=motion,
        plants=BOTH_PLANTS,
    )  # fmt: skip


def _largest_request(scales: SignalScales) -> float:
    return float(np.abs(scales.requests).max())


def _limits(scales: SignalScales) -> tuple[float, ...]:
    return tuple(float(q) for q in np.quantile(np.abs(scales.requests), (0.995, 0.98, 0.95, 0.9, 0.8, 0.65)))


def _middle_request(scales: SignalScales) -> float:
    return float(np.quantile(np.abs(scales.requests), 0.6))


def _changes(scales: SignalScales) -> np.ndarray:
    rates = np.abs(np.diff(scales.requests)) / scales.step
    return rates[rates > 0.0]


def _rates(scales: SignalScales) -> tuple[float, ...]:
    changes = _changes(scales)
    shares = (0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98)
    return tuple(float(q) for q in np.quantile(changes, shares)) if changes.size else ()


def _is_reached(rate: float, scales: SignalScales) -> bool:
    """Tell whether the request goes beyond a rate [N.m/s] at times: what holds it back always is a lag."""
    step, torque, behind = rate * scales.step, float(scales.requests[0]), 0
    for request in scales.requests.tolist():
        torque += min(max(request - torque, -step), step)
        behind += torque != request
    return 0 < behind < MOST_BEHIND * scales.requests.size


def _small_twist(scales: SignalScales) -> float:
    return 0.02 * scales.typical_twist


def _gaps(scales: SignalScales) -> tuple[float, ...]:
    if not scales.twist_is_measured:
        return tuple(float(f * scales.typical_twist) for f in np.geomspace(0.3, 15.0, 14))
    return tuple(float(q) for q in np.quantile(np.abs(scales.twist), (0.03, 0.1, 0.2, 0.35, 0.5, 0.7)))


def _is_gap(values: Mapping[str, float], scales: SignalScales) -> bool:
    return not scales.twist_is_measured or values["alpha"] < 0.95 * float(np.abs(scales.twist).max())


def _wave(name: str, site: str, small: str, motion: str, plants: tuple[str, ...] = (DRIVETRAIN,)) -> Effect:
    """Return the row of a wave over the motor's angle; ``small`` says what its amplitude is measured by."""

    def least(scales: SignalScales) -> float:
        return LEAST_CYCLES / scales.turns

    sizes = {"torque": lambda s: 0.01 * s.torque, "twist": _small_twist}
    return Effect(
        name, site, "wave", group(name, "amplitude", "cycles_per_rev", "phase"), "amplitude",
        lambda s: {"amplitude": sizes[small](s), "cycles_per_rev": 0.02 / s.turns}, amplitudes=("amplitude",),
        phase="phase", bounds=lambda s: {"cycles_per_rev": (least(s), math.inf)},
        possible=lambda v, s: v["cycles_per_rev"] > 1.03 * least(s), wave_site="motor", angular=True,
        motion=motion, plants=plants,
    )  # fmt: skip


def _end_stop(side: str) -> Effect:
    """Return the row of the end stop on one side: where it stands and how stiff it is; its damping is that of metal."""

    def angles(scales: SignalScales) -> tuple[float, ...]:
        x = scales.angles["load"]
        travel = float(np.ptp(x)) + 1e-12
        end, inwards = (float(x.max()), -travel) if side == "upper" else (float(x.min()), travel)
        return tuple(end + share * inwards for share in (0.0005, 0.002, 0.006, 0.02, 0.06, 0.15))

    def stiffness(scales: SignalScales) -> float:
        return scales.torque_at("load") / (float(np.ptp(scales.angles["load"])) + 1e-12)

    def is_touched(values: Mapping[str, float], scales: SignalScales) -> bool:
        x = scales.angles["load"]
        depth = x.max() - values["angle"] if side == "upper" else values["angle"] - x.min()
        return bool(0.0 < depth < DEEPEST_STOP * np.ptp(x)) and values["stiffness"] > 0.0

    return Effect(
        f"{side}_end_stop", "load", "position",
        {"angle": f"effects.end_stop.{side}", "stiffness": "effects.end_stop.stiffness"}, "stiffness",
        lambda s: {"angle": 1e-3 * float(np.ptp(s.angles["load"])), "stiffness": stiffness(s)},
        lambda s: {"angle": angles(s)}, ("stiffness",), signed=False, possible=is_touched, against="position",
        motion=f"the axis runs into a stop at the {side} end and bounces", plants=BOTH_PLANTS,
    )  # fmt: skip


_OFFSET = "the encoders' zeros differ from the model's: no influence on the motion, but a biased twist"
PLANT_BANK: tuple[Effect, ...] = (
    Effect(
        "backlash", "shaft", "gap", {"alpha": "alpha"}, "alpha", lambda s: {"alpha": _small_twist(s)},
        lambda s: {"alpha": _gaps(s)}, possible=_is_gap,
        motion="between the flanks the motor turns alone; the load follows late, and each contact is an impact",
    ),
    *_dry_friction("motor"),
    *_dry_friction("load"),
    _end_stop("lower"),
    _end_stop("upper"),
    _timing("input_delay", "delay", longest_time,
            "the torque is delayed, which reduces the phase margin of every control loop"),
    _timing("drive_filter", "time_constant", longest_lag,
            "the torque is delayed and smoothed, which reduces the phase margin of every control loop"),
    Effect(
        "torque_saturation", "actuator", "limit", group("torque_saturation", "limit"), "limit",
        lambda s: {"limit": 0.02 * _largest_request(s)}, lambda s: {"limit": _limits(s)},
        bounds=lambda s: {"limit": (_middle_request(s), BIG)},
        possible=lambda v, s: _middle_request(s) < v["limit"] < 0.999 * _largest_request(s), takes_drive=True,
        motion="requests beyond the limit are not delivered: the axis lags when it must accelerate most",
        plants=BOTH_PLANTS,
    ),
    Effect(
        "rate_limit", "actuator", "timing", group("rate_limit", "rate"), "rate",
        lambda s: {"rate": 0.02 * float(np.max(np.abs(np.diff(s.requests)))) / s.step}, lambda s: {"rate": _rates(s)},
        bounds=lambda s: {"rate": (1e-3 * float(np.max(_changes(s), initial=1.0)), BIG)},
        possible=lambda v, s: _is_reached(v["rate"], s) and not s.torque_raster, takes_drive=True,
        motion="the torque cannot follow fast requests: steps become ramps, and the axis responds late",
        plants=BOTH_PLANTS,
    ),
    Effect(
        "hardening_stiffness", "shaft", "gap", group("hardening_stiffness", "cubic", "sharpness"), "cubic",
        lambda s: {"cubic": 0.05 * s.stiffness / s.typical_twist**2, "sharpness": 0.3},
        lambda s: {"sharpness": (0.0, 0.6, 1.2)}, ("cubic",), signed=False,
        bounds=lambda s: {"sharpness": (0.0, 5.0)}, priors=lambda s: {"sharpness": (0.6, 0.6)},
        motion="the shaft is soft for small twists and stiff for large ones: its resonance depends on the torque",
    ),
    _wave("torque_ripple", "motor", "torque",
          "a torque that is periodic in the motor's angle: speed ripple at a constant request", BOTH_PLANTS),
    _wave("gear_eccentricity", "shaft", "twist",
          "the load's angle deviates periodically from the motor's, once in each cycle of the gear"),
    Effect(
        "load_torque", "load", "constant", group("load_torque", "torque"), "torque",
        lambda s: {"torque": 0.01 * s.torque_at("load")}, amplitudes=("torque",),
        motion="a constant torque pulls the load to one side", plants=BOTH_PLANTS,
    ),
    Effect(
        "gravity_load", "load", "position", group("gravity_load", "amplitude", "phase"), "amplitude",
        lambda s: {"amplitude": 0.01 * s.torque_at("load")}, amplitudes=("amplitude",), phase="phase", angular=True,
        against="angle",
        motion="a torque that is periodic in the load's angle: it drives on one side and brakes on the other",
        plants=BOTH_PLANTS,
    ),
    Effect(
        "extra_resonance", "load", "resonance",
        group("extra_resonance", "inertia", "frequency", "damping_ratio"), "inertia",
        lambda s: {"inertia": 0.02 * s.inertia, "frequency": 0.5, "damping_ratio": 0.01},
        lambda s: {"frequency": tuple(2.0 * np.pi * f for f in np.geomspace(s.cutoff / 12, 0.8 * s.cutoff, 20)),
                   "damping_ratio": (0.03,)},
        ("inertia",), signed=False, bounds=lambda s: {"frequency": (0.1, 2.0 * np.pi * s.cutoff),
                                                      "damping_ratio": (0.0, 1.0)},
        priors=lambda s: {"damping_ratio": (0.03, 0.03)}, memory=True,
        motion="a part of the load oscillates separately: a further resonance and its antiresonance",
    ),
    *of_bodies.AT_LOAD,
    Effect(
        "sensor_offset", "motor", "constant", group("sensor_offset", "motor.offset"), "offset",
        lambda s: {"offset": _small_twist(s) * s.ratio}, amplitudes=("offset",), both_encoders=True,
        motion=_OFFSET,
    ),
    Effect(
        "sensor_offset", "load", "constant", group("sensor_offset", "load.offset"), "offset",
        lambda s: {"offset": _small_twist(s)}, amplitudes=("offset",), both_encoders=True,
        motion=_OFFSET,
    ),
    _directional_friction("motor"),
    _directional_friction("load"),
    # Spring and varying inertia are not searched on the axis, whose FMU has them: without a second encoder they take up
    # what an imperfect law of dry friction leaves.
    Effect(
        "spring_load", "load", "position", group("spring_load", "stiffness", "angle"), "stiffness",
        lambda s: {"stiffness": 0.01 * s.torque_at("load") / rms(s.angles["load"] - s.angles["load"].mean()),
                   "angle": 0.05},
        lambda s: {"angle": (float(s.angles["load"].mean()),)}, ("stiffness",), signed=False, against="position",
        motion="a torque that pulls the load to one position, in proportion to the distance from it",
    ),
    Effect(
        "varying_inertia", "load", "position", group("varying_inertia", "amplitude", "phase"), "amplitude",
        lambda s: {"amplitude": 0.02 * s.inertia}, amplitudes=("amplitude",), phase="phase", angular=True,
        motion="the load's inertia depends on its angle",
    ),
    Effect(
        "shaft_hysteresis", "shaft", "gap", group("shaft_hysteresis", "torque", "twist"), "torque",
        lambda s: {"torque": 0.01 * s.torque_at("load"), "twist": 0.05 * s.typical_twist},
        lambda s: {"twist": tuple(f * s.typical_twist for f in (0.1, 0.4, 1.2))}, ("torque",), signed=False,
        bounds=lambda s: {"twist": (0.02 * s.typical_twist, 5.0 * s.typical_twist)},
        possible=lambda v, s: v["twist"] < 4.75 * s.typical_twist, memory=True,
        motion="the twist depends on the history of the torque: lost motion without a gap",
    ),
    of_logs.EARLY_TORQUE,
    of_logs.LATE_LOAD,
    of_logs.SAMPLED_TORQUE,
    *of_logs.ECCENTRIC_ENCODERS,
)  # fmt: skip


def bank_of(plant: str) -> tuple[Effect, ...]:
    """Return the effects and nuisances that stand on a ``plant``, by its name."""
    return tuple(row for row in PLANT_BANK if plant in row.plants)
