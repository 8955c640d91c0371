"""The bank of effects: one row each, with what a fit needs to start from and how large the effect may be.

A new effect needs its term in ``pyfmu_sources/effects.py`` (and the equations that call it), its parameters in the
plant's table, and one row here; ``docs/diagnosis.md`` walks through an example.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.plants import Plant

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Scene:
    """What starting values depend on: typical sizes of the record's signals.

    Attributes:
        h: sample time [s].
        torque: rms of the drive's torque [N.m].
        u: (n,) requested torque [N.m].
        speed_m, speed_l: rms speeds [rad/s].
        twist: largest twist of the fitted model [rad].
        inertia: of the load [kg.m2].
        stiffness: of the shaft [N.m/rad].
        ratio: gear ratio.
        turns: travel of the motor in revolutions.
        cycles: name of a periodic effect -> cycles per revolution at the peaks of its frequency scan.
    """

    h: float
    torque: float
    u: Array
    speed_m: float
    speed_l: float
    twist: float
    inertia: float
    stiffness: float
    ratio: float
    turns: float
    cycles: dict[str, tuple[float, ...]] = field(default_factory=dict)


Start = dict[str, tuple[float, ...]]


@dataclass(frozen=True)
class Effect:
    """One row of the bank.

    Attributes:
        name: of the effect, as in the report.
        site: part of the machine at which it acts.
        parameters: short name -> name in the plant's table.
        size: the parameter whose zero (or ``off``) value switches the effect off.
        unit_of_size: scene -> a small amount of ``size``, used for differences and as the scale of the fit.
        starts: scene -> values to try of every parameter that is not found by regression (all combinations).
        amplitudes: short names of parameters in which the response is linear, found by regression.
        phase: short name of a phase; amplitude and phase are then found together from sine and cosine.
        scales: scene -> scale of the other parameters.
        family: effects with the same family look alike when the experiment is poor.
        needs: label of an effect that this one contains; it is tried only when that one pays, from
        refine: (values of that one, scene) -> starting values.
        plausible: values -> False when the fit has left what the effect means.
        bounds: scene -> short name -> (least, largest), narrower than the table's.
        nuisances: parameters of the predictor alone that are fitted with the effect, and not reported as its own.
        priors: scene -> short name -> (mean, standard deviation).
        angular: True if it makes sense for an angle only, not for a position in metres.
        both_encoders: True if it can be seen only with an encoder on either side.
        leaves: share of what the effect gains that its law, not being exact, may leave for other effects to gain.
        least_noise: level of process noise, as a share of the drive's torque, below which no model with this effect is
            trusted: impacts amplify what their law leaves out, and a predictor that is hardly corrected goes astray.
        taken_from: short name -> parameter of the plant that holds as much already, if it has been re-fitted: it is
            lowered by as much when the effect is put into a model.
        tries: how many starts, of different values of the first parameter in ``starts``, are fitted in full.
        tolerance: name in the plant's table -> share of its value to which laws of this kind, of which none is exact,
            leave the parameter undefined (standard deviation; measured on records made with other laws).
    """

    name: str
    site: str
    parameters: dict[str, str]
    size: str
    unit_of_size: Callable[[Scene], float]
    starts: Callable[[Scene], Start] = lambda scene: {}
    amplitudes: tuple[str, ...] = ()
    phase: str = ""
    scales: Callable[[Scene], dict[str, float]] = lambda scene: {}
    family: str = ""
    needs: str = ""
    refine: Callable[[dict[str, float], Scene], tuple[dict[str, float], ...]] = lambda values, scene: ()
    plausible: Callable[[dict[str, float]], bool] = lambda values: True
    bounds: Callable[[Scene], dict[str, tuple[float, float]]] = lambda scene: {}
    both_encoders: bool = False
    angular: bool = False
    nuisances: dict[str, str] = field(default_factory=dict)
    priors: Callable[[Scene], dict[str, tuple[float, float]]] = lambda scene: {}
    leaves: float = 0.01
    least_noise: float = 0.0
    taken_from: dict[str, str] = field(default_factory=dict)
    tries: int = 1
    tolerance: dict[str, float] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """Return name and site, unique in the bank."""
        return f"{self.name}@{self.site}"

    def put(self, plant: Plant, p: Array, values: Mapping[str, float], refitted: Collection[int]) -> Array:
        """Return parameters ``p`` of a model without the effect with ``values`` of it put in, within their bounds.

        ``refitted`` are the places of the plant's own parameters that have been fitted without the effect.
        """
        moved = p.copy()
        for short, place in self.places(plant).items():
            if short in values:
                entry = plant.entry(place)
                moved[place] = min(max(values[short], entry.minimum), entry.maximum)
                if self._holder(plant, short) in refitted:
                    moved[self._holder(plant, short)] -= moved[place]
        return moved

    def taken_out(self, plant: Plant, p: Array, default: Array, refitted: Collection[int]) -> Array:
        """Return parameters ``p`` with the effect switched off, its parameters at their ``default``."""
        moved = p.copy()
        for short, place in self.places(plant).items():
            if self._holder(plant, short) in refitted:
                moved[self._holder(plant, short)] += moved[place]
            moved[place] = default[place]
        return moved

    def _holder(self, plant: Plant, short: str) -> int:
        return plant.index(self.taken_from[short]) if short in self.taken_from else -1

    def places(self, plant: Plant) -> dict[str, int]:
        """Return the place of each parameter in the predictor's tuple, by short name, nuisances last."""
        return {short: plant.index(name) for short, name in (self.parameters | self.nuisances).items()}


