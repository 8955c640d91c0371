"""Whether names do harm: predictions of data that no diagnosis has seen, with names and with re-fitted values alone.

    python -m benchmarks.harm --singles 50 --doubles 20 --none 20 --unknown 10 --seed 83000
    python -m benchmarks.harm --self-test

Of each record of the independent simulator the diagnosis gets the first 85 %, once with names and once with re-fitted
parameters alone (``search=False``). The independent simulator then runs both over the rest, a second at a time, from
true states. What it misses of the measured angles is compared, in units of the encoders' noise. A name does harm where
the runs with names miss more, by more than 1 %. Nothing of this goes through the diagnosis's own account of its
predictions. The exit code is 1 where more than 2 % of the records with names are harmed.

``--self-test`` counts a diagnosis that is made to do harm, with each named torque of the wrong sign or five times as
large, and exits with 0 only where the count above would have failed.
"""

import argparse
import math
import sys
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.diagnosis import add_ways, ways_of
from benchmarks.judging import Row, judge
from benchmarks.rows import run_tasks
from benchmarks.simulated import Counts, SimulatedTask, model_of, simulated_tasks, truth_of
from benchmarks.verdicts import Estimate, NamedEffect, Outcome, diagnose_record
from orchestrator.records.record import Record, record_from_columns
from tests.support.hidden_effects import RATE, Case
from tests.support.independent_plant import NOISE, make_record

SEEN = 0.85  # of a record that the diagnosis gets
RUN, FILLS = 1.0, 1.0  # s: of a run, and before it, of what its drive remembers
WORSE = 1.01  # ratio of misfits from which it is harm: less is rounding
MOST = 0.02  # share of records with names that may be harmed
WRONG = 5.0  # factor on a size that has no sign, of a diagnosis that is made to do harm
STATES = ("theta_m", "omega_m", "theta_l", "omega_l", "T_m")

# Effect, parameter -> the simulator's.
DELIVERED = {
    "backlash@shaft": {"alpha": "alpha"}, "coulomb_friction@motor": {"torque": "Fc_m"},
    "coulomb_friction@load": {"torque": "Fc_l"}, "input_delay@actuator": {"delay": "delay"},
    "torque_saturation@actuator": {"limit": "sat"}, "rate_limit@actuator": {"rate": "slew"},
    "torque_ripple@motor": {"amplitude": "rip", "cycles_per_rev": "rip_n", "phase": "rip_ph"},
    "gear_eccentricity@shaft": {"amplitude": "ecc", "cycles_per_rev": "ecc_n", "phase": "ecc_ph"},
    "load_torque@load": {"torque": "T0"}, "gravity_load@load": {"amplitude": "grav", "phase": "grav_ph"},
    "quadratic_drag@load": {"coefficient": "qd"}, "drive_filter@actuator": {"time_constant": "tau2"},
    "directional_friction@motor": {"difference": "dv_m"}, "directional_friction@load": {"difference": "dv_l"},
    "spring_load@load": {"stiffness": "ks", "angle": "ks_x"}, "load_dependent_friction@motor": {"coefficient": "mu_m"},
    "load_dependent_friction@load": {"coefficient": "mu_l"},
    "shaft_hysteresis@shaft": {"torque": "bw", "twist": "bw_x"},
    "sensor_offset@motor": {"offset": "off_m"}, "sensor_offset@load": {"offset": "off_l"},
}  # fmt: skip
SIGNED = ("rip", "ecc", "T0", "grav", "dv_m", "dv_l", "off_m", "off_l")


def seen_part(case: Case) -> Record:
    """Return the part of a record that the diagnosis gets.

    Args:
        case: the record.

    Returns:
        Its first rows.
    """
    record, rows = case.record, round(SEEN * case.record.size)
    columns = {"time": record.time[:rows], "u": record.u[:rows], "theta_m": record.theta_m[:rows]}
    if record.theta_l is not None:
        columns["theta_l"] = record.theta_l[:rows]
    return record_from_columns(columns, record.source)


def simulated_effects(names: dict[str, NamedEffect]) -> dict[str, float] | None:
    """Return named effects as the simulator's, or None where it has one of them not.

    Args:
        names: of an outcome.

    Returns:
        Values by the simulator's names.
    """
    effects: dict[str, float] = {}
    for label, effect in names.items():
        if label.startswith("stribeck_friction"):
            site = "l" if label.endswith("@load") else "m"
            known = {name: one.value for name, one in effect.values.items()}
            effects[f"Fc_{site}"] = known["coulomb"]
            effects[f"Fs_{site}"] = known["breakaway"] - known["coulomb"]
            effects["vs" if site == "m" else "vs_l"] = known["stribeck_speed"]
            continue
        if label not in DELIVERED:
            return None
        effects |= {
            target: effect.values[name].value for name, target in DELIVERED[label].items() if name in effect.values
        }
    return effects


