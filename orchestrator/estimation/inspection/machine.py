"""A rough machine from a record alone: gear ratio, inertia, friction, lag of the drive, frequency of the shaft."""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from orchestrator.errors import RecordError
from orchestrator.records.model_file import Model, ModelParameter
from orchestrator.records.plausibility import check_plausible, momentum_balance, smooth, smooth_rows
from orchestrator.records.record import Record
from orchestrator.shared.inference.inverse import pseudo_inverse
from orchestrator.shared.results.inspect import EffectShown

LAGS = (1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0)  # s, tried for the drive
LEAST_LAG = 1e-9  # s, of a drive that has none
LEAST_FREQUENCY = 5.0  # Hz, of a shaft
SAME_RATIO = 0.1  # of two gear ratios, as a share
SAME_INERTIA = 2.0  # factor between two inertias, of which one is from a record
# How far the rough values may be off, as a share.
ROUGH = {
    "J_m": 0.5, "J_l": 0.5, "k": 0.6, "c": 0.9, "b_m": 0.9, "b_l": 0.9, "tau": 0.5, "i": 0.0, "J": 0.9, "b": 0.9
}  # fmt: skip


@dataclass(frozen=True)
class RoughMachine:
    """Values by name, and a sentence on each that says where it is from."""

    values: Mapping[str, float]
    origin: Mapping[str, str]


def is_of(record: Record, model: Model) -> bool:
    """Return whether a record looks like one of this machine: gear ratio and inertia are the model's."""
    try:
        check_plausible(record, model)
    except RecordError:
        return False
    p = {name: entry.value for name, entry in model.parameters.items()}
    record = record.fill_missing()
    same = record.theta_l is None or abs(_ratio(record)[0] / p["i"] - 1.0) < SAME_RATIO
    inertia, _, _ = momentum_balance(*smooth(record, p["tau"]))
    relative = inertia / (p["J_m"] + p["J_l"] / p["i"] ** 2)
    return same and 1.0 / SAME_INERTIA < relative < SAME_INERTIA


def rough_axis(record: Record) -> RoughMachine:
    """Return inertia and friction of a single axis that could have made the record."""
    _, inertia, friction, share = _balance(record.fill_missing())
    said = f"ASSUMED: momentum balance of the record, explains {100.0 * share:.1f} %; put in the machine's"
    return RoughMachine({"J": inertia, "b": max(friction, 1e-9)}, {"J": said, "b": said})


def rough_machine(record: Record) -> RoughMachine:
    """Return a machine that could have made the record; what the record does not show is assumed and called that."""
    record = record.fill_missing()
    ratio, said = _ratio(record)
    values, origin = {"i": ratio}, {"i": said}
    if not record.has_torque:
        return RoughMachine(values, origin)
    tau, inertia, friction, share = _balance(record)
    values["tau"], origin["tau"] = tau, f"ROUGH, from the record: momentum balance, explains {100.0 * share:.1f} %"
    ratio = abs(values["i"])
    values["J_m"], origin["J_m"] = (
        0.5 * inertia,
        "ASSUMED: half of the inertia seen at the motor; put in the data sheet's",
    )
    values["J_l"] = 0.5 * inertia * ratio**2
    origin["J_l"] = f"ASSUMED: the other half; the record shows J_m + J_l/i^2 = {inertia:.4g} kg.m2"
    values["b_m"] = values["b_l"] = max(0.5 * friction, 1e-9)
    values["b_l"] *= ratio**2
    origin["b_m"] = origin["b_l"] = (
        f"ROUGH: half of the friction that the record shows, {friction:.3g} N.m.s/rad at the motor"
    )
    frequency = _shaft_frequency(record, ratio)
    reduced = 1.0 / (1.0 / values["J_l"] + 1.0 / (values["J_m"] * ratio**2))
    values["k"] = reduced * (2.0 * math.pi * frequency) ** 2
    origin["k"] = f"ROUGH: a shaft that oscillates at {frequency:.3g} Hz; put in the data sheet's"
    values["c"] = 0.06 * math.sqrt(values["k"] * reduced)
    origin["c"] = "ASSUMED: 3 % of critical damping"
    return RoughMachine(values, origin)


