"""Records with hidden effects for tests and the benchmark of the diagnosis: what is hidden, how large, its right name.

The smallest size of an effect is where it changes the response by three times the noise: the rms, over windows of
one second with a straight line removed (angle and speed
matched, so that old drift does not count), of the difference between the simulations with and
without it, in the encoder that shows it better.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from orchestrator.records.record import Record, record_from_columns
from tests.support.independent_plant import NOISE, NOMINAL, SUBSTEPS, make_record

TIMES_NOISE = 3.0
RATE = 200.0  # samples per second
REACHED = ("sat", "slew", "stop")  # sizes of what acts only where it is reached
LIMITS = {"saturation", "rate_limit", "end_stops"}  # a loop that is closed need not reach them
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
    "second_lag": ({"tau2": 0.06}, "tau2", ("drive_filter@actuator",)),
    "directional_motor": ({"dv_m": 0.1}, "dv_m", ("directional_friction@motor",)),
    "directional_load": ({"dv_l": 1.0}, "dv_l", ("directional_friction@load",)),
    "spring": ({"ks": 30.0}, "ks", ("spring_load@load",)),
    "varying_inertia": ({"jvar": 0.2}, "jvar", ("varying_inertia@load",)),
    "shaft_hysteresis": ({"bw": 60.0, "bw_x": 0.01}, "bw", ("shaft_hysteresis@shaft",)),
    "rate_limit": ({"slew": 0.9}, "slew", ("rate_limit@actuator",)),
    "end_stops": ({"stop": 0.3, "stop_k": 2e4}, "stop", ("upper_end_stop@load", "lower_end_stop@load")),
    "load_dependent_motor": (
        {"mu_m": 0.05}, "mu_m", ("load_dependent_friction@motor",)),
    "load_dependent_load": (
        {"mu_l": 0.05}, "mu_l", ("load_dependent_friction@load",)),
    "offset": ({"off_m": 0.05}, "off_m", ("sensor_offset@motor", "sensor_offset@load")),
}  # fmt: skip

# The same of encoders that are mounted off their centre, which change no motion but that of a closed loop.
OFF_CENTRE: dict[str, tuple[dict[str, float], str, tuple[str, ...]]] = {
    f"off_centre_{body}": ({f"enc_{body[0]}": 0.03}, f"enc_{body[0]}", (f"{body}_encoder_eccentricity",))
    for body in ("motor", "load")
}

UNKNOWN: dict[str, dict[str, float]] = {
    "late_friction": {"late_Fc": 0.6},
    "stiffness_with_speed": {"kspeed": 0.15},
    "knocks": {"knock": 15.0},
}


# Machines of the records with one encoder -> nominal parameters, and the factor on the thesis's excitation.
MACHINES: dict[str, tuple[dict[str, float], float]] = {
    "thesis": (dict(NOMINAL), 1.0),
    "servo": ({"J_m": 0.02, "J_l": 1.5, "k": 1200.0, "c": 0.6, "b_m": 0.02, "b_l": 0.4, "i": 10.0, "tau": 0.05}, 0.035),
    "press": ({"J_m": 0.5, "J_l": 1.0, "k": 4000.0, "c": 4.0, "b_m": 0.2, "b_l": 0.5, "i": 2.0, "tau": 0.2}, 1.0),
}
# Friction that differs by direction -> the viscous friction that it is part of. Beyond that it would drive the machine:
# with a b that is up to 5 % off, a size stays within four fifths of it.
VISCOUS = {"dv_m": "b_m", "dv_l": "b_l"}
MOST_OF_VISCOUS = 0.8
GAPS = (0.3, 3.0)  # half-gaps of the records with one encoder, in typical (rms) twists

# Unit of each size, in powers of a record's torque, load torque, speeds, load angle and twist: on another machine than
# the thesis's, sizes are as much larger as these are.
UNITS: dict[str, dict[str, int]] = {
    **{name: {"torque": 1} for name in ("Fc_m", "Fs_m", "rip", "late_Fc")},
    **{name: {"load": 1} for name in ("Fc_l", "Fs_l", "T0", "grav", "bw", "knock")},
    **{name: {"twist": 1} for name in ("alpha", "hard", "ecc", "bw_x")},
    "vs": {"speed_m": 1}, "vs_l": {"speed_l": 1},
    "dv_m": {"torque": 1, "speed_m": -1}, "dv_l": {"load": 1, "speed_l": -1},
    "qd": {"load": 1, "speed_l": -2}, "ks": {"load": 1, "angle_l": -1}, "stop_k": {"load": 1, "angle_l": -1},
    "stop": {"angle_l": 1}, "kspeed": {"speed_l": -1}, "J3": {"load": 1, "speed_l": -1},
}  # fmt: skip


@dataclass(frozen=True)
class Ways:
    """How records are made: the machine, and which nuisances half of them have.

    Attributes:
        machine: one of ``MACHINES``.
        torque_noise: half have a coloured torque noise.
        shifts: half have signals that are late by up to two samples.
        gain: half have a drive whose torque is up to 10 % off.
    """

    machine: str = "thesis"
    torque_noise: bool = False
    shifts: bool = False
    gain: bool = False

    @property
    def plant(self) -> dict[str, Any]:
        """Return what the simulator must know of the machine."""
        nominal, torque = MACHINES[self.machine]
        return {} if self.machine == "thesis" else {"nominal": nominal, "torque": torque}

    def sized(self, effects: dict[str, float]) -> dict[str, float]:
        """Return effects of the thesis's machine as large on this one."""
        if self.machine == "thesis":
            return dict(effects)
        here, there = _magnitudes(self.machine), _magnitudes("thesis")
        changed = {}
        for name, value in effects.items():
            powers = UNITS.get(name, {})
            changed[name] = value * float(
                np.prod([(here[unit] / there[unit]) ** power for unit, power in powers.items()])
            )
        return changed


