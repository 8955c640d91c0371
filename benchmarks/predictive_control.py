"""A model predictive controller that knows the gap, beside the laws of ``compensate``.

Run as ``python -m benchmarks.predictive_control [--plants 15] [--tau 1] [--seed 0]``. DAQP solves the programmes.

Two linear models of the same six states take turns:

- **On the flank** that is wanted, the drivetrain without a gap, its motor's angle less the half-gap. The cost is that
  of the LQR about the motion that the reference asks for, with the LQR's cost to go behind the horizon. So this is the
  shifted LQR, but for the torque limit, and for the reference ahead, which it knows.
- **In the gap** motor and load apart. The cost is the way to the flank. The speed of the twist is at most ``rate``
  times the way that is left to a point behind the flank, which makes it the impact speed at the flank.

Requests are held over blocks that grow with the horizon, and are in units of the torque limit. The optimiser is that of
Arnström, Bemporad and Axehill, IEEE Trans. Automatic Control 67(8), 2022.
"""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import daqp
import numpy as np
from numpy.typing import NDArray

import orchestrator as oc
from orchestrator.api.compensate import summarise_law
from orchestrator.building.fastest import ensure_fastest
from orchestrator.control.loops import FMUS, SHIFTED, ControlTask, make_loop
from orchestrator.control.measures import least_time, measure_loop
from orchestrator.errors import SlaveError
from orchestrator.master.protocol import ModelInterface, Signals, Transfer, Value, Variable
from orchestrator.master.system import Connection, Instance, System
from orchestrator.plants.design import discretise, five_state_model, six_state_model, solve_riccati
from orchestrator.scenarios.definition import Scenario
from orchestrator.scenarios.scenario import simulate
from orchestrator.shared.results.compensate import LawFound
from pyfmu_sources.controllers.backlash_compensator import Tuning, impact_speed
from pyfmu_sources.controllers.lqr import Estimate

Array = NDArray[np.float64]
MPC = "MPC"
BLOCKS = 14  # held requests of a horizon
HORIZON = 3.0  # in shortest times of a traversal
QUICKNESS = 4.0  # bandwidth of the way in the gap times the shortest time of a traversal
RATE = 3.0  # of the speed limit in the gap times the shortest time of a traversal
TOUCH = 3e-4  # before the flank, from which it is held: noise of the estimated twist [rad]
SOFT = 8  # DAQP's sign of a constraint that may be broken at a price
INPUTS = ("theta_m_hat", "omega_m_hat", "theta_l_hat", "omega_l_hat", "T_l_hat", "T_m_hat", "offset_hat", "alpha_hat")


