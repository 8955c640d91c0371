"""Loops of the FMUs `BacklashEstimator` and `BacklashCompensator` whose half-gap is told wrongly, or that are late.

Run as ``python -m benchmarks.compensated_loops [--plants 20] [--seed 0]`` (with a C compiler). The plant is that of
:mod:`benchmarks.compensation`, with dry friction of 2 N.m at the load; a sine of 0.25 rad asks for two traversals in
each of its periods.

- Half-gap: the estimator starts from one that is 30 % off, and beside it from the true one (known to 1 %). A third run
  has the true half-gap in place of the estimate. Times and impacts of the first five traversals, and of later ones.
- Delay: requests act 0 to 3 ms late. The FMUs are told so, or not.
"""

import argparse
from collections.abc import Mapping
from functools import cache
from types import MappingProxyType

import numpy as np
from numba import njit

from benchmarks.compensation import ALPHA, DRIVES, ENCODERS, LIMIT, STEP, SUBSTEPS, WEIGHTS
from orchestrator.building.native_build import ensure_native
from orchestrator.plants.design import DrivetrainValues, design_regulator, five_state_model
from tests.support import independent_plant
from tests.support.fmu_calls import RawFmu

ESTIMATES = ("theta_m", "omega_m", "theta_l", "omega_l", "T_l", "T_m", "offset")
MEASURED = ("alpha_hat", "alpha_deviation", *(f"{name}_hat" for name in ESTIMATES))
Array = np.ndarray


class SampledFmu:
    """One instance of a native FMU, stepped once a sample."""

    def __init__(self, fmu: RawFmu, step: float, outputs: tuple[str, ...], parameters: Mapping[str, float]) -> None:
        component = fmu.instantiate()
        assert component is not None
        self.fmu, self.component, self.step, self.outputs = fmu, component, step, outputs
        assert fmu.set_real(component, list(parameters), list(parameters.values())) == 0, fmu.messages
        fmu.setup(component)
        fmu.library.fmi2EnterInitializationMode(component)
        self.samples = -1

    def sample(self, inputs: Mapping[str, float]) -> list[float]:
        """Return the outputs for the inputs of this sample."""
        assert self.fmu.set_real(self.component, list(inputs), list(inputs.values())) == 0, self.fmu.messages
        if self.samples < 0:
            self.fmu.library.fmi2ExitInitializationMode(self.component)
        else:
            assert self.fmu.step(self.component, self.samples * self.step, self.step) == 0, self.fmu.messages
        self.samples += 1
        return self.fmu.get_real(self.component, self.outputs)[1]


@cache
def fmus() -> tuple[RawFmu, RawFmu]:
    """The two native FMUs."""
    paths = ensure_native(["BacklashEstimator", "BacklashCompensator"], here=True)
    return RawFmu(paths["BacklashEstimator"]), RawFmu(paths["BacklashCompensator"])


@cache
def plant():
    """A sample of the plant, compiled; the request changes ``late`` substeps after its begin."""
    step, bristle, coulomb = independent_plant._step, independent_plant.bristle, independent_plant.FC_L

    @njit
    def run(x, bend, v, before, u, late, h, out):
        for m in range(SUBSTEPS):
            out[m] = x
            bend[0], friction = bristle(bend[0], x[3], h, 20000.0, v[coulomb], 0.0, 0.2)
            x = step(0.0, x, v, before if m < late else u, 0.0, friction, 1.0, 9, h)
        return x

    return run


def sine(end: float, step: float, height: float = 0.25, frequency: float = 0.5) -> tuple[Array, Array]:
    """The wanted angle [rad] and speed [rad/s] of the load: between 0 and ``2 height``."""
    t = np.arange(round(end / step)) * step
    w = 2.0 * np.pi * frequency
    return height * (1.0 - np.cos(w * t)), height * w * np.sin(w * t)


