"""``simulate``: one paired run with its plots, or any scenario file."""

import argparse
import csv
import math
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np

from orchestrator.commands._console import print_table
from orchestrator.commands._experiment import (
    add_experiment_arguments,
    chosen_experiment,
    refuse_with_scenario,
    require_not_negative,
)
from orchestrator.errors import ScenarioError
from orchestrator.fmi.build import ensure_built
from orchestrator.master.result import Result
from orchestrator.output import staged, write_result
from orchestrator.paired.cosimulation import FMUS
from orchestrator.paired.figures import draw_pair, draw_signals
from orchestrator.paired.pair import PairRun, run_pair, with_settings
from orchestrator.reporting import write_report
from orchestrator.scenario import load_scenario, run_scenario


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what a run takes."""
    add_experiment_arguments(parser)
    parser.add_argument("--alpha", type=float, default=0.02, metavar="RAD", help="half-gap (default: %(default)s)")
    parser.add_argument("--noise", type=float, default=0.0, metavar="RAD", help="encoder noise (default: none)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the noise (default: %(default)s)")
    parser.add_argument("--scenario", type=Path, metavar="FILE", help="run this TOML scenario instead of the pair")


def run(arguments: argparse.Namespace) -> int:
    """Run, print a table, write CSV, JSON and figure."""
    if arguments.scenario is not None:
        return _scenario(arguments)
    return _pair(arguments)


def _scenario(arguments: argparse.Namespace) -> int:
    refuse_with_scenario(arguments, {"alpha": 0.02, "noise": 0.0, "seed": 0})
    scenario = load_scenario(arguments.scenario)
    with staged(arguments.out) as directory:
        result = run_scenario(scenario)
        _write_csv(directory / "simulate.csv", {"time": result.time} | {n: result[n] for n in result.names})
        units = {name: result.units.get(name) or "" for name in result.names}
        draw_signals(directory / "simulate.png", result.time, {n: result[n] for n in result.names}, units)
        rows = [_summary(name, units[name], result) for name in result.names]
        head = ("signal", "unit", "first", "last", "smallest", "largest")
        print_table(f"{arguments.scenario.name}: {len(result.time) - 1} steps", head, rows)
        results = {"signals": [dict(zip(head, row, strict=True)) for row in rows], "steps": len(result.time) - 1}
        write_result(directory, "simulate", {"scenario": str(arguments.scenario)}, None, results)
        write_report(directory, "simulate")
    sys.stdout.write(f"Written to {arguments.out}: report.html, simulate.csv, simulate.json, simulate.png\n")
    return 0


def _summary(name: str, unit: str, result: Result) -> list[str]:
    values = result[name]
    return [name, unit, *(f"{v:.6g}" for v in (values[0], values[-1], values.min(), values.max()))]


def _pair(arguments: argparse.Namespace) -> int:
    alpha = require_not_negative("--alpha", arguments.alpha)
    noise = require_not_negative("--noise", arguments.noise)
    if arguments.seed < 0:
        raise ScenarioError(f"`--seed` must not be negative, but is {arguments.seed}")
    experiment = with_settings(chosen_experiment(arguments), noise=noise)
    with staged(arguments.out) as directory:
        fmus = ensure_built(FMUS)
        pair = run_pair(experiment, fmus, alpha, arguments.seed)
        reference = experiment.reference()[0]
        signals = {"time": pair.machine.time, "reference": reference}
        signals |= pair.machine.signals
        signals |= {f"twin_{name}": values for name, values in pair.twin.signals.items()}
        _write_csv(directory / "simulate.csv", signals)
        title = f"Paired loops, {experiment.backlash_model}, half-gap {alpha:g} rad"
        draw_pair(directory / "simulate.png", pair.machine, pair.twin, reference, title)
        _print_pair(pair, alpha)
        results = {
            "alpha": alpha,
            "S": pair.total,
            "estimate": None if pair.estimate is None else asdict(pair.estimate),
            "no_estimate": pair.no_estimate,
            "crossings": _crossings(pair),
            "experiment": asdict(experiment),
        }
        given = {"alpha": alpha, "noise": noise, "experiment": experiment.name}
        given |= {"backlash_model": experiment.backlash_model}
        write_result(directory, "simulate", given, arguments.seed, results)
        write_report(directory, "simulate")
    sys.stdout.write(f"Written to {arguments.out}: report.html, simulate.csv, simulate.json, simulate.png\n")
    return 0


def _crossings(pair: PairRun) -> int:
    flank = pair.machine["contact"][pair.machine["contact"] != 0]
    return int(np.sum(flank[1:] != flank[:-1]))


def _print_pair(pair: PairRun, alpha: float) -> None:
    machine, twin = pair.machine, pair.twin
    rows = [
        ["actual half-gap", f"{alpha:.6g}", "rad"],
        ["S, sum of differences", f"{pair.total:.6g}", "rad"],
        ["largest difference of the load angles", f"{np.abs(machine['theta_l'] - twin['theta_l']).max():.6g}", "rad"],
        ["time in the gap", f"{100.0 * np.mean(machine['contact'] == 0):.1f}", "%"],
        ["crossings of the gap", str(_crossings(pair)), ""],
        ["largest torque request", f"{np.abs(machine['u']).max():.4g}", "N.m"],
    ]
    if pair.estimate is None:
        rows.append(["estimate", f"none: {pair.no_estimate}", ""])
    else:
        e = pair.estimate
        rows.append(["estimated half-gap", f"{e.alpha:.8g}  (95 %: {e.lower:.8g} .. {e.upper:.8g})", "rad"])
        if alpha > 0.0 and math.isfinite(e.alpha):
            rows.append(["error", f"{100.0 * abs(e.alpha - alpha) / alpha:.4f}", "%"])
    print_table("Paired run", ("", "value", "unit"), rows)


def _write_csv(path: Path, columns: dict[str, np.ndarray]) -> None:
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*(values.tolist() for values in columns.values()), strict=True))
