"""The machine that a controller is made for: its values, its drive and encoders, and what is not known of it."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from orchestrator.errors import ScenarioError
from orchestrator.plants.design import DrivetrainValues
from orchestrator.records.model_file import Model, ModelParameter
from orchestrator.shared.arrays import Array
from orchestrator.shared.inference.normal import NORMAL_95
from pyfmu_sources.controllers.backlash_compensator import Tuning, crossing_time
from pyfmu_sources.controllers.state_prediction import MOST_LATE, Train
from pyfmu_sources.laws.parameter_rows import BIG

LINEAR = ("J_m", "J_l", "k", "c", "b_m", "b_l", "i", "tau")
OFFSET = 0.005  # standard deviation of the twist in mid-gap over the half-gap: the zeros are those of the record
SCALE = DrivetrainValues()  # whose noise settings the estimator starts with
SCALE_TORQUE = 300.0  # of that drive [N.m]
DELAY, LIMIT, FILTER = (
    f"effects.{name}" for name in ("input_delay.delay", "torque_saturation.limit", "drive_filter.time_constant")
)
OFFSETS = tuple(f"effects.sensor_offset.{body}.offset" for body in ("motor", "load"))
LARGEST_CHANGE = 3.0  # of the logarithm of a drawn parameter


@dataclass(frozen=True)
class Machine:
    """A drivetrain with a gap, as a model knows it."""

    source: str  # the record's file
    parameters: Mapping[str, ModelParameter]  # of the ``Drivetrain`` FMU, by name
    alpha: float  # half-gap [rad]
    deviation: float  # its standard deviation [rad]
    torque_limit: float  # of the drive [N.m]
    noise: tuple[float, float]  # standard deviation of the encoders at motor and load, rounding included [rad]
    counts: tuple[float, float]  # one count of each [rad]; 0: not rounded
    unknowns: tuple[str, ...] = ()  # names of the parameters that may be off
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0)), repr=False)  # of these (unknowns, unknowns)
    # of uniform distributions, by name, for parameters that no covariance covers
    half_widths: Mapping[str, float] = field(default_factory=dict)

    @property
    def nominal(self) -> DrivetrainValues:
        """The linear drivetrain; a filter of the drive counts as more of its lag."""
        values = {name: self.value(name) for name in LINEAR}
        return DrivetrainValues(**values | {"tau": max(values["tau"] + self.value(FILTER), 1e-6)})

    @property
    def train(self) -> Train:
        """The drivetrain as the compensator takes it."""
        v = self.nominal
        return Train(v.J_m, v.J_l, v.b_m, v.b_l, v.i, 1.0 / v.k, v.tau)

    @property
    def margin(self) -> float:
        """Noise of the estimated twist [rad]."""
        return 1.8 * math.hypot(self.noise[0] / self.nominal.i, self.noise[1])

    @property
    def crossing(self) -> float:
        """About how long a crossing takes [s]."""
        return crossing_time(self.alpha, self.train, Tuning(1.0, 0.85, self.torque_limit, self.margin, 1e-3))

    def value(self, name: str) -> float:
        """Return a parameter of the ``Drivetrain`` FMU."""
        return self.parameters[name].value

    def delay(self, sample_time: float) -> float:
        """Return how late a request acts [samples]."""
        return min(self.value(DELAY) / sample_time, float(MOST_LATE))

    def white_noise(self, encoder: int) -> float:
        """Return the standard deviation [rad] of the motor's (0) or the load's (1) encoder before rounding."""
        return math.sqrt(max(self.noise[encoder] ** 2 - self.counts[encoder] ** 2 / 12.0, 0.0))

    def settings(self, sample_time: float) -> dict[str, dict[str, float]]:
        """Return start values of ``BacklashEstimator`` and, but for gains and landing, of ``BacklashCompensator``."""
        v = self.nominal
        shared = {name: getattr(v, name) for name in ("J_m", "J_l", "b_m", "b_l", "i", "tau")}
        shared |= {"sample_time": sample_time, "delay": self.delay(sample_time)}
        motor = self.torque_limit / SCALE_TORQUE
        load = motor * v.i / SCALE.i
        offset = self.value(OFFSETS[0]) / v.i - self.value(OFFSETS[1])
        estimator = shared | {
            "k": v.k,
            "c": v.c,
            "noise_m": 1.1 * self.noise[0],
            "noise_l": 1.1 * self.noise[1],
            "torque_noise_m": 0.1 * motor,
            "torque_noise_l": 0.3 * load,
            "load_walk": 2.0 * load,
            "alpha_walk": 5e-4 * self.alpha,
            "offset_spread": max(math.hypot(OFFSET * self.alpha, offset), 1e-9),
            "alpha_start": self.alpha,
            "alpha_spread": max(self.deviation / self.alpha, 0.01),
        }
        compensator = shared | {"compliance": 1.0 / v.k, "u_max": self.torque_limit, "margin": self.margin}
        return {"BacklashEstimator": estimator, "BacklashCompensator": compensator}

    def plant(self, values: Mapping[str, float] | None = None) -> dict[str, float]:
        """Return start values of ``Drivetrain`` with some other ``values``, at rest on the lower flank."""
        found = {name: p.value for name, p in self.parameters.items() if name not in ("alpha", "backlash_model")}
        found |= {"alpha": self.alpha} | dict(values or {})
        found["backlash_model"] = self.value("backlash_model") + 1.0  # the FMU counts from one
        return found | {"theta_m_start": -found["alpha"] * found["i"]}

    def draw(self, rng: np.random.Generator) -> dict[str, float]:
        """Return parameters of one plant, drawn from what is not known: jointly where a covariance says so.

        What is positive is drawn on a logarithmic scale, which is the same where it is known well.
        """
        deviations = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        scale = np.where(deviations > 0.0, deviations, 1.0)
        size, vectors = np.linalg.eigh(self.covariance / np.outer(scale, scale))
        normal = scale * (vectors @ (np.sqrt(np.maximum(size, 0.0)) * rng.standard_normal(size.size)))
        shifts = dict(zip(self.unknowns, normal.tolist(), strict=True))
        uniform = {name: half * float(rng.uniform(-1.0, 1.0)) for name, half in self.half_widths.items()}
        return {name: self._shift(name, shift) for name, shift in (uniform | shifts).items()}

    def _shift(self, name: str, shift: float) -> float:
        p = self.parameters[name]
        centre = self.alpha if name == "alpha" else p.value
        if centre > 0.0 and p.minimum >= 0.0:
            change = shift / centre if abs(shift) < 1e-3 * centre else max(-LARGEST_CHANGE, shift / centre)
            moved = centre * math.exp(min(change, LARGEST_CHANGE))
        else:
            moved = centre + shift
        return min(max(moved, p.minimum), p.maximum)


def machine_of(model: Model, *, alpha: float | None = None, torque_limit: float | None = None) -> Machine:
    """Return the machine of a model that a record was fitted to.

    Args:
        alpha: half-gap in place of the model's [rad]; as uncertain as the record's, or known to 1 % where it has none.
        torque_limit: in place of the model's, or of the record's largest request [N.m].

    Raises:
        ScenarioError: the model has no gap or two, one encoder, or nothing that says its limit of the torque.
    """
    record, parameters, source = model.record, model.parameters, model.source
    if model.fmu != "Drivetrain":
        raise ScenarioError(
            f"{source}: `fmu` must be Drivetrain, one gap between motor and load, but is {model.fmu}", "model"
        )
    if record is None:
        raise ScenarioError(
            f"{source}: `model` must have a table [record]: give the corrected.toml that `diagnose` or "
            "`estimate` wrote",
            "model",
        )
    if len(record.noise) != 2 or len(record.counts) != 2:
        raise ScenarioError(f"{source}: `model` must be of a record with both encoders, but has one", "model")
    size = parameters["alpha"].value if alpha is None else alpha
    if not size > 0.0:
        raise ScenarioError(
            f"{source}: `model` must have a gap to be crossed, but `alpha` is {size:g}: give the half-gap, "
            "or use `regulator` for an LQR of this machine",
            "model",
            "alpha",
        )
    limit = torque_limit or min(parameters[LIMIT].value, record.torque if parameters[LIMIT].value >= BIG else BIG)
    unknowns = record.unknowns
    covariance = np.array(record.covariance, dtype=float).reshape(len(unknowns), len(unknowns))
    half = {name: p.uncertainty for name, p in parameters.items() if p.uncertainty > 0.0} | (
        {} if alpha is None else {"alpha": 0.01 * size}
    )
    half = {name: width for name, width in half.items() if name not in unknowns}
    deviation = half.get("alpha", 0.0) / NORMAL_95
    if "alpha" in unknowns:
        deviation = math.sqrt(covariance[unknowns.index("alpha"), unknowns.index("alpha")])
    return Machine(
        record.source, parameters, size, deviation, limit, (record.noise[0], record.noise[1]),
        (record.counts[0], record.counts[1]), unknowns, covariance, half,
    )  # fmt: skip


def thesis_machine(model: Model, alpha: float, tau: float, friction: float) -> Machine:
    """Return the drivetrain of ``model``, the default one, with a gap and dry friction at the load [rad, s, N.m].

    The half-gap is known to 1 %, encoders have 10,000 and 20,000 counts.
    """
    spread = {name: 0.05 for name in LINEAR if name != "i"}
    parameters = dict(model.parameters)
    changed = {"tau": tau, "effects.coulomb_friction.load.torque": friction}
    parameters |= {name: replace(parameters[name], value=value) for name, value in changed.items()}
    half = {name: share * parameters[name].value for name, share in spread.items()} | {"alpha": 0.01 * alpha}
    counts = (2.0 * math.pi / 10_000, 2.0 * math.pi / 20_000)
    noise = tuple(math.hypot(n, count / math.sqrt(12.0)) for n, count in zip((3e-4, 1.5e-4), counts, strict=True))
    return Machine(
        "the thesis's drivetrain", parameters, alpha, 0.005 * alpha, SCALE_TORQUE, (noise[0], noise[1]), counts,
        half_widths=half,
    )  # fmt: skip
