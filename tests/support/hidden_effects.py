"""Records with hidden effects for tests and the benchmark of the diagnosis: what is hidden, how large, its right name.

The smallest size of an effect is where it changes the response by three times the noise: the rms, over windows of
one second with a straight line removed (angle and speed
matched, so that old drift does not count), of the difference between the simulations with and
without it, in the encoder that shows it better.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from orchestrator.record import Record, record_from_columns
from tests.support.independent_plant import NOISE, SUBSTEPS, make_record

TIMES_NOISE = 3.0
RATE = 200.0  # samples per second
EXCITATIONS = ("multisine", "multisine", "levels", "closed_loop")

# Kind -> (effects of the independent plant at the largest size, name of the size, labels that are right).
# A limit is small when it is large: sizes of "sat" are shares of the largest torque cut off.
SINGLE: dict[str, tuple[dict[str, float], str, tuple[str, ...]]] = {
    "backlash": ({"alpha": 0.02}, "alpha", ("backlash@shaft",)),
    "coulomb_motor": ({"Fc_m": 1.2}, "Fc_m", ("coulomb_friction@motor", "stribeck_friction@motor")),
    "coulomb_load": ({"Fc_l": 5.0}, "Fc_l", ("coulomb_friction@load", "stribeck_friction@load")),
    "stribeck_motor": (
        {"Fc_m": 0.8, "Fs_m": 0.6, "vs": 0.6}, "Fc_m", ("stribeck_friction@motor", "coulomb_friction@motor")),
    "stribeck_load": (
        {"Fc_l": 3.0, "Fs_l": 2.5, "vs_l": 0.15}, "Fc_l", ("stribeck_friction@load", "coulomb_friction@load")),
    "delay": ({"delay": 0.03}, "delay", ("input_delay@actuator",)),
    "saturation": ({"sat": 0.7}, "sat", ("torque_saturation@actuator",)),
    "hardening": ({"hard": 0.04}, "hard", ("hardening_stiffness@shaft",)),
    "ripple": ({"rip": 1.5, "rip_n": 6.0, "rip_ph": 0.4}, "rip", ("torque_ripple@motor",)),
    "eccentricity": ({"ecc": 0.002, "ecc_n": 1.0, "ecc_ph": 1.1}, "ecc", ("gear_eccentricity@shaft",)),
    "load_torque": ({"T0": 5.0}, "T0", ("load_torque@load",)),
    "gravity": ({"grav": 8.0, "grav_ph": 0.7}, "grav", ("gravity_load@load",)),
    "resonance": ({"J3": 1.5, "w3": 60.0}, "J3", ("extra_resonance@load",)),
    "drag": ({"qd": 1.0}, "qd", ("quadratic_drag@load",)),
    "offset": ({"off_m": 0.05}, "off_m", ("sensor_offset@motor", "sensor_offset@load")),
}  # fmt: skip

UNKNOWN: dict[str, dict[str, float]] = {
    "inertia_varies": {"jvar": 0.15},
    "hysteresis": {"bw": 40.0, "bw_x": 0.01},
    "late_friction": {"late_Fc": 0.6},
    "stiffness_with_speed": {"kspeed": 0.15},
    "knocks": {"knock": 15.0},
}


@dataclass(frozen=True)
class Case:
    """One hidden case: its kind, the record, the truth, and the labels that would be right (all of them, in pairs)."""

    kind: str
    seed: int
    record: Record
    truth: dict[str, Any]
    right: tuple[tuple[str, ...], ...]
    times_noise: float = 0.0


def none_case(seed: int, duration: float = 30.0) -> Case:
    """Return a record with nothing hidden beside parameters that are off by up to 5 %."""
    rng = np.random.default_rng([seed, 1])
    return _case("none", seed, {}, (), str(rng.choice(EXCITATIONS)), duration)


def single_case(kind: str, seed: int, duration: float = 30.0) -> Case:
    """Return a record with one effect, its size drawn log-uniformly from three times the noise to large."""
    rng = np.random.default_rng([seed, 2])
    effects, size, right = SINGLE[kind]
    effects = _varied(effects, rng)
    excitation = str(rng.choice(EXCITATIONS[:3] if kind == "saturation" else EXCITATIONS))
    chosen, ratio = draw_size(effects, size, seed, excitation, rng, duration)
    return _case(kind, seed, chosen, (right,), excitation, duration, ratio)


def double_case(kinds: tuple[str, str], seed: int, duration: float = 30.0) -> Case:
    """Return a record with two effects, each drawn from ten times the noise to half of the largest size."""
    rng = np.random.default_rng([seed, 3])
    excitation = str(rng.choice(EXCITATIONS[:3] if "saturation" in kinds else EXCITATIONS))
    both: dict[str, float] = {}
    for kind in kinds:
        effects, size, _ = SINGLE[kind]
        chosen, _ = draw_size(_varied(effects, rng), size, seed, excitation, rng, duration, 10.0, 0.5)
        both |= chosen
    return _case("+".join(kinds), seed, both, tuple(SINGLE[kind][2] for kind in kinds), excitation, duration)


def unknown_case(kind: str, seed: int, duration: float = 30.0) -> Case:
    """Return a record with an effect that the library does not hold."""
    rng = np.random.default_rng([seed, 4])
    effects = {
        name: value * (rng.uniform(0.7, 1.5) if name not in ("bw_x",) else 1.0) for name, value in UNKNOWN[kind].items()
    }
    return _case(kind, seed, effects, (), str(rng.choice(EXCITATIONS)), duration)


def draw_size(
    effects: dict[str, float], size: str, seed: int, excitation: str, rng: np.random.Generator, duration: float,
    least: float = TIMES_NOISE, largest: float = 1.0,
) -> tuple[dict[str, float], float]:  # fmt: skip
    """Return the effects at a size between ``least`` times the noise and ``largest``, and the drawn times-noise."""
    plain = _raw({}, seed, excitation, duration)
    if size == "off_m":
        return scaled(effects, size, least * NOISE[0] / effects[size] * float(np.exp(rng.uniform(0.0, 3.0)))), 0.0

    def change(share: float) -> float:
        return times_noise(plain, _raw(scaled(effects, size, share), seed, excitation, duration))

    share = 1.0
    for _ in range(2 if size != "sat" else 0):
        share = min(max(share * least / max(change(share), 1e-3), 1e-4), 1.0)
    if size == "sat":
        inside, outside = 1.0, 0.0
        for _ in range(6):
            middle = 0.5 * (inside + outside)
            inside, outside = (middle, outside) if change(middle) > least else (inside, middle)
        share = inside
    low, high = np.log(share), max(np.log(largest), np.log(share))
    drawn = float(np.exp(rng.uniform(low, high)))
    chosen = scaled(effects, size, drawn)
    return chosen, change(drawn)


def scaled(effects: dict[str, float], size: str, share: float) -> dict[str, float]:
    """Return the effects with their size at ``share`` of the largest."""
    changed = dict(effects)
    if size == "sat":
        # Largest torque of the records is 259 N.m; the share is what is cut off of it.
        changed["sat"] = 259.0 * (1.0 - effects["sat"] * share)
    elif size == "hard":
        changed["hard"] = effects["hard"] / np.sqrt(share)
    else:
        changed[size] = effects[size] * share
        for partner, owner in (("Fs_m", "Fc_m"), ("Fs_l", "Fc_l")):
            if size == owner and partner in effects:
                changed[partner] = effects[partner] * share
    return changed


def times_noise(a: np.ndarray, b: np.ndarray, rate: float = 200.0) -> float:
    """Return the change between two responses (n, 2) in units of the noise, drift over one second removed."""
    width = round(rate)
    basis, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, width), 2))
    ratios = []
    for channel, noise in enumerate(NOISE):
        panes = (a - b)[: len(a) // width * width, channel].reshape(-1, width)
        left = panes - (panes @ basis) @ basis.T
        ratios.append(float(np.sqrt(np.mean(left**2))) / noise)
    return max(ratios)


def _varied(effects: dict[str, float], rng: np.random.Generator) -> dict[str, float]:
    changed = dict(effects)
    if "rip_n" in changed:
        changed |= {"rip_n": float(rng.choice([1, 2, 4, 6, 12])), "rip_ph": float(rng.uniform(-3, 3))}
    if "ecc_n" in changed:
        changed |= {"ecc_n": float(rng.choice([1, 2, 3])), "ecc_ph": float(rng.uniform(-3, 3))}
    if "grav_ph" in changed:
        changed["grav_ph"] = float(rng.uniform(-3, 3))
    if "w3" in changed:
        changed["w3"] = float(
            rng.uniform(25, 70)
        )  # higher ones, above the excited band, are load inertia to any record
    if "T0" in changed:
        changed["T0"] *= float(rng.choice([-1.0, 1.0]))
    return changed


def _raw(effects: dict[str, float], seed: int, excitation: str, duration: float) -> np.ndarray:
    """Return the true encoder angles (n, 2), offsets included; closed loops are compared open, by the same torque."""
    _, truth = make_record(
        effects, seed, duration, excitation="multisine" if excitation == "closed_loop" else excitation, substeps=25
    )
    angles = truth["states"][:, [0, 2]].copy()
    angles[:, 0] += effects.get("off_m", 0.0)
    return angles


def _case(
    kind: str, seed: int, effects: dict[str, float], right: tuple[tuple[str, ...], ...], excitation: str,
    duration: float, ratio: float = 0.0,
) -> Case:  # fmt: skip
    columns, truth = make_record(effects, seed, duration, excitation=excitation)
    if "delay" in effects:
        # The simulator applies a dead time in whole internal steps.
        truth["effects"]["delay"] = round(effects["delay"] * RATE * SUBSTEPS) / (RATE * SUBSTEPS)
    return Case(kind, seed, record_from_columns(columns, f"{kind}-{seed}"), truth, right, ratio)