def _group(effect: str, *names: str) -> dict[str, str]:
    return {name.rpartition(".")[2]: f"effects.{effect}.{name}" for name in names}


def _friction(site: str) -> tuple[Effect, Effect]:
    at_load = site == "load"

    def unit(scene: Scene) -> float:
        return 0.01 * scene.torque * (scene.ratio if at_load else 1.0)

    def rms(scene: Scene) -> float:
        return scene.speed_l if at_load else scene.speed_m

    def build_up(scene: Scene) -> tuple[float, float]:
        return float(np.log(0.04 * scene.h * rms(scene))), 2.0

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

    names = (f"{site}.coulomb", f"{site}.breakaway", f"{site}.stribeck_speed")
    coulomb = Effect(
        "coulomb_friction", site, _group("coulomb_friction", f"{site}.torque"), "torque", unit, start,
        amplitudes=("torque",), scales=lambda s: {"presliding": 0.2},
        family=f"dry friction of the {site}", nuisances=nuisances, priors=priors, leaves=0.04,
    )  # fmt: skip
    stribeck = Effect(
        "stribeck_friction", site, _group("stribeck_friction", *names), "coulomb", unit,
        refine=refine, plausible=falls, scales=lambda s: {"stribeck_speed": 0.02 * rms(s), "presliding": 0.2},
        family=f"dry friction of the {site}", needs=f"coulomb_friction@{site}", nuisances=nuisances, priors=priors,
        leaves=0.04,
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
    return tuple(scene.h * f for f in (0.04, 0.12, 0.3, 0.7, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0))


def _frequencies(scene: Scene) -> tuple[float, ...]:
    top = 0.8 * np.pi / scene.h
    return tuple(float(f) for f in np.geomspace(min(8.0, top / 8), min(250.0, top), 48))


def _band(scene: Scene) -> tuple[float, float]:
    return 0.5 * _frequencies(scene)[0], 1.2 * _frequencies(scene)[-1]


def _parts_of_the_load(scene: Scene) -> tuple[float, ...]:
    return tuple(f * scene.inertia for f in (3e-4, 1.2e-3, 5e-3, 0.02, 0.08))


def _periodic(
    name: str, site: str, unit: Callable[[Scene], float], tolerance: float = 0.0, leaves: float = 0.01
) -> Effect:
    return Effect(
        name, site, _group(name, "amplitude", "cycles_per_rev", "phase"), "amplitude", unit,
        lambda scene: {"cycles_per_rev": scene.cycles.get(name, ())}, amplitudes=("amplitude",), phase="phase",
        scales=lambda scene: {"cycles_per_rev": 0.01 / max(scene.turns, 1e-9), "phase": 0.05},
        bounds=lambda scene: {"cycles_per_rev": (0.7 / max(scene.turns, 1e-9), 1e9)}, family=f"periodic, {site}",
        tolerance={f"effects.{name}.amplitude": tolerance}, leaves=leaves,
    )  # fmt: skip


def _torque(scene: Scene) -> float:
    return 0.01 * scene.torque


def _load_torque(scene: Scene) -> float:
    return 0.01 * scene.torque * scene.ratio


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
    Effect(
        "input_delay", "actuator", _group("input_delay", "delay"), "delay", lambda s: 0.02 * s.h,
        lambda s: {"delay": _delays(s)},
    ),
    Effect(
        "torque_saturation", "actuator", _group("torque_saturation", "limit"), "limit",
        lambda s: 0.003 * float(np.max(np.abs(s.u))), lambda s: {"limit": _limits(s)},
    ),
    Effect(
        "hardening_stiffness", "shaft", _group("hardening_stiffness", "cubic"), "cubic",
        lambda s: 0.02 * s.stiffness / s.twist**2, amplitudes=("cubic",), family="weak shaft at small torque",
        leaves=0.03,
    ),
    _periodic("torque_ripple", "motor", _torque),
    # Where the tooth force acts on an eccentric gear, and so its lever arm, differs between models.
    _periodic("gear_eccentricity", "shaft", lambda s: 0.003 * s.twist, tolerance=8e-3, leaves=0.04),
    Effect(
        "load_torque", "load", _group("load_torque", "torque"), "torque", _load_torque, amplitudes=("torque",),
    ),
    Effect(
        "gravity_load", "load", _group("gravity_load", "amplitude", "phase"), "amplitude", _load_torque,
        amplitudes=("amplitude",), phase="phase", scales=lambda s: {"phase": 0.05}, angular=True,
    ),
    Effect(
        "extra_resonance", "load", _group("extra_resonance", "inertia", "frequency", "damping_ratio"), "inertia",
        lambda s: 0.01 * s.inertia,
        lambda s: {"frequency": _frequencies(s), "damping_ratio": (0.03,), "inertia": _parts_of_the_load(s)},
        scales=lambda s: {"frequency": 0.5, "damping_ratio": 0.01},
        bounds=lambda s: {"frequency": _band(s), "damping_ratio": (0.0, 1.0)},
        # Below its resonance the added inertia moves with the load, so the re-fitted J_l already holds it.
        taken_from={"inertia": "J_l"}, tries=3,
    ),
    Effect(
        "quadratic_drag", "load", _group("quadratic_drag", "coefficient"), "coefficient",
        lambda s: 0.01 * s.torque * s.ratio / s.speed_l**2, amplitudes=("coefficient",),
    ),
    Effect(
        "sensor_offset", "motor", _group("sensor_offset", "motor.offset"), "offset",
        lambda s: 0.003 * s.twist * s.ratio, amplitudes=("offset",),
        family="offset between the encoders", both_encoders=True,
    ),
    Effect(
        "sensor_offset", "load", _group("sensor_offset", "load.offset"), "offset", lambda s: 0.003 * s.twist,
        amplitudes=("offset",),
        family="offset between the encoders", both_encoders=True,
    ),
)  # fmt: skip

_AXIS = ("coulomb_friction@motor", "stribeck_friction@motor", "input_delay@actuator", "torque_saturation@actuator",
         "torque_ripple@motor", "load_torque@load", "gravity_load@load", "quadratic_drag@load")  # fmt: skip

_DIRECTIONAL = Effect(
    "directional_friction", "motor", _group("directional_friction", "motor.difference"), "difference",
    lambda s: 0.01 * s.torque / max(s.speed_m, 1e-12), amplitudes=("difference",),
    leaves=0.04,
)  # fmt: skip

SERVO_AXIS_BANK = (*(effect for effect in DRIVETRAIN_BANK if effect.label in _AXIS), _DIRECTIONAL)

BANKS = {"Drivetrain": DRIVETRAIN_BANK, "ServoAxis": SERVO_AXIS_BANK}
