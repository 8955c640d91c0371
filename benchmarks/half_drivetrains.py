"""The two halves of a drivetrain under a small importer of FMI 3.0, against one solution of the whole.

python -m benchmarks.half_drivetrains             # prints a table
python -m benchmarks.half_drivetrains --reference  # writes fmus/halves/reference.csv and contacts.csv

The importer takes all of FMI 3.0 that a contact between FMUs needs: event mode, early return, intermediate updates,
output derivatives and saved states. It is the smallest one, not the fastest: windows of one fixed length.
"""

import argparse
import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi3 import FMU3Slave
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from orchestrator.building.native_build import ensure_native

J_M, B_M, RATIO, TAU = 0.4, 0.1, 3.984, 0.05
J_L, STIFFNESS, DAMPING, B_L = 5.6, 3300.0, 1.0, 1.0
AMPLITUDE, PERIOD, STOP = 40.0, 0.8, 2.0
SAME = 1e-12  # s: instants that are one
SETTLED = 1e-11  # of the torque at the end of a window
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


class Half:
    """One FMU in event mode; ``feed`` returns its inputs at a time inside a step, by name."""

    def __init__(self, path: Path, folder: str) -> None:
        fmpy.extract(str(path), folder)
        description = fmpy.read_model_description(folder)
        self.references = {variable.name: variable.valueReference for variable in description.modelVariables}
        self.feed: Callable[[float], dict[str, float]] = lambda _: {}
        self.steps = 0
        identifier = description.coSimulation.modelIdentifier
        self.fmu = FMU3Slave(guid=description.guid, unzipDirectory=folder, modelIdentifier=identifier, instanceName="i")
        self.fmu.instantiate(eventModeUsed=True, earlyReturnAllowed=True, intermediateUpdate=self._update)

    def _update(self, _: Any, time: float, setting: bool, *more: Any) -> None:
        if setting:
            self.set(**self.feed(time))

    def set(self, **values: float) -> None:
        """Set variables."""
        self.fmu.setFloat64([self.references[name] for name in values], list(values.values()))

    def get(self, *names: str) -> list[float]:
        """Return variables."""
        return list(self.fmu.getFloat64([self.references[name] for name in names]))

    def rate(self, name: str) -> float:
        """Return the derivative of an output."""
        return float(self.fmu.getOutputDerivatives([self.references[name]], [1])[0])

    def start(self) -> None:
        """Initialise."""
        self.fmu.enterInitializationMode(startTime=0.0)
        self.fmu.exitInitializationMode()
        self.settle()

    def settle(self) -> None:
        """End event mode."""
        self.fmu.updateDiscreteStates()
        self.fmu.enterStepMode()

    def step(self, time: float, step: float) -> tuple[bool, float]:
        """Step; return whether an event is due, and the time reached."""
        self.steps += 1
        event, _, _, reached = self.fmu.doStep(time, step)
        return bool(event), float(reached)


def cubic(begin: float, end: float, y: Sequence[float], rates: Sequence[float]) -> Callable[[float], float]:
    """Return Hermite's cubic through two values and derivatives."""
    h = end - begin
    mean = (y[1] - y[0]) / h
    c, d = (3.0 * mean - 2.0 * rates[0] - rates[1]) / h, (rates[0] + rates[1] - 2.0 * mean) / h**2
    return lambda t: y[0] + (t - begin) * (rates[0] + (t - begin) * (c + (t - begin) * d))


@dataclass
class Run:
    """What a run found: times, both angles, contact changes and calls of fmi3DoStep."""

    times: list[float] = field(default_factory=lambda: [0.0])
    angles: list[tuple[float, float]] = field(default_factory=lambda: [(0.0, 0.0)])
    contacts: list[float] = field(default_factory=list)
    calls: int = 0


