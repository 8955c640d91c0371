"""The bank of effects: one row each, with what a fit needs to start from and how large the effect may be.

A new effect needs its term in ``pyfmu_sources/effects.py`` (and the equations that call it), its parameters in the
plant's table, and one row here; ``docs/diagnosis.md`` walks through an example.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.plants.effects import LEAST_CYCLES, Effect, Scene, Start
from pyfmu_sources.drivetrain_parameters import BIG, Parameter

Array = NDArray[np.float64]

# Of the predictor alone: logarithm [rad] of the distance over which dry friction builds up, or of the penetration over
# which the damping of teeth in contact does.
PRESLIDING = Parameter("presliding", "1", math.log(1e-5), math.log(1e-9), 0.0, "Logarithm of a build-up distance")


# Shorter distances [rad] than an encoder sees are left out of the FMU, where they would only cost time.
SHORTEST = 1e-7


def built_up(stated: float, fitted: float) -> float:
    """Return the build-up distance [rad] that the FMU gets: the fitted one, or as stated where none was fitted.

    Args:
        stated: distance in the model's own parameters [rad]; 0: none.
        fitted: logarithm of the distance that the predictor has.

    Returns:
        The distance; 0.0: none.
    """
    if fitted == PRESLIDING.default:
        return stated
    distance = math.exp(fitted)
    return distance if distance >= SHORTEST else 0.0


def group(effect: str, *names: str) -> dict[str, str]:
    """Return short name -> name in the table of an effect's parameters.

    Args:
        effect: its name.

    Returns:
        The names.
    """
    return {name.rpartition(".")[2]: f"effects.{effect}.{name}" for name in names}


def _speed(scene: Scene, site: str) -> float:
    return scene.speed_l if site == "load" else scene.speed_m


def _build_up(scene: Scene, site: str) -> tuple[float, float]:
    return float(np.log(0.04 * scene.h * _speed(scene, site))), 2.0


def _friction(site: str) -> tuple[Effect, Effect]:
    def unit(scene: Scene) -> float:
        return 0.01 * scene.torque * (scene.ratio if site == "load" else 1.0)

    def rms(scene: Scene) -> float:
        return _speed(scene, site)

    def build_up(scene: Scene) -> tuple[float, float]:
        return _build_up(scene, site)

    def start(scene: Scene) -> Start:
        return {"presliding": (build_up(scene)[0],)}

    def refine(values: dict[str, float], scene: Scene) -> tuple[dict[str, float], ...]:
        level = values["torque"]
        common = {"coulomb": 0.9 * level, "breakaway": 1.7 * level, "presliding": values["presliding"]}
        return tuple(common | {"stribeck_speed": f * rms(scene)} for f in (0.04, 0.25))

    def falls(values: dict[str, float]) -> bool:
        return values["breakaway"] > 1.02 * values["coulomb"] > 0.0

    nuisances = {"presliding": f"presliding.{site}"}

    def priors(scene: Scene) -> dict[str, tuple[float, float]]:
        return {"presliding": build_up(scene)}

    def bounds(scene: Scene) -> dict[str, tuple[float, float]]:
        # Crossed in a moment, a lower speed is no more told by any record, and takes the shortest steps of all.
        return {"stribeck_speed": (0.005 * rms(scene), math.inf)}

    names = (f"{site}.coulomb", f"{site}.breakaway", f"{site}.stribeck_speed")
    coulomb = Effect(
        "coulomb_friction", site, group("coulomb_friction", f"{site}.torque"), "torque", unit, start,
        amplitudes=("torque",), scales=lambda s: {"presliding": 0.2},
        family=f"dry friction of the {site}", nuisances=nuisances, priors=priors, leaves=0.04,
        against="speed",
    )  # fmt: skip
    stribeck = Effect(
        "stribeck_friction", site, group("stribeck_friction", *names), "coulomb", unit,
        refine=refine, plausible=falls, bounds=bounds,
        scales=lambda s: {"stribeck_speed": 0.02 * rms(s), "presliding": 0.2},
        family=f"dry friction of the {site}", needs=f"coulomb_friction@{site}", nuisances=nuisances, priors=priors,
        leaves=0.04, against="speed",
    )  # fmt: skip
    return coulomb, stribeck


def _fractions(scene: Scene) -> tuple[float, ...]:
    return tuple(float(scene.twist * f) for f in (0.001, 0.003, 0.01, 0.02, 0.04, 0.08, 0.15, 0.3, 0.6, 0.9))


def _onset(scene: Scene) -> tuple[float, float]:
    return float(np.log(0.03 * scene.twist)), 2.0


def _limits(scene: Scene) -> tuple[float, ...]:
    asked = np.abs(scene.u)
    shares = (0.3, 0.5, 0.7, 0.8, 0.88, 0.93, 0.96, 0.98, 0.99, 0.995, 0.998)
    near_largest = (0.8, 0.84, 0.88, 0.91, 0.94, 0.97, 0.99)
    return tuple(float(v) for v in np.quantile(asked, shares)) + tuple(f * float(asked.max()) for f in near_largest)


def _delays(scene: Scene) -> tuple[float, ...]:
    return tuple(scene.h * f for f in (0.01, 0.02, 0.04, 0.12, 0.3, 0.7, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0))


def _rates(scene: Scene) -> tuple[float, ...]:
    asked = np.abs(np.diff(scene.u)) / scene.h
    changes = asked[asked > 0.0]
    shares = (0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 0.995)
    return tuple(float(v) for v in np.quantile(changes, shares)) if changes.size else ()


def _frequencies(scene: Scene) -> tuple[float, ...]:
    top = 0.8 * np.pi / scene.h
    return tuple(float(f) for f in np.geomspace(min(8.0, top / 8), min(250.0, top), 48))


def _band(scene: Scene) -> tuple[float, float]:
    return 0.5 * _frequencies(scene)[0], 1.2 * _frequencies(scene)[-1]


def _parts_of_the_load(scene: Scene) -> tuple[float, ...]:
    return tuple(f * scene.inertia for f in (3e-4, 1.2e-3, 5e-3, 0.02, 0.08))


def _periodic_at(site: str) -> str:
    return f"periodic, {site}"


def _periodic(
    name: str, site: str, unit: Callable[[Scene], float], tolerance: float = 0.0, leaves: float = 0.01
) -> Effect:
    return Effect(
        name, site, group(name, "amplitude", "cycles_per_rev", "phase"), "amplitude", unit,
        lambda scene: {"cycles_per_rev": scene.cycles.get(name, ())}, amplitudes=("amplitude",), phase="phase",
        scales=lambda scene: {"cycles_per_rev": 0.01 / max(scene.turns, 1e-9), "phase": 0.05},
        bounds=lambda scene: {"cycles_per_rev": (LEAST_CYCLES / max(scene.turns, 1e-9), 1e9)},
        family=_periodic_at(site), tolerance={f"effects.{name}.amplitude": tolerance}, leaves=leaves,
    )  # fmt: skip


def _eccentricity() -> Effect:
    """Return the row of an eccentric gear, whose lever arm follows its ratio, or an encoder's, whose arm does not."""
    wave = _periodic("gear_eccentricity", "shaft", lambda s: 0.003 * s.twist, tolerance=8e-3, leaves=0.04)
    return replace(
        wave,
        parameters=wave.parameters | group(wave.name, "lever_arm"),
        starts=lambda s: wave.starts(s) | {"lever_arm": (0.5,)},
        scales=lambda s: wave.scales(s) | {"lever_arm": 0.3},
        priors=lambda s: {"lever_arm": (0.5, 0.5)},
        shape=("lever_arm",),
    )


