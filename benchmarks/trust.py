"""Whether green results of ``estimate`` hold the truth: records that the model fits, and records that it does not.

::

    python -m benchmarks.trust 25             # records of each of the four families
    python -m benchmarks.trust 25 --first 500 # other seeds
    python -m benchmarks.trust 25 --no-diagnose

Families: ``right`` (values off by up to the stated 5 %), ``wrong_model`` (an effect that the model lacks, beside the
gap), ``wrong_twin`` (values off by up to 25 %, stated as 5 %), ``little_motion`` (a hundredth of the torque). Every
method estimates every record, and where the model does not explain it, the diagnosis follows, as in ``estimate``; the
table counts, per method and level, the results and how many intervals hold the size.
"""

import argparse
from collections import defaultdict
from dataclasses import dataclass

import numpy as np

import orchestrator as oc
from orchestrator.errors import OrchestratorError
from orchestrator.records.record import Record, record_from_columns
from tests.support.hidden_effects import SINGLE
from tests.support.independent_plant import make_record

FAMILIES = ("right", "wrong_model", "wrong_twin", "little_motion")
EXCITATIONS = ("multisine", "levels", "closed_loop")
STRANGERS = ("coulomb_motor", "coulomb_load", "delay", "drag", "eccentricity", "hardening", "gravity", "resonance")
SEED = 7_000_000


@dataclass
class Count:
    """Results of one method and level."""

    results: int = 0
    held: int = 0
    far: int = 0  # off by more than three half-widths of the interval


def record_of(family: str, number: int) -> tuple[Record, float]:
    """Return a record of 15 s and the half-gap [rad] in it, log-uniform from 0.005 to 0.05."""
    rng = np.random.default_rng([SEED, number, FAMILIES.index(family)])
    alpha = float(0.005 * 10.0 ** rng.random())
    effects = {"alpha": alpha}
    if family == "wrong_model":
        stranger, size, _ = SINGLE[str(rng.choice(STRANGERS))]
        effects |= stranger | {size: stranger[size] * float(rng.uniform(0.2, 1.0))}
    columns, _ = make_record(
        effects,
        int(rng.integers(2**31)),
        15.0,
        mismatch=0.25 if family == "wrong_twin" else 0.05,
        excitation=EXCITATIONS[number % 3],
        torque=0.01 if family == "little_motion" else 1.0,
    )
    return record_from_columns(columns, f"{family} {number}"), alpha


def main() -> None:
    """Estimate all records and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("count", type=int)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--no-diagnose", action="store_true")
    arguments = parser.parse_args()
    counts: dict[tuple[str, str], Count] = defaultdict(Count)
    for family in FAMILIES:
        for number in range(arguments.first, arguments.first + arguments.count):
            record, alpha = record_of(family, number)
            try:
                with np.errstate(all="ignore"):
                    found = oc.estimate(record, method="all", diagnose=not arguments.no_diagnose)
            except OrchestratorError as error:
                print(f"{record.source}: refused: {error}", flush=True)
                continue
            for method in found.methods:
                estimate = method.estimate
                if estimate is None or method.trust is None:
                    continue
                low, high = estimate.interval
                held = low <= alpha <= high
                far = abs(alpha - estimate.alpha) > 3.0 * max(high - estimate.alpha, estimate.alpha - low)
                level = method.trust.level.word
                for key in ((method.method, level), (f"{family}: {method.method}", level)):
                    counts[key].results += 1
                    counts[key].held += held
                    counts[key].far += far
                if level == "green" and not held:
                    said = f"{estimate.alpha:.6g} ({low:.6g} to {high:.6g})"
                    print(f"{record.source}: green {method.method} {said}, is {alpha:.6g}", flush=True)
    print(f"{'':44}{'results':>8}{'held':>6}{'far':>5}")
    for (name, level), c in sorted(counts.items()):
        print(f"{name:36}{level:>8}{c.results:8d}{c.held:6d}{c.far:5d}")


if __name__ == "__main__":
    main()