class PredictiveLaw:
    """The two programmes of a task, condensed: requests are their only unknowns."""

    def __init__(self, task: ControlTask) -> None:
        v, h = task.nominal, task.sample_time
        self.task = task
        self._reference, self._tuning = (
            task.reference(),
            Tuning(task.impact_speed, 1.0, task.machine.torque_limit, TOUCH, h),
        )
        bound = least_time(task, task.impact_speed)
        self._steps = max(BLOCKS, round(HORIZON * bound / h))
        blocks = np.unique(np.ceil(self._steps * np.linspace(0.0, 1.0, BLOCKS + 1) ** 2).astype(int))
        held = np.zeros((self._steps, blocks.size - 1))
        for n, (begin, end) in enumerate(pairwise(blocks)):
            held[begin:end, n] = task.machine.torque_limit
        self._ends = blocks[1:] - 1
        box = np.ones(blocks.size - 1)

        # On the flank.
        price = task.torque_weight * h
        keep = [0, 1, 2, 3, 5]
        sampled = discretise(five_state_model(v), h)
        weights = np.zeros((self._steps, 6, 6))
        weights[:, np.ix_(keep, keep)[0], np.ix_(keep, keep)[1]] = np.diag(task.state_weights) * h
        _, to_go = solve_riccati(*sampled, weights[-1][np.ix_(keep, keep)], np.array([[price]]))
        weights[-1][np.ix_(keep, keep)] = to_go
        free, forced = predict(*discretise(six_state_model(v), h), held)
        weighed = np.einsum("kam,kab->mkb", forced, weights)
        H = np.einsum("mkb,kbn->mn", weighed, forced) + price * held.T @ held
        self._held_state = np.einsum("mkb,kbc->mc", weighed, free)
        self._held_aim = self._aims(weighed, price * held)
        self._held_load = np.einsum("mkb,b->m", weighed, [v.i / v.k, 0, 0, 0, 0, 1.0 / v.i]) + price * held.sum(0) / v.i
        self._hold = daqp.Model()
        self._hold.setup(H, np.zeros(box.size), np.zeros((0, box.size)), box, -box)

        # In the gap; rows of the way and of its speed.
        free, forced = predict(*discretise(six_state_model(replace(v, k=0.0, c=0.0)), h), held)
        way = np.array([[1.0 / v.i, 0, -1.0, 0, 0, 0], [0, 1.0 / v.i, 0, -1.0, 0, 0]])
        free, forced = way @ free, way @ forced
        w, self._rate = QUICKNESS / bound, RATE / bound
        weight = task.torque_weight * (v.J_m * v.i) ** 2 * w**4 * (1.0 + (v.tau * w) ** 2) * h
        self._cross_state = weight * forced[:, 0].T @ free[:, 0]
        self._cross_aim = weight * forced[:, 0].sum(0)
        H = weight * forced[:, 0].T @ forced[:, 0] + price * held.T @ held
        self._limit_state = (free[:, 1] + self._rate * free[:, 0])[self._ends]
        limit = (forced[:, 1] + self._rate * forced[:, 0])[self._ends]
        self._cross = daqp.Model()
        self._box, least = np.append(box, 1e9 * np.ones(box.size)), np.append(-box, -1e9 * np.ones(box.size))
        sense = np.append(np.zeros(box.size), SOFT * np.ones(box.size)).astype(np.int32)
        self._cross.setup(H, np.zeros(box.size), limit, self._box.copy(), least, sense)
        self._least = least

    def _aims(self, weighed: Array, priced: Array) -> Array:
        """Return what the reference from each sample on adds to the gradient without load torque (samples, blocks)."""
        v, h = self.task.nominal, self.task.sample_time
        angle, speed = (np.append(r, np.full(self._steps, r[-1])) for r in self._reference)
        acceleration = np.gradient(speed, h)
        load = v.J_l * acceleration + v.b_l * speed
        theta_m = v.i * (angle + load / v.k)
        T_m = v.i * (v.J_m * acceleration + v.b_m * speed) + load / v.i
        aim = np.array([theta_m, np.gradient(theta_m, h), angle, speed, np.zeros_like(angle), T_m]).T
        u = T_m + v.tau * np.gradient(T_m, h)
        n = angle.size - self._steps
        parts = (
            aim[k + 1 : k + 1 + n] @ weighed[:, k].T + np.outer(u[k : k + n], priced[k]) for k in range(self._steps)
        )
        return np.asarray(sum(parts))

    def request(self, sample: int, x: Estimate, flank: float, alpha: float) -> float:
        """Return the torque request [N.m] for the estimate ``x``, whose twist is zero in mid-gap.

        Args:
            sample: number of the sample.
            x: ``(theta_m, omega_m, theta_l, omega_l, T_l, T_m)``.
            flank: wanted, -1 or 1.
            alpha: half-gap [rad].
        """
        if flank * (x[0] / self.task.nominal.i - x[2]) >= alpha - TOUCH:
            model = self._hold
            shifted = (x[0] - flank * self.task.nominal.i * alpha, *x[1:])
            aim = self._held_aim[min(sample, len(self._held_aim) - 1)]
            model.update(f=self._held_state @ shifted - aim - self._held_load * x[4])
        else:
            model = self._cross
            angle, speed = (float(r[min(sample, r.size - 1)]) for r in self._reference)
            aim = alpha + impact_speed(angle, speed, x, alpha, self._tuning) / self._rate
            f = self._cross_state @ x - flank * aim * self._cross_aim
            most, n = self._rate * aim, self._ends.size
            now = self._limit_state @ x
            upper, lower = self._box.copy(), self._least.copy()
            if flank > 0:
                upper[n:] = most - now
            else:
                lower[n:] = -most - now
            model.update(f=f, bupper=upper, blower=lower)
        best, _, flag, _ = model.solve()
        if flag < 1:
            raise SlaveError(f"controller: the quadratic programme of sample {sample} has no solution ({flag})")
        return float(best[0]) * self.task.machine.torque_limit


def predict(A: Array, B: Array, held: Array) -> tuple[Array, Array]:
    """Return free response (steps, n, n) of the state and its response to the held requests (steps, n, blocks)."""
    free, forced = [A], [B @ held[:1]]
    for row in held[1:]:
        free.append(A @ free[-1])
        forced.append(A @ forced[-1] + B @ row[None])
    return np.array(free), np.array(forced)


