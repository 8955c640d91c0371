"""An independent simulator of records of two-stage drivetrains, which shares no code or formulation with the library.

A motor drives an intermediate shaft through stage 1, and that the load through stage 2. Either stage is a ratio, an
elastic shaft and a gap. Small fixed Runge-Kutta steps, a dead zone without located events, LuGre friction. Quantities::

    J_m J_s J_l           inertias of motor, intermediate shaft and load [kg.m2]; ``share`` is J_s / J_m
    i_1 i_2               ratios: speed of the motor over that of the shaft, of the shaft over that of the load
    k_1 c_1 alpha_1       stage 1, seen from the intermediate shaft: stiffness, damping, half-gap
    k_2 c_2 alpha_2       stage 2, seen from the load
    b_m b_s b_l           viscous friction
    tau                   time constant of the drive's torque [s]
  effects (off by default):
    Fc_m Fs_m Fc_l Fs_l   LuGre friction of motor and load: sliding, extra breakaway [N.m]
    T0                    constant torque against the load [N.m]
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numba import njit

from tests.support.excitations import coloured, levels, multisine
from tests.support.independent_plant import bristle

Array = np.ndarray

NOMINAL = {
    "J_m": 0.4, "J_s": 0.04, "J_l": 5.6, "i_1": 2.0, "i_2": 1.992, "k_1": 1660.0, "c_1": 0.5, "k_2": 6600.0, "c_2": 2.0,
    "b_m": 0.1, "b_s": 0.02, "b_l": 1.0, "tau": 0.005,
}  # fmt: skip
MISMATCHED = ("J_m", "J_s", "J_l", "k_1", "c_1", "k_2", "c_2", "b_m", "b_s", "b_l", "tau")
EFFECTS = {"alpha_1": 0.0, "alpha_2": 0.0, "Fc_m": 0.0, "Fs_m": 0.0, "Fc_l": 0.0, "Fs_l": 0.0, "T0": 0.0}
NAMES = (*NOMINAL, *EFFECTS)
STATES = ("theta_m", "omega_m", "theta_s", "omega_s", "theta_l", "omega_l", "T_m")
FRICTION = {"Fc_m": 0.5, "Fs_m": 0.3, "Fc_l": 1.5, "Fs_l": 0.8}  # that an estimator may leave out
COUNTS = (10_000, 20_000)
NOISE = (3e-4, 1.5e-4)
DITHER = 60.0  # Hz, beside the reversals: it moves the intermediate shaft within its gaps
SIGMA_M, SIGMA_L = 4000.0, 20000.0  # LuGre bristle stiffness [N.m/rad]
VS_M, VS_L = 0.5, 0.2  # Stribeck speed [rad/s]

(J_M, J_S, J_L, I_1, I_2, K_1, C_1, K_2, C_2, B_M, B_S, B_L, TAU,
 ALPHA_1, ALPHA_2, FC_M, FS_M, FC_L, FS_L, T0) = range(len(NAMES))  # fmt: skip


@njit(cache=True)
def _teeth(twist, speed, stiffness, damping, half_gap):
    """Return the torque of a shaft behind a dead zone [N.m]."""
    if half_gap <= 0.0:
        return stiffness * twist + damping * speed
    if abs(twist) <= half_gap:
        return 0.0
    return stiffness * (twist - np.sign(twist) * half_gap) + damping * speed


@njit(cache=True)
def _rates(x, v, request, fm, fl):
    """Return the derivatives of ``STATES``."""
    first = _teeth(x[0] / v[I_1] - x[2], x[1] / v[I_1] - x[3], v[K_1], v[C_1], v[ALPHA_1])
    second = _teeth(x[2] / v[I_2] - x[4], x[3] / v[I_2] - x[5], v[K_2], v[C_2], v[ALPHA_2])
    return np.array([
        x[1], (x[6] - v[B_M] * x[1] - fm - first / v[I_1]) / v[J_M],
        x[3], (first - v[B_S] * x[3] - second / v[I_2]) / v[J_S],
        x[5], (second - v[B_L] * x[5] - fl - v[T0]) / v[J_L],
        (request - x[6]) / v[TAU],
    ])  # fmt: skip


@njit(cache=True)
def _simulate(v, u, step, substeps, late, push):
    """Return the true states (n, 7) from rest under ``u`` (n,), which acts ``late`` [s]; ``push``: on the motor."""
    n = u.size
    h = step / substeps
    x = np.zeros(7)
    zm, zl = 0.0, 0.0
    states = np.empty((n, 7))
    for row in range(n):
        states[row] = x
        for m in range(substeps):
            back = int(np.floor((row * substeps + m + 0.5 - late / h) / substeps))
            request = u[back] if back >= 0 else 0.0
            zm, fm = bristle(zm, x[1], h, SIGMA_M, v[FC_M], v[FS_M], VS_M)
            zl, fl = bristle(zl, x[5], h, SIGMA_L, v[FC_L], v[FS_L], VS_L)
            fm -= push[row]
            a = _rates(x, v, request, fm, fl)
            b = _rates(x + 0.5 * h * a, v, request, fm, fl)
            c = _rates(x + 0.5 * h * b, v, request, fm, fl)
            d = _rates(x + h * c, v, request, fm, fl)
            x = x + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    return states


def reversals(rng: np.random.Generator, n: int, step: float, torque: float) -> Array:
    """Return torques (n,) of changing sign, each held for 0.1 to 0.3 s, and a tone of ``DITHER`` a third as large."""
    held = np.cumsum(rng.uniform(0.1, 0.3, round(n * step / 0.1) + 2))
    times = np.arange(n) * step
    sign = 1.0 - 2.0 * (np.searchsorted(held, times, side="right") % 2)
    size = rng.uniform(0.6, 1.0, len(held))[np.searchsorted(held, times, side="right")]
    phase = rng.uniform(0.0, 2.0 * np.pi)
    return torque * (sign * size + np.sin(2.0 * np.pi * DITHER * times + phase) / 3.0)


def draw_machine(rng: np.random.Generator, mismatch: float, nominal: Mapping[str, float] = NOMINAL) -> dict[str, float]:
    """Return the nominal parameters, each but the ratios off by a uniform draw of up to the share ``mismatch``."""
    drawn = dict(nominal)
    for name in MISMATCHED:
        drawn[name] *= 1.0 + mismatch * rng.uniform(-1.0, 1.0)
    return drawn


def make_two_stage_record(
    effects: Mapping[str, float] | None = None,
    seed: int = 0,
    share: float = 0.1,
    duration: float = 2.0,
    rate: float = 1000.0,
    mismatch: float = 0.05,
    excitation: str = "reversals",
    torque: float = 20.0,
    noise_factor: float = 1.0,
    torque_noise: float = 0.01,
    late: float = 0.0,
    counts: tuple[int, int] | None = COUNTS,
    u: Array | None = None,
    linear: Mapping[str, float] | None = None,
    substeps: int = 50,
) -> tuple[dict[str, Array], dict[str, Any]]:
    """Return one record (time, u, theta_m, theta_l) of a machine at rest at first, and the truth that made it.

    Args:
        effects: values of ``EFFECTS`` that are on, such as ``{"alpha_1": 0.02} | FRICTION``; unknown: ``KeyError``.
        seed: of mismatch, excitation and noise.
        share: nominal inertia of the intermediate shaft over that of the motor.
        duration: [s].
        rate: samples per second.
        mismatch: each parameter but the ratios is off its nominal value by a uniform draw of up to this share.
        excitation: "reversals", "multisine" or "levels".
        torque: size of the excitation [N.m].
        noise_factor: multiplies ``NOISE``, the encoders' standard deviations before rounding.
        torque_noise: rms of a coloured torque on the motor that is not in ``u``, as a share of the rms of the drive's.
        late: how much later than the record says the request acts [s].
        counts: encoder counts per revolution, or None: not rounded.
        u: the request itself (n,), instead of an excitation [N.m].
        linear: parameters to set outright, instead of the draw; also what the nominal ones are then.
        substeps: Runge-Kutta steps per sample.

    Returns:
        the columns, and truth: ``effects``, ``linear`` (drawn), ``nominal``, ``states`` (n, 7) as in ``STATES``.
    """
    rng = np.random.default_rng(seed)
    chosen = dict(EFFECTS)
    for name, value in (effects or {}).items():
        if name not in chosen:
            raise KeyError(name)
        chosen[name] = float(value)
    nominal = NOMINAL | {"J_s": share * NOMINAL["J_m"]} | dict(linear or {})
    drawn = draw_machine(rng, mismatch, nominal) | dict(linear or {})
    step, n = 1.0 / rate, round(duration * rate)
    if u is not None:
        request = np.asarray(u, dtype=float)
        n = request.size
    elif excitation == "reversals":
        request = reversals(rng, n, step, torque)
    else:
        request = {"multisine": multisine, "levels": levels}[excitation](rng, n, step, torque)
    request = np.array([float(f"{value:.6g}") for value in request])
    v = np.array([{**drawn, **chosen}[name] for name in NAMES])
    noise = noise_factor * np.array(NOISE)
    disturbance = rng.standard_normal((n, 2)) * noise
    push = np.zeros(n)
    if torque_noise > 0.0:
        # A first run without noise tells the rms of the drive's torque.
        plain = _simulate(v, request, step, substeps, late, push)
        push = torque_noise * float(np.std(plain[:, 6])) * coloured(np.random.default_rng([seed, 9]), n, step)
    states = _simulate(v, request, step, substeps, late, push)
    seen = states[:, [0, 4]] + disturbance
    if counts is not None:
        unit = 2.0 * np.pi / np.array(counts)
        seen = np.round(seen / unit) * unit
    columns = {"time": np.arange(n) * step, "u": request, "theta_m": seen[:, 0].copy(), "theta_l": seen[:, 1].copy()}
    truth = {
        "effects": chosen,
        "linear": drawn,
        "nominal": nominal,
        "states": states,
        "noise": (float(noise[0]), float(noise[1])),
        "counts": counts,
        "seed": seed,
    }
    return columns, truth
