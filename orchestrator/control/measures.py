"""What is measured of a loop with a gap: traversals, impacts, error of the load, and how it rests."""

from dataclasses import dataclass

import numpy as np

from orchestrator.control.loops import REST, ControlTask
from orchestrator.master.result import Recording
from orchestrator.shared.arrays import Array
from pyfmu_sources.controllers.gap_traversal import Traversal, plan, point_at


@dataclass(frozen=True)
class LoopMeasures:
    """One run."""

    times: Array  # from one flank to the other [s], shape (traversals,)
    impacts: Array  # speeds of the twist at their ends [rad/s], shape (traversals,)
    largest_impact: float  # of all contacts, those on the same flank included [rad/s]
    error: float  # root mean square error of the load from the begin of the move on [rad]
    rest: float  # motion of the load at the end of the run, peak to peak [counts of its encoder, or its noise]
    contacts: float  # at the end of the run [1/s]
    stable: bool  # the load stays near the end of the move
    # of the first traversal, times [s] and twist from the flank at its start [rad]; empty where there is none
    path: tuple[Array, Array]


def measure_loop(run: Recording, task: ControlTask) -> LoopMeasures:
    """Return the measures of a run of ``make_loop``."""
    contact = np.round(run["plant.contact"])
    speed = np.abs(run["plant.omega_m"] / task.nominal.i - run["plant.omega_l"])
    twist = run["plant.theta_m"] / task.nominal.i - run["plant.theta_l"]
    met = np.flatnonzero((contact[1:] != 0) & (contact[:-1] != contact[1:]))
    left = np.flatnonzero((contact[:-1] != 0) & (contact[:-1] != contact[1:]))
    times: list[float] = []
    impacts: list[float] = []
    path = (np.zeros(0), np.zeros(0))
    for end in met:
        before = left[left <= end]
        if before.size and contact[before[-1]] == -contact[end + 1]:
            begin, flank = before[-1], contact[end + 1]
            if not times:
                rows = slice(begin, end + 2)
                path = (run.time[rows] - run.time[begin], flank * twist[rows] + task.machine.alpha)
            times.append((end - begin) * task.sample_time)
            impacts.append(speed[end])
    theta_l = run["plant.theta_l"]
    count = task.machine.counts[1] or task.machine.noise[1]
    moving = task.stop - REST
    tail = run.time >= moving
    reference = task.reference()[0][: theta_l.size]
    return LoopMeasures(
        np.array(times),
        np.array(impacts),
        float(speed[met].max(initial=0.0)),
        float(np.sqrt(np.mean((theta_l - reference)[~tail] ** 2))),
        float(np.ptp(theta_l[tail]) / count),
        float(np.sum(run.time[met] >= moving) / REST),
        bool(np.abs(theta_l - reference)[tail].max() < task.height),
        path,
    )


def least_time(task: ControlTask, impact_speed: float) -> float:
    """Return the least time [s] of a traversal from rest that lands at ``impact_speed`` [rad/s] without torque.

    See :mod:`pyfmu_sources.controllers.gap_traversal`: it is reached by the whole torque in three parts. It is 0 where
    no traversal ends so quickly.
    """
    t = _best(task, impact_speed)
    return t.first + t.second + t.third


def quickest_landing(task: ControlTask) -> float:
    """Return the largest speed [rad/s] with which a traversal from rest can end without torque, to a thousandth."""
    possible = 0.0
    width = 0.5 * task.impact_speed
    while width > 1e-3 * possible:
        possible += width if least_time(task, possible + width) > 0.0 else 0.0
        width *= 0.5
    return possible


def quickest_path(task: ControlTask, impact_speed: float) -> tuple[Array, Array]:
    """Return times [s] and twist from the flank that is left [rad] of the traversal in the least time."""
    t = _best(task, impact_speed)
    times = np.linspace(0.0, t.first + t.second + t.third, 101)
    inertia = task.nominal.J_m * task.nominal.i
    return times, np.array(
        [point_at(t, float(time), task.nominal.tau, inertia)[0] for time in times]
    ) + task.machine.alpha


def _best(task: ControlTask, impact_speed: float) -> Traversal:
    inertia = task.nominal.J_m * task.nominal.i
    return plan(
        (-task.machine.alpha, 0.0, 0.0),
        task.machine.alpha,
        impact_speed,
        task.machine.torque_limit,
        task.nominal.tau,
        inertia,
    )