@cache
def _magnitudes(machine: str) -> dict[str, float]:
    """Return rms of torque, load torque, speeds, load angle and twist of a record without effects."""
    ways = Ways(machine)
    _, truth = make_record({}, 0, 10.0, substeps=25, **ways.plant)
    nominal, (theta_m, omega_m, theta_l, omega_l, torque) = MACHINES[machine][0], truth["states"][:, :5].T
    twist = theta_m / nominal["i"] - theta_l
    sizes = {
        "torque": torque,
        "load": nominal["k"] * twist,
        "speed_m": omega_m,
        "speed_l": omega_l,
        "angle_l": theta_l - theta_l.mean(),
        "twist": twist,
    }
    return {name: float(np.sqrt(np.mean(values**2))) for name, values in sizes.items()}


@dataclass(frozen=True)
class Case:
    """One hidden case: its kind, the record, the truth, and the labels that would be right (all of them, in pairs)."""

    kind: str
    seed: int
    record: Record
    truth: dict[str, Any]
    right: tuple[tuple[str, ...], ...]
    times_noise: float = 0.0


def none_case(seed: int, duration: float = 30.0, ways: Ways = Ways()) -> Case:
    """Return a record with nothing hidden beside parameters that are off by up to 5 %."""
    rng = np.random.default_rng([seed, 1])
    return _case("none", seed, {}, (), str(rng.choice(EXCITATIONS)), duration, ways)


def single_case(kind: str, seed: int, duration: float = 30.0, ways: Ways = Ways()) -> Case:
    """Return a record with one effect, its size drawn log-uniformly from three times the noise to large."""
    rng = np.random.default_rng([seed, 2])
    effects, size, right = (SINGLE | OFF_CENTRE)[kind]
    effects = ways.sized(_varied(effects, rng))
    excitation = str(rng.choice(EXCITATIONS[:3] if kind in LIMITS else EXCITATIONS))
    chosen, ratio = draw_size(effects, size, seed, excitation, rng, duration, ways=ways)
    return _case(kind, seed, chosen, (right,), excitation, duration, ways, ratio)


