"""Prints how far the plant FMU lies from solutions that share no code with it."""

import numpy as np

from orchestrator.building.build import ensure_built
from orchestrator.fmi.instances import fmu_instance
from orchestrator.master.algorithms import GaussSeidel
from orchestrator.master.session import Session
from orchestrator.master.signals import Samples
from orchestrator.master.system import SignalSource, System
from pyfmu_sources.drivetrain.equations import parameters
from pyfmu_sources.laws.backlash_models import BACKLASH_MODELS
from tests.support.compiled_plants import compiled_plant
from tests.support.reference_plant import ReferencePlant
from tests.support.reference_runs import linear_solution, reference_solution

H, STEPS = 1e-3, 2000
SIGNALS = ("theta_m", "omega_m", "theta_l", "omega_l", "T_m")


def run_fmu(path, torque, **values):
    """States (STEPS + 1, 5) of the FMU with the torque held over each step, and its contacts."""
    plant = fmu_instance("plant", path, values)
    system = System((plant,), sources=(SignalSource("plant.u", Samples(torque, H)),))
    record = [f"plant.{name}" for name in (*SIGNALS, "contact")]
    with Session(system, record, GaussSeidel(H), STEPS * H) as session:
        signals = session.run().values
    return signals[:5].T, signals[5]


def run_compiled(torque, **values):
    """The same from the compiled source."""
    plant, p = compiled_plant("drivetrain"), parameters(**values)
    x = plant.consistent_start((0.0,) * 8, p)
    mode, table = plant.initial_mode(x, p), plant.prepare(p, H)
    states = [x[:5]]
    for u in torque:
        x, mode = plant.advance(x, mode, p, float(u), 0.0, H, table)
        states.append(x[:5])
    return np.array(states)


def main():
    """Run all cases and print the table."""
    path = ensure_built(["Drivetrain"])["Drivetrain"]
    print(
        f"{'model':10s} {'alpha [rad]':>11s} {'crossings':>9s} "
        f"{'theta_m [rad]':>14s} {'theta_l [rad]':>14s} {'in C':>9s}"
    )
    for model in ("dead_zone", "nordin"):
        for k, alpha in enumerate((0.002, 0.02, 0.1)):
            time = H * np.arange(STEPS)
            torque = np.random.default_rng(k).uniform(-300.0, 300.0, STEPS) + 300.0 * np.sin(10.0 * time)
            states, contact = run_fmu(path, torque, alpha=alpha, backlash_model=model)
            truth = reference_solution(ReferencePlant(alpha=alpha, model=model), torque, H)
            error = np.abs(states - truth).max(axis=0)
            fast = run_compiled(torque, alpha=alpha, backlash_model=float(BACKLASH_MODELS.index(model)))
            flank = contact[contact != 0]
            crossings = int(np.sum(flank[1:] != flank[:-1]))
            same = np.abs(states - fast).max()
            print(f"{model:10s} {alpha:11g} {crossings:9d} {error[0]:14.2e} {error[2]:14.2e} {same:9.1e}")
    torque = np.random.default_rng(9).uniform(-300.0, 300.0, STEPS)
    states, _ = run_fmu(path, torque, backlash_model="none")
    truth = linear_solution(ReferencePlant(), torque, H, np.zeros(5))
    relative = np.abs(states - truth).max(axis=0) / np.abs(truth).max(axis=0)
    print(f"no gap, expm: relative error {relative.max():.1e}")


if __name__ == "__main__":
    main()
