"""One position loop with a gap under each law: drivetrain, online estimator and controller as FMUs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orchestrator.fmi.instances import fmu_instance
from orchestrator.master.algorithms import GaussSeidel
from orchestrator.master.signals import Constant, Noise, Samples
from orchestrator.master.system import Connection, SignalSource, System
from orchestrator.plants.design import DrivetrainValues, design_regulator, five_state_model
from orchestrator.scenarios.definition import Scenario

Array = NDArray[np.float64]

LQR, SHIFTED, MPC, COMPENSATOR = "LQR", "shifted LQR", "MPC", "compensator"
FMUS = ("Drivetrain", "BacklashEstimator", "BacklashCompensator")
RECORDED = ("plant.theta_m", "plant.omega_m", "plant.theta_l", "plant.omega_l", "plant.contact", "controller.u")
COUNTS = (10_000, 20_000)  # of the encoders at motor and load, in one turn
NOISE = (3e-4, 1.5e-4)  # standard deviation of the measured angles [rad]
REST = 2.0  # the last seconds of a run, in which the load shall be at rest [s]
OFFSET_SPREAD = 1e-4  # of the twist in mid-gap, where the encoders have their zeros [rad]
_BEGIN = 0.5  # before the move [s]


@dataclass(frozen=True)
class ControlTask:
    """A smooth move across the gap, and rest behind it.

    Attributes:
        alpha: half-gap [rad].
        tau: time constant of the drive [s].
        impact_speed: at which the teeth shall meet [rad/s].
        friction: dry friction at the load, which no controller knows [N.m].
        torque_limit: of the drive [N.m].
        height: of the move [rad].
        duration: of the move [s].
        stop: end of the run [s].
        sample_time: [s].
        mismatch: largest relative error of the plant's parameters.
        known: largest relative error of the half-gap that the controllers are given.
        state_weights: of the LQR for ``REGULATOR_STATES``; these damp the load.
        torque_weight: price of the request in the LQR, in the units of the other weights per (N.m)2.
    """

    alpha: float = 0.02
    tau: float = 5e-3
    impact_speed: float = 0.1
    friction: float = 2.0
    torque_limit: float = 300.0
    height: float = 0.5
    duration: float = 1.0
    stop: float = 6.0
    sample_time: float = 1e-3
    mismatch: float = 0.05
    known: float = 0.01
    state_weights: tuple[float, ...] = (10.0, 1.0, 1000.0, 500.0, 0.01)
    torque_weight: float = 2e-3

    @property
    def nominal(self) -> DrivetrainValues:
        """The drivetrain as the controllers know it."""
        return DrivetrainValues(tau=self.tau)

    def gains(self) -> tuple[float, ...]:
        """Return the gains of the LQR for ``REGULATOR_STATES``."""
        weights = np.diag(self.state_weights)
        return design_regulator(five_state_model(self.nominal), weights, self.torque_weight, self.sample_time).gains

    def reference(self) -> tuple[Array, Array]:
        """Return the wanted angle [rad] and speed [rad/s] of the load at each sample, acceleration continuous."""
        t = np.arange(round(self.stop / self.sample_time) + 1) * self.sample_time
        s = np.clip((t - _BEGIN) / self.duration, 0.0, 1.0)
        angle = self.height * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5)
        return angle, self.height / self.duration * (30.0 * s**2 - 60.0 * s**3 + 30.0 * s**4)


def make_loop(task: ControlTask, fmus: Mapping[str, Path], law: str, seed: Sequence[int]) -> Scenario:
    """Return the loop under the LQR, shifted or not, or the compensator.

    Plant, noise and half-gap that is given follow from ``seed`` alone.
    """
    rng = np.random.default_rng(seed)
    nominal = task.nominal
    names = ("J_m", "J_l", "k", "c", "b_m", "b_l", "tau")
    drawn = {name: getattr(nominal, name) * (1.0 + task.mismatch * rng.uniform(-1.0, 1.0)) for name in names}
    given = task.alpha * (1.0 + task.known * rng.uniform(-1.0, 1.0))
    seeds = [int(n) for n in rng.integers(2**31, size=2)]
    values = {name: getattr(nominal, name) for name in ("J_m", "J_l", "b_m", "b_l", "i", "tau")}
    controller = values | {f"K[{n}]": gain for n, gain in enumerate(task.gains(), start=1)}
    controller |= {"compliance": 1.0 / nominal.k, "u_max": task.torque_limit, "sample_time": task.sample_time}
    controller |= {"impact_speed": task.impact_speed, "torque_share": 0.0 if law == SHIFTED else 0.85}
    plant = drawn | {"alpha": task.alpha, "backlash_model": "nordin", "theta_m_start": -task.alpha * nominal.i}
    plant["effects.coulomb_friction.load.torque"] = task.friction
    estimator = values | {"k": nominal.k, "c": nominal.c, "sample_time": task.sample_time}
    estimator["offset_spread"] = OFFSET_SPREAD
    starts = (plant, estimator, controller)
    instances = [fmu_instance(part, fmus[fmu], start) for part, fmu, start in zip(_PARTS, FMUS, starts, strict=True)]
    known = {} if law == LQR else {"alpha_hat": given, "alpha_deviation": 0.5 * task.known * task.alpha}
    sources = [SignalSource(f"controller.{name}", Constant(value)) for name, value in known.items()]
    for name, signal in zip(("reference", "reference_speed"), task.reference(), strict=True):
        sources.append(SignalSource(f"controller.{name}", Samples(signal, task.sample_time)))
    for angle, deviation, number in zip(("theta_m", "theta_l"), NOISE, seeds, strict=True):
        sources.append(SignalSource(f"estimator.{angle}", Noise(deviation, number, task.sample_time)))
    system = System(tuple(instances), _connections(), tuple(sources))
    return Scenario(system, RECORDED, GaussSeidel(task.sample_time), task.stop, name=law)


_PARTS = ("plant", "estimator", "controller")
_ESTIMATES = ("theta_m", "omega_m", "theta_l", "omega_l", "T_m", "T_l", "offset")


def _connections() -> tuple[Connection, ...]:
    measured = (
        Connection(f"plant.{angle}", f"estimator.{angle}", quantum=2.0 * np.pi / counts)
        for angle, counts in zip(("theta_m", "theta_l"), COUNTS, strict=True)
    )
    estimates = (Connection(f"estimator.{name}_hat", f"controller.{name}_hat") for name in _ESTIMATES)
    return (
        *measured,
        *estimates,
        Connection("controller.u", "estimator.u"),
        Connection("controller.u", "plant.u"),
    )
