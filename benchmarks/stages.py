"""In which stage of a train the gap is: counts over many records of the independent simulator.

::

    python -m benchmarks.stages 200               # intermediate inertia of 5 and 20 % of the motor's
    python -m benchmarks.stages 60 --light        # of 1 and 2 %, where a set is the right answer
    python -m benchmarks.stages 8 --cost          # processor time beside that of `maximum_likelihood`

Every machine has dry friction that its model file does not state, 1 % of torque noise, encoders with 10,000 and 20,000
counts whose zeros differ, and parameters up to 5 % off. The gap is in stage 1, in stage 2 and in both in turn. Noise is
one and five times the usual one, the torque on time and 2 ms late. Seeds below 1000 were looked at while the method was
made; ``--first 100000`` starts at seeds that were not.
"""

import argparse
import json
import math
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import OrchestratorError
from orchestrator.estimation.methods import maximum_likelihood
from orchestrator.estimation.stages.location import locate_gap
from orchestrator.records.model_file import Model, default_model, read_model
from orchestrator.records.record import record_from_columns
from tests.support.independent_plant import make_record
from tests.support.two_stage_record import FRICTION, NOMINAL, make_two_stage_record

Array = NDArray[np.float64]
ANSWERS = ("1", "2", "both")
HEAVY, LIGHT = (0.05, 0.2), (0.01, 0.02)  # intermediate inertia over that of the motor
NOISE = (1.0, 5.0)
LATE = (0.0, 0.002)  # s
TORQUE = 30.0  # N.m
ZERO = 2.0 * math.pi / 20_000  # rad, a count of the load's encoder


@dataclass(frozen=True)
class Case:
    """What a record is made of: the place of the gap, both half-gaps [rad], and the conditions."""

    seed: int
    answer: str
    halves: tuple[float, float]
    share: float
    noise: float
    late: float


