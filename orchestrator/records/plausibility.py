"""Does a record fit its model at all: units, signs, exchanged columns.

The sampling rate must resolve the shaft's oscillation. Three numbers of the record are compared with the model's, each
only where the motion is large enough for it to mean something: the slope of the load's angle over the motor's, the
inertia that the torque seems to move, and their signs.
"""

import math
from collections.abc import Mapping

import numpy as np

from orchestrator.errors import RecordError
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record
from orchestrator.shared.arrays import Array

WITH_SHAFT = ("Drivetrain", "TwoStageTrain")
DEGREES = 180.0 / math.pi
LARGE_TRAVEL = 0.5  # rad of the load, beyond which twist no longer disturbs the slope
LONGEST_STEP = 1.5  # rad of the shaft's oscillation
SHORTEST_RECORD = 2.0 * math.pi  # rad of it: in less than a period, no teeth part and meet again
SMOOTHING_TIME = 0.05  # s
NEEDED_FIT = 0.8
NEARLY_STILL = 0.05  # of the rms speed, within which dry friction changes its sign
LEAST_TRAVEL = 0.02  # rad of load and motor, from which slow motion tells a sign
OPPOSITE = -0.9  # correlation of slow motion from which one angle counts the other way
TWISTS = 3.0  # of the shaft under the drive's slow torque, and of what scatters, that only a wrong ratio exceeds
NEAR_DEGREES = 0.3  # of a logarithm: an inertia this near to 1/57 of the model's may be an angle in degrees


def check_plausible(record: Record, model: Model) -> None:
    """Refuse a record of one stage or two whose units, signs or columns cannot be what the format demands."""
    if model.fmu not in WITH_SHAFT:
        return
    record = record.fill_missing()
    parameters = _of_one_stage({name: entry.value for name, entry in model.parameters.items()})
    if record.theta_l is not None:
        _check_directions(record, record.theta_l, parameters)
        slow = 2 * _rows_of_swing(record, parameters)
        motor, load = (_smooth(angles, slow) for angles in (record.theta_m, record.theta_l))
        name = "i" if "i" in model.parameters else "i_1"
        _check_slope(record.source, motor, load, parameters["i"], name)
    _check_rate(record, _frequency(parameters))
    _check_inertia(record, parameters)
    if record.theta_l is not None:
        ratios = [entry for key, entry in model.parameters.items() if key in ("i", "i_1", "i_2")]
        open_share = sum(entry.uncertainty / abs(entry.value) for entry in ratios)
        _check_ratio(record, (motor, load), slow, parameters, open_share, name)


def natural_frequency(model: Model) -> float:
    """Return how fast [rad/s] the shaft of a machine oscillates, its motor free to turn; 0.0 where there is none."""
    if model.fmu not in WITH_SHAFT:
        return 0.0
    return _frequency(_of_one_stage({name: entry.value for name, entry in model.parameters.items()}))


def _of_one_stage(p: Mapping[str, float]) -> Mapping[str, float]:
    """Return the parameters of a drivetrain that turns as a train of two stages does while all teeth touch."""
    if "i_1" not in p:
        return p
    compliance = 1.0 / max(p["k_2"], 1e-9) + 1.0 / max(p["k_1"] * p["i_2"] ** 2, 1e-9)
    inertia = p["J_m"] + p["J_s"] / p["i_1"] ** 2
    return {"J_m": inertia, "J_l": p["J_l"], "k": 1.0 / compliance, "i": p["i_1"] * p["i_2"], "tau": p["tau"]}


def _frequency(p: Mapping[str, float]) -> float:
    return math.sqrt(p["k"] * (1.0 / p["J_l"] + 1.0 / (p["J_m"] * p["i"] ** 2)))


def _check_rate(record: Record, frequency: float) -> None:
    """Refuse records that are too slow or too short for the shaft's own oscillation, or tell time in another unit."""
    if frequency * record.step > LONGEST_STEP:
        raise RecordError(
            f"{record.source}: column `time` must step by at most {LONGEST_STEP / frequency:.3g} s to show a shaft "
            f"that oscillates at {frequency:.3g} rad/s, but steps by {record.step:g} s: log faster, or "
            "mend `k`, `J_m`, `J_l` (`model`)"
        )
    if frequency * record.duration < SHORTEST_RECORD:
        raise RecordError(
            f"{record.source}: column `time` must last at least {SHORTEST_RECORD / frequency:.3g} s, a period of the "
            f"shaft, but lasts {record.duration:g} s: say `[columns.time] unit`, or mend `k`, `J_m`, `J_l` (`model`)"
        )


