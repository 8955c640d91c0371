"""Crossings by the FMU `BacklashCompensator` beside the bound, a move and rest beside the plain LQR.

Run as ``python -m benchmarks.compensation [--plants 200] [--seed 0]`` (with a C compiler). The plant is the
independent simulator (Hunt-Crossley contact, LuGre friction), each parameter up to 5 % off; encoders of 10,000
and 20,000 counts with noise of 3e-4 and 1.5e-4 rad; half-gap 0.02 rad, known to 1 %; torque limit 300 N.m.
States come from one filter of :mod:`pyfmu_sources.estimators.backlash_estimator` that is told the half-gap; the request
from the native FMU. The LQR has the thesis's weights, and others that damp the load.
"""

import argparse
import ctypes
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType

import numpy as np
from numba import njit

from orchestrator.building.native_build import ensure_native
from orchestrator.building.translation.kernels import Kernels
from orchestrator.plants.design import DrivetrainValues, design_regulator, five_state_model
from pyfmu_sources.controllers.backlash_compensator_slave import BacklashCompensator
from pyfmu_sources.controllers.gap_traversal import plan
from pyfmu_sources.estimators.backlash_estimator import SIZE, NoiseSettings, covariance
from tests.support import independent_plant
from tests.support.fmu_calls import RawFmu

STEP = 1e-3
SUBSTEPS = 10
ALPHA = 0.02
LIMIT = 300.0
DRIVES = {"slow": 1.0, "fast": 5e-3}
COUNT = 2.0 * np.pi / 20_000
ENCODERS = (2.0 * np.pi / 10_000, COUNT)
WEIGHTS = {"thesis": (10.0, 50.0, 1.0, 1.0, 0.01), "load": (10.0, 1.0, 1000.0, 500.0, 0.01)}
_CASES = {"friction 2 N.m": {"Fc_l": 2.0}, "load 5 N.m": {"T0": 5.0}}
NAMES = [variable.name for variable in BacklashCompensator.table]
Array = np.ndarray
Reference = tuple[Array, Array]


@dataclass(frozen=True)
class Run:
    """True states (n, 8) at every substep, and the gear ratio."""

    states: Array
    ratio: float

    @property
    def twist(self) -> Array:
        return self.states[:, 0] / self.ratio - self.states[:, 2]

    @property
    def speed(self) -> Array:
        return self.states[:, 1] / self.ratio - self.states[:, 3]

    def impacts(self) -> Array:
        """Speeds [rad/s] with which the teeth met."""
        twist, speed = self.twist, self.speed
        up = (twist[1:] >= ALPHA) & (twist[:-1] < ALPHA)
        down = (twist[1:] <= -ALPHA) & (twist[:-1] > -ALPHA)
        return np.concatenate([speed[1:][up], -speed[1:][down], [0.0]])


OBSERVER = Kernels("benchmarks.observer_kernel", checked=True)


@cache
def kernels() -> tuple[Callable[..., None], Callable[..., Array]]:
    """The filter's sample and the plant's, compiled."""
    step, bristle = independent_plant._step, independent_plant.bristle
    coulomb = independent_plant.FC_L

    def observe(f, model, settings, u, theta_m, theta_l, first):
        OBSERVER.observe(f, model, settings, u, theta_m, theta_l, STEP, first)

    @njit
    def run(x, bend, v, u, out):
        h = STEP / SUBSTEPS
        for m in range(SUBSTEPS):
            out[m] = x
            bend[0], friction = bristle(bend[0], x[3], h, 20000.0, v[coulomb], 0.0, 0.2)
            x = step(0.0, x, v, u, 0.0, friction, 1.0, 9, h)
        return x

    return observe, run


