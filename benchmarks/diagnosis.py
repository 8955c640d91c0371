"""Benchmark of the diagnosis on records of the independent simulator: confusion matrix and rates.

    python -m benchmarks.diagnosis --singles 200 --none 100 --doubles 40 --unknown 50 --seed 80000
    python -m benchmarks.diagnosis --one-encoder 60 --seed 80000    # a gap behind the motor's encoder alone

One line a record as it goes, the matrix and the figures at the end, and ``bench_diagnosis.json``. An interrupted run
goes on where it stopped (``--out`` keeps its lines). Seeds below 70000 were used in development.

With ``--one-encoder`` records are of ``theta_m`` alone, of three machines in open and closed loops, with a gap of 0.3
to 3 times the typical twist.
"""

import argparse
import itertools
import json
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.harm import counted, harmed
from orchestrator.diagnosis.diagnose import diagnose
from orchestrator.diagnosis.outcome import Diagnosis
from orchestrator.diagnosis.verdict.gain import CARRIERS
from orchestrator.plants.bank import DRIVETRAIN_BANK
from orchestrator.records.model_file import Model, default_model
from tests.support import hidden_effects
from tests.support.hidden_effects import (
    SINGLE,
    UNKNOWN,
    Case,
    double_case,
    none_case,
    one_encoder_case,
    single_case,
    unknown_case,
)

FAMILY = {effect.label: effect.family or effect.label for effect in DRIVETRAIN_BANK}
# Truth of the independent simulator -> named parameter, for cases whose meaning is the same.
RECOVERED = {
    "alpha": ("backlash", "alpha"), "Fc_m": ("coulomb_friction", "torque"), "Fc_l": ("coulomb_friction", "torque"),
    "delay": ("input_delay", "delay"), "sat": ("torque_saturation", "limit"), "rip": ("torque_ripple", "amplitude"),
    "ecc": ("gear_eccentricity", "amplitude"), "T0": ("load_torque", "torque"), "grav": ("gravity_load", "amplitude"),
    "J3": ("extra_resonance", "inertia"), "qd": ("quadratic_drag", "coefficient"),
}  # fmt: skip


def model_of(case: Case) -> Model:
    """Return the nominal model of a case's machine, each linear parameter known to 5 %."""
    model = default_model()
    known = dict(model.parameters)
    for name, value in case.truth["nominal"].items():
        known[name] = replace(known[name], value=value, uncertainty=0.05 * value)
    return replace(model, parameters=known)


def judge(case: Case, diagnosis: Diagnosis) -> dict[str, Any]:
    """Return one row: what was hidden, what was said, whether that is right, wrong or neither."""
    labels = [f"{effect.name}@{effect.site}" for effect in diagnosis.effects]
    families = [set(effect.family) | {label} for effect, label in zip(diagnosis.effects, labels, strict=True)]
    found = [any(group & set(right) for group in families) for right in case.right]
    spare = [
        label for label, group in zip(labels, families, strict=True)
        if not any(group & set(right) for right in case.right)
    ]  # fmt: skip
    if case.truth.get("shifts", (0.0, 0.0))[0] > 0.0:
        # Angles that are all stamped late are a dead time to one record.
        spare = [label for label in spare if FAMILY.get(label) != FAMILY["input_delay@actuator"]]
    row: dict[str, Any] = {"kind": case.kind, "seed": case.seed, "times_noise": case.times_noise,
                           "verdict": diagnosis.verdict, "named": labels, "found": found, "spare": spare}  # fmt: skip
    row["right"] = bool(case.right) and all(found) and not spare
    row["wrong"] = bool(spare)
    row["warned"] = bool(diagnosis.warnings)
    row["nuisances"] = {n.name: e.value for n in diagnosis.nuisances for e in n.parameters.values()}
    row["misfits"] = [[misfit.before, misfit.after, misfit.noise] for misfit in diagnosis.misfit]
    row["harm"] = harmed(diagnosis)
    if diagnosis.verdict == "unknown":
        row["learned"] = learned(diagnosis)
    row["errors"] = errors(case, diagnosis)
    row["linear"] = linear_errors(case, diagnosis)
    return row