def double_case(kinds: tuple[str, str], seed: int, duration: float = 30.0, ways: Ways = Ways()) -> Case:
    """Return a record with two effects, each drawn from ten times the noise to half of the largest size."""
    rng = np.random.default_rng([seed, 3])
    excitation = str(rng.choice(EXCITATIONS[:3] if LIMITS & set(kinds) else EXCITATIONS))
    both: dict[str, float] = {}
    for kind in kinds:
        effects, size, _ = SINGLE[kind]
        effects = ways.sized(_varied(effects, rng))
        chosen, _ = draw_size(effects, size, seed, excitation, rng, duration, 10.0, 0.5, ways)
        both |= chosen
    return _case("+".join(kinds), seed, both, tuple(SINGLE[kind][2] for kind in kinds), excitation, duration, ways)


def unknown_case(kind: str, seed: int, duration: float = 30.0, ways: Ways = Ways()) -> Case:
    """Return a record with an effect that the library does not hold."""
    rng = np.random.default_rng([seed, 4])
    effects = {
        name: value * (rng.uniform(0.7, 1.5) if name not in ("bw_x",) else 1.0) for name, value in UNKNOWN[kind].items()
    }
    return _case(kind, seed, ways.sized(effects), (), str(rng.choice(EXCITATIONS)), duration, ways)


