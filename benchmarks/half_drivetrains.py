"""The two halves of a drivetrain under our master algorithms, against one solution of the whole.

python -m benchmarks.half_drivetrains              # prints a table
python -m benchmarks.half_drivetrains --log        # prints the calls of one contact
python -m benchmarks.half_drivetrains --reference  # writes fmus/halves/reference.csv and contacts.csv
"""

import argparse
import csv
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from orchestrator.building.native_build import ensure_native
from orchestrator.fmi.instances import fmu_instance
from orchestrator.master.algorithms import Adaptive, Algorithm, GaussSeidel, Iterated, Jacobi
from orchestrator.master.protocol import EventUpdate, StepOutcome
from orchestrator.master.result import Recording
from orchestrator.master.session import Session
from orchestrator.master.signals import Square
from orchestrator.master.system import Connection, SignalSource, System

J_M, B_M, RATIO, TAU = 0.4, 0.1, 3.984, 0.05
J_L, STIFFNESS, DAMPING, B_L = 5.6, 3300.0, 1.0, 1.0
AMPLITUDE, PERIOD, STOP = 40.0, 0.8, 2.0
SHOWN = {"sends", "receives", "get_state", "set_state", "step", "enter_event_mode", "update_discrete_states"}
SHOWN |= {"leave_event_mode"}
FOLDER = Path(__file__).resolve().parents[1] / "fmus" / "halves"


def torque(time: float) -> float:
    """Return the requested torque [N.m] from ``time`` [s] on: a square wave."""
    return AMPLITUDE if time % PERIOD < 0.5 * PERIOD - 1e-9 or PERIOD - time % PERIOD < 1e-9 else -AMPLITUDE


# The whole ---------------------------------------------------------------------------------------------------------


def solve(alpha: float, times: NDArray[np.float64]) -> tuple[NDArray[np.float64], list[float]]:
    """Return theta_m, omega_m, T_m, theta_l, omega_l at ``times``, one row each, and the contact changes [s]."""
    x, now, side = np.zeros(5), 0.0, 0
    rows, events = np.zeros((len(times), 5)), []
    while now < STOP - 1e-12:
        end = min((np.floor(now / (0.5 * PERIOD) + 1e-9) + 1.0) * 0.5 * PERIOD, STOP)
        inside = np.unique(np.append(times[(times > now + 1e-13) & (times <= end)], end))
        answer = solve_ivp(
            _rates(side, alpha, torque(now)), (now, end), x, "DOP853", inside, events=_guards(side, alpha),
            rtol=1e-13, atol=1e-15,
        )  # fmt: skip
        for time, row in zip(answer.t, np.reshape(answer.y, (5, -1)).T, strict=True):
            rows[np.abs(times - time) < 1e-13] = row
        if answer.status == 1:
            guard = next(n for n, found in enumerate(answer.t_events) if len(found))
            now, x = float(answer.t_events[guard][0]), answer.y_events[guard][0]
            events.append(now)
            side = 0 if side else 1 - 2 * guard
        else:
            now, x = float(end), answer.y[:, -1]
    return rows, events


def _rates(side: int, alpha: float, u: float) -> Callable[[float, Any], list[float]]:
    def rates(_: float, x: Any) -> list[float]:
        wound, rate = x[0] / RATIO - x[3] - side * alpha, x[1] / RATIO - x[4]
        shaft = STIFFNESS * wound + DAMPING * rate if side else 0.0
        return [x[1], (x[2] - shaft / RATIO - B_M * x[1]) / J_M, (u - x[2]) / TAU, x[4], (shaft - B_L * x[4]) / J_L]

    return rates


def _guards(side: int, alpha: float) -> list[Any]:
    def guard(sign: int, offset: float) -> Any:
        def distance(_: float, x: Any) -> float:
            return float(offset + sign * (x[0] / RATIO - x[3]))

        distance.terminal, distance.direction = True, -1  # type: ignore[attr-defined]
        return distance

    return [guard(side, -alpha)] if side else [guard(-1, alpha), guard(1, alpha)]


# The halves --------------------------------------------------------------------------------------------------------


def couple(paths: Mapping[str, Path], alpha: float, tolerance: float | None = None) -> System:
    """Return both FMUs, coupled, under the square torque; ``tolerance`` is that of their own solvers."""
    instances = (
        fmu_instance("motor", paths["MotorHalf"], {}, tolerance, events=True),
        fmu_instance("load", paths["LoadHalf"], {"alpha": alpha}, tolerance, events=True),
    )
    connections = (
        Connection("motor.theta_m", "load.theta_m"),
        Connection("motor.omega_m", "load.omega_m"),
        Connection("load.T_shaft", "motor.T_shaft"),
    )
    return System(instances, connections, (SignalSource("motor.u", Square(AMPLITUDE, PERIOD)),))


def simulate(paths: Mapping[str, Path], alpha: float, algorithm: Algorithm) -> Recording:
    """Run both halves; the recording has theta_m and theta_l."""
    with Session(couple(paths, alpha), ["motor.theta_m", "load.theta_l"], algorithm, STOP) as session:
        return session.run()


