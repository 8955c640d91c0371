"""An independent simulator that makes measured records, and shares no code or formulation with the library.

Where the library locates events and uses signum friction and a dead zone, this one uses small fixed
Runge-Kutta steps, LuGre friction, Hunt-Crossley contact and a tangent spring. Effects (all off by default),
with the names used in ``truth``::

    alpha                 half gap [rad]; Hunt-Crossley contact (``contact="dead_zone"``: sharp, exact twin)
    Fc_m Fs_m vs          LuGre friction of the motor: sliding, extra breakaway [N.m], Stribeck speed [rad/s]
    Fc_l Fs_l vs_l        the same at the load
    delay                 of the torque request [s]
    sat                   torque limit [N.m]
    hard                  twist at which the tangent spring would become rigid [rad]
    rip rip_n rip_ph      torque ripple at the motor [N.m, cycles per motor revolution, rad]
    ecc ecc_n ecc_ph      ecc*sin(ecc_n*theta_m + ecc_ph) added to the twist [rad]
    T0                    constant torque against the load [N.m]
    grav grav_ph          grav*sin(theta_l + grav_ph) against the load [N.m, rad]
    J3 w3 z3              third inertia [kg.m2], its frequency [rad/s] and damping ratio (0.02)
    qd                    quadratic drag of the load [N.m.s2/rad2]
    off_m off_l           encoder offsets [rad]
    enc_m enc_m_ph enc_l enc_l_ph   encoders off their centre: enc*sin(angle + ph) added to what they measure [rad]
    ks ks3 ks_x           spring that pulls the load back [N.m/rad, N.m/rad3], its angle at rest [rad]
    stop stop_k stop_d    end stops of the load at +stop and -stop [rad, 0: none], stiffness, dissipation [s/rad]
    dv_m dv_l             viscous friction that differs by direction [N.m.s/rad]
    mu_m mu_l             dry friction per torque of the shaft (motor side and load side)
    wav_m wav_n wav_ph    part of the motor's dry friction that repeats with its angle [N.m, 1, rad]
    rip2 rip2_ph rip3 rip3_ph   harmonics of the ripple
    kvar kvar_n kvar_ph   relative part of the stiffness that turns with the motor
    tau2 slew             second lag of the drive [s], fastest change of its request [N.m/s]
  that no library is meant to hold:
    jvar                  load inertia times 1 + jvar*cos(theta_l)
    bw bw_x               Bouc-Wen hysteresis in the shaft [N.m], yield twist [rad]
    late_Fc               motor friction [N.m] that starts half-way through the record
    alpha_end             half gap at the end of the record, grown linearly from alpha
    kspeed                stiffness times 1 + kspeed*|omega_l| (per rad/s)
    knock                 torque pulses [N.m] on the load, 20 ms every 0.7 s, not in ``u``
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

from tests.support.excitations import coloured, levels, multisine

NOMINAL = {"J_m": 0.4, "J_l": 5.6, "k": 3300.0, "c": 1.0, "b_m": 0.1, "b_l": 1.0, "i": 3.984, "tau": 1.0}
MISMATCHED = ("J_m", "J_l", "k", "c", "b_m", "b_l", "tau")
EFFECTS = {
    "alpha": 0.0, "Fc_m": 0.0, "Fs_m": 0.0, "vs": 0.5, "Fc_l": 0.0, "Fs_l": 0.0, "vs_l": 0.2, "delay": 0.0,
    "sat": 1e9,
    "hard": 0.0, "rip": 0.0, "rip_n": 6.0, "rip_ph": 0.0, "ecc": 0.0, "ecc_n": 1.0, "ecc_ph": 0.0, "T0": 0.0,
    "grav": 0.0, "grav_ph": 0.0, "J3": 0.0, "w3": 60.0, "z3": 0.02, "qd": 0.0, "off_m": 0.0, "off_l": 0.0,
    "jvar": 0.0,
    "ks": 0.0, "ks3": 0.0, "ks_x": 0.0, "stop": 0.0, "stop_k": 1e4, "stop_d": 0.1, "dv_m": 0.0, "dv_l": 0.0,
    "mu_m": 0.0, "mu_l": 0.0, "wav_m": 0.0, "wav_n": 1.0, "wav_ph": 0.0, "rip2": 0.0, "rip2_ph": 0.0, "rip3": 0.0,
    "rip3_ph": 0.0, "kvar": 0.0, "kvar_n": 1.0, "kvar_ph": 0.0, "tau2": 0.0, "slew": 0.0,
    "enc_m": 0.0, "enc_m_ph": 0.0, "enc_l": 0.0, "enc_l_ph": 0.0,
    "bw": 0.0, "bw_x": 0.01, "late_Fc": 0.0, "alpha_end": -1.0, "kspeed": 0.0, "knock": 0.0,
}  # fmt: skip
LINEAR = tuple(NOMINAL)
NAMES = (*LINEAR, *EFFECTS)
COUNTS = (10_000, 20_000)
NOISE = (3e-4, 1.5e-4)
SUBSTEPS = 100  # per sample

(
    J_M, J_L, K, C, B_M, B_L, RATIO, TAU, ALPHA, FC_M, FS_M, VS_M, FC_L, FS_L, VS_L, DELAY, SAT, HARD,
    RIP, RIP_N, RIP_PH, ECC, ECC_N,
    ECC_PH, T0, GRAV, GRAV_PH, J3, W3, Z3, QD, OFF_M, OFF_L, JVAR, KS, KS3, KS_X, STOP, STOP_K, STOP_D, DV_M, DV_L,
    MU_M, MU_L, WAV_M, WAV_N, WAV_PH, RIP2, RIP2_PH, RIP3, RIP3_PH, KVAR, KVAR_N, KVAR_PH, TAU2, SLEW,
    ENC_M, ENC_M_PH, ENC_L, ENC_L_PH, BW, BW_X, LATE, ALPHA_END, KSPEED, KNOCK,
) = range(len(NAMES))  # fmt: skip
SIGMA_M, SIGMA_L = 4000.0, 20000.0  # LuGre bristle stiffness [N.m/rad]


@njit(cache=True)
def _spring(d, w, v, alpha, flank):
    """Return the elastic-plus-damping torque of the mesh [N.m]; ``flank`` 9: Hunt-Crossley, else a sharp mode."""
    k, c = v[K], v[C]
    if flank != 9:
        return k * (d - flank * alpha) + c * w if flank != 0 else 0.0
    if alpha <= 0.0:
        gap, side = d, 0.0
    elif d > alpha:
        gap, side = d - alpha, 1.0
    elif d < -alpha:
        gap, side = d + alpha, -1.0
    else:
        return 0.0
    if v[HARD] > 0.0:
        reach = min(max(gap / v[HARD], -0.999), 0.999)
        elastic = k * v[HARD] * 2.0 / np.pi * np.tan(0.5 * np.pi * reach)
    else:
        elastic = k * gap
    if side == 0.0:
        return elastic + c * w
    # Hunt-Crossley: damping in proportion to the penetration, never pulling; c is reached at 2 mrad.
    torque = elastic + c * w * min(abs(gap) / 2e-3, 1.0)
    return max(torque, 0.0) if side > 0.0 else min(torque, 0.0)


@njit(cache=True)
def _rates(t, x, v, torque_request, fm, fl, end, flank):
    """Return derivatives of (theta_m, omega_m, theta_l, omega_l, T_m, theta_3, omega_3, z_bw)."""
    tm, wm, tl, wl, T, t3, w3, z = x
    i = v[RATIO]
    d = tm / i - tl + v[ECC] * np.sin(v[ECC_N] * tm + v[ECC_PH])
    w = wm / i - wl + v[ECC] * v[ECC_N] * wm * np.cos(v[ECC_N] * tm + v[ECC_PH])
    alpha = v[ALPHA]
    if v[ALPHA_END] >= 0.0:
        alpha += (v[ALPHA_END] - v[ALPHA]) * t / end
    shaft = _spring(d, w, v, alpha, flank) * (1.0 + v[KSPEED] * abs(wl)) + v[BW] * z
    if v[KVAR] != 0.0:
        shaft += v[K] * v[KVAR] * np.sin(v[KVAR_N] * tm + v[KVAR_PH]) * d
    dz = 0.0
    if v[BW] != 0.0:
        dz = (w - 0.5 * abs(w) * z - 0.5 * w * abs(z)) / v[BW_X]
    load = v[T0] + v[GRAV] * np.sin(tl + v[GRAV_PH]) + v[QD] * wl * abs(wl)
    if v[KNOCK] != 0.0 and t % 0.7 < 0.02:
        load += v[KNOCK]
    a3 = 0.0
    if v[J3] > 0.0:
        link = v[J3] * v[W3] ** 2 * (tl - t3) + 2.0 * v[Z3] * v[W3] * v[J3] * (wl - w3)
        load += link
        a3 = link / v[J3]
    ripple = v[RIP] * np.sin(v[RIP_N] * tm + v[RIP_PH])
    ripple += v[RIP2] * np.sin(2.0 * v[RIP_N] * tm + v[RIP2_PH]) + v[RIP3] * np.sin(3.0 * v[RIP_N] * tm + v[RIP3_PH])
    load += v[KS] * (tl - v[KS_X]) + v[KS3] * (tl - v[KS_X]) ** 3 + v[DV_L] * abs(wl)
    if v[STOP] > 0.0 and abs(tl) > v[STOP]:
        inwards = wl if tl > 0.0 else -wl
        push = v[STOP_K] * (abs(tl) - v[STOP]) * (1.0 + v[STOP_D] * inwards)
        load += max(push, 0.0) if tl > 0.0 else -max(push, 0.0)
    fm += v[DV_M] * abs(wm)
    am = (T + ripple - v[B_M] * wm - fm - shaft / i) / v[J_M]
    inertia = v[J_L] * (1.0 + v[JVAR] * np.cos(tl))
    al = (shaft - load - v[B_L] * wl - fl + 0.5 * v[J_L] * v[JVAR] * np.sin(tl) * wl * wl) / inertia
    return np.array([wm, am, wl, al, (torque_request - T) / v[TAU], w3, a3, dz])


@njit(cache=True)
def _step(t, x, v, request, fm, fl, end, flank, h):
    """Return the state after one Runge-Kutta step of 4th order."""
    k1 = _rates(t, x, v, request, fm, fl, end, flank)
    k2 = _rates(t + 0.5 * h, x + 0.5 * h * k1, v, request, fm, fl, end, flank)
    k3 = _rates(t + 0.5 * h, x + 0.5 * h * k2, v, request, fm, fl, end, flank)
    k4 = _rates(t + h, x + h * k3, v, request, fm, fl, end, flank)
    return x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


@njit(cache=True)
def _flank(x, v):
    """Return the flank that a sharp dead zone touches; +1 without a gap."""
    d = x[0] / v[RATIO] - x[2]
    if v[ALPHA] <= 0.0 or d > v[ALPHA]:
        return 1
    return -1 if d < -v[ALPHA] else 0


@njit(cache=True)
def _sharp_step(t, x, v, request, fm, fl, end, h):
    """Return the state after ``h`` with a sharp dead zone: the step is cut where the flank changes."""
    before = _flank(x, v)
    new = _step(t, x, v, request, fm, fl, end, before, h)
    after = _flank(new, v)
    if after == before or abs(after - before) > 1:
        return new
    edge = v[ALPHA] * (before + after)
    low, high = 0.0, h
    for _ in range(45):
        cut = 0.5 * (low + high)
        mid = _step(t, x, v, request, fm, fl, end, before, cut)
        crossed = (mid[0] / v[RATIO] - mid[2] > edge) == (new[0] / v[RATIO] - new[2] > edge)
        low, high = (low, cut) if crossed else (cut, high)
    mid = _step(t, x, v, request, fm, fl, end, before, high)
    return _step(t + high, mid, v, request, fm, fl, end, after, h - high)


@njit(cache=True)
def bristle(z, w, h, sigma, coulomb, extra, vs):
    """Return the LuGre bristle after ``h`` at constant speed (exact) and the mean friction torque."""
    level = coulomb + extra * np.exp(-((w / vs) ** 2))
    if level <= 0.0:
        return 0.0, 0.0
    settle = level / sigma * (1.0 if w > 0.0 else -1.0)
    new = settle + (z - settle) * np.exp(-sigma * abs(w) * h / level)
    return new, sigma * 0.5 * (z + new) + 0.02 * np.sqrt(sigma) * (new - z) / h


@njit(cache=True)
def _followed(asked, request, h, tau2, slew):
    """Return a request behind a second lag or a slew limit, ``h`` later (small steps)."""
    change = (request - asked) * (1.0 - np.exp(-h / tau2)) if tau2 > 0.0 else request - asked
    if slew > 0.0:
        change = min(max(change, -slew * h), slew * h)
    return asked + change


@njit(cache=True)
def _control(state, measured, target, step, p, inertia, tau, limit):
    """Return the torque of a third-order pole-placement position loop on the motor encoder."""
    raw = (measured - state[0]) / step
    state[0] = measured
    state[1] += 0.3 * (raw - state[1])
    u = state[2] * (1.0 - 3.0 * p * tau) - tau * inertia * p * p * (3.0 * state[1] + p * (measured - target))
    u = min(max(u, -limit), limit)
    state[2] += step / tau * (u - state[2])
    return u


@njit(cache=True)
def _simulate(v, u, step, substeps, x0, target, gain, noise_m, noise_l, sharp, push, torque_gain, seen, still=0):
    """Return measured-before-rounding (n, 2), the true states (n, 8), and u as applied.

    The bodies begin to move after ``still`` rows, the drive's request at once.
    """
    n = u.size
    h = step / substeps
    end = n * step
    x = x0.copy()
    zm, zl = 0.0, 0.0
    asked = u[0]
    out = np.empty((n, 2))
    states = np.empty((n, 8))
    loop = np.zeros(3)
    loop[0] = x0[0] + v[OFF_M] + v[ENC_M] * np.sin(x0[0] + v[ENC_M_PH])
    applied = u.copy()
    for n_k in range(n):
        states[n_k] = x
        out[n_k, 0] = x[0] + v[OFF_M] + v[ENC_M] * np.sin(x[0] + v[ENC_M_PH]) + noise_m[n_k]
        out[n_k, 1] = x[2] + v[OFF_L] + v[ENC_L] * np.sin(x[2] + v[ENC_L_PH]) + noise_l[n_k]
        if gain > 0.0:
            ask = _control(loop, out[n_k, 0], target[n_k], step, gain, *seen)
            applied[n_k] = float(round(ask * 1e4)) / 1e4 + u[n_k]
        for m in range(substeps):
            t = (n_k * substeps + m) * h
            back = int(np.floor((n_k * substeps + m + 0.5 - v[DELAY] / h) / substeps))
            request = applied[back] if back >= 0 else 0.0
            request = torque_gain * min(max(request, -v[SAT]), v[SAT])
            if v[TAU2] > 0.0 or v[SLEW] > 0.0:
                before = asked
                asked = _followed(asked, request, h, v[TAU2], v[SLEW])
                request = 0.5 * (before + asked)
            if n_k < still:
                continue
            coulomb = v[FC_M] + (v[LATE] if t > 0.5 * end else 0.0)
            coulomb_l = v[FC_L]
            if v[MU_M] > 0.0 or v[MU_L] > 0.0:
                carried = abs(_spring(x[0] / v[RATIO] - x[2], x[1] / v[RATIO] - x[3], v, v[ALPHA], 9))
                coulomb += v[MU_M] * carried / v[RATIO]
                coulomb_l += v[MU_L] * carried
            coulomb = max(0.0, coulomb + v[WAV_M] * np.sin(v[WAV_N] * x[0] + v[WAV_PH]))
            zm, fm = bristle(zm, x[1], h, SIGMA_M, coulomb, v[FS_M], v[VS_M])
            fm -= push[n_k]
            zl, fl = bristle(zl, x[3], h, SIGMA_L, coulomb_l, v[FS_L], v[VS_L])
            cut = _sharp_step(t, x, v, request, fm, fl, end, h) if sharp else x
            x = cut if sharp else _step(t, x, v, request, fm, fl, end, 9, h)
    return out, states, applied


Array = np.ndarray


def late(angles: Array, shifts: tuple[float, float]) -> Array:
    """Return angles (n, 2) as a log has them that is late by ``shifts`` samples."""
    from scipy.interpolate import CubicSpline

    at = np.arange(len(angles))
    moved = [CubicSpline(at, angles[:, n])(at - shift) for n, shift in enumerate(shifts)]
    return np.column_stack([moved[n] if shift else angles[:, n] for n, shift in enumerate(shifts)])


def draw_parameters(
    rng: np.random.Generator, mismatch: float, names=MISMATCHED, nominal: Mapping[str, float] = NOMINAL
) -> dict[str, float]:
    """Return the nominal parameters, each of ``names`` off by a uniform draw of up to ``mismatch``."""
    drawn = dict(nominal)
    for name in names:
        drawn[name] *= 1.0 + mismatch * rng.uniform(-1.0, 1.0)
    return drawn


def make_record(
    effects: Mapping[str, float] | None = None,
    seed: int = 0,
    duration: float = 30.0,
    rate: float = 200.0,
    mismatch: float = 0.05,
    excitation: str = "multisine",
    noise: tuple[float, float] = NOISE,
    counts: tuple[int, int] | None = COUNTS,
    contact: str = "hunt_crossley",
    u: np.ndarray | None = None,
    torque: float = 1.0,
    x0: Mapping[str, float] | None = None,
    linear: Mapping[str, float] | None = None,
    substeps: int = SUBSTEPS,
    torque_noise: float = 0.0,
    shifts: tuple[float, float] = (0.0, 0.0),
    torque_gain: float = 1.0,
    nominal: Mapping[str, float] | None = None,
    still: int = 0,
) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Return one record (time, u, theta_m, theta_l) and the truth that made it.

    Args:
        effects: values of ``EFFECTS`` that are on; unknown names raise ``KeyError``.
        seed: of mismatch, excitation and noise.
        duration: [s].
        rate: samples per second.
        mismatch: each linear parameter but the gear ratio is off by a uniform draw of up to this share.
        excitation: "multisine", "levels" or "closed_loop" (motor position loop on random steps).
        noise: standard deviation before rounding [rad], motor and load.
        counts: encoder counts per revolution, or None: not rounded.
        contact: "hunt_crossley" or "dead_zone".
        u: the torque request itself (n,), instead of an excitation.
        torque: factor on the excitation.
        x0: initial state by name (theta_m, omega_m, theta_l, omega_l, T_m).
        linear: linear parameters to set outright, instead of the draw.
        substeps: Runge-Kutta steps per sample.
        torque_noise: rms of a coloured torque on the motor that is not in ``u``, as a share of the rms of the drive's.
        shifts: how late [samples] the log has the motor's and the load's angle, against ``u``; may be negative.
        torque_gain: torque of the drive over ``u``.
        nominal: linear parameters of another machine than ``NOMINAL``, before they are drawn off.
        still: rows over which the bodies stay as ``x0`` has them, while the drive's request runs.

    Returns:
        the columns, and truth: ``effects``, ``linear``, ``nominal``, ``states`` (n, 8), ``noise``, ...
    """
    rng = np.random.default_rng(seed)
    machine = dict(nominal or NOMINAL)
    drawn = draw_parameters(rng, mismatch, nominal=machine) | dict(linear or {})
    # What the position loop takes the machine for: inertia at the motor, lag, limit (the thesis's, rounded).
    seen = (0.753, 1.0, 300.0)
    if nominal is not None:
        seen = (machine["J_m"] + machine["J_l"] / machine["i"] ** 2, machine["tau"], 300.0 * torque)
    chosen = dict(EFFECTS)
    for name, value in (effects or {}).items():
        if name not in chosen:
            raise KeyError(name)
        chosen[name] = float(value)
    step, n = 1.0 / rate, round(duration * rate)
    target, gain = np.zeros(n), 0.0
    if u is not None:
        request = np.asarray(u, dtype=float)
        n = request.size
        target = np.zeros(n)
    elif excitation == "closed_loop":
        target = 1.5 * np.repeat(rng.uniform(-2.0, 2.0, n // round(1.5 * rate) + 1), round(1.5 * rate))[:n]
        request, gain = multisine(rng, n, step, 10.0 * torque), 5.0
    else:
        request = {"multisine": multisine, "levels": levels}[excitation](rng, n, step) * torque
    request = np.array([float(f"{value:.6g}") for value in request])
    start = np.zeros(8)
    for name, value in (x0 or {}).items():
        start[("theta_m", "omega_m", "theta_l", "omega_l", "T_m").index(name)] = value
    start[5], start[6] = start[2], start[3]
    v = np.array([{**drawn, **chosen}[name] for name in NAMES])
    disturbance = rng.standard_normal((2, n)) * np.array(noise)[:, None]
    sharp = contact == "dead_zone"
    push = np.zeros(n)
    if torque_noise > 0.0:
        # A first run without noise tells the rms of the drive's torque.
        _, plain, _ = _simulate(
            v, request, step, min(substeps, 25), start, target, gain, *disturbance, sharp, push, torque_gain, seen
        )
        push = torque_noise * float(np.std(plain[:, 4])) * coloured(np.random.default_rng([seed, 9]), n, step)
    raw, states, applied = _simulate(
        v, request, step, substeps, start, target, gain, *disturbance, sharp, push, torque_gain, seen, still
    )
    raw = raw + late(states[:, [0, 2]], shifts) - states[:, [0, 2]]
    if counts is not None:
        unit = 2.0 * np.pi / np.array(counts)
        raw = np.round(raw / unit) * unit
    columns = {
        "time": np.arange(n) * step,
        "u": applied,
        "theta_m": raw[:, 0].copy(),
        "theta_l": raw[:, 1].copy(),
    }
    truth = {
        "effects": dict(effects or {}),
        "linear": drawn,
        "nominal": machine,
        "states": states,
        "noise": noise,
        "counts": counts,
        "seed": seed,
    }
    return columns, truth


def write_csv(path: Path, columns: Mapping[str, np.ndarray]) -> None:
    """Write the columns with the digits of the shared example records."""
    names = list(columns)
    lines = [",".join(names)]
    for row in zip(*(columns[name] for name in names), strict=True):
        cells = zip(names, row, strict=True)
        lines.append(",".join(f"{value:.6g}" if name == "time" else f"{value:.9g}" for name, value in cells))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