def make_case(seed: int, light: bool) -> tuple[Case, dict[str, Array]]:
    """Return a machine and the columns of its record.

    Args:
        seed: of everything that is random.
        light: the intermediate shaft has 1 or 2 % of the motor's inertia.
    """
    rng = np.random.default_rng([seed, 55])
    answer = ANSWERS[seed % 3]
    kind = seed // 3
    share = (LIGHT if light else HEAVY)[kind % 2]
    noise, late = NOISE[kind // 2 % 2], LATE[kind // 4 % 2]
    total = float(0.01 * 3.0 ** rng.random())
    second = {"1": 0.0, "2": 1.0, "both": float(rng.uniform(0.3, 0.7))}[answer]
    halves = ((1.0 - second) * total * NOMINAL["i_2"], second * total)
    friction = {name: value * rng.uniform(0.3, 1.2) for name, value in FRICTION.items()}
    effects = {"alpha_1": halves[0], "alpha_2": halves[1]} | friction
    columns, _ = make_two_stage_record(effects, seed, share, noise_factor=noise, late=late, torque=TORQUE)
    columns["theta_l"] = columns["theta_l"] + ZERO * round(rng.uniform(-0.05, 0.05) / ZERO)
    return Case(seed, answer, halves, share, noise, late), columns


def model_of(share: float) -> Model:
    """Return the model of a machine, as its file states it."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "train.toml"
        path.write_text(
            f'fmu = "TwoStageTrain"\n[parameters.J_s]\nvalue = {share * NOMINAL["J_m"]!r}\n', encoding="utf-8"
        )
        return read_model(path)


def row(seed: int, light: bool) -> dict[str, object]:
    """Return what is said of one record beside the truth.

    Args:
        seed: of the machine.
        light: see ``make_case``.
    """
    case, columns = make_case(seed, light)
    facts: dict[str, object] = asdict(case)
    begun = time.process_time()
    try:
        location = locate_gap(record_from_columns(columns, f"train {seed}"), model_of(case.share))
    except OrchestratorError as error:
        return facts | {"failed": str(error)}
    intervals = [gap.interval for gap in location.stages]
    present = [n for n in range(2) if case.halves[n] > 0.0]
    return facts | {
        "answers": list(location.answers),
        "behind": location.behind,
        "sizes": [gap.alpha for gap in location.stages],
        "intervals": intervals,
        "errors": [location.stages[n].alpha / case.halves[n] - 1.0 for n in present],
        "held": [bool(intervals[n][0] <= case.halves[n] <= intervals[n][1]) for n in present],
        "absent_held": [bool(intervals[n][0] <= 0.0) for n in range(2) if n not in present],
        "seconds": time.process_time() - begun,
    }


def print_counts(rows: list[dict]) -> None:
    """Print how many answers are right, sets and wrong, and how good sizes and intervals are."""
    right = [r for r in rows if r.get("answers") == [r["answer"]]]
    sets = [r for r in rows if r["answer"] in r.get("answers", []) and r not in right]
    failed = [r for r in rows if "failed" in r]
    wrong = len(rows) - len(right) - len(sets) - len(failed)
    single = sum(r.get("answers") in (["1"], ["2"]) and r["answers"] != [r["answer"]] for r in rows)
    print(
        f"{len(rows)} records: right {len(right)} ({len(right) / len(rows):.1%}), a set that holds the truth "
        f"{len(sets)}, wrong {wrong}, of them a wrong single stage {single}; failed {len(failed)}"
    )
    for name, chosen in (("named rightly", right), ("a set", sets)):
        if not chosen:
            continue
        held = [h for r in chosen for h in r["held"]]
        absent = [h for r in chosen for h in r["absent_held"]]
        errors = np.abs([e for r in chosen for e in r["errors"] if math.isfinite(e)])
        size = f"error of sizes: median {np.median(errors):.2%}, worst {errors.max():.1%}; " if errors.size else ""
        print(
            f"  {name}: {size}intervals of gaps that are there hold {sum(held)} of {len(held)} "
            f"({np.mean(held):.1%}), of shut stages {sum(absent)} of {len(absent)}"
        )
    print(f"  processor time: median {np.median([r['seconds'] for r in rows if 'seconds' in r]):.2f} s")


def print_cost(count: int, first: int) -> None:
    """Print the processor time of both fits of records of 2 s at 1 kHz, in turn."""
    times: list[tuple[float, float]] = []
    for seed in range(first, first + count):
        ours = float(str(row(seed, False).get("seconds", math.nan)))
        kind = ("multisine", "levels", "closed_loop")[seed % 3]
        columns, _ = make_record({"alpha": 0.02, "Fc_m": 0.5, "Fc_l": 1.5}, seed, 2.0, 1000.0, excitation=kind)
        begun = time.process_time()
        maximum_likelihood.estimate(record_from_columns(columns, "one stage"), default_model())
        times.append((ours, time.process_time() - begun))
        print(f"seed {seed}: two stages {times[-1][0]:.2f} s, one stage {times[-1][1]:.2f} s")
    two, one = np.median(np.array(times), axis=0)
    print(f"median: two stages {two:.2f} s, one stage {one:.2f} s, ratio {two / one:.2f}")


def main() -> None:
    """Print a line of JSON for each record where asked, then the counts of each kind and of all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("count", type=int)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--light", action="store_true", help="intermediate inertia of 1 and 2 %% of the motor's")
    parser.add_argument("--cost", action="store_true", help="processor time beside that of one stage")
    parser.add_argument("--json", action="store_true", help="a line of JSON for each record")
    args = parser.parse_args()
    if args.cost:
        print_cost(args.count, args.first)
        return
    rows = []
    for seed in range(args.first, args.first + args.count):
        rows.append(row(seed, args.light))
        if args.json:
            print(json.dumps(rows[-1]), flush=True)
    kinds = sorted({(float(str(r["share"])), float(str(r["noise"]))) for r in rows})
    for share, noise in kinds:
        print(f"inertia {share:.0%}, noise times {noise:g}:")
        print_counts([r for r in rows if (r["share"], r["noise"]) == (share, noise)])
    print_counts(rows)


if __name__ == "__main__":
    main()