def compare(paths: Mapping[str, Path], alpha: float, algorithm: Algorithm) -> tuple[Recording, float, float, int]:
    """Return a run, its largest error of both angles [rad] and of contact instants [s], and how many there are."""
    run = simulate(paths, alpha, algorithm)
    rows, found = solve(alpha, run.time)
    contacts = found if alpha > 0.0 else []
    error = float(np.abs(run.values.T - rows[:, [0, 3]]).max())
    times = run.statistics.events.times
    late = float(np.abs(np.subtract(times, contacts)).max(initial=0.0)) if len(times) == len(contacts) else np.inf
    return run, error, late, len(contacts)


class Logged:
    """A slave whose calls in a run are written down: names, times and what comes back."""

    def __init__(self, slave: Any, log: list[str]) -> None:
        self._slave, self._log = slave, log

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._slave, name)
        if name not in SHOWN:
            return found
        if name in ("sends", "receives"):
            return lambda names, buffer: self._moved(name[:-1], names, found(names, buffer))

        def call(*arguments: Any) -> Any:
            answer = found(*arguments)
            times = ", ".join(f"{a:.6f}" for a in arguments if isinstance(a, float))
            match answer:
                case StepOutcome(reached, event):
                    said = f" -> {reached:.6f}{', event' if event else ''}"
                case EventUpdate(again):
                    said = f" -> {'again' if again else 'settled'}"
                case _:
                    said = ""
            self._log.append(f"{self._slave.name}.{name}({times}){said}")
            return answer

        return call

    def _moved(self, call: str, names: Sequence[str], move: Callable[[], None]) -> Callable[[], None]:
        def moved() -> None:
            move()
            self._log.append(f"{self._slave.name}.{call}({', '.join(names)})")

        return moved


def log_contact(paths: Mapping[str, Path], alpha: float = 0.01, step: float = 1e-3) -> list[str]:
    """Return the calls of the communication step of Gauss-Seidel in which the first contact is made."""
    system, log = couple(paths, alpha), list[str]()
    instances = [
        replace(i, create=lambda name, i=i: Logged(i.create(name), log))  # type: ignore[misc]
        for i in system.instances
    ]
    contact = solve(alpha, np.array([STOP]))[1][0]
    with Session(
        replace(system, instances=tuple(instances)), ["load.contact"], GaussSeidel(step), step * np.ceil(contact / step)
    ) as session:
        session.run()
    starts = [n for n, line in enumerate(log) if line.startswith("motor.get_state")]
    event = next(n for n, line in enumerate(log) if line.endswith("event"))
    return log[max(n for n in starts if n < event) : max(n for n, line in enumerate(log) if "leave" in line) + 1]


def write_reference(alpha: float = 0.01) -> None:
    """Write the reference's files: rows at 10 ms, and the contact changes."""
    times = np.array([0.01 * n for n in range(201)])
    rows, events = solve(alpha, times)
    with (FOLDER / "reference.csv").open("w", encoding="ascii", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["time", "theta_m", "omega_m", "T_m", "theta_l", "omega_l"])
        writer.writerows(
            [[f"{t:.2f}", *(f"{value:.12g}" for value in row)] for t, row in zip(times, rows, strict=True)]
        )
    lines = ["time", *(f"{time:.12f}" for time in events)]
    (FOLDER / "contacts.csv").write_text("\n".join(lines) + "\n", encoding="ascii")


def main() -> None:
    """Print the table or the log of a contact, or write the reference."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--reference", action="store_true")
    parser.add_argument("--log", action="store_true")
    arguments = parser.parse_args()
    if arguments.reference:
        write_reference()
        return
    with TemporaryDirectory() as folder:
        paths = ensure_native(["MotorHalf", "LoadHalf"], Path(folder), here=True, fmi=3)
        if arguments.log:
            print("\n".join(log_contact(paths)))
            return
        print("half-gap [rad], algorithm, contact changes, events, calls, error [rad], error of instants [s]")
        for tolerance in (1e-8, 1e-7):
            for alpha in (0.0, 0.005, 0.01, 0.02, 0.05, 0.1):
                print_row(paths, alpha, Adaptive(1e-3, tolerance), f"adaptive {tolerance:g}")
        for name, kind in (("gauss_seidel", GaussSeidel), ("jacobi", Jacobi), ("iterated", Iterated)):
            print_row(paths, 0.01, kind(1e-3), f"{name} 0.001 s")


def print_row(paths: Mapping[str, Path], alpha: float, algorithm: Algorithm, name: str) -> None:
    """Print one line of the table."""
    run, error, late, count = compare(paths, alpha, algorithm)
    calls, events = sum(run.statistics.do_steps.values()), len(run.statistics.events.times)
    print(f"{alpha}, {name}, {count}, {events}, {calls:,}, {error:.1e}, {late:.1e}", flush=True)


if __name__ == "__main__":
    main()
