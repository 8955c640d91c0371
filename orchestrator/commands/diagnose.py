"""``diagnose``: where a record and the model disagree, what is missing, and the corrected FMU."""

import argparse
import csv
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from orchestrator.commands._console import print_table
from orchestrator.diagnosis.admission import check_comparable
from orchestrator.diagnosis.corrected import BeforeAfter, before_and_after, build_corrected
from orchestrator.diagnosis.diagnose import diagnose
from orchestrator.diagnosis.evidence import Term, evidence_of
from orchestrator.diagnosis.figures import draw_candidates, draw_innovations, draw_lines, draw_missing, draw_signals
from orchestrator.diagnosis.outcome import Diagnosis, Gap
from orchestrator.diagnosis.validate import STAGES, Validation, torque_errors, validate
from orchestrator.errors import ConvergenceError
from orchestrator.model_file import Model, read_model
from orchestrator.output import staged, write_result
from orchestrator.record import Record, read_record
from orchestrator.record_plausibility import check_plausible
from orchestrator.reporting import write_report

SHOWN = 5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("record", type=Path, metavar="DATA.csv", help="measured record: time,u,theta_m[,theta_l]")
    parser.add_argument("--model", type=Path, metavar="FILE.toml", help="the model it is compared with")
    parser.add_argument("--validate", type=Path, metavar="OTHER.csv", help="a second record, to show the gap on")


def run(args: argparse.Namespace) -> int:
    """Diagnose, print what was found, write JSON, CSV, figures, report and the corrected FMU."""
    model = read_model(args.model)
    record = _read(args.record, model)
    other = _read(args.validate, model) if args.validate else None
    begun = time.monotonic()
    with staged(args.out) as directory, np.errstate(all="ignore"):
        try:
            with _shown() as progress:
                diagnosis = diagnose(record, model, progress)
            fmu = build_corrected(diagnosis, args.record.name, directory)
            runs = before_and_after(diagnosis, fmu)
            results = diagnosis.as_json() | {"model": str(args.out / fmu.name)}
            results["cosimulation"] = {"largest_difference_from_compiled": runs.difference, "unit": "rad"}
            if other is not None:
                results |= _validated(validate(other, diagnosis))
            if errors := torque_errors(record, diagnosis):
                results["torque_error"] = {"record": errors} | results.get("torque_error", {})
            found = evidence_of(diagnosis)
            results["also_seen"] = [_term(term, diagnosis) for term in found.terms]
        except np.linalg.LinAlgError as error:
            raise ConvergenceError(f"{record.source}: no model can be fitted to this record: {error}") from None
        results["seconds"] = time.monotonic() - begun
        _write_csv(directory / "diagnose.csv", runs)
        draw_signals(directory / "diagnose_signals.png", runs, diagnosis)
        draw_innovations(directory / "diagnose_innovations.png", diagnosis)
        draw_candidates(directory / "diagnose_candidates.png", diagnosis)
        draw_missing(directory / "diagnose_missing_torque.png", diagnosis)
        draw_lines(directory / "diagnose_ripple.png", found, diagnosis.gap[0].unit)
        given = {"record": str(args.record), "model": args.model and str(args.model)}
        given["validate"] = args.validate and str(args.validate)
        write_result(directory, "diagnose", given, None, results)
        write_report(directory, "diagnose")
    _print(diagnosis, results)
    sys.stdout.write(f"Corrected FMU: {results['model']}\nWritten to {args.out}: report.html, diagnose.json, figures\n")
    return 0


def _read(path: Path, model: Model) -> Record:
    """Return a record that the model can be compared with."""
    record = read_record(path, model.columns)
    check_comparable(record)
    check_plausible(record, model)
    return record


def _validated(found: Validation) -> dict[str, Any]:
    """Return what the other record says, in its form for ``diagnose.json``."""
    signals = {
        gap.signal: _gap(gap) | {"r_squared": {name: values[n] for name, values in found.r_squared.items()}}
        for n, gap in enumerate(found.gap)
    }
    return {"validation": signals} | (
        {"torque_error": {"validation": found.torque_error}} if found.torque_error else {}
    )


def _term(term: Term, diagnosis: Diagnosis) -> dict[str, Any]:
    """Return what is left and what it follows, in its form for ``diagnose.json``."""
    metric = diagnosis.gap[0].unit == "m"
    return {
        "name": term.name,
        "period": None if term.period is None else 1e3 * term.period if metric else term.period,
        "period_unit": "mm" if metric else "rad",
        "size": term.size,
        "unit": "N" if metric else "N.m",
        "gain": term.gain,
        "level": term.level,
        "sure": term.sure,
    }


def _gap(gap: Gap) -> dict[str, Any]:
    return {"before": gap.before, "after": gap.after, "noise": gap.noise, "unit": gap.unit}


