"""Model exchange of native FMUs by FMPy's CVode beside their own co-simulation; used by tests."""

import ctypes
from collections.abc import Callable
from pathlib import Path

import numpy as np
from fmpy import simulate_fmu
from fmpy.fmi2 import FMU2Model

STEP, END = 1e-2, 2.0
TOLERANCE = 1e-12


def request(n: int) -> float:
    """The torque [N.m] held over step ``n``."""
    return float(20.0 * np.sign(np.sin(2.0 * np.pi * 0.9 * n * STEP + 0.3)))


def first_time(reached: Callable[[float], bool]) -> float:
    """Return when [s] within a step something is reached that stays so, by halving."""
    low, high = 0.0, STEP
    while high - low > 1e-13:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if reached(middle) else (middle, high)
    return high


def exchanged(fmu: Path, start: dict[str, float], outputs: list[str], events: bool = False) -> np.ndarray:
    """Integrate by CVode; inputs jump where the co-simulation's do."""
    rows = [(t, request(n), 0.0) for n in range(round(END / STEP)) for t in (n * STEP, (n + 1) * STEP)]
    signals = np.array(rows, dtype=[("time", float), ("u", float), ("T_l", float)])
    return simulate_fmu(
        str(fmu),
        fmi_type="ModelExchange",
        solver="CVode",
        stop_time=END,
        output_interval=STEP,
        relative_tolerance=TOLERANCE,
        start_values=start,
        input=signals,
        output=outputs,
        record_events=events,
    )


def stepped_and_exchanged(fmu: Path, start: dict[str, float], outputs: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Return the outputs at the communication points of a co-simulation, and by CVode."""
    rows = [(n * STEP, request(n), 0.0) for n in range(round(END / STEP))]
    stepped = simulate_fmu(
        str(fmu),
        fmi_type="CoSimulation",
        stop_time=END,
        step_size=STEP,
        output_interval=STEP,
        start_values=start,
        input=np.array(rows, dtype=[("time", float), ("u", float), ("T_l", float)]),
        output=outputs,
    )
    return stepped, exchanged(fmu, start, outputs)


def event_times(fmu: Path, start: dict[str, float]) -> list[float]:
    """Return the times [s] of the events between communication points, which only the model can have caused."""
    times = exchanged(fmu, start, [], events=True)["time"]
    doubled = times[1:][np.diff(times) == 0.0]
    return [float(t) for t in doubled if abs(t / STEP - round(t / STEP)) > 1e-6]


def compare_directional_derivatives(
    fmu: FMU2Model, references: dict[str, int], known: list[str], unknown: list[str], nominal: np.ndarray, seed: int
) -> None:
    """Hold each column at five random points to a central difference; ``known``: all states, then ``u`` and ``T_l``."""
    count = len(known) - 2

    def response(point: np.ndarray) -> np.ndarray:
        fmu.setReal([references["u"], references["T_l"]], point[count:].tolist())
        fmu.setContinuousStates((ctypes.c_double * count)(*point[:count]), count)
        return np.array(fmu.getReal([references[n] for n in unknown]))

    rng = np.random.default_rng(seed)
    for _ in range(5):
        point = rng.normal(0.0, 0.05, len(known)) * nominal
        for n, variable in enumerate(known):
            step = np.zeros(len(known))
            step[n] = 1e-5 * nominal[n]
            expected = (response(point + step) - response(point - step)) / (2.0 * step[n])
            response(point)
            column = fmu.getDirectionalDerivative([references[v] for v in unknown], [references[variable]], [1.0])
            assert np.max(np.abs(column - expected)) <= 1e-6 * max(np.max(np.abs(expected)), 1.0), variable
