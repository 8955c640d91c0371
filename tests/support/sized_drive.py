"""Logs of drives of many sizes, as their controllers write them: amperes, degrees, milliseconds."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.support.excitations import multisine
from tests.support.independent_plant import NOMINAL, make_record

LEAST_INERTIA = 1e-5  # kg.m2
BAND = 6.0  # Hz, up to which the current moves the machine


@dataclass(frozen=True)
class Drive:
    """A drive and how it is logged.

    Attributes:
        linear: parameters of the plant.
        gap: half-gap at the load [rad].
        friction: dry friction of the motor [N.m].
        acceleration: of the load, rms [rad/s2].
        torque_constant: [N.m/A].
        counts: of motor and load encoder per revolution.
        rate: [Hz].
        seconds: length of the log.
        seed: of excitation and noise.
    """

    linear: Mapping[str, float]
    gap: float
    friction: float
    acceleration: float
    torque_constant: float
    counts: tuple[int, int]
    rate: float
    seconds: float
    seed: int

    @property
    def inertia(self) -> float:
        """Return the inertia of the whole at the motor [kg.m2]."""
        return self.linear["J_m"] + self.linear["J_l"] / self.linear["i"] ** 2

    @property
    def torque(self) -> float:
        """Return the rms of the drive's torque [N.m]."""
        return self.inertia * self.linear["i"] * self.acceleration


def draw_drive(seed: int) -> Drive:
    """Return a drive: ratio 1 to 160, load of 1e-5 to 10 kg.m2, a shaft of 8 to 40 Hz, half-gap of 1 to 15 mrad."""
    rng = np.random.default_rng([seed, 56])
    while True:
        ratio = float(np.round(160.0 ** rng.random(), 1))
        load = float(LEAST_INERTIA * 1e6 ** rng.random())
        motor = load / ratio**2 * float(0.3 * 10.0 ** rng.random())
        if motor >= LEAST_INERTIA:
            break
    at_load = motor * ratio**2
    reduced = 1.0 / (1.0 / load + 1.0 / at_load)
    angular = 2.0 * np.pi * float(8.0 * 5.0 ** rng.random())
    k = reduced * angular**2
    drag = float(0.1 * 5.0 ** rng.random())  # 1/s
    linear = {
        "J_m": motor, "J_l": load, "k": k, "c": 2.0 * float(rng.uniform(0.01, 0.05)) * reduced * angular,
        "b_m": drag * motor, "b_l": drag * load, "i": ratio, "tau": float(1e-3 * 10.0 ** rng.random()),
    }  # fmt: skip
    acceleration = float(20.0 * 5.0 ** rng.random())
    torque = (motor + load / ratio**2) * ratio * acceleration
    return Drive(
        linear,
        float(1e-3 * 15.0 ** rng.random()),
        torque * float(rng.choice([0.0, 0.05, 0.15])),
        acceleration,
        float(f"{10.0 ** rng.uniform(-1.5, 0.5):.3g}"),
        (int(rng.choice([4096, 20000])), int(rng.choice([20000, 65536, 131072]))),
        float(rng.choice([250.0, 500.0, 1000.0])),
        float(rng.uniform(8.0, 14.0)),
        seed,
    )


def drive_columns(drive: Drive) -> dict[str, np.ndarray]:
    """Return time [s], torque [N.m] and angles [rad] of the drive's log.

    All torques are brought to those of a machine that the simulator's friction is made for, and back.
    """
    factor = NOMINAL["J_m"] / drive.linear["J_m"]
    carried = {name: drive.linear[name] * (1.0 if name in ("i", "tau") else factor) for name in drive.linear}
    rng = np.random.default_rng(drive.seed)
    shape = multisine(rng, round(drive.seconds * drive.rate), 1.0 / drive.rate, 1.0, BAND)
    u = factor * drive.torque * shape / float(np.std(shape))
    step = 2.0 * np.pi / np.array(drive.counts)
    columns, _ = make_record(
        {"alpha": drive.gap, "Fc_m": factor * drive.friction}, drive.seed, rate=drive.rate, u=u, linear=carried,
        noise=(0.3 * step[0], 0.3 * step[1]), counts=drive.counts, substeps=40,
    )  # fmt: skip
    return columns | {"u": columns["u"] / factor}


def write_drive_log(path: Path, drive: Drive) -> None:
    """Write the log: a line about the device, then milliseconds, amperes and degrees, separated by semicolons."""
    columns = drive_columns(drive)
    lines = ["Device;simulated", "Time [ms];Current setpoint [A];Motor position [deg];Load position [deg]"]
    current = columns["u"] / drive.torque_constant
    unit = 10.0 ** np.floor(np.log10(np.abs(current).max()) - 3.0)  # four digits, as drives log
    for n in range(current.size):
        angles = (np.rad2deg(columns[name][n]) for name in ("theta_m", "theta_l"))
        cells = [f"{1e3 * n / drive.rate:g}", f"{round(current[n] / unit) * unit:.6g}", *(f"{a:.6f}" for a in angles)]
        lines.append(";".join(cells))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
