"""From a record to a controller, and back to the machine: what `compensate` foresees beside what then happens.

Run as ``python -m benchmarks.machine_controllers [--machines 8] [--moves 6] [--seed 0]``. Machines, records and loops
are those of the independent simulator, which shares no code with the library: LuGre friction at the load, Hunt-Crossley
teeth, late torque. The controller is the plain C that the command writes.
"""

import argparse
import ctypes
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

import orchestrator as oc
from orchestrator.control.loops import ControlTask
from orchestrator.control.measures import least_time
from orchestrator.control.take_away import c_files
from orchestrator.errors import OrchestratorError
from orchestrator.records.model_file import read_model
from pyfmu_sources.controllers.lqr import control
from tests.support import independent_plant

SUBSTEPS = 10
Array = np.ndarray


def draw_machine(rng: np.random.Generator) -> tuple[dict[str, float], dict[str, float], dict[str, Any]]:
    """Return linear values, effects, and what the record needs: torque limit, noise and counts of the encoders."""
    i, J_m = float(np.exp(rng.uniform(0.0, np.log(100.0)))), float(np.exp(rng.uniform(np.log(1e-4), np.log(10.0))))
    J_l = J_m * i**2 * float(np.exp(rng.uniform(np.log(0.3), np.log(3.0))))
    k = J_l * (24.0 * float(np.exp(rng.uniform(-0.3, 1.0)))) ** 2
    tau = 5e-3 if rng.uniform() < 0.5 else float(rng.uniform(0.3, 1.0))
    limit = 188.0 * J_m * i * float(np.exp(rng.uniform(-0.5, 0.5)))
    linear = {"J_m": J_m, "J_l": J_l, "k": k, "c": 3e-4 * k, "b_m": 0.25 * J_m, "b_l": 0.18 * J_l, "i": i, "tau": tau}
    effects = {"alpha": float(np.exp(rng.uniform(np.log(5e-3), np.log(0.03))))}
    effects |= {"Fc_l": 0.01 * limit * i * rng.uniform(), "delay": 1e-3 * float(rng.integers(0, 4))}
    counts = tuple(int(np.exp(rng.uniform(np.log(5e3), np.log(1e5)))) for _ in range(2))
    noise = tuple(0.5 * 2.0 * np.pi / count for count in counts)
    return linear, effects, {"limit": limit, "noise": noise, "counts": counts}


def model_text(linear: dict[str, float]) -> str:
    """Return the model file of the nominal machine, each value known to 5 %, the gear ratio exactly."""
    rows = (
        f"{name} = {{ value = {value!r}, relative_uncertainty = {0.0 if name == 'i' else 0.05} }}"
        for name, value in linear.items()
    )
    return "\n".join(['fmu = "Drivetrain"', "[parameters]", *rows]) + "\n"


@njit
def move(x: Array, bend: Array, v: Array, requests: Array, substeps: int, h: float, out: Array) -> Array:
    """Fill twist, its speed and load angle of a sample, and return the state behind it; ``requests`` per substep."""
    for m in range(substeps):
        out[m, 0], out[m, 1] = x[0] / v[6] - x[2], x[1] / v[6] - x[3]
        bend[0], friction = independent_plant.bristle(bend[0], x[3], h, independent_plant.SIGMA_L, v[12], 0.0, 0.2)
        x = independent_plant._step(0.0, x, v, requests[m], 0.0, friction, 1.0, 9, h)
    return x


class PlainC:
    """The estimator and the compensator as the command wrote them."""

    def __init__(self, folder: Path, task: ControlTask) -> None:
        for name, text in c_files("machine", task).items():
            (folder / name).write_text(text, encoding="utf-8")
        library = folder / f"controller_{time.monotonic_ns()}.so"
        source = str(folder / "controller_machine.c")
        subprocess.run(["cc", "-std=c99", "-O2", "-shared", "-fPIC", source, "-o", str(library), "-lm"], check=True)
        self.library = ctypes.CDLL(str(library))
        self.inputs, self.outputs = (ctypes.c_double * 4)(), (ctypes.c_double * 7)()

    def sample(self, first: bool, values: tuple[float, ...]) -> float:
        """Return the request [N.m] for angles and reference."""
        self.inputs[:] = list(values)
        step = self.library.controller_machine_start if first else self.library.controller_machine_step
        if step(self.inputs, self.outputs):
            raise RuntimeError("the controller failed")
        return self.outputs[0]