class Importer:
    """Both halves; a window is swept until the torque at its end has settled, and ends at an event of the load."""

    def __init__(self, paths: dict[str, Path], alpha: float, folder: str) -> None:
        self.motor = Half(paths["MotorHalf"], f"{folder}/motor")
        self.load = Half(paths["LoadHalf"], f"{folder}/load")
        self.motor.set(u=torque(0.0))
        self.load.set(alpha=alpha)
        self.motor.start()
        self.load.start()

    def run(self, step: float) -> Run:
        """Run to the end in windows of ``step`` [s]."""
        found, time = Run(), 0.0
        for n in range(1, round(STOP / step) + 1):
            end = n * step
            self.motor.set(u=torque(time))
            while time < end - SAME:
                time, event = self.cross(time, end)
                if event:
                    found.contacts.append(time)
                    self.handle()
            time = end
            found.times.append(end)
            found.angles.append((self.motor.get("theta_m")[0], self.load.get("theta_l")[0]))
        found.calls = self.motor.steps + self.load.steps
        return found

    def handle(self) -> None:
        """Go through one event with both, and pass on the torque, which may have jumped."""
        for half in (self.motor, self.load):
            half.fmu.enterEventMode()
        self.load.fmu.updateDiscreteStates()
        self.motor.set(T_shaft=self.load.get("T_shaft")[0])
        self.motor.settle()
        self.load.settle()

    def cross(self, begin: float, end: float) -> tuple[float, bool]:
        """Take both to the end of a window or to an event in it; return where they are, and whether there is one."""
        motor, load = self.motor, self.load
        states = [(half, half.fmu.getFMUState()) for half in (motor, load)]
        theta, omega = motor.get("theta_m", "omega_m")
        first = (load.get("T_shaft")[0], load.rate("T_shaft") + self.torque_rate())
        last, last_rate = first[0] + (end - begin) * first[1], first[1]
        before = np.inf
        accelerations = [motor.rate("omega_m"), 0.0]
        while True:
            shaft = cubic(begin, end, (first[0], last), (first[1], last_rate))
            motor.fmu.setFMUState(states[0][1])
            motor.set(T_shaft=first[0])
            motor.feed = lambda t, shaft=shaft: {"T_shaft": shaft(t)}  # type: ignore[misc]
            motor.step(begin, end - begin)
            theta_end, omega_end = motor.get("theta_m", "omega_m")
            accelerations[1] = motor.rate("omega_m")
            angle = cubic(begin, end, (theta, theta_end), (omega, omega_end))
            speed = cubic(begin, end, (omega, omega_end), accelerations)
            load.fmu.setFMUState(states[1][1])
            load.set(theta_m=theta, omega_m=omega)
            load.feed = lambda t, a=angle, s=speed: {"theta_m": a(t), "omega_m": s(t)}  # type: ignore[misc]
            event, reached = load.step(begin, end - begin)
            last, last_rate = load.get("T_shaft")[0], load.rate("T_shaft") + self.torque_rate()
            if reached - begin < SAME:  # the event is where the window begins: the motor stays there
                motor.fmu.setFMUState(states[0][1])
                end = reached
                break
            whole = end - reached < SAME
            if whole and abs(last - before) <= SETTLED * max(1.0, abs(last)):
                break
            before = last if whole else np.inf
            end = end if whole else reached
        for half, state in states:
            half.fmu.freeFMUState(state)
        return end, event

    def torque_rate(self) -> float:
        """Return what the motor's acceleration adds to the derivative of the torque, whose half holds the speed."""
        touching = self.load.fmu.getInt32([self.load.references["contact"]])[0] != 0
        return DAMPING * self.motor.rate("omega_m") / RATIO if touching else 0.0


def simulate(paths: dict[str, Path], alpha: float, step: float) -> Run:
    """Run both halves."""
    with TemporaryDirectory() as folder:
        return Importer(paths, alpha, folder).run(step)


def compare(paths: dict[str, Path], alpha: float, step: float) -> tuple[Run, float, float, int]:
    """Return a run, its largest error of both angles [rad] and of contact instants [s], and how many there are."""
    run = simulate(paths, alpha, step)
    rows, events = solve(alpha, np.array(run.times))
    errors = np.abs(np.array(run.angles) - rows[:, [0, 3]])
    late = np.abs(np.array(run.contacts) - np.array(events)) if len(events) == len(run.contacts) else np.array([np.inf])
    return run, float(errors.max()), float(late.max()), len(events)


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
    """Print the table, or write the reference."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--reference", action="store_true")
    if parser.parse_args().reference:
        write_reference()
        return
    with TemporaryDirectory() as folder:
        paths = ensure_native(["MotorHalf", "LoadHalf"], Path(folder), here=True, fmi=3)
        print("half-gap [rad], window [s], contact changes, calls, error [rad], error of instants [s]")
        for alpha in (0.005, 0.01, 0.02, 0.05, 0.1):
            for step in (2e-3, 1e-3):
                run, error, late, count = compare(paths, alpha, step)
                print(f"{alpha}, {step}, {count}, {run.calls}, {error:.1e}, {late:.1e}")


if __name__ == "__main__":
    main()