def _print(diagnosis: Diagnosis, results: dict[str, Any]) -> None:
    for line in summary(diagnosis):
        sys.stdout.write(line + "\n")
    rows = [
        [
            ", ".join(step["on_top_of"]) or "parameters",
            tried["effect"],
            f"{tried['gain']:.1f}",
            f"{tried['decided']:.1f}",
            "added" if step["accepted"] and n == 0 else "",
        ]
        for step in results["candidates"]
        for n, tried in enumerate(step["tried"][:SHOWN])
    ]
    if rows:
        print_table("Candidates", ("on top of", "effect", "gain", "of it on deciding part", ""), rows)
    gaps = [
        [gap.signal, name, f"{rms:.4g}", f"{rms / gap.noise:.2f}"] for gap in diagnosis.gap for name, rms in gap.stages
    ]
    print_table("Gap on held-out data", ("signal", "model", f"rms [{diagnosis.gap[0].unit}]", "times noise"), gaps)
    _print_also_seen(results["also_seen"])
    if "validation" in results:
        rows = [
            [signal, f"{g['before']:.4g}", f"{g['after']:.4g}", f"{g['noise']:.4g}"]
            for signal, g in results["validation"].items()
        ]
        print_table(
            "Gap on the other record",
            ("signal", *(f"{name} [{diagnosis.gap[0].unit}]" for name in ("before", "after", "noise"))),
            rows,
        )
        rows = [
            [signal, *(f"{g['r_squared'][name]:.4f}" for name in STAGES)] for signal, g in results["validation"].items()
        ]
        print_table("R2 of one free run over all of the other record", ("signal", *STAGES), rows)
    if "torque_error" in results:
        rows = [
            [record, *(f"{100.0 * errors[name]:.2f} %" for name in STAGES)]
            for record, errors in results["torque_error"].items()
        ]
        print_table("Relative torque error of the inverse model", ("on", *STAGES), rows)


def _print_also_seen(terms: Sequence[dict[str, Any]]) -> None:
    """Print what the final model leaves that chance does not explain."""
    rows = [
        [
            term["name"],
            "" if term["period"] is None else f"{term['period']:.4g} {term['period_unit']}",
            f"{term['size']:.3g} {term['unit']}",
            f"{term['gain']:.0f}",
            f"{term['gain'] / term['level']:.0f}",
        ]
        for term in terms
        if term["sure"]
    ]
    if rows:
        columns = ("what", "period", "size", "gain", "times that of any period")
        print_table("Also seen at the motor, and not added to the model", columns, rows)


def summary(diagnosis: Diagnosis) -> Iterator[str]:
    """Yield what was found, one sentence a line."""
    meaning = {
        "none": "the model explains the record to its noise",
        "parameters": "re-fitted parameters explain the record",
        "effects": "effects are missing in the model",
        "unknown": "a gap is left that nothing in the library explains",
    }
    yield f"Verdict: {diagnosis.verdict}: {meaning[diagnosis.verdict]}"
    for effect in diagnosis.effects:
        values = ", ".join(
            f"{name} = {e.value:.5g} +- {e.standard_error:.2g} {e.unit}".rstrip()
            for name, e in effect.parameters.items()
        )
        runner = f"; runner-up {effect.runner_up}, behind by {effect.margin:.0f}" if effect.runner_up else ""
        yield f"  {effect.name} ({effect.site}): {values}; gain {effect.score:.0f}{runner}"
    if diagnosis.where and diagnosis.verdict not in ("none", "parameters"):
        yield "Where:"
        for place in diagnosis.where[:SHOWN]:
            yield f"  {place.words}"
    for warning in diagnosis.warnings:
        yield f"Note: {warning}"


def _write_csv(path: Path, runs: BeforeAfter) -> None:
    names: Sequence[str] = ("theta_m", "theta_l")[: runs.measured.shape[1]]
    header = ["time", "u"] + [f"{name}{suffix}" for name in names for suffix in ("", "_before", "_after")]
    columns = [runs.time, runs.u]
    for n in range(len(names)):
        columns += [runs.measured[:, n], runs.before[:, n], runs.after[:, n]]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows([f"{value:.9g}" for value in row] for row in zip(*columns, strict=True))


@contextmanager
def _shown() -> Iterator[Any]:
    """Yield a progress callback: a bar on a terminal, nothing elsewhere."""
    if not sys.stderr.isatty():
        yield lambda done, expected, what: None
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed} fits"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(file=sys.stderr), transient=True) as bar:
        task = bar.add_task("diagnose", total=None)
        yield lambda done, expected, what: bar.update(
            task, completed=done, total=expected, description=f"fitted {what}"
        )