def run_move(task, controller: PlainC, linear, effects, signals, seed, plain: bool) -> dict[str, object]:
    """Return times, impacts, error of the load and whether it is stable, of one move of the true machine."""
    rng = np.random.default_rng(seed)
    named = independent_plant.NOMINAL | independent_plant.EFFECTS | linear | effects
    v = np.array([named[name] for name in independent_plant.NAMES])
    h, limit, alpha = task.sample_time, signals["limit"], effects["alpha"]
    reference = task.reference()
    n, units = reference[0].size, 2.0 * np.pi / np.array(signals["counts"])
    noise = rng.standard_normal((n, 2)) * np.array(signals["noise"])
    late = round(effects["delay"] / h * SUBSTEPS)
    requests = np.zeros(n * SUBSTEPS + late)
    x, bend, u = np.zeros(8), np.zeros(1), 0.0
    x[0] = -alpha * linear["i"]
    path, load = np.empty((n, SUBSTEPS, 2)), np.empty(n)
    nominal = task.nominal
    for sample in range(n):
        seen = np.round((x[[0, 2]] + noise[sample]) / units) * units
        asked = (float(seen[0]), float(seen[1]), float(reference[0][sample]), float(reference[1][sample]))
        u = controller.sample(sample == 0, asked)
        if plain:
            true = (x[0], x[1], x[2], x[3], 0.0, x[4])  # the plain LQR even sees the true state
            u = control(asked[2], asked[3], true, task.gains, nominal.i, 1.0 / nominal.k, limit)
        requests[sample * SUBSTEPS + late : (sample + 1) * SUBSTEPS + late] = u
        load[sample] = x[2]
        at = sample * SUBSTEPS
        x = move(x, bend, v, requests[at : at + SUBSTEPS], SUBSTEPS, h / SUBSTEPS, path[sample])
    twist, speed = path.reshape(-1, 2).T
    flank = np.where(twist >= alpha, 1, np.where(twist <= -alpha, -1, 0))
    touched = np.flatnonzero(flank)
    gaps = np.flatnonzero(np.diff(touched) > 1)
    crossed = [(touched[g], touched[g + 1]) for g in gaps if flank[touched[g]] != flank[touched[g + 1]]]
    tail = round(2.0 / h)
    error = load - reference[0]
    return {
        "times": [(b - a) * h / SUBSTEPS for a, b in crossed],
        "impacts": [abs(speed[b]) for _, b in crossed],
        "error": float(np.sqrt(np.mean(error[:-tail] ** 2))),
        "stable": bool(np.abs(error[-tail:]).max() < task.height),
    }


def judge_machine(seed: int, number: int, moves: int, folder: Path) -> str:
    """Return one line on one machine."""
    rng = np.random.default_rng([seed, number])
    nominal, effects, signals = draw_machine(rng)
    columns, truth = independent_plant.make_record(
        effects, seed=1000 * seed + number, duration=20.0, nominal=nominal, torque=signals["limit"] / 300.0,
        noise=signals["noise"], counts=signals["counts"],
    )  # fmt: skip
    independent_plant.write_csv(folder / "machine.csv", columns)
    (folder / "machine.toml").write_text(model_text(nominal), encoding="utf-8")
    about = f"{number}: i {nominal['i']:.3g} J_m {nominal['J_m']:.2g} tau {nominal['tau']:.2g} "
    about += f"alpha {effects['alpha']:.3g} delay {effects['delay']:.0e};"
    try:
        diagnosis = oc.diagnose(folder / "machine.csv", read_model(folder / "machine.toml"))
        out = folder / f"diagnosis{number}"
        out.mkdir()
        diagnosis.write_data(out)
        begun = time.process_time()
        found = oc.compensate(model=out / "corrected.toml", torque_limit=signals["limit"], plants=40)
        seconds = time.process_time() - begun
    except OrchestratorError as error:
        return f"{about} refused: {str(error)[:160]}"
    task = found.task
    controller = PlainC(folder, task)
    runs = [
        [run_move(task, controller, truth["linear"], effects, signals, [seed, number, n], plain) for n in range(moves)]
        for plain in (False, True)
    ]
    times = np.concatenate([run["times"] for run in runs[0]])
    impacts = np.concatenate([run["impacts"] for run in runs[0]])
    ours, plain = (float(np.median([run["error"] for run in both])) for both in runs)
    law = found.laws[-1]
    assert law.error is not None
    true = least_time(replace_gap(task, effects["alpha"]), task.impact_speed)
    asked, foreseen = task.impact_speed, float(np.median(law.times))
    unstable = sum(not run["stable"] for run in runs[0])
    parts = (
        f"{about} trust {diagnosis.trust.level.word}, asked {asked:.3g}: impact, 95 %, ",
        f"{np.quantile(impacts, 0.95) / asked:.2f} of it, foreseen {law.upper['landing'] / asked:.2f}; ",
        f"time {np.median(times) / true:.2f} of the bound, foreseen {foreseen / true:.2f}; ",
        f"error {ours / plain:.2f} of the LQR's, {1e3 * ours:.3g} mrad, foreseen {1e3 * (law.error or 0.0):.3g} ",
        f"({1e3 * law.upper['error']:.3g}); unstable {unstable} of {moves}, ",
        f"foreseen {law.unstable} of 40; {seconds:.0f} s",
    )
    return "".join(parts)


def replace_gap(task, alpha: float):
    """Return the task with another half-gap."""
    from dataclasses import replace

    return replace(task, machine=replace(task.machine, alpha=alpha))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--machines", type=int, default=8)
    parser.add_argument("--moves", type=int, default=6)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    for number in range(arguments.machines):
        with tempfile.TemporaryDirectory() as folder:
            print(judge_machine(arguments.seed, number, arguments.moves, Path(folder)), flush=True)


if __name__ == "__main__":
    main()