class PredictiveSlave:
    """The law as a slave: it samples at the end of each step, as the FMUs of controllers do."""

    def __init__(self, name: str, law: PredictiveLaw) -> None:
        self.name, self.model, self._law = name, MODEL, law
        self.reset()

    def set(self, values: Mapping[str, Value]) -> None:
        """Set variables by name."""
        self._values.update({name: float(value) for name, value in values.items()})

    def get(self, names: Sequence[str]) -> list[Value]:
        """Return variables by name."""
        return [self._values[name] for name in names]

    def sends(self, names: Sequence[str], buffer: Signals) -> Transfer:
        """Return a call that sets variables from a buffer."""
        return lambda: self._values.update(zip(names, buffer.tolist(), strict=True))

    def receives(self, names: Sequence[str], buffer: Signals) -> Transfer:
        """Return a call that reads variables into a buffer."""

        def receive() -> None:
            buffer[:] = self.get(names)

        return receive

    def start(self) -> None:
        """Request for the first sample."""
        self._sample(0)

    def do_step(self, time: float, step: float) -> None:
        """Request for the sample at the end of the step."""
        self._sample(round((time + step) / self._law.task.sample_time))

    def _sample(self, sample: int) -> None:
        theta_m, omega_m, theta_l, omega_l, T_l, T_m, offset, alpha = (self._values[name] for name in INPUTS)
        x = (theta_m - self._law.task.nominal.i * offset, omega_m, theta_l, omega_l, T_l, T_m)
        self._values["u"] = self._law.request(sample, x, self._values["flank"], alpha)

    def reset(self) -> None:
        """Return to the start values."""
        self._values = dict.fromkeys(MODEL.variables, 0.0)

    def get_state(self) -> Any:
        """Return nothing: the model says that states cannot be saved."""

    def _pass(self, *given: Any, **named: Any) -> None:
        """Nothing is to be done."""

    begin = set_state = free_state = terminate = close = _pass


_NAMES = (*INPUTS, "flank")
MODEL = ModelInterface(
    MPC,
    {n: Variable(n, "input", start=0.0) for n in _NAMES} | {"u": Variable("u", "output", variability="discrete")},
    feedthrough={"u": frozenset(_NAMES)},
    can_save_state=False,
)


def make_predictive_loop(law: PredictiveLaw, fmus: Mapping[str, Path], seed: Sequence[int]) -> Scenario:
    """Return the loop of ``make_loop`` under the MPC; the shifted LQR beside it says which flank is wanted."""
    loop = make_loop(law.task, fmus, SHIFTED, seed)
    plant, estimator, flanks = loop.system.instances
    controller = Instance("controller", MODEL, lambda name: PredictiveSlave(name, law))
    system = System(
        (plant, estimator, replace(flanks, name="flanks"), controller),
        (*_shared(loop.system.connections), Connection("flanks.flank", "controller.flank")),
        tuple(_shared(loop.system.sources)),
    )
    return replace(loop, system=system, name=MPC)


def _shared(parts: Sequence[Any]) -> Iterator[Any]:
    """Yield connections or sources; those to the controller lead to the LQR, and to the MPC what is an input of it."""
    for part in parts:
        instance, _, name = part.target.partition(".")
        if instance != "controller" or name in INPUTS:
            yield part
        if instance == "controller":
            yield replace(part, target=f"flanks.{name}")


def run_predictive(task: ControlTask, plants: int, seed: int) -> LawFound:
    """Return what is measured of the MPC on the plants of ``compensate``."""
    law, fmus = PredictiveLaw(task), ensure_fastest(FMUS).paths
    runs = [simulate(make_predictive_loop(law, fmus, (seed, plant))) for plant in range(plants)]
    return summarise_law(MPC, [measure_loop(run, task) for run in runs])


def main() -> None:
    """Print the medians of all laws."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plants", type=int, default=15)
    parser.add_argument("--tau", type=float, default=5e-3, help="time constant of the drive [s]")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    found = oc.compensate(plants=args.plants, tau=args.tau, seed=args.seed)
    predictive = run_predictive(found.task, args.plants, args.seed)
    print(replace(found, laws=(*found.laws[:-1], predictive, found.laws[-1])))


if __name__ == "__main__":
    main()