def _torque(scene: Scene) -> float:
    return 0.01 * scene.torque


def _load_torque(scene: Scene) -> float:
    return 0.01 * scene.torque * scene.ratio


def _driving(scene: Scene) -> dict[str, tuple[float, float]]:
    """Return which way a constant torque acts: one that holds back what goes one way is dry friction."""
    if not scene.way:
        return {}
    return {"torque": (-BIG, 0.0) if scene.way > 0.0 else (0.0, BIG)}


def directional_friction(site: str) -> Effect:
    """Return the row of viscous friction that differs by direction.

    Args:
        site: "motor" or "load".

    Returns:
        The effect.
    """
    at_load = site == "load"

    def unit(scene: Scene) -> float:
        speed = scene.speed_l if at_load else scene.speed_m
        return 0.01 * scene.torque * (scene.ratio if at_load else 1.0) / max(speed, 1e-12)

    return Effect(
        "directional_friction", site, group("directional_friction", f"{site}.difference"), "difference", unit,
        amplitudes=("difference",), leaves=0.04, against="speed",
    )  # fmt: skip


def _end_stop(side: str) -> Effect:
    """Return the row of the end stop on one side: where it stands, how stiff it is and what it dissipates."""

    def travel(scene: Scene) -> float:
        return max(scene.highest - scene.lowest, 1e-12)

    def angles(scene: Scene) -> tuple[float, ...]:
        end, inwards = (scene.highest, -travel(scene)) if side == "upper" else (scene.lowest, travel(scene))
        return tuple(end + f * inwards for f in (0.0005, 0.002, 0.006, 0.02, 0.06, 0.15))

    def stiffness(scene: Scene) -> tuple[float, ...]:
        return tuple(f * scene.torque * scene.ratio / travel(scene) for f in (3.0, 30.0, 300.0))

    names = {"angle": side, "stiffness": "stiffness", "dissipation": "dissipation"}
    return Effect(
        f"{side}_end_stop", "load", {short: f"effects.end_stop.{name}" for short, name in names.items()},
        "angle", lambda s: 1e-4 * travel(s),
        lambda s: {"angle": angles(s), "stiffness": stiffness(s), "dissipation": (0.1,)},
        scales=lambda s: {"stiffness": 0.1 * stiffness(s)[1], "dissipation": 0.1}, tries=3,
        tolerance={"effects.end_stop.stiffness": 0.01}, leaves=0.06, against="position",
        shared=("stiffness", "dissipation"),
    )  # fmt: skip


