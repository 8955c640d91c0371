"""One position loop with a gap under each law: drivetrain, online estimator and controller as FMUs."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from orchestrator.control.machine import Machine
from orchestrator.fmi.instances import fmu_instance
from orchestrator.master.algorithms import GaussSeidel
from orchestrator.master.signals import Noise, Samples
from orchestrator.master.system import Connection, SignalSource, System
from orchestrator.plants.design import DrivetrainValues, design_regulator, five_state_model
from orchestrator.scenarios.definition import Scenario
from orchestrator.shared.arrays import Array

LQR, SHIFTED, COMPENSATOR = "LQR", "shifted LQR", "compensator"
FMUS = ("Drivetrain", "BacklashEstimator", "BacklashCompensator")
RECORDED = ("plant.theta_m", "plant.omega_m", "plant.theta_l", "plant.omega_l", "plant.contact", "controller.u")
REST = 2.0  # the last seconds of a run, in which the load shall be at rest [s]
SETTLING = 2.5  # behind the move, before that [s]
BEGIN = 0.5  # before the move [s]
HEIGHT = 25.0  # of the move, in half-gaps
QUICKEST = 6.0  # crossings that a move lasts at least
SHARE = 0.3  # of the torque limit, that a move asks for at most
LANDING = 0.4  # impact speed over the mean speed of a crossing, where none is asked for


@dataclass(frozen=True)
class ControlTask:
    """A smooth move across the gap, and rest behind it."""

    machine: Machine  # as the controllers know it
    impact_speed: float  # at which the teeth shall meet [rad/s]
    # of the LQR for ``REGULATOR_STATES``; these damp the load of the thesis's drivetrain
    state_weights: tuple[float, ...] = (10.0, 1.0, 1000.0, 500.0, 0.01)
    torque_weight: float = 2e-3  # price of the request in the LQR, in the units of the other weights per (N.m)2
    height: float = 0.5  # of the move [rad]
    duration: float = 1.0  # of the move [s]
    sample_time: float = 1e-3  # [s]

    @property
    def nominal(self) -> DrivetrainValues:
        """The drivetrain as the controllers know it."""
        return self.machine.nominal

    @property
    def stop(self) -> float:
        """End of the run [s]."""
        return round((BEGIN + self.duration + SETTLING + REST) / self.sample_time) * self.sample_time

    @cached_property
    def gains(self) -> tuple[float, ...]:
        """Gains of the LQR for ``REGULATOR_STATES``."""
        weights = np.diag(self.state_weights)
        return design_regulator(five_state_model(self.nominal), weights, self.torque_weight, self.sample_time).gains

    def reference(self) -> tuple[Array, Array]:
        """Return the wanted angle [rad] and speed [rad/s] of the load at each sample, acceleration continuous."""
        t = np.arange(round(self.stop / self.sample_time) + 1) * self.sample_time
        s = np.clip((t - BEGIN) / self.duration, 0.0, 1.0)
        angle = self.height * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5)
        return angle, self.height / self.duration * (30.0 * s**2 - 60.0 * s**3 + 30.0 * s**4)

    def settings(self) -> dict[str, dict[str, float]]:
        """Return start values of the FMUs of estimator, compensator and plain LQR."""
        found = self.machine.settings(self.sample_time)
        gains = {f"K[{n}]": gain for n, gain in enumerate(self.gains, start=1)}
        found["BacklashCompensator"] |= gains | {"impact_speed": self.impact_speed}
        shared = ("i", "compliance", "u_max", "sample_time")
        found["LqrController"] = gains | {name: found["BacklashCompensator"][name] for name in shared}
        return found


def make_task(machine: Machine, sample_time: float, impact_speed: float | None = None) -> ControlTask:
    """Return a move that suits a machine: over many half-gaps, not quicker than its drive and its crossings."""
    crossing, v = machine.crossing, machine.nominal
    height = HEIGHT * machine.alpha
    speed = LANDING * 2.0 * machine.alpha / crossing if impact_speed is None else impact_speed
    inertia = v.J_m * v.i + v.J_l / v.i
    duration = QUICKEST * crossing
    while height * inertia * (5.8 / duration**2 + v.tau * 60.0 / duration**3) > SHARE * machine.torque_limit:
        duration *= 1.1  # the quintic's largest acceleration and jerk, in units of height and duration
    duration = math.ceil(20.0 * duration) / 20.0
    return ControlTask(machine, speed, height=height, duration=duration, sample_time=sample_time)


def make_loop(task: ControlTask, fmus: Mapping[str, Path], law: str, seed: Sequence[int]) -> Scenario:
    """Return the loop under the LQR, shifted or not, or the compensator, on a plant that ``seed`` alone decides."""
    rng = np.random.default_rng(seed)
    machine, settings = task.machine, task.settings()
    drawn = machine.draw(rng)
    seeds = [int(n) for n in rng.integers(2**31, size=2)]
    controller = settings["BacklashCompensator"] | {"torque_share": 0.0 if law == SHIFTED else 0.85}
    starts = (machine.plant(drawn), settings["BacklashEstimator"], controller)
    instances = [fmu_instance(part, fmus[fmu], start) for part, fmu, start in zip(PARTS, FMUS, starts, strict=True)]
    sources = []
    for name, signal in zip(("reference", "reference_speed"), task.reference(), strict=True):
        sources.append(SignalSource(f"controller.{name}", Samples(signal, task.sample_time)))
    for n, angle in enumerate(("theta_m", "theta_l")):
        if deviation := machine.white_noise(n):
            sources.append(SignalSource(f"estimator.{angle}", Noise(deviation, seeds[n], task.sample_time)))
    system = System(tuple(instances), connections(machine, law != LQR), tuple(sources))
    return Scenario(system, RECORDED, GaussSeidel(task.sample_time), task.stop, name=law)


PARTS = ("plant", "estimator", "controller")
ESTIMATES = ("theta_m", "omega_m", "theta_l", "omega_l", "T_m", "T_l", "offset")


def connections(machine: Machine, gap: bool) -> tuple[Connection, ...]:
    """Return the connections of the loop; without the ``gap`` the controller is not told of it."""
    measured = (
        Connection(f"plant.{angle}", f"estimator.{angle}", quantum=count)
        for angle, count in zip(("theta_m", "theta_l"), machine.counts, strict=True)
    )
    estimates = [f"{name}_hat" for name in ESTIMATES] + (["alpha_hat", "alpha_deviation"] if gap else [])
    return (
        *measured,
        *(Connection(f"estimator.{name}", f"controller.{name}") for name in estimates),
        Connection("controller.u", "estimator.u"),
        Connection("controller.u", "plant.u"),
    )
