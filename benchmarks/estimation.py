"""Statistics of the estimators over many records of the independent simulator; prints the table of docs/estimation.md.

::

    python -m benchmarks.estimation exact 200        # exact twin: error against the Cramer-Rao bound, coverage
    python -m benchmarks.estimation mismatch 60      # 5 % mismatch, rounding: every method on the same records
    python -m benchmarks.estimation literature 10    # 0.024 and 0.035 rad
    python -m benchmarks.estimation motor_only 40    # theta_m alone
    python -m benchmarks.estimation none 200         # alpha = 0
    python -m benchmarks.estimation online 60        # the online estimator in a running loop

Each family has its own seeds, none of which any test or default uses; ``--set N`` chooses among disjoint sets of
them (set 0 was looked at while settings were chosen). ``--append FILE`` keeps one JSON line per case, so that a long
run can be looked at, and goes on after the lines that are there.
"""

import argparse
import json
import math
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks import paired_sum
from orchestrator.errors import OrchestratorError
from orchestrator.estimation import cramer_rao
from orchestrator.estimation.methods import maximum_likelihood
from orchestrator.estimation.problem import make_problem
from orchestrator.estimation.protocol import METHODS, estimator
from orchestrator.records.model_file import default_model
from orchestrator.records.record import Record, record_from_columns
from tests.support.independent_plant import make_record

EXCITATIONS = ("multisine", "levels", "closed_loop")
SEEDS_IN_A_SET = 1_000_000
THESIS = "paired_sum"  # no method of the library: its intervals hold the truth on no record of a real machine


def _size(seed: int) -> float:
    """Return a half-gap, log-uniform from 0.005 to 0.1 rad."""
    return float(0.005 * 20.0 ** np.random.default_rng(seed + 77).random())


def _row(record: Record, alpha: float, method: str) -> dict:
    started = time.perf_counter()
    try:
        estimate = paired_sum.estimate if method == THESIS else estimator(method)
        result = estimate(record, default_model())
    except OrchestratorError as error:
        return {"method": method, "alpha": alpha, "failed": str(error)}
    low, high = result.interval
    return {
        "method": method,
        "alpha": alpha,
        "estimate": result.alpha,
        "standard_error": result.standard_error,
        "low": low,
        "high": high,
        "covered": bool(low <= alpha <= high),
        "seconds": time.perf_counter() - started,
        "message": result.message,
    }


def exact(n: int) -> list[dict]:
    """Exact twin, noise 1e-4 rad, no rounding, no mismatch prior to speak of: 10 s of the position loop or torque."""
    alpha, seed, excitation = _size(n), 100_000 + n, EXCITATIONS[n % 3]
    columns, truth = make_record(
        {"alpha": alpha}, seed, 10.0, contact="dead_zone", noise=(1e-4, 1e-4), counts=None, excitation=excitation
    )
    record = record_from_columns(columns, "exact")
    row = _row(record, alpha, "maximum_likelihood")
    values = cramer_rao.truth_values(truth["linear"], alpha, truth["states"][0, :5])
    row["bound"] = cramer_rao.error_bound(make_problem(record, default_model()), values, (1e-4, 1e-4))
    return [row | {"excitation": excitation}]


def joint(n: int) -> list[dict]:
    """Two records of one exact machine together, 6 s each: error and standard error against the bound of both."""
    alpha = _size(n + 17_000)
    made = [
        make_record(
            {"alpha": alpha},
            700_000 + 2 * n + k,
            6.0,
            200.0,
            0.0,
            EXCITATIONS[(n + k) % 3],
            (1e-4, 1e-4),
            None,
            "dead_zone",
        )
        for k in range(2)
    ]
    records = [record_from_columns(columns, f"record {k}") for k, (columns, _) in enumerate(made)]
    started = time.perf_counter()
    result = maximum_likelihood.estimate(records[0], default_model(), more=records[1:])
    states = [truth["states"][0, :5] for _, truth in made]
    values = cramer_rao.truth_values(made[0][1]["linear"], alpha, *states)
    bound = cramer_rao.error_bound([make_problem(record, default_model()) for record in records], values, (1e-4, 1e-4))
    low, high = result.interval
    return [
        {
            "method": "maximum_likelihood, two records",
            "alpha": alpha,
            "estimate": result.alpha,
            "standard_error": result.standard_error,
            "low": low,
            "high": high,
            "covered": bool(low <= alpha <= high),
            "seconds": time.perf_counter() - started,
            "message": result.message,
            "bound": bound,
        }
    ]


