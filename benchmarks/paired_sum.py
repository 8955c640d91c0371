"""The thesis's method on a measured record: the sum of differences to a twin without backlash.

The twin is the ``Drivetrain`` FMU with the nominal values and no gap, run by the master algorithm and fed with the
record's torque. S = mean |theta_l(record) - theta_l(twin)|; the map from S to alpha comes from the same plant with
known gaps (compiled). The method has no way to tell a gap from any other difference between the machine and the twin,
so on a real machine it is far off: it is here for comparison.
"""

import math
from collections.abc import Mapping

import numpy as np

from orchestrator.building.build import ensure_built
from orchestrator.estimation.design import plant_of
from orchestrator.estimation.filter.innovations import simulate
from orchestrator.estimation.problem import measurement_noise
from orchestrator.estimation.protocol import Estimate, NotApplicableError
from orchestrator.fmi.instances import fmu_instance
from orchestrator.master.algorithms import GaussSeidel
from orchestrator.master.session import Session
from orchestrator.master.signals import Samples
from orchestrator.master.system import SignalSource, System
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record
from orchestrator.shared.arrays import Array
from orchestrator.shared.inference.normal import interval_95
from pyfmu_sources.drivetrain.equations import PARAMETERS

SIZES = (0.0, *(3e-4 * 1.25**n for n in range(34)))  # to half a radian


def estimate(record: Record, model: Model) -> Estimate:
    """Return the half-gap at which the twin with a gap differs from the twin without one as much as the record does."""
    if record.theta_l is None:
        raise NotApplicableError("this method needs the load's angle `theta_l`")
    start = {"theta_m_start": float(record.theta_m[0]), "theta_l_start": float(record.theta_l[0])}
    without = twin(record, model, start)
    x0 = np.array([record.theta_m[0], 0.0, record.theta_l[0], 0.0, 0.0])
    runs = [without]
    for alpha in SIZES[1:]:
        runs.append(simulate(plant_of(model, alpha), record.u, record.step, x0)[:, 2])
    sums = np.array([float(np.mean(np.abs(run - without))) for run in runs])
    monotone = np.maximum.accumulate(sums)
    measured = float(np.mean(np.abs(record.theta_l - without)))
    beyond = measured > monotone[-1]
    alpha = float(np.interp(measured, monotone, SIZES))
    slope = float(np.interp(measured, monotone, np.gradient(monotone, SIZES)))
    noise = measurement_noise(record, model, "theta_l") / math.sqrt(record.size)
    error = noise / slope if slope > 0.0 else math.inf
    message = "the twin differs from the machine by more than any gap explains" if beyond else ""
    diagnostics = {"sum": measured, "largest_sum": float(monotone[-1])}
    low, high = interval_95(alpha, error, 0.0)
    return Estimate("paired_sum", alpha, error, (low, high), not beyond, message, diagnostics)


def twin(record: Record, model: Model, start: Mapping[str, float]) -> Array:
    """Return the load angle (n,) [rad] of the ``Drivetrain`` FMU without a gap, fed with the record's torque."""
    nominal = {entry.name: entry.default for entry in PARAMETERS if entry.name not in ("alpha", "backlash_model")}
    named = {name: model.parameters[name].value for name in nominal if model.parameters[name].value != nominal[name]}
    fmu = fmu_instance("twin", ensure_built(["Drivetrain"])["Drivetrain"], {**named, **start})
    system = System((fmu,), (), (SignalSource("twin.u", Samples(record.u, record.step)),))
    with Session(system, ("twin.theta_l",), GaussSeidel(record.step), (record.size - 1) * record.step) as session:
        return session.run()["twin.theta_l"]
