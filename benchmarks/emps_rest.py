"""What a law fitted to the estimation record of EMPS leaves in its test record: the inverse model, law by law.

    EMPS_DATA=FOLDER python -m benchmarks.emps_rest

Mass, viscous and dry friction, offset and the difference between the directions are fitted by least squares to the
force of the estimation record where the carriage moves, alone and with one more law at a time. One line a law: rms
left in the estimation record [N], in the test record, and the mean force against the motion that the test record asks
for beyond the model; then what that mean is at each speed and in each quarter of the test record.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, filtfilt

from tests.support import emps

Array = NDArray[np.float64]

CUT_OFF = 40.0  # Hz
LATE = 0.8  # rows by which the force acts late: the residual of either record is least
SLOWEST = 0.01  # m/s: below, friction has no clear sign
BORDER = 200  # rows at either end where the filter settles
SCREW = 2512.3  # rad/m, the ripple that `diagnose` finds


def motion(which: str) -> dict[str, Array]:
    """Return filtered force, position, speed and acceleration where the carriage moves, and the time."""
    data = emps.read(which)
    rows = np.arange(data["force"].size)
    b, a = butter(4, 2.0 * emps.STEP * CUT_OFF)
    force, position = (
        filtfilt(b, a, values) for values in (np.interp(rows - LATE, rows, data["force"]), data["position"])
    )
    speed = np.gradient(position, emps.STEP)
    found = {"force": force, "x": position, "v": speed, "a": np.gradient(speed, emps.STEP), "t": rows * emps.STEP}
    moves = (np.abs(speed) > SLOWEST) & (rows >= BORDER) & (rows < rows.size - BORDER)
    return {name: values[moves] for name, values in found.items()}


def laws(m: dict[str, Array]) -> dict[str, tuple[Array, ...]]:
    """Return forces of unit parameters, law by law."""
    way = np.sign(m["v"])
    return {
        "nothing more": (),
        "ripple of the screw": (np.cos(SCREW * m["x"]), np.sin(SCREW * m["x"])),
        "friction that falls with speed": (way * np.exp(-np.abs(m["v"]) / 0.02),),
        "friction with load": (way * np.abs(m["force"]),),
        "quadratic drag": (m["v"] * np.abs(m["v"]),),
        "force that grows with position": (m["x"],),
        "friction that grows with position": (m["x"] * way,),
        "friction that grows with time": (m["t"] * way,),
        "mass that differs by direction": (m["a"] * way,),
    }


def with_law(m: dict[str, Array], law: str) -> Array:
    """Return (n, k) forces of unit parameters of the axis with one more law."""
    way = np.sign(m["v"])
    return np.column_stack([m["a"], m["v"], way, np.ones_like(way), np.abs(m["v"]), *laws(m)[law]])


def main() -> None:
    """Print the table."""
    first, other = motion("estimation"), motion("test")
    against = np.sign(other["v"])
    print(f"{'law':36} rms left [N]: estimation  test  against the motion, test [N]")
    beyond = {}
    for law in laws(first):
        A = with_law(first, law)
        found = np.linalg.lstsq(A, first["force"], rcond=None)[0]
        left, rest = first["force"] - A @ found, other["force"] - with_law(other, law) @ found
        beyond[law] = rest * against
        print(f"{law:36} {np.std(left):24.3f} {np.std(rest):5.3f} {np.mean(beyond[law]):10.3f}")
    plain = beyond["nothing more"]
    for speed in (0.04, 0.08, 0.12):
        near = np.abs(np.abs(other["v"]) - speed) < 0.01
        asked = np.mean((other["force"] * against)[near])
        print(f"at {speed:g} m/s: {np.mean(plain[near]):.3f} N beyond, of {asked:.1f}")
    quarters = [f"{np.mean(part):.3f}" for part in np.array_split(plain, 4)]
    print(f"in quarters of the test record: {', '.join(quarters)} N")


if __name__ == "__main__":
    main()
