"""Records whose torque has rows of its own, 20 to 200 Hz beside angles at 500 Hz: names of timing, and coverage.

python -m benchmarks.torque_rasters            # 60 records, half of them held, half sampled
python -m benchmarks.torque_rasters 12 --seed 7 --method estimate
"""

import argparse
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import orchestrator as oc
from orchestrator.errors import OrchestratorError
from orchestrator.records.model_file import Model, default_model
from tests.support.excitations import multisine
from tests.support.independent_plant import NOMINAL, make_record

RATE, FINER = 500.0, 2  # rows of the angles [Hz], steps of the simulation in each
RASTERS = (20.0, 25.0, 50.0, 100.0, 125.0, 200.0)  # Hz
MACHINE = {**NOMINAL, "tau": 0.01}
NOISE = (2e-4, 2e-4)  # rad
TIMING = ("input_delay", "drive_filter", "rate_limit", "early_torque", "late_load")
SURE = ("certain", "likely")


@dataclass(frozen=True)
class Log:
    """A record as it is logged.

    Attributes:
        kind: "held": the request changes at its own rows alone; "sampled": at every row of the angles.
        raster: rows of the torque [Hz].
        columns: ``time``, ``theta_m``, ``theta_l`` (n,).
        own: time of the torque's rows (m,) [s].
        torque: (m,) [N.m].
        alpha: half-gap [rad].
        tau: lag of the drive [s].
    """

    kind: str
    raster: float
    columns: Mapping[str, np.ndarray]
    own: np.ndarray
    torque: np.ndarray
    alpha: float
    tau: float


def make_log(number: int, seed: int, duration: float = 8.0) -> Log:
    """Return one of the logs: kinds and rasters take turns."""
    kind, raster = ("held", "sampled")[number % 2], RASTERS[number // 2 % len(RASTERS)]
    rng = np.random.default_rng([seed, number])
    rate = RATE * FINER
    rows = np.arange(round(duration * rate))
    asked = multisine(rng, rows.size, 1.0 / rate, 14.0, min(6.0, 0.2 * raster))
    every = round(rate / raster) if kind == "held" else FINER
    request = asked[rows // every * every]
    alpha = float(np.exp(rng.uniform(np.log(0.005), np.log(0.02))))
    columns, truth = make_record(
        {"alpha": alpha}, 1000 * seed + number, rate=rate, u=request, nominal=MACHINE, noise=NOISE, counts=None,
        contact="dead_zone", substeps=10,
    )  # fmt: skip
    logged = rows[:: round(rate / raster)]
    angles = {name: columns[name][::FINER] for name in ("time", "theta_m", "theta_l")}
    return Log(kind, raster, angles, logged / rate, columns["u"][logged], alpha, truth["linear"]["tau"])


def write_log(log: Log, path: Path) -> None:
    """Write a log as MF4 with two rasters."""
    import asammdf

    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(log.torque, log.own, name="u", unit="Nm")])
        time = log.columns["time"]
        file.append([asammdf.Signal(log.columns[n], time, name=n, unit="rad") for n in ("theta_m", "theta_l")])
        file.save(path, overwrite=True)


def nominal_model() -> Model:
    """Return the model, each linear parameter known to 5 %."""
    model = default_model()
    known = {
        name: replace(model.parameters[name], value=value, uncertainty=0.05 * value) for name, value in MACHINE.items()
    }
    return replace(model, parameters={**model.parameters, **known})


@dataclass(frozen=True)
class Outcome:
    """What a method says of a log: names of timing with a grade above possible, whether intervals hold the truth."""

    timing: tuple[str, ...]
    alpha: bool
    tau: bool
    words: str


def diagnose_log(log: Log, path: Path) -> Outcome:
    """Return what ``diagnose`` says."""
    found = oc.diagnose(path, nominal_model())
    named = [(one.name, one.grade.word) for one in found.effects]
    named += [(one.name, one.grade.word) for one in found.diagnosis.nuisances]
    gaps = [one.parameters["alpha"] for one in found.effects if one.name == "backlash"]
    tau = found.diagnosis.parameters["tau"]
    timing = tuple(name for name, grade in named if name in TIMING and grade in SURE)
    words = ", ".join(f"{name} ({grade})" for name, grade in named)
    within = bool(gaps) and gaps[0].interval[0] <= log.alpha <= gaps[0].interval[1]
    return Outcome(timing, within, tau.interval[0] <= log.tau <= tau.interval[1], f"{words}; tau {tau.value:.5f}")


def estimate_log(log: Log, path: Path) -> Outcome:
    """Return what ``estimate`` says."""
    methods = oc.estimate(path, nominal_model()).estimates
    found = methods[0]
    low, high = found.interval
    tau = next(one for one in methods if "parameters" in one.diagnostics).diagnostics["parameters"]["tau"]
    within = abs(tau["value"] - log.tau) <= 1.96 * tau["standard_error"]
    words = f"alpha {found.alpha:.5f}, tau {tau['value']:.5f}; {found.message}"
    return Outcome((), low <= log.alpha <= high, within, words)


def main() -> None:
    """Print a line for each record, and the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int, nargs="?", default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--method", choices=("diagnose", "estimate"), default="diagnose")
    args = parser.parse_args()
    judge = {"diagnose": diagnose_log, "estimate": estimate_log}[args.method]
    outcomes: list[tuple[str, Outcome]] = []
    with TemporaryDirectory() as folder:
        for number in range(args.count):
            log = make_log(number, args.seed)
            path = Path(folder) / f"log_{number}.mf4"
            write_log(log, path)
            try:
                one = judge(log, path)
            except OrchestratorError as error:
                one = Outcome((), False, False, str(error))
            outcomes.append((log.kind, one))
            print(
                f"{number:3} {log.kind:8}{log.raster:5.0f} Hz  alpha {log.alpha:.5f} {'in' if one.alpha else 'OUT':4}"
                f"tau {log.tau:.5f} {'in' if one.tau else 'OUT':4} {one.words}",
                flush=True,
            )
    for kind in ("held", "sampled"):
        of_kind = [one for k, one in outcomes if k == kind]
        named = [name for one in of_kind for name in one.timing]
        print(
            f"{kind}: {len(of_kind)} records; timing named above possible {len(named)} {sorted(set(named))}; within "
            f"its interval: half-gap {sum(one.alpha for one in of_kind)}, tau {sum(one.tau for one in of_kind)}"
        )


if __name__ == "__main__":
    main()