def _load_dependent(site: str) -> Effect:
    def build_up(scene: Scene) -> tuple[float, float]:
        # Its distance is that at 1 N.m, what is seen is that at the torque which the shaft carries.
        carried = scene.torque * (scene.ratio if site == "load" else 1.0)
        distance, width = _build_up(scene, site)
        return distance - float(np.log(max(carried, 1e-9))), width

    return Effect(
        "load_dependent_friction", site, group("load_dependent_friction", f"{site}.coefficient"), "coefficient",
        lambda scene: 0.01, lambda scene: {"presliding": (build_up(scene)[0],)}, amplitudes=("coefficient",),
        scales=lambda scene: {"presliding": 0.2}, family=f"dry friction of the {site}",
        nuisances={"presliding": f"presliding.{site}"}, priors=lambda scene: {"presliding": build_up(scene)},
        tolerance={f"effects.load_dependent_friction.{site}.coefficient": 0.01}, leaves=0.04, against="speed",
    )  # fmt: skip


DRIVETRAIN_BANK: tuple[Effect, ...] = (
    Effect(
        "backlash", "shaft", {"alpha": "alpha"}, "alpha", lambda s: 0.003 * s.twist,
        lambda s: {"alpha": _fractions(s), "onset": (_onset(s)[0],)}, family="weak shaft at small torque",
        scales=lambda s: {"onset": 0.2}, nuisances={"onset": "contact.onset"}, priors=lambda s: {"onset": _onset(s)},
        tolerance={"alpha": 2e-3, "k": 5e-4, "J_m": 4e-4, "J_l": 4e-4, "tau": 3e-4, "c": 0.01, "b_m": 3e-3,
                   "b_l": 6e-3}, least_noise=9e-4, leaves=0.025,
    ),
    *_friction("motor"),
    *_friction("load"),
    _load_dependent("motor"),
    _load_dependent("load"),
    _end_stop("lower"),
    _end_stop("upper"),
    Effect(
        "input_delay", "actuator", group("input_delay", "delay"), "delay", lambda s: 0.02 * s.h,
        lambda s: {"delay": _delays(s)}, family="late drive",
    ),
    Effect(
        "torque_saturation", "actuator", group("torque_saturation", "limit"), "limit",
        lambda s: 0.003 * float(np.max(np.abs(s.u))), lambda s: {"limit": _limits(s)},
    ),
    Effect(
        "rate_limit", "actuator", group("rate_limit", "rate"), "rate",
        lambda s: 0.003 * float(np.max(np.abs(np.diff(s.u)))) / s.h, lambda s: {"rate": _rates(s)}, family="late drive",
    ),
    Effect(
        "hardening_stiffness", "shaft", group("hardening_stiffness", "cubic", "sharpness"), "cubic",
        lambda s: 0.02 * s.stiffness / s.twist**2, lambda s: {"sharpness": (0.6,)}, amplitudes=("cubic",),
        scales=lambda s: {"sharpness": 0.3}, priors=lambda s: {"sharpness": (0.6, 0.6)}, shape=("sharpness",),
        family="weak shaft at small torque", leaves=0.03,
    ),
    _periodic("torque_ripple", "motor", _torque),
    _eccentricity(),
    Effect(
        "load_torque", "load", group("load_torque", "torque"), "torque", _load_torque, amplitudes=("torque",),
        bounds=_driving,
    ),
    Effect(
        "gravity_load", "load", group("gravity_load", "amplitude", "phase"), "amplitude", _load_torque,
        amplitudes=("amplitude",), phase="phase", scales=lambda s: {"phase": 0.05}, angular=True,
        against="angle", family=_periodic_at("motor"),  # a ripple of one cycle a turn of the load
    ),
    Effect(
        "extra_resonance", "load", group("extra_resonance", "inertia", "frequency", "damping_ratio"), "inertia",
        lambda s: 0.01 * s.inertia,
        lambda s: {"frequency": _frequencies(s), "damping_ratio": (0.03,), "inertia": _parts_of_the_load(s)},
        scales=lambda s: {"frequency": 0.5, "damping_ratio": 0.01},
        bounds=lambda s: {"frequency": _band(s), "damping_ratio": (0.0, 1.0)},
        priors=lambda s: {"damping_ratio": (0.03, 0.03)},  # of metal: where a record does not tell it, it is not zero
        # Below its resonance the added inertia moves with the load, so the re-fitted J_l already holds it.
        taken_from={"inertia": "J_l"}, tries=3, memory=True,
    ),
    Effect(
        "quadratic_drag", "load", group("quadratic_drag", "coefficient"), "coefficient",
        lambda s: 0.01 * s.torque * s.ratio / s.speed_l**2, amplitudes=("coefficient",),
        against="speed",
    ),
    Effect(
        "sensor_offset", "motor", group("sensor_offset", "motor.offset"), "offset",
        lambda s: 0.003 * s.twist * s.ratio, amplitudes=("offset",),
        family="offset between the encoders", both_encoders=True,
    ),
    Effect(
        "sensor_offset", "load", group("sensor_offset", "load.offset"), "offset", lambda s: 0.003 * s.twist,
        amplitudes=("offset",),
        family="offset between the encoders", both_encoders=True,
    ),
    Effect(
        "drive_filter", "actuator", group("drive_filter", "time_constant"), "time_constant", lambda s: 0.02 * s.h,
        lambda s: {"time_constant": _delays(s)}, family="late drive",
    ),
    directional_friction("motor"),
    directional_friction("load"),
    Effect(
        "spring_load", "load", group("spring_load", "stiffness", "angle"), "stiffness",
        lambda s: 0.01 * s.torque * s.ratio**2 / (2.0 * np.pi * max(s.turns, 1e-9)), lambda s: {"angle": (0.0,)},
        amplitudes=("stiffness",), scales=lambda s: {"angle": 0.05}, against="position",
    ),
    Effect(
        "varying_inertia", "load", group("varying_inertia", "amplitude", "phase"), "amplitude",
        lambda s: 0.01 * s.inertia, amplitudes=("amplitude",), phase="phase", scales=lambda s: {"phase": 0.05},
        angular=True,
    ),
    Effect(
        "shaft_hysteresis", "shaft", group("shaft_hysteresis", "torque", "twist"), "torque",
        lambda s: 0.01 * s.torque * s.ratio, lambda s: {"twist": tuple(f * s.twist for f in (0.1, 0.3, 1.0, 2.0))},
        amplitudes=("torque",), scales=lambda s: {"twist": 0.02 * s.twist},
        bounds=lambda s: {"twist": (0.02 * s.twist, 5.0 * s.twist)}, family="weak shaft at small torque",
        memory=True,
    ),
)  # fmt: skip
