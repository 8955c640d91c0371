"""Makes the record of the example for any FMU: ``python -m tests.support.example_axis`` writes it anew.

An axis with LuGre friction, integrated in small Runge-Kutta steps; nothing is shared with the library.
"""

from pathlib import Path

import numpy as np

FILE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "axis.csv"
INERTIA, VISCOUS, FRICTION = 1.04, 0.97, 0.8
STIFFNESS, NOISE = 4e4, 1e-4  # of the bristles [N.m/rad], of the encoder [rad]
RATE, ROWS, SUBSTEPS = 200.0, 1200, 400


def _rates(x: np.ndarray, u: float) -> np.ndarray:
    _, speed, bristle = x
    friction = STIFFNESS * bristle
    return np.array([speed, (u - VISCOUS * speed - friction) / INERTIA, speed - abs(speed) * friction / FRICTION])


def example_axis() -> dict[str, np.ndarray]:
    """Return 6 s at 200 Hz of an axis under random steps of torque with a slow sine."""
    rng = np.random.default_rng(2028)
    u = np.repeat(rng.uniform(-8.0, 8.0, ROWS // 16), 16) + 2.0 * np.sin(2.0 * np.arange(ROWS) / RATE)
    u = np.round(u, 4)
    x, angle, h = np.zeros(3), np.empty(ROWS), 1.0 / RATE / SUBSTEPS
    for n, torque in enumerate(u):
        angle[n] = x[0]
        for _ in range(SUBSTEPS):
            k1 = _rates(x, torque)
            k2 = _rates(x + 0.5 * h * k1, torque)
            k3 = _rates(x + 0.5 * h * k2, torque)
            k4 = _rates(x + h * k3, torque)
            x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return {"time": np.arange(ROWS) / RATE, "u": u, "theta_m": angle + NOISE * rng.standard_normal(ROWS)}


if __name__ == "__main__":
    columns = example_axis()
    lines = [f"{t:.6g},{u:.6g},{y:.9g}" for t, u, y in zip(*columns.values(), strict=True)]
    FILE.write_text("\n".join([",".join(columns), *lines]) + "\n", encoding="utf-8")