def simulate(
    rng: np.random.Generator,
    drive: str,
    reference: tuple[Array, Array],
    *,
    alpha: float = ALPHA,
    late: float = 0.0,
    step: float = STEP,
    known: float = 0.0,
    mismatch: float = 0.05,
    linear: Mapping[str, float] = MappingProxyType({}),
    effects: Mapping[str, float] = MappingProxyType({"Fc_l": 2.0}),
    estimator: Mapping[str, float] = MappingProxyType({}),
    compensator: Mapping[str, float] = MappingProxyType({}),
    weights: tuple[float, ...] = WEIGHTS["load"],
    counts: tuple[float, float] = ENCODERS,
) -> tuple[Array, Array]:
    """Return the states (n, SUBSTEPS, 8) of the plant, and (n, 5) request, flank, crossing, half-gap, deviation.

    Args:
        late: from a request until it acts [s].
        known: half-gap that the compensator is given in place of the estimate [rad].
        linear: parameters of the plant that are set.
    """
    nominal = independent_plant.NOMINAL | {"tau": DRIVES[drive]}
    drawn = independent_plant.draw_parameters(rng, mismatch, nominal=nominal) | dict(linear)
    named = drawn | independent_plant.EFFECTS | {"alpha": alpha, **effects}
    v = np.array([named[n] for n in independent_plant.NAMES])
    n = reference[0].size
    noise = rng.normal(0.0, independent_plant.NOISE, (n, 2))
    model = five_state_model(DrivetrainValues(tau=DRIVES[drive]))
    gains = design_regulator(model, np.diag(weights), 2e-3, step).gains
    first, second = fmus()
    tuned = {f"K[{k + 1}]": gain for k, gain in enumerate(gains)}
    tuned |= {"tau": DRIVES[drive], "u_max": LIMIT, "sample_time": step, **compensator}
    sensing = {name: nominal[name] for name in ("J_m", "J_l", "k", "c", "b_m", "b_l", "i", "tau")}
    sensing |= {"sample_time": step, "offset_spread": 1e-4, **estimator}
    observer = SampledFmu(first, step, MEASURED, sensing)
    controller = SampledFmu(second, step, ("u", "flank", "crossing"), tuned)
    x, bend = np.zeros(8), np.zeros(1)
    x[0] = -alpha * nominal["i"]
    h = step / SUBSTEPS
    whole, part = divmod(round(late / h), SUBSTEPS)
    sent = [0.0] * (whole + 2)
    states, told = np.empty((n, SUBSTEPS, 8)), np.empty((n, 5))
    for k in range(n):
        seen = [round((x[2 * m] + noise[k, m]) / counts[m]) * counts[m] for m in range(2)]
        found = observer.sample({"u": sent[-1], "theta_m": seen[0], "theta_l": seen[1]})
        inputs = dict(zip(MEASURED, found, strict=True))
        inputs |= {"reference": reference[0][k], "reference_speed": reference[1][k]}
        if known:
            inputs |= {"alpha_hat": known, "alpha_deviation": 0.005 * known}
        request = controller.sample(inputs)
        told[k] = (*request, *found[:2])
        sent = [*sent[1:], request[0]]
        x = plant()(x, bend, v, sent[-2 - whole], sent[-1 - whole], part, h, states[k])
    for one in (observer, controller):
        one.fmu.library.fmi2FreeInstance(one.component)
    return states.reshape(-1, 8), told


def traversals(states: Array, ratio: float, alpha: float, h: float) -> Array:
    """Return (n, 3): begin [s], time [s] and impact [rad/s] of all traversals from flank to flank."""
    twist = states[:, 0] / ratio - states[:, 2]
    speed = np.abs(states[:, 1] / ratio - states[:, 3])
    side = np.where(twist >= alpha, 1, np.where(twist <= -alpha, -1, 0))
    at = np.flatnonzero(side)
    jumps = np.flatnonzero(side[at[1:]] != side[at[:-1]])
    rows = [(at[j] * h, (at[j + 1] - at[j]) * h, speed[at[j + 1]]) for j in jumps]
    return np.array(rows).reshape(-1, 3)