def missed(case: Case, outcome: Outcome, effects: dict[str, float]) -> float:
    """Return what runs over the unseen part miss of the measured angles, in units of the noise; infinite: they stray.

    Runs begin at true states, which no longer run does: over that, what any rounding of a friction misses is drift.
    What a drive remembers of its request is no state of the record: it is filled while the bodies stand still.

    Args:
        case: the record.
        outcome: whose re-fitted parameters are taken.
        effects: of the simulator.

    Returns:
        The root mean square over encoders and rows.
    """
    record, rows, before = case.record, round(RUN * RATE), round(FILLS * RATE)
    measured = [record.theta_m] + ([record.theta_l] if record.theta_l is not None else [])
    ways: dict[str, Any] = {
        "linear": case.truth["nominal"] | {name: one.value for name, one in outcome.parameters.items()},
        "nominal": case.truth["nominal"],
        "noise": (0.0, 0.0),
        "counts": None,
        "duration": (before + rows) / RATE,
        "still": before,
    }
    squares = []
    for first in range(round(SEEN * record.size), record.size - rows + 1, rows):
        part = slice(first - before, first + rows)
        at_start = dict(zip(STATES, case.truth["states"][first], strict=False))
        columns, _ = make_record(effects, u=record.u[part], x0=at_start, **ways)
        for one, seen, noise in zip((columns["theta_m"], columns["theta_l"]), measured, NOISE, strict=False):
            squares.append(np.mean(np.square((one - seen[part])[before:] / noise)))
    rms = float(np.sqrt(np.mean(squares)))
    return rms if math.isfinite(rms) else math.inf


def falsify(names: dict[str, NamedEffect]) -> dict[str, NamedEffect]:
    """Return names as a diagnosis that does harm would deliver them: of wrong sign, or five times as large.

    Args:
        names: of an outcome.

    Returns:
        The names.
    """
    changed = {}
    for label, effect in names.items():
        values = dict(effect.values)
        for number, (name, one) in enumerate(effect.values.items()):
            if number == 0:
                factor = -1.0 if DELIVERED.get(label, {}).get(name) in SIGNED else WRONG
                values[name] = Estimate(factor * one.value, factor * one.low, factor * one.high)
        changed[label] = replace(effect, values=values)
    return changed


def diagnose_task(task: SimulatedTask, false: bool = False) -> Row:
    """Return a row whose misfit is that of both runs over the unseen part; without names, or undelivered: none.

    Args:
        task: the record.
        false: the diagnosis is made to do harm.

    Returns:
        The row.
    """
    case = task.make()
    record, model = seen_part(case), model_of(case)
    outcome = diagnose_record(record, model)
    names = {label: outcome.names[label] for label in outcome.labels()}
    effects = simulated_effects(falsify(names) if false else names)
    misfit = {}
    if names and effects is not None:
        alone = diagnose_record(record, model, search=False)
        misfit = {"unseen": (missed(case, alone, {}), missed(case, outcome, effects))}
    outcome = replace(outcome, misfit=misfit)
    return Row(task.key, task.group, "+".join(task.kinds), outcome, judge(outcome, truth_of(case)))


def show_harm(row: Row) -> str:
    """Return one line of a record.

    Args:
        row: of the record.

    Returns:
        The line.
    """
    names = ", ".join(row.outcome.labels()) or "no name"
    if not row.outcome.misfit:
        return f"      {row.key}: {names}"
    before, after = row.outcome.misfit["unseen"]
    mark = "HARM" if after > WORSE * before else "ok"
    return f"{mark:>5} {row.key}: {names}: {before:.2f} to {after:.2f} times the noise"


def harmed(rows: Sequence[Row]) -> tuple[int, int]:
    """Return how many records are harmed, and how many have names that were run.

    Args:
        rows: of records.

    Returns:
        Both counts.
    """
    misfits = [row.outcome.misfit["unseen"] for row in rows if row.outcome.misfit]
    return sum(after > WORSE * before for before, after in misfits), len(misfits)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, default in (("singles", 25), ("doubles", 0), ("none", 0), ("unknown", 0)):
        parser.add_argument(f"--{name}", type=int, default=default, metavar="N")
    parser.add_argument(
        "--self-test", action="store_true", help="a diagnosis that is made to do harm must be found out"
    )
    add_ways(parser)
    parser.add_argument("--out", type=Path, default=Path("results/harm"))
    args = parser.parse_args()
    tasks = simulated_tasks(
        Counts(args.none, args.singles, args.doubles, args.unknown), args.seed, ways_of(args), args.machines
    )
    work = partial(diagnose_task, false=args.self_test)
    lines = args.out / f"rows-{args.seed}{'-false' if args.self_test else ''}.jsonl"
    worse, run = harmed(run_tasks(tasks, work, lines, args.processes, show_harm))
    failed = worse > MOST * run
    print(f"harm: {worse} of {run} records with names predict unseen data worse than re-fitted parameters do")
    print("the count fails" if failed else "the count passes")
    sys.exit(0 if failed == args.self_test else 1)


if __name__ == "__main__":
    main()