def mismatch(n: int) -> list[dict]:
    """Every linear parameter off by up to 5 %, Hunt-Crossley contact, noise and rounding, 30 s; all methods."""
    alpha, seed = _size(n + 5000), 200_000 + n
    columns, _ = make_record({"alpha": alpha}, seed, excitation=EXCITATIONS[n % 3])
    record = record_from_columns(columns, "mismatch")
    return [_row(record, alpha, method) | {"excitation": EXCITATIONS[n % 3]} for method in (*METHODS, THESIS)]


def literature(n: int) -> list[dict]:
    """The sizes of Lagerberg & Egardt (0.024 rad) and of Yang et al. (0.035 rad), conditions as in ``mismatch``."""
    alpha = (0.024, 0.035)[n % 2]
    columns, _ = make_record({"alpha": alpha}, 300_000 + n, excitation=EXCITATIONS[(n // 2) % 3])
    return [_row(record_from_columns(columns, "literature"), alpha, "maximum_likelihood")]


def motor_only(n: int) -> list[dict]:
    """As ``mismatch``, without the load encoder."""
    alpha = _size(n + 9000)
    columns, _ = make_record({"alpha": alpha}, 400_000 + n, excitation=EXCITATIONS[n % 3])
    record = record_from_columns(columns, "motor only").without_load_encoder()
    return [_row(record, alpha, "maximum_likelihood") | {"excitation": EXCITATIONS[n % 3]}]


def none(n: int) -> list[dict]:
    """No gap, 5 % mismatch, noise and rounding, 6 s."""
    columns, _ = make_record({}, 500_000 + n, 6.0, excitation=EXCITATIONS[n % 3])
    return [_row(record_from_columns(columns, "none"), 0.0, "maximum_likelihood")]


def online(n: int) -> list[dict]:
    """The online estimator in a position loop, 4 s at 1 kHz, judged after 2 s; 5 % mismatch."""
    from tests.support.online_loop import run_case

    return [run_case(600_000 + n, _size(n + 13_000))]


FAMILIES: dict[str, Callable[[int], list[dict]]] = {
    f.__name__: f for f in (exact, joint, mismatch, literature, motor_only, none, online)
}


def summary(rows: list[dict]) -> str:
    """Return one line for each method."""
    lines = []
    for method in dict.fromkeys(row["method"] for row in rows):
        mine = [row for row in rows if row["method"] == method]
        done = [row for row in mine if "failed" not in row]
        text = f"{method:20s} n {len(mine):4d}  not applicable {len(mine) - len(done):3d}"
        if done and done[0]["alpha"] > 0.0:
            error = np.array([abs(row["estimate"] / row["alpha"] - 1.0) for row in done]) * 100.0
            text += f"  mean error {error.mean():9.4f} %  median {np.median(error):9.4f} %  worst {error.max():9.4f} %"
        if done:
            text += f"  covered {100 * np.mean([row['covered'] for row in done]):5.1f} %"
            text += f"  excludes 0: {sum(row['low'] > 0 for row in done)}"
            text += f"  s/record {np.median([row['seconds'] for row in done]):.2f}"
        if done and "bound" in done[0]:
            score = np.array([(row["estimate"] - row["alpha"]) / row["bound"] for row in done])
            claimed = np.array([row["standard_error"] / row["bound"] for row in done])
            text += f"  rms error / bound {math.sqrt(np.mean(score**2)):.3f}"
            text += f"  standard error / bound {claimed.mean():.3f} ({claimed.min():.3f} to {claimed.max():.3f})"
        if done and "nees" in done[0]:
            text += f"  nees mean {np.mean([row['nees'] for row in done]):.2f}"
            text += f"  below 3.84: {100 * np.mean([row['nees'] < 3.84 for row in done]):.1f} %"
        lines.append(text)
    return "\n".join(lines)


def main() -> None:
    """Run one family and print its summary."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("family", choices=FAMILIES)
    parser.add_argument("count", type=int)
    parser.add_argument("--set", type=int, default=0, help="of seeds")
    parser.add_argument("--append", type=Path)
    arguments = parser.parse_args()
    rows: list[dict] = []
    if arguments.append and arguments.append.exists():
        rows = [json.loads(line) for line in arguments.append.read_text().splitlines()]
    done = len({row["case"] for row in rows})
    for n in range(done, arguments.count):
        # A whole number of rounds through excitations and sizes, so that they alternate alike in every set.
        seed = n + 6 * (arguments.set * SEEDS_IN_A_SET // 6)
        new = [row | {"case": n} for row in FAMILIES[arguments.family](seed)]
        rows += new
        if arguments.append:
            with arguments.append.open("a") as file:
                file.writelines(json.dumps(row) + "\n" for row in new)
    print(summary(rows))


if __name__ == "__main__":
    main()