def largest_impact(states: Array, ratio: float, alpha: float, after: int) -> float:
    """Return the largest speed [rad/s] at which teeth meet from row ``after`` on, bounces included."""
    twist = states[after:, 0] / ratio - states[after:, 2]
    speed = states[after:, 1] / ratio - states[after:, 3]
    up = (twist[1:] >= alpha) & (twist[:-1] < alpha)
    down = (twist[1:] <= -alpha) & (twist[:-1] > -alpha)
    return float(np.concatenate([speed[1:][up], -speed[1:][down], [0.0]]).max())


def print_wrong_starts(plants: int, seed: int) -> None:
    """Print the traversals of loops whose half-gap is 30 % off at the start, beside that which is known."""
    print("drive, half-gap; traversals 1 to 5, 6 to 9: median time over that with the true one; impact median, largest")
    for drive in DRIVES:
        rows: dict[str, list[Array]] = {}
        for n in range(plants):
            for name, told in (("true", None), ("1 %", (1.0, 0.005)), ("low", (0.7, 0.2)), ("high", (1.3, 0.2))):
                start = {} if told is None else {"alpha_start": told[0] * ALPHA, "alpha_spread": told[1]}
                rng = np.random.default_rng([seed, n])
                states, _ = simulate(
                    rng, drive, sine(10.5, STEP), known=ALPHA if told is None else 0.0, estimator=start
                )
                found = traversals(states, independent_plant.NOMINAL["i"], ALPHA, STEP / SUBSTEPS)
                padded = np.full((9, 3), np.nan)
                padded[: len(found)] = found[:9]
                rows.setdefault(name, []).append(padded)
        base = np.nanmedian([r[:, 1] for r in rows["true"]], axis=0)
        for name, all_rows in rows.items():
            table = np.array(all_rows)
            times, impacts = np.nanmedian(table[:, :, 1], axis=0), table[:, :, 2]
            ratio = " ".join(f"{x:.3f}" for x in (times / base)[:5]) + f" {np.mean((times / base)[5:]):.3f}"
            middle = " ".join(f"{x:.2f}" for x in np.nanmedian(impacts, axis=0)[:5])
            most = " ".join(f"{x:.2f}" for x in np.nanmax(impacts, axis=0)[:5])
            later = impacts[:, 5:]
            print(
                f"{drive} {name}: time {ratio} ({base[2]:.4f} s); impact {middle} {np.nanmedian(later):.2f}; "
                f"largest {most} {np.nanmax(later):.2f}",
                flush=True,
            )


def print_delays(plants: int, seed: int) -> None:
    """Print impacts and error of loops that are late, told so or not."""
    print("drive, late [ms], told: impact of traversals median, 95 %, of all contacts largest [rad/s], error [mrad]")
    reference = sine(6.0, STEP)
    for drive in DRIVES:
        for late in (0.0, 1e-3, 1.5e-3, 2e-3, 3e-3):
            for told in (False, True) if late else (True,):
                impacts, largest, errors = [], [], []
                delay = {"delay": late / STEP} if told else {}
                for n in range(plants):
                    states, _ = simulate(
                        np.random.default_rng([seed, n]), drive, reference, late=late, compensator=delay,
                        estimator=delay | {"alpha_start": ALPHA, "alpha_spread": 0.005},
                    )  # fmt: skip
                    ratio = independent_plant.NOMINAL["i"]
                    impacts += traversals(states, ratio, ALPHA, STEP / SUBSTEPS)[:, 2].tolist()
                    largest.append(largest_impact(states, ratio, ALPHA, 10 * SUBSTEPS))
                    errors.append(np.sqrt(np.mean((states[::SUBSTEPS, 2] - reference[0]) ** 2)))
                print(
                    f"{drive} {1e3 * late:g} {told}: {np.median(impacts):.3f} {np.quantile(impacts, 0.95):.3f} "
                    f"{np.median(largest):.2f} {1e3 * np.median(errors):.1f}",
                    flush=True,
                )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--plants", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    print_wrong_starts(arguments.plants, arguments.seed)
    print_delays(arguments.plants, arguments.seed)


if __name__ == "__main__":
    main()