def _ratio(record: Record) -> tuple[float, str]:
    """Return the gear ratio, and where it is from."""
    if record.theta_l is None:
        return 1.0, "ASSUMED: one encoder does not show it"
    motor, load = record.theta_m - record.theta_m.mean(), record.theta_l - record.theta_l.mean()
    ratio = float(motor @ load) / max(float(load @ load), 1e-300)
    near = round(ratio) if abs(ratio - round(ratio)) < 0.005 * abs(ratio) else ratio
    return float(near) or 1.0, f"from the record: slope of motor over load angle {ratio:.6g}"


def as_model(rough: RoughMachine, base: Model) -> Model:
    """Return ``base`` with the rough values and wide uncertainties."""
    parameters: dict[str, ModelParameter] = dict(base.parameters)
    for name, value in rough.values.items():
        old = parameters[name]
        held = min(max(value, old.minimum), old.maximum)
        parameters[name] = replace(old, value=held, uncertainty=ROUGH[name] * abs(held))
    return replace(base, parameters=parameters, source="rough machine")


def _balance(record: Record) -> tuple[float, float, float, float]:
    """Return lag [s], inertia [kg.m2] and viscous friction at the motor, and the share of the impulse they explain.

    The lag is the shortest one that the next longer one does not better: behind seconds of lag any torque looks like
    one that a friction without inertia takes.
    """
    tried = [(tau, *momentum_balance(*smooth(record, tau))) for tau in LAGS]
    best = next((now for now, longer in itertools.pairwise(tried) if longer[3] <= now[3]), tried[-1])
    tau, inertia, friction, share = best
    return tau, abs(inertia) or 1.0, abs(friction), share


def _shaft_frequency(record: Record, ratio: float) -> float:
    """Return the frequency [Hz] at which the twist oscillates most beyond the band of the torque, or a guess."""
    rate = 1.0 / record.step
    guess = min(20.0, 0.1 * rate)
    if record.theta_l is None:
        return guess
    from scipy.signal import welch

    twist = record.theta_m / ratio - record.theta_l
    frequency, power = welch(np.diff(twist), rate, nperseg=min(record.size // 4, 1024))
    inside = (frequency > LEAST_FREQUENCY) & (frequency < 0.2 * rate)
    if not inside.any():
        return guess
    return float(frequency[inside][np.argmax(power[inside])])


def visible_effects(record: Record, model: Model) -> list[EffectShown]:
    """Return the smallest size of each effect that would show in the motor's momentum (three standard errors).

    The balance of impulses over windows of a tenth of a second is fitted with inertia, viscous friction and a constant
    torque; what it leaves is the noise that an effect must stand out of.
    """
    record = record.fill_missing()
    if not record.has_torque:
        return []
    p = {name: entry.value for name, entry in model.parameters.items()}
    impulse, speed, angle, _ = smooth(record, max(p["tau"], LEAST_LAG))
    h = record.step
    load = angle / p.get("i", 1.0)
    shapes = {
        "friction at the motor": (np.sign(speed), "N.m"),
        "quadratic drag": (speed * np.abs(speed), "N.m.s2/rad2"),
        "gravity or imbalance of the load": (np.sin(load), "N.m"),
        "torque ripple (6 a turn)": (np.sin(6.0 * angle), "N.m"),
    }
    hop = max(smooth_rows(record), round(0.1 / h))
    ends = np.arange(0, speed.size, hop)
    if ends.size < 20:
        return []
    nuisance = np.column_stack([np.diff(speed[ends]), np.diff(angle[ends]), np.diff(ends) * h])
    target = np.diff(impulse[ends])
    found = []
    for name, (shape, unit) in shapes.items():
        table = np.column_stack([np.diff(np.cumsum(shape)[ends]) * h, nuisance])
        scale = np.sqrt(np.sum(table**2, axis=0))
        if np.any(scale <= 0.0):
            continue
        scaled = table / scale
        solution, *_ = np.linalg.lstsq(scaled, target, rcond=None)
        spread = float(np.std(target - scaled @ solution))
        inverse = pseudo_inverse(scaled.T @ scaled)
        smallest = 3.0 * spread * math.sqrt(max(float(inverse[0, 0]), 0.0)) / float(scale[0])
        found.append(EffectShown(name, smallest, unit))
    return found
