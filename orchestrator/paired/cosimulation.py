"""The paired loops as systems of FMUs: three slaves for one loop, six for both.

In all functions: ``alpha``: half-gap [rad]; zero for the loop without a gap.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from orchestrator.fmi.instances import fmu_instance
from orchestrator.master.algorithms import GaussSeidel
from orchestrator.master.protocol import Value
from orchestrator.master.session import Session
from orchestrator.master.signals import Samples, Signal
from orchestrator.master.system import Connection, Instance, SignalSource, System
from orchestrator.paired.experiment import Experiment
from orchestrator.plants.design import KalmanFilter
from orchestrator.shared.arrays import Array

FMUS = ("Drivetrain", "KalmanEstimator", "LqrController")
PARTS = ("plant", "estimator", "controller")
ESTIMATES = ("theta_m_hat", "omega_m_hat", "theta_l_hat", "omega_l_hat", "T_l_hat", "T_m_hat")
# Signals that a loop records, by the names that results use.
RECORDED = {
    "theta_l_hat": "estimator.theta_l_hat",
    "theta_m": "plant.theta_m",
    "theta_l": "plant.theta_l",
    "u": "controller.u",
    "T_shaft": "plant.T_shaft",
    "contact": "plant.contact",
}
MACHINE, TWIN = "", "twin_"


LoopValues = Mapping[str, Mapping[str, float | str]]
"""Parameters by name, for each of the three ``FMUS``."""


def loop_system(
    experiment: Experiment, fmus: Mapping[str, Path], prefixes: tuple[str, ...], values: LoopValues | None = None
) -> System:
    """Return one loop for each of ``prefixes``, all on the same reference.

    Instances are called ``plant``, ``estimator`` and ``controller``, each after its loop's prefix. Without further
    start values no loop has a gap. ``prefixes``: ``(MACHINE,)``, ``(TWIN,)`` or both.
    """
    if values is None:
        values = loop_values(experiment)
    instances: list[Instance] = []
    connections: list[Connection] = []
    sources: list[SignalSource] = []
    for prefix in prefixes:
        instances += [
            fmu_instance(f"{prefix}{part}", fmus[fmu], values[fmu], resets=True)
            for fmu, part in zip(FMUS, PARTS, strict=True)
        ]
        connections += [Connection(source, target) for source, target in loop_connections(prefix)]
        sources += _sources(experiment, prefix)
    return System(tuple(instances), tuple(connections), tuple(sources))


@cache
def loop_values(experiment: Experiment) -> LoopValues:
    """Return the parameters of a loop without a gap, designed once for each experiment."""
    e, v = experiment, experiment.values
    gains = {f"K[{n}]": gain for n, gain in enumerate(e.regulator().gains, start=1)}
    controller = gains | {"i": v.i, "compliance": 1.0 / v.k, "u_max": e.torque_limit, "sample_time": e.sample_time}
    plant: dict[str, float | str] = {
        "J_m": v.J_m, "J_l": v.J_l, "k": v.k, "c": v.c, "b_m": v.b_m, "b_l": v.b_l, "i": v.i, "tau": v.tau,
        "alpha": 0.0, "backlash_model": "none",
    }  # fmt: skip
    return dict(zip(FMUS, (plant, _estimator_parameters(e.estimator()), controller), strict=True))


def _estimator_parameters(estimator: KalmanFilter) -> dict[str, float]:
    """Return the parameters of ``KalmanEstimator`` for a designed filter."""
    rows = range(6)
    return (
        {f"A_d[{r + 1},{c + 1}]": float(estimator.A[r, c]) for r in rows for c in rows}
        | {f"B_d[{r + 1}]": float(estimator.B[r]) for r in rows}
        | {f"K_f[{r + 1},{c + 1}]": float(estimator.L[r, c]) for r in rows for c in (0, 1)}
        | {f"S_inv[{r + 1},{c + 1}]": float(estimator.S_inverse[r, c]) for r, c in ((0, 0), (0, 1), (1, 1))}
        | {"sample_time": estimator.sample_time}
    )


def loop_connections(prefix: str) -> tuple[tuple[str, str], ...]:
    """Return what is connected in one loop."""
    plant, estimator, controller = (f"{prefix}{part}" for part in PARTS)
    return (
        (f"{controller}.u", f"{plant}.u"),
        (f"{controller}.u", f"{estimator}.u"),
        (f"{plant}.theta_m", f"{estimator}.theta_m"),
        (f"{plant}.theta_l", f"{estimator}.theta_l"),
        *((f"{estimator}.{name}", f"{controller}.{name}") for name in ESTIMATES),
    )


def _sources(experiment: Experiment, prefix: str) -> list[SignalSource]:
    angle, speed = experiment.reference()
    h = experiment.sample_time
    found = [
        SignalSource(f"{prefix}controller.reference", Samples(angle, h)),
        SignalSource(f"{prefix}controller.reference_speed", Samples(speed, h)),
    ]
    if prefix == MACHINE:
        zero = Samples(np.zeros(experiment.steps + 1), h)
        found += [SignalSource("estimator.theta_m", zero), SignalSource("estimator.theta_l", zero)]
    return found


ERROR_SOURCES = (2, 3)


@dataclass(frozen=True)
class LoopRun:
    """Signals of one loop at the communication points, by the names of ``RECORDED``, each of shape (steps + 1,)."""

    time: Array
    signals: Mapping[str, Array]

    def __getitem__(self, name: str) -> Array:
        """Return the signal ``name``."""
        return self.signals[name]


@dataclass(frozen=True, slots=True)
class _AtPoints(Signal):
    """One value per communication point of a run: nothing is looked up."""

    values: Array

    def sample(self, times: Array) -> Array:
        assert len(times) == len(self.values)
        return self.values


class LoopSession:
    """One loop of three FMUs, instantiated once and run for any number of sizes. Use as a context manager.

    Args:
        record: which of ``RECORDED``; fewer are quicker.
        values: what ``loop_values`` returned for the experiment (default: it is asked).
    """

    def __init__(
        self,
        experiment: Experiment,
        fmus: Mapping[str, Path],
        record: tuple[str, ...] = tuple(RECORDED),
        values: LoopValues | None = None,
    ) -> None:
        self._experiment = experiment
        self._record = record
        self._session = Session(
            loop_system(experiment, fmus, (MACHINE,), values),
            [RECORDED[name] for name in record],
            GaussSeidel(experiment.sample_time),
            experiment.duration,
        )

    def __enter__(self) -> "LoopSession":
        return self

    def __exit__(self, *_: object) -> None:
        self._session.close()

    def close(self) -> None:
        """Release the slaves."""
        self._session.close()

    def run(
        self, alpha: float, errors: tuple[Array, Array] | None = None, start: Mapping[str, Value] | None = None
    ) -> LoopRun:
        """Return the run of a loop whose half-gap is ``alpha`` [rad].

        ``errors``: errors [rad] of both encoders at the communication points; default none.
        """
        values = plant_values(self._experiment, alpha) | dict(start or {})
        signals = None
        if errors is not None:
            signals = {k: _AtPoints(error) for k, error in zip(ERROR_SOURCES, errors, strict=True)}
        result = self._session.run(values, signals)
        return LoopRun(result.time, dict(zip(self._record, result.values, strict=True)))


def plant_values(experiment: Experiment, alpha: float) -> dict[str, Value]:
    """Return the parameters of the plant with a half-gap ``alpha`` [rad]."""
    model = experiment.backlash_model if alpha else "none"
    return {"plant.alpha": alpha, "plant.backlash_model": model}