def learned(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return what the learned law follows, and by how much it shrinks each signal's misfit; ``least`` is 1 without one.

    ``lacking`` is the held-out misfit of re-fitted parameters over the noise: what there was to shrink.
    """
    law = diagnosis.learned
    lacking = max(one.after / one.noise for one in diagnosis.misfit)
    if law is None:
        return {"law": "", "least": 1.0, "lacking": lacking, "left": lacking}
    left = max(one.after / one.noise for one in law.misfit)
    return {"law": f"{law.argument} ({law.site})", "least": law.shrinks, "lacking": lacking, "left": left}


def seen(case: Case, value: float, unit: str | None) -> float:
    """Return a true value as a record shows it: in torques of a drive whose gain is taken for one."""
    return value / float(case.truth["gain"]) if unit and unit.startswith(CARRIERS) else value


def errors(case: Case, diagnosis: Diagnosis) -> list[tuple[str, float, float, bool]]:
    """Return (parameter, relative error, error in standard errors, inside the interval) of each size that was named."""
    rows = []
    for short, true in case.truth["effects"].items():
        name, parameter = RECOVERED.get(short, ("", ""))
        for effect in diagnosis.effects:
            if effect.name == name and parameter in effect.parameters:
                estimate = effect.parameters[parameter]
                value = true if short == "sat" else seen(case, true, estimate.unit)  # a limit is one of the request
                off = abs(estimate.value) - abs(value)
                low, high = estimate.interval
                inside = low <= value <= high or low <= -value <= high  # a sign can be in the phase
                rows.append((short, off / abs(value), off / max(estimate.standard_error, 1e-300), inside))
    return rows


def linear_errors(case: Case, diagnosis: Diagnosis) -> list[tuple[str, float, bool]]:
    """Return (parameter, relative error, inside the interval) of each linear parameter."""
    rows = []
    for name, entry in diagnosis.parameters.items():
        true: Any = seen(case, case.truth["linear"][name], entry.unit)
        assert entry.value is not None
        assert entry.interval is not None
        low, high = entry.interval
        rows.append((name, (entry.value - true) / true, low <= true <= high))
    return rows


def cases(args: argparse.Namespace) -> Any:
    """Yield (group, function that makes the case)."""
    kinds = list(SINGLE)
    pairs = [pair for pair in itertools.combinations(kinds, 2) if not _same_family(*pair)]
    np.random.default_rng(args.seed).shuffle(pairs)
    unknown = list(UNKNOWN)
    first = int(args.seed)
    groups: list[tuple[str, Callable[[], Case]]] = [("none", partial(none_case, first + n)) for n in range(args.none)]
    for n in range(args.singles):
        groups.append(("single", partial(single_case, kinds[n % len(kinds)], first + 1000 + n)))
    for n in range(args.unknown):
        groups.append(("unknown", partial(unknown_case, unknown[n % len(unknown)], first + 3000 + n)))
    for n in range(args.doubles):
        groups.append(("double", partial(double_case, pairs[n % len(pairs)], first + 2000 + n)))
    if args.one_encoder:
        groups = [("one_encoder", partial(one_encoder_case, first + 4000 + n)) for n in range(args.one_encoder)]
    order = np.random.default_rng(args.seed + 1).permutation(len(groups))
    return [(int(n), *groups[n]) for n in order]


def _same_family(a: str, b: str) -> bool:
    return FAMILY[SINGLE[a][2][0]] == FAMILY[SINGLE[b][2][0]]


def report(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Print the matrix and the rates of what has been run, and return the figures."""
    figures: dict[str, Any] = {}
    print("\nHidden (rows) against named (columns, family)")
    matrix = Counter((row["kind"], _said(row)) for row in rows if row["group"] in ("none", "single", "unknown"))
    said = sorted({name for _, name in matrix})
    for number, name in enumerate(said):
        print(f"  [{number}] {name}")
    for kind in dict.fromkeys(row["kind"] for row in rows if row["group"] in ("none", "single", "unknown")):
        print(f"{kind:>22} " + " ".join(f"{matrix[kind, name] or '.':>4}" for name in said))
    for group in ("none", "single", "double", "unknown", "one_encoder"):
        chosen = [row for row in rows if row["group"] == group]
        if chosen:
            figures[group] = _rates(group, chosen)
            print(group, figures[group])
    effects = [row for row in rows if row["verdict"] == "effects" and row["right"]]
    if effects:
        after = [max(after / noise for _, after, noise in row["misfits"]) for row in effects]
        ratio = [min(before / after for before, after, _ in row["misfits"]) for row in effects]
        figures["misfit"] = {
            "after_over_noise_median": float(np.median(after)),
            "after_over_noise_90": float(np.quantile(after, 0.9)),
            "before_over_after_median": float(np.median(ratio)),
            "before_over_after_10": float(np.mean(np.array(ratio) >= 10.0)),
        }
        errors_ = [e for row in effects if row["group"] == "single" for e in row["errors"]]
        figures["parameters"] = {"count": len(errors_)}
        if errors_:
            figures["parameters"] |= {
                "relative_error_median": float(np.median([abs(e[1]) for e in errors_])),
                "relative_error_90": float(np.quantile([abs(e[1]) for e in errors_], 0.9)),
                "inside_95_percent_interval": float(np.mean([e[3] for e in errors_])),
            }
        linear = [e for row in rows if row["group"] == "none" or row["right"] for e in row["linear"]]
        figures["linear"] = {
            "relative_error_median": float(np.median([abs(e[1]) for e in linear])),
            "inside_95_percent_interval": float(np.mean([e[2] for e in linear])),
            "count": len(linear),
        }
        print(figures["misfit"], figures["parameters"], figures["linear"])
    print(counted([row for row in rows if "harm" in row]))
    figures["seconds_median"] = float(np.median([row["seconds"] for row in rows]))
    figures["seconds_largest"] = float(np.max([row["seconds"] for row in rows]))
    print({name: round(value, 1) for name, value in figures.items() if isinstance(value, float)})
    return figures


def _said(row: dict[str, Any]) -> str:
    names = sorted({FAMILY[name] for name in row["named"]})
    return " + ".join(names) if names else "no effect" if row["verdict"] in ("none", "parameters") else row["verdict"]


def _rates(group: str, rows: list[dict[str, Any]]) -> dict[str, Any]:
    count = len(rows)
    rates: dict[str, Any] = {"records": count, "wrong": sum(row["wrong"] for row in rows)}
    if group == "none":
        # A dead time that a late log has is none: it is in the record.
        rates["false_alarms"] = sum(row["wrong"] or row["verdict"] == "unknown" for row in rows)
    elif group == "unknown":
        rates["unknown"] = sum(row["verdict"] == "unknown" for row in rows)
        rates["missed"] = sum(row["verdict"] in ("none", "parameters") for row in rows)
        laws = [row["learned"] for row in rows if "learned" in row]
        rates["learned"] = sum(bool(law["law"]) for law in laws)
        rates["shrunk_five_times"] = sum(law["least"] >= 5.0 for law in laws)
        rates["shrunk_to_twice_the_noise"] = sum(law["left"] <= 2.0 for law in laws)
    else:
        if group == "one_encoder":
            off = [abs(e[1]) for row in rows for e in row["errors"] if e[0] == "alpha"]
            rates["size_error_median"] = float(np.median(off)) if off else None
            rates["size_inside_interval"] = sum(e[3] for row in rows for e in row["errors"] if e[0] == "alpha")
        rates["right"] = sum(row["right"] for row in rows)
        rates["all_found"] = sum(all(row["found"]) for row in rows)
        rates["missed"] = sum(not row["wrong"] and not row["right"] for row in rows)
    return rates


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, default in (("singles", 200), ("none", 100), ("doubles", 40), ("unknown", 50)):
        parser.add_argument(f"--{name}", type=int, default=default)
    parser.add_argument("--seed", type=int, default=80_000)
    parser.add_argument("--one-encoder", type=int, default=0, metavar="N", help="N records of theta_m with a gap alone")
    parser.add_argument("--torque-noise", action="store_true", help="coloured torque noise on half of the records")
    parser.add_argument("--shifts", action="store_true", help="signals late by up to two samples on half of them")
    parser.add_argument("--gain", action="store_true", help="a torque that is up to 10 %% off on half of them")
    parser.add_argument("--out", type=Path, default=Path("results/bench_diagnosis"))
    args = parser.parse_args()
    hidden_effects.TORQUE_NOISE, hidden_effects.SHIFTS, hidden_effects.GAIN = args.torque_noise, args.shifts, args.gain
    args.out.mkdir(parents=True, exist_ok=True)
    lines = args.out / f"{'one-encoder' if args.one_encoder else 'rows'}-{args.seed}.jsonl"
    rows = [json.loads(line) for line in lines.read_text().splitlines()] if lines.exists() else []
    done = {row["number"] for row in rows}
    for number, group, make in cases(args):
        if number in done:
            continue
        case = make()
        begun = time.process_time()
        found = diagnose(case.record, model_of(case))
        row, case_trust = judge(case, found), found.trust.level.word
        row |= {"number": number, "group": group, "seconds": time.process_time() - begun}
        row |= {name: case.truth[name] for name in ("torque_noise", "shifts", "gain")}
        row["trust"] = case_trust
        row["truth"] = {name: float(value) for name, value in case.truth["effects"].items()}
        rows.append(row)
        with lines.open("a") as file:
            file.write(json.dumps(row) + "\n")
        mark = "ok" if row["right"] or not (case.right or row["wrong"]) else "WRONG" if row["wrong"] else "miss"
        print(
            f"{mark:>5} {case.kind} {case.seed} {row['verdict']} {row['named']} {row['truth']} {row['errors']} "
            f"{row.get('learned', '')} {row['seconds']:.1f} s",
            flush=True,
        )
    figures = report(rows)
    (args.out / "bench_diagnosis.json").write_text(json.dumps(figures, indent=1) + "\n")


if __name__ == "__main__":
    main()
