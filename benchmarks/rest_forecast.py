"""Forecast of what loops do at rest beside simulations of them.

Run as ``python -m benchmarks.rest_forecast [--loops 50] [--seed 0]``. Drivetrain, drive and weights
of the LQR are drawn; the simulator is the independent one, without friction and limit, from two starts.
"""

import argparse
from collections.abc import Callable

import numpy as np
from numba import njit

from orchestrator.control.standstill import forecast_rest
from orchestrator.plants.design import DrivetrainValues, design_regulator, five_state_model
from tests.support import independent_plant

ALPHA = 0.02
STEP = 1e-3
SUBSTEPS = 4
DURATION = 80.0
TAIL = 10.0
STILL = 0.05  # motion of the load over the half-gap that is rest
Array = np.ndarray


@njit
def simulate(x: Array, v: Array, gains: Array, steps: int, plant: Callable[..., Array]) -> Array:
    """Return twist [rad times the gear ratio aside] and load angle [rad] at each sample."""
    out = np.empty((steps, 2))
    for n in range(steps):
        u = -(gains[0] * x[0] + gains[1] * x[1] + gains[2] * x[2] + gains[3] * x[3] + gains[4] * x[4])
        out[n, 0], out[n, 1] = x[0], x[2]
        for _ in range(SUBSTEPS):
            x = plant(0.0, x, v, u, 0.0, 0.0, 1.0, 9, STEP / SUBSTEPS)
    return out


def draw_loop(rng: np.random.Generator) -> tuple[DrivetrainValues, tuple[float, ...]]:
    """Return a random drivetrain and the gains of an LQR of random weights for it."""
    scale = np.exp(rng.uniform(-0.7, 0.7, 4))
    values = DrivetrainValues(
        J_m=0.4 * scale[0],
        J_l=5.6 * scale[1],
        k=3300.0 * scale[2],
        c=scale[3],
        tau=float(np.exp(rng.uniform(-6.2, 0.0))),
    )
    weights = np.exp(rng.uniform(np.log((1.0, 0.5, 1.0, 1.0, 1e-3)), np.log((100.0, 100.0, 3000.0, 1000.0, 0.1))))
    price = float(np.exp(rng.uniform(np.log(5e-4), np.log(2e-2))))
    return values, design_regulator(five_state_model(values), np.diag(weights), price, STEP).gains


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--loops", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    right = wrong = 0
    print("loop, forecast: twist/alpha, load/alpha, Hz; simulated: the same")
    for n in range(arguments.loops):
        values, gains = draw_loop(np.random.default_rng([arguments.seed, n]))
        f = forecast_rest(values, gains, STEP)
        named = independent_plant.NOMINAL | independent_plant.EFFECTS | vars(values) | {"alpha": ALPHA}
        v = np.array([named[name] for name in independent_plant.NAMES])
        best = (0.0, 0.0, 0.0)
        for angle, speed in ((1.0, 0.0), (0.05, 0.2)):
            x = np.zeros(8)
            x[2], x[3], x[0] = angle, speed, values.i * angle
            run = simulate(x, v, np.array(gains), round(DURATION / STEP), independent_plant._step)
            tail = run[-round(TAIL / STEP) :]
            load = 0.5 * np.ptp(tail[:, 1]) / ALPHA
            if load > max(best[1], STILL):
                middle = tail[:, 1] - 0.5 * (tail[:, 1].max() + tail[:, 1].min())
                up = np.flatnonzero((middle[1:] >= 0.0) & (middle[:-1] < 0.0))
                hertz = (up.size - 1) / ((up[-1] - up[0]) * STEP) if up.size > 1 else 0.0
                best = (0.5 * np.ptp(tail[:, 0] / values.i - tail[:, 1]) / ALPHA, load, hertz)
        same = bool(f.cycles) == (best[1] > 0.0)
        near = same and np.allclose((f.twist, f.load, f.frequency), best, rtol=0.1)
        right += near
        wrong += best[1] > 0.0 and not f.cycles
        print(
            f"{n} {f.twist:.2f} {f.load:.2f} {f.frequency:.2f} {'' if f.settled else 'unsettled'}; "
            f"{best[0]:.2f} {best[1]:.2f} {best[2]:.2f} {'' if near else 'OFF'}",
            flush=True,
        )
    print(f"within 10 %: {right} of {arguments.loops}; called still, but cycles: {wrong}")


if __name__ == "__main__":
    main()