def _check_directions(record: Record, theta_l: Array, p: Mapping[str, float]) -> None:
    """Refuse angles of which one counts the other way: motion slower than the load's swing on a held motor tells."""
    width = _rows_of_swing(record, p)
    if 4 * width > record.size:
        return
    motor, load = record.theta_m, theta_l
    for _ in range(3):  # leaves 1 % of what swings faster
        motor, load = _means(motor, width), _means(load, width)
    if min(np.ptp(motor), np.ptp(load)) < LEAST_TRAVEL:
        return
    if float(np.corrcoef(motor, load)[0, 1]) < OPPOSITE:
        raise RecordError(
            f"{record.source}: column `theta_l` must grow with `theta_m`, but falls: one of them has the wrong "
            "sign; say `[columns.theta_l] factor = -1` (or that of theta_m and u) in the model file"
        )


def _rows_of_swing(record: Record, p: Mapping[str, float]) -> int:
    """Return the rows of a swing of the load on a held motor: what is slower, the load follows."""
    return max(1, round(2.0 * math.pi * math.sqrt(p["J_l"] / p["k"]) / record.step))


def _smooth(values: Array, rows: int) -> Array:
    """Return the means over so many rows, a quarter of all at most, about their own mean."""
    means = _means(values, min(rows, values.size // 4))
    return np.asarray(means - means.mean())


def _means(values: Array, rows: int) -> Array:
    """Return the mean of each ``rows`` rows that follow one another, (n - rows + 1,) of (n,)."""
    rows, middle = min(rows, values.size), values.mean()
    sums = np.concatenate([[0.0], np.cumsum(values - middle)])
    return np.asarray(middle + (sums[rows:] - sums[:-rows]) / rows)


def _check_slope(source: str, motor: Array, load: Array, ratio: float, name: str = "i") -> None:
    """Compare the slope of load over motor angle with 1/i, where the parameter ``name`` would mend ``i``."""
    if max(float(np.ptp(motor)) / ratio, float(np.ptp(load))) < LARGE_TRAVEL:
        return
    correlation = float(motor @ load) / math.sqrt(float(motor @ motor) * float(load @ load))
    if abs(correlation) < 0.95:
        raise RecordError(
            f"{source}: column `theta_l` must follow `theta_m`, but their correlation is "
            f"{correlation:.2f}: name the right column by `[columns.theta_l] name = ...` in the model file"
        )
    relative = float(np.std(load) / np.std(motor)) * ratio
    in_degrees = 'say `[columns.{}] unit = "deg"` (`model`)'
    suspects = (
        (DEGREES, "column `theta_l` must be in radians, but seems to be in degrees", in_degrees.format("theta_l")),
        (
            1.0 / DEGREES,
            "column `theta_m` must be in radians, but seems to be in degrees",
            in_degrees.format("theta_m"),
        ),
        (
            ratio * ratio,
            "columns `theta_m` and `theta_l` must be those of motor and load, but seem to be exchanged, or "
            f"`{name}` is the load's turns per turn of the motor",
            'say `[columns.theta_m] name = "theta_l"` and the reverse in the model file, or put the inverse into '
            f"`[parameters.{name}] value`",
        ),
    )
    for factor, text, cure in suspects:
        if abs(math.log(relative / factor)) < min(0.2, abs(math.log(relative))):  # nearer to that than to what is right
            raise RecordError(f"{source}: {text} (theta_m/theta_l is {ratio / relative:.4g}, i is {ratio:g}): {cure}")
    if abs(math.log(relative)) > 0.3:
        raise _other_ratio(source, ratio, ratio / relative, name)


def _check_ratio(
    record: Record, angles: tuple[Array, Array], rows: int, p: Mapping[str, float], open_share: float, name: str
) -> None:
    """Refuse a gear ratio that means over ``rows`` contradict by more than the shaft can twist, or is left open."""
    motor, load = angles
    if not record.has_torque or float(np.ptp(load)) < LARGE_TRAVEL:
        return
    slope, stated = float(motor @ load) / float(motor @ motor), 1.0 / p["i"]
    apart = 0.5 * max(abs(slope - stated) - open_share * abs(stated), 0.0) * float(np.ptp(motor))
    torque = _smooth(lag_torque(record.u, p["tau"], record.step), rows)
    twist = abs(p["i"]) * float(np.max(np.abs(torque))) / p["k"]
    if apart > TWISTS * (twist + float(np.std(load - slope * motor))):
        raise _other_ratio(record.source, p["i"], 1.0 / slope, name)


def _other_ratio(source: str, ratio: float, moved: float, name: str) -> RecordError:
    return RecordError(
        f"{source}: columns `theta_m` and `theta_l` must have the model's gear ratio {ratio:g}, but have {moved:.4g}: "
        "mend `unit` and `counts_per_rev` of both columns, exchange their names if they are swapped, or mend "
        f"`[parameters.{name}] value` (`model`)"
    )


def smooth(record: Record, tau: float) -> tuple[Array, Array, Array, Array]:
    """Return impulse, speed and angle of the motor, smoothed over a short time.

    ``record``: with every sample of its grid, missing ones filled; ``tau``: lag of the drive [s].

    Returns:
        Impulse of the torque [N.m.s], speed [rad/s], angle [rad], and the impulse [s] of a unit torque that the drive
        had when the record began, which nobody knows.
    """
    width = smooth_rows(record)
    first = np.cumsum(np.exp(-record.step / max(tau, 1e-9) * np.arange(record.size))) * record.step
    impulse = np.cumsum(lag_torque(record.u, tau, record.step)) * record.step
    speed = np.gradient(record.theta_m, record.step)
    impulse, speed, angle, first = (_means(v, width) for v in (impulse, speed, record.theta_m, first))
    return impulse, speed, angle, first


def smooth_rows(record: Record) -> int:
    """Return how many rows ``smooth`` takes the mean of."""
    return max(5, round(SMOOTHING_TIME / record.step))


def momentum_balance(impulse: Array, speed: Array, angle: Array, first: Array) -> tuple[float, float, float]:
    """Return what a torque's impulse moves, apart from a constant torque, dry friction and the drive's first torque.

    Without dry friction a position loop with much of it, whose torque follows the angle, seems to move an inertia of
    any size and sign. ``impulse``: (n,) of the torque [N.m.s]; ``speed``: (n,) of the motor [rad/s]; ``angle``: (n,) of
    the motor [rad]; ``first``: (n,) impulse of a unit torque that the drive began with [s].

    Returns:
        Inertia [kg.m2] and viscous friction [N.m.s/rad] at the motor, and the share of the impulse they explain.
    """
    time = np.linspace(-1.0, 1.0, speed.size)
    trend = np.column_stack([np.ones_like(time), time, first])
    dry = np.cumsum(np.tanh(speed / max(NEARLY_STILL * float(np.sqrt(np.mean(speed**2))), 1e-300))) / speed.size
    table = np.column_stack([speed, angle, trend, dry])
    solution, *_ = np.linalg.lstsq(table, impulse, rcond=None)
    plain, *_ = np.linalg.lstsq(trend[:, :2], impulse, rcond=None)
    share = 1.0 - float(np.var(impulse - table @ solution)) / max(float(np.var(impulse - trend[:, :2] @ plain)), 1e-300)
    return float(solution[0]), float(solution[1]), share


def _apparent_inertia(record: Record, tau: float) -> float | None:
    """Return the inertia at the motor [kg.m2] that the torque seems to move; negative where they go opposite ways.

    None where the record does not tell.
    """
    if record.size < 20 * smooth_rows(record):
        return None
    impulse, speed, angle, first = smooth(record, tau)
    if np.ptp(angle) < 0.2:
        return None
    inertia, _, share = momentum_balance(impulse, speed, angle, first)
    return inertia if share >= NEEDED_FIT else None


def _check_inertia(record: Record, p: Mapping[str, float]) -> None:
    """Compare the inertia that the torque moves with the model's; both may be what is wrong."""
    moved = _apparent_inertia(record, p["tau"])
    if moved is None:
        return
    own = p["J_m"] + p["J_l"] / p["i"] ** 2
    relative = moved / own
    machine = "the machine's `[parameters.J_m] value` and `[parameters.J_l] value` (`model`)"
    if relative < -3.0 / DEGREES:
        raise RecordError(
            f"{record.source}: column `u` must be positive where it drives `theta_m` forward, but the motion goes "
            "against it: the sign of `u` or of the angles is wrong; say `[columns.u] factor = -1` (`model`)"
        )
    if abs(relative) < 3.0 / DEGREES:
        shown = f"(the motion fits {abs(moved):.2g} kg.m2, the model has {own:.2g} kg.m2)"
        if abs(math.log(max(abs(relative), 1e-12) * DEGREES)) < NEAR_DEGREES:
            raise RecordError(
                f"{record.source}: column `theta_m` must be in radians, but seems to be in degrees {shown}: say "
                f'`[columns.theta_m] unit = "deg"`, or where it is in radians {machine}'
            )
        raise RecordError(
            f"{record.source}: the model's inertia must be the machine's, but is {1.0 / max(abs(relative), 1e-12):.3g} "
            f"times as large {shown}: say {machine}, or the right `unit` in `[columns.u]`, "
            "`[columns.theta_m]` and `[columns.time]`"
        )
    if relative > DEGREES / 3.0:
        raise RecordError(
            f"{record.source}: column `u` must be in N.m and `theta_m` in radians, but the motion fits "
            f"{relative:.3g} times the model's inertia: say `[columns.u] unit` and `[columns.theta_m] unit`, or the "
            f"{machine.removeprefix('the ')}"
        )


def lag_torque(u: Array, tau: float, step: float) -> Array:
    """Return the torque (n,) [N.m] of a drive that starts at rest for a request ``u`` (n,) [N.m].

    ``tau``: time constant of the drive [s]; ``step``: over which each request is held [s].
    """
    from scipy.signal import lfilter  # a tenth of a second that most commands need not pay

    keep = math.exp(-step / tau)
    return np.asarray(lfilter([0.0, 1.0 - keep], [1.0, -keep], u))