class Compensator:
    """The FMU, stepped once a sample; without a known half-gap it is the plain LQR."""

    def __init__(self, path: Path, tau: float, impact_speed: float, known: bool, weights: str) -> None:
        self.fmu = RawFmu(path)
        component = self.fmu.instantiate()
        assert component is not None
        self.component = component
        model = five_state_model(DrivetrainValues(tau=tau))
        gains = design_regulator(model, np.diag(WEIGHTS[weights]), 2e-3, STEP).gains
        values = {f"K[{n + 1}]": gain for n, gain in enumerate(gains)}
        self.known = known
        self.set(values | {"tau": tau, "impact_speed": impact_speed, "u_max": LIMIT})
        library, zero = self.fmu.library, ctypes.c_double(0.0)
        library.fmi2SetupExperiment(self.component, 0, zero, zero, 0, zero)
        library.fmi2EnterInitializationMode(self.component)
        self.samples = -1

    def set(self, values: dict[str, float]) -> None:
        """Set variables by name."""
        n = len(values)
        references = (ctypes.c_uint * n)(*(NAMES.index(name) for name in values))
        self.fmu.library.fmi2SetReal(
            self.component, references, ctypes.c_size_t(n), (ctypes.c_double * n)(*values.values())
        )

    def sample(self, values: dict[str, float]) -> float:
        """Return the request [N.m] for the inputs of this sample."""
        if self.samples >= 0:
            self.set(values)
            self.fmu.step(self.component, self.samples * STEP, STEP)
        else:
            self.set(values)
            self.fmu.library.fmi2ExitInitializationMode(self.component)
        self.samples += 1
        u = ctypes.c_double()
        reference = (ctypes.c_uint * 1)(NAMES.index("u"))
        self.fmu.library.fmi2GetReal(self.component, reference, ctypes.c_size_t(1), ctypes.byref(u))
        return float(u.value)


def simulate(
    path: Path,
    rng: np.random.Generator,
    drive: str,
    speed: float,
    reference: Reference,
    known: bool = True,
    wait: int = 0,
    effects: Mapping[str, float] = MappingProxyType({}),
    weights: str = "thesis",
) -> Run:
    """Run one loop; for the first ``wait`` samples nothing is requested."""
    tau = DRIVES[drive]
    nominal = independent_plant.NOMINAL | {"tau": tau}
    drawn = independent_plant.draw_parameters(rng, 0.05, nominal=nominal)
    v = np.array(
        [(drawn | independent_plant.EFFECTS | {"alpha": ALPHA, **effects})[n] for n in independent_plant.NAMES]
    )
    observe, plant = kernels()
    model = tuple(nominal[name] for name in ("J_m", "J_l", "k", "c", "b_m", "b_l", "i", "tau"))
    settings = tuple(NoiseSettings(offset_spread=1e-4))
    n = reference[0].size
    noise = rng.normal(0.0, independent_plant.NOISE, (n, 2))
    alpha = ALPHA * (1.0 + 0.01 * rng.uniform(-1.0, 1.0))
    x = np.zeros(8)
    x[0] = -ALPHA * nominal["i"]
    f = np.zeros(SIZE)
    f[0] = x[0]
    for k, spread in enumerate((3e-4, 1.0, 1.5e-4, 0.3, 5.0, 1.0, 0.005 * ALPHA, 0.03, 1e-4)):
        f[covariance(k, k)] = spread**2
    f[6] = alpha
    bend = np.zeros(1)
    states = np.empty((n, SUBSTEPS, 8))
    controller = Compensator(path, tau, speed, known, weights)
    u = 0.0
    for k in range(n):
        seen = [round((x[2 * m] + noise[k, m]) / ENCODERS[m]) * ENCODERS[m] for m in range(2)]
        observe(f, model, settings, u, *seen, k == 0)
        inputs = dict(zip(NAMES[2:8], (f[0], f[1], f[2], f[3], f[5], f[4]), strict=True))
        inputs |= {"reference": reference[0][k], "reference_speed": reference[1][k], "offset_hat": f[8]}
        inputs |= {"alpha_hat": f[6] if known else 0.0, "alpha_deviation": np.sqrt(max(f[covariance(6, 6)], 0.0))}
        if k >= wait:
            u = controller.sample(inputs)
        x = plant(x, bend, v, u, states[k])
    return Run(states.reshape(-1, 8), drawn["i"])


