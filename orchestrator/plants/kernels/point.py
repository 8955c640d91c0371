"""The state in which plants are compared with records: eight numbers, of which a plant may use fewer.

Their places are those of ``pyfmu_sources.drivetrain.equations``: angle and speed of motor and load, the drive's torque,
angle and speed of an added inertia, the memory of the shaft.
"""

Point = tuple[float, float, float, float, float, float, float, float]


def travel_bound(speed: float, acceleration: float, h: float) -> float:
    """Return how far [rad] a part may come within ``h``, half again of what its acceleration adds if it stays.

    ``speed``: of the part [rad/s]; ``acceleration``: [rad/s^2]; ``h``: [s].
    """
    return abs(speed) * h + 0.75 * h * h * abs(acceleration)


def along(x: Point, rate: Point, h: float) -> Point:
    """Return the state after a straight step of ``h`` [s]."""
    return (
        x[0] + h * rate[0],
        x[1] + h * rate[1],
        x[2] + h * rate[2],
        x[3] + h * rate[3],
        x[4] + h * rate[4],
        x[5] + h * rate[5],
        x[6] + h * rate[6],
        x[7] + h * rate[7],
    )


def with_torque(x: Point, torque: float) -> Point:
    """Return the state with another torque of the drive."""
    return (x[0], x[1], x[2], x[3], torque, x[5], x[6], x[7])