def one_encoder_case(seed: int, duration: float = 30.0, torque_noise: bool = False) -> Case:
    """Return a record of the motor's encoder alone with a gap of 0.3 to 3 times the typical twist.

    Machines take turns, and so do excitations; ``truth`` has the machine's nominal parameters.
    """
    rng = np.random.default_rng([seed, 6])
    machine = tuple(MACHINES)[seed % len(MACHINES)]
    nominal, torque = MACHINES[machine]
    excitation = EXCITATIONS[1:][seed // len(MACHINES) % 3]
    ways: dict[str, Any] = {"excitation": excitation, "nominal": nominal, "torque": torque}
    _, plain = make_record({}, seed, duration, substeps=25, **ways)
    states = plain["states"]
    typical = float(np.sqrt(np.mean((states[:, 0] / nominal["i"] - states[:, 2]) ** 2)))
    share = float(np.exp(rng.uniform(*np.log(GAPS))))
    noise = torque_noise_of(seed) if torque_noise else 0.0
    columns, truth = make_record({"alpha": share * typical}, seed, duration, torque_noise=noise, **ways)
    record = record_from_columns(columns, f"{machine}-{excitation}-{seed}").without_load_encoder()
    truth |= {"torque_noise": noise, "shifts": (0.0, 0.0), "gain": 1.0}
    return Case(f"{machine}, {excitation}", seed, record, truth, (SINGLE["backlash"][2],), share)


def torque_noise_of(seed: int) -> float:
    """Return the rms of the torque noise of a case, as a share of the drive's: 0.5 to 3 % on half of them."""
    rng = np.random.default_rng([seed, 5])
    return float(np.exp(rng.uniform(np.log(0.005), np.log(0.03)))) if rng.random() < 0.5 else 0.0


def shifts_of(seed: int) -> tuple[float, float]:
    """Return how late [samples] motor and load are in a case: up to two samples, on half of them, one or both."""
    rng = np.random.default_rng([seed, 6])
    motor, load = rng.uniform(-2.0, 2.0, 2)
    either = ((motor, motor), (0.0, load), (motor, load))[int(rng.integers(3))]
    return (float(either[0]), float(either[1])) if rng.random() < 0.5 else (0.0, 0.0)


def gain_of(seed: int) -> float:
    """Return the torque of a case's drive over what it is taken for: up to 10 % off, on half of them."""
    rng = np.random.default_rng([seed, 7])
    return float(1.0 + rng.uniform(-0.1, 0.1)) if rng.random() < 0.5 else 1.0


def draw_size(
    effects: dict[str, float], size: str, seed: int, excitation: str, rng: np.random.Generator, duration: float,
    least: float = TIMES_NOISE, largest: float = 1.0, ways: Ways = Ways(),
) -> tuple[dict[str, float], float]:  # fmt: skip
    """Return the effects at a size between ``least`` times the noise and ``largest``, and the drawn times-noise."""
    plain = _raw({}, seed, excitation, duration, ways)
    if size in ("enc_m", "enc_l"):
        noise = NOISE[size == "enc_l"]
        drawn = 10.0 * noise * (effects[size] / (10.0 * noise)) ** float(rng.random())
        return {size: drawn, f"{size}_ph": float(rng.uniform(-np.pi, np.pi))}, 0.0
    if size == "off_m":
        return scaled(effects, size, least * NOISE[0] / effects[size] * float(np.exp(rng.uniform(0.0, 3.0)))), 0.0

    def change(share: float) -> float:
        return times_noise(plain, _raw(scaled(effects, size, share, ways), seed, excitation, duration, ways))

    share = 1.0
    for _ in range(2 if size not in REACHED else 0):
        share = min(max(share * least / max(change(share), 1e-3), 1e-4), 10.0)
    if size in REACHED:
        inside, outside = 1.0, 0.0
        for _ in range(6):
            middle = 0.5 * (inside + outside)
            inside, outside = (middle, outside) if change(middle) > least else (inside, middle)
        share = inside
    low, high = np.log(share), max(np.log(largest), np.log(share))
    drawn = float(np.exp(rng.uniform(low, high)))
    chosen = scaled(effects, size, drawn, ways)
    return chosen, change(drawn)


def scaled(effects: dict[str, float], size: str, share: float, ways: Ways = Ways()) -> dict[str, float]:
    """Return the effects with their size at ``share`` of the largest."""
    changed = dict(effects)
    if size == "sat":
        # Largest torque of the thesis's records is 259 N.m; the share is what is cut off of it.
        changed["sat"] = 259.0 * MACHINES[ways.machine][1] * (1.0 - effects["sat"] * share)
    elif size == "slew":
        # The request of the thesis's records changes by up to 9000 N.m/s.
        changed["slew"] = 9000.0 * MACHINES[ways.machine][1] * (1.0 - effects["slew"] * share)
    elif size in VISCOUS:
        most = MOST_OF_VISCOUS * MACHINES[ways.machine][0][VISCOUS[size]]
        changed[size] = min(effects[size] * share, most)
    elif size == "stop":
        changed["stop"] = effects["stop"] / share  # the farther out, the less it is reached
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


def _raw(effects: dict[str, float], seed: int, excitation: str, duration: float, ways: Ways) -> np.ndarray:
    """Return the true encoder angles (n, 2), offsets included; closed loops are compared open, by the same torque."""
    _, truth = make_record(
        effects, seed, duration, excitation="multisine" if excitation == "closed_loop" else excitation, substeps=25,
        **ways.plant,
    )  # fmt: skip
    angles = truth["states"][:, [0, 2]].copy()
    angles[:, 0] += effects.get("off_m", 0.0)
    return angles


def _case(
    kind: str, seed: int, effects: dict[str, float], right: tuple[tuple[str, ...], ...], excitation: str,
    duration: float, ways: Ways, ratio: float = 0.0,
) -> Case:  # fmt: skip
    noise = torque_noise_of(seed) if ways.torque_noise else 0.0
    shifts = shifts_of(seed) if ways.shifts else (0.0, 0.0)
    gain = gain_of(seed) if ways.gain else 1.0
    columns, truth = make_record(
        effects,
        seed,
        duration,
        excitation=excitation,
        torque_noise=noise,
        shifts=shifts,
        torque_gain=gain,
        **ways.plant,
    )
    truth |= {"torque_noise": noise, "shifts": shifts, "gain": gain}
    if "delay" in effects:
        # The simulator applies a dead time in whole internal steps.
        truth["effects"]["delay"] = round(effects["delay"] * RATE * SUBSTEPS) / (RATE * SUBSTEPS)
    return Case(kind, seed, record_from_columns(columns, f"{kind}-{seed}"), truth, right, ratio)