def smooth_move(start: float, duration: float, height: float, end: float) -> Reference:
    """A move of the load [rad] with continuous acceleration, and its speed."""
    t = np.arange(round(end / STEP)) * STEP
    s = np.clip((t - start) / duration, 0.0, 1.0)
    return height * (10 * s**3 - 15 * s**4 + 6 * s**5), height / duration * (30 * s**2 - 60 * s**3 + 30 * s**4)


def print_crossings(path: Path, plants: int, seed: int) -> None:
    """Print time and impact of single crossings beside the bound."""
    wait = 200
    reference = (np.where(np.arange(1000) < wait, 0.0, 0.1), np.zeros(1000))
    inertia = DrivetrainValues().J_m * DrivetrainValues().i
    print(
        "crossing from rest: drive, impact asked [rad/s], bound [s], median time [s], impact median, 95 % [rad/s], lost"
    )
    for drive, tau in DRIVES.items():
        for speed in (0.1, 0.3):
            best = plan((-ALPHA, 0.0, 0.0), ALPHA, speed, LIMIT, tau, inertia)
            times, impacts = [], []
            for n in range(plants):
                run = simulate(path, np.random.default_rng([seed, n]), drive, speed, reference, wait=wait)
                at = np.flatnonzero(run.twist[wait * SUBSTEPS :] >= ALPHA)
                if at.size:
                    times.append(at[0] * STEP / SUBSTEPS)
                    impacts.append(run.speed[wait * SUBSTEPS + at[0]])
            bound = best.first + best.second + best.third
            print(
                f"{drive} {speed} {bound:.4f} {np.median(times):.4f} {np.median(impacts):.3f} "
                f"{np.quantile(impacts, 0.95):.3f} {plants - len(times)}"
            )


def rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def print_moves(path: Path, plants: int, seed: int, weights: str) -> None:
    """Print impact and tracking error of a smooth move, and the motion at rest, beside the plain LQR's."""
    print(f"weights of the LQR: {weights}")
    print("drive, case, impact and rms error over the LQR's (medians), at rest peak to peak [counts] median, 90 %, LQR")
    for drive in DRIVES:
        for case, effects in _CASES.items():
            ratios, rests = [], []
            reference = smooth_move(0.5, 1.0, 0.5, 10.0)
            for n in range(plants):
                both = [
                    simulate(
                        path,
                        np.random.default_rng([seed, n]),
                        drive,
                        0.1,
                        reference,
                        known,
                        effects=effects,
                        weights=weights,
                    )
                    for known in (True, False)
                ]
                moves = slice(500 * SUBSTEPS, 4000 * SUBSTEPS)
                largest = [Run(run.states[moves], run.ratio).impacts().max() for run in both]
                errors = [rms(run.states[::SUBSTEPS, 2][500:4000] - reference[0][500:4000]) for run in both]
                ratios.append((largest[0] / max(largest[1], 1e-9), errors[0] / errors[1]))
                rests.append([np.ptp(run.states[-2000 * SUBSTEPS :, 2]) / COUNT for run in both])
            impact, error = np.median(ratios, axis=0)
            ours, plain = np.array(rests).T
            print(
                f"{drive}, {case}: {impact:.2f} {error:.2f}; {np.median(ours):.1f} {np.quantile(ours, 0.9):.1f}; "
                f"{np.median(plain):.0f}"
            )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--plants", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    path = ensure_native(["BacklashCompensator"], here=True)["BacklashCompensator"]
    print_crossings(path, arguments.plants, arguments.seed)
    for weights in WEIGHTS:
        print_moves(path, max(arguments.plants // 4, 1), arguments.seed, weights)


if __name__ == "__main__":
    main()
