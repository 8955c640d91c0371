"""Short records of the plants, made with their exact equations, for unit tests of a diagnosis."""

import numpy as np

from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.signals import Signals
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.plants.known import plants
from pyfmu_sources import drivetrain, servo_axis

DRIVETRAIN, AXIS = plants()["Drivetrain"], plants()["ServoAxis"]
SETTINGS = DiagnosisSettings()
H = 0.01
NOISE = np.array([3e-4, 1.5e-4])


def torque(size: int, seed: int = 3, level: float = 30.0) -> np.ndarray:
    """Return random steps of torque, ten samples each."""
    return np.repeat(np.random.default_rng(seed).uniform(-level, level, -(-size // 10)), 10)[:size]


def drivetrain_angles(p: np.ndarray, u: np.ndarray, start=(0.0,) * 8, h: float = H) -> np.ndarray:
    """Return the exact angles (n, 2) of a drivetrain."""
    flat = tuple(p[: len(DRIVETRAIN.table)].tolist())
    x = drivetrain.consistent_start(tuple(start), flat)
    mode, whole, out = drivetrain.initial_mode(x, flat), drivetrain.prepare(flat, h), []
    for value in u:
        out.append((x[0], x[2]))
        x, mode = drivetrain.advance(x, mode, flat, float(value), 0.0, h, whole)
    return np.array(out)


def axis_angles(p: np.ndarray, u: np.ndarray, h: float = H) -> np.ndarray:
    """Return the exact angles (n, 2) of an axis, the second column zero."""
    flat, out = tuple(p[: len(AXIS.table)].tolist()), []
    x = servo_axis.start(0.0, 0.0, 0.0, flat)
    limit = flat[AXIS.index("effects.torque_saturation.limit")]  # the drive's, not the equations'
    mode = servo_axis.initial_mode(x, flat, float(u[0]))
    for value in np.clip(u, -limit, limit):
        out.append((x[0], 0.0))
        x, mode = servo_axis.advance(x, mode, flat, float(value), 0.0, h)
    return np.array(out)


def signals_from(y: np.ndarray, u: np.ndarray, channels: int, noise: np.ndarray = NOISE, h: float = H) -> Signals:
    """Return signals of angles (n, 2)."""
    return Signals(np.ascontiguousarray(y), u, h, channels, noise[:channels], float(np.sqrt(np.mean(u**2))))


def drivetrain_likelihood(size: int = 160, seed: int = 3, channels: int = 2, noise: float = 1.0, **true: float):
    """Return the likelihood of a drivetrain's record under its default parameters, and the true parameters."""
    nominal = DRIVETRAIN.extended([entry.default for entry in DRIVETRAIN.table])
    p = nominal.copy()
    for name, value in true.items():
        p[DRIVETRAIN.index(name.replace("__", "."))] = value
    u = torque(size, seed)
    error = noise * NOISE * np.random.default_rng(seed + 100).standard_normal((size, 2))
    y = drivetrain_angles(p, u) + error
    if channels == 1:
        y[:, 1] = 0.0
    return RecordLikelihood(DRIVETRAIN, signals_from(y, u, channels), nominal, size, SETTINGS), p


def axis_likelihood(size: int = 240, seed: int = 5, noise: float = 1e-4, bias: float = 0.0, **true: float):
    """Return the likelihood of an axis's record under J = 1, b = 2, and the true parameters."""
    nominal = AXIS.extended([entry.default for entry in AXIS.table])
    nominal[AXIS.index("J")], nominal[AXIS.index("b")] = 1.0, 2.0
    p = nominal.copy()
    for name, value in true.items():
        p[AXIS.index(name.replace("__", "."))] = value
    u = torque(size, seed, 8.0) + bias
    y = axis_angles(p, u)
    y[:, 0] += noise * np.random.default_rng(seed + 100).standard_normal(size)
    signals = signals_from(y, u, 1, np.array([noise]))
    return RecordLikelihood(AXIS, signals, nominal, size, SETTINGS), p
