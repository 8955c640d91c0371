"""The paired sweep: what it prints, draws and writes."""

import argparse
from dataclasses import asdict
from pathlib import Path

import numpy as np

from orchestrator.commands._console import print_table, say
from orchestrator.commands._experiment import chosen_experiment
from orchestrator.commands._progress import samples_of, swept
from orchestrator.engine import DesignCases, Row, Status, Sweep
from orchestrator.engine.work import file_hash
from orchestrator.errors import ScenarioError
from orchestrator.fmi.build import ensure_built
from orchestrator.output import staged
from orchestrator.paired.calibration import Calibration
from orchestrator.paired.cosimulation import FMUS, MACHINE, loop_system
from orchestrator.paired.figures import draw_errors, draw_estimates, draw_pair
from orchestrator.paired.metric import ErrorStatistics
from orchestrator.paired.pair import run_pair, with_settings
from orchestrator.paired.sweep import OWN_PARAMETERS, SweepArrays, SweepPlan, gather, sweep_work
from orchestrator.scenario_sweep import check_parameters

MOST_ROWS_PRINTED = 40


def run_paired_sweep(arguments: argparse.Namespace) -> int:
    """Run the sweep of the paired loops; return the number of failed cases."""
    plan = SweepPlan(
        chosen_experiment(arguments),
        arguments.sizes,
        _levels(arguments.noise),
        arguments.seeds,
        arguments.seed,
        tuple(arguments.vary),
        samples_of(arguments),
    )
    cases = plan.cases()
    with staged(arguments.out) as directory:
        say("preparing FMUs, compiled loop and calibration (the first time takes half a minute)")
        fmus = ensure_built(FMUS)
        check_parameters(loop_system(plan.experiment, fmus, (MACHINE,)), cases, OWN_PARAMETERS)
        calibrations = plan.calibrations(say)
        with swept(cases, sweep_work(plan, fmus, calibrations), arguments, directory) as (sweep, results):
            arrays = gather(sweep.rows())
            statistics = arrays.statistics()
            _print_rows(sweep, cases)
            _print_statistics(statistics, len(cases), sweep.failed)
            _draw(directory, plan, fmus, arrays)
            results |= {
                "statistics": [{"noise": level} | asdict(s) for level, s in statistics.items()],
                "experiment": asdict(plan.experiment),
                "calibrations": {f"{level:g}": _provenance(c) for level, c in calibrations.items()},
                "fmus": {name: file_hash(path) for name, path in fmus.items()},
            }
    sweep.discard_journal()
    return sweep.failed


def _levels(text: str) -> tuple[float, ...]:
    try:
        levels = tuple(float(word) for word in text.split(","))
    except ValueError:
        raise ScenarioError(f"`--noise` must be numbers separated by commas, but is {text!r}") from None
    if len(set(levels)) != len(levels):
        raise ScenarioError(f"`--noise` must name each level once, but is {text!r}")
    return levels


def _provenance(calibration: Calibration) -> dict[str, object]:
    return {
        "digest": calibration.digest,
        "runs": calibration.runs,
        "seed_branch": calibration.seed_branch,
        "smallest": calibration.smallest,
        "largest": calibration.largest,
        "level": calibration.level,
        "width": calibration.width,
        "version": calibration.version,
    }


def _print_rows(sweep: Sweep, cases: DesignCases) -> None:
    shown: list[list[str]] = []
    for row in sweep.rows():
        if len(shown) == MOST_ROWS_PRINTED:
            break
        shown.append(_cells(row, cases.names))
    title = f"Sweep of {len(cases)} cases"
    if len(cases) > len(shown):
        title += f", the first {len(shown)}; all of them are in sweep.csv"
    extra = [name for name in cases.names if name not in OWN_PARAMETERS]
    found = ("S [rad]", "estimate [rad]", "interval [rad]", "error [rad]", "error [%]")
    head = ["actual [rad]", "noise [rad]", *extra, *found]
    print_table(title, head, shown)


def _cells(row: Row, names: tuple[str, ...]) -> list[str]:
    p = row.case.parameters
    extra = [str(p[name]) for name in names if name not in OWN_PARAMETERS]
    start = [f"{p['alpha']:.6g}", f"{p['noise']:g}", *extra]
    if row.outcome.status is not Status.DONE:
        return [*start, row.outcome.status.value, row.outcome.message, "", "", ""]
    total, estimate, lower, upper, error, percent = (float(v or 0.0) for v in row.outcome.values)
    interval = f"{lower:.8g} .. {upper:.8g}"
    return [*start, f"{total:.6g}", f"{estimate:.8g}", interval, f"{error:.2e}", f"{percent:.4f}"]


def _print_statistics(statistics: dict[float, ErrorStatistics], total: int, failed: int) -> None:
    rows = [
        [
            f"{level:g}",
            str(s.count),
            f"{s.mean_percent:.4f}",
            f"{s.worst_percent:.4f}",
            f"{s.mse:.3e}",
            f"{100.0 * s.coverage:.1f}",
        ]
        for level, s in statistics.items()
    ]
    title = f"Errors by noise level ({total - failed} of {total} cases done, {failed} failed)"
    head = ("noise [rad]", "cases", "mean error [%]", "worst [%]", "MSE [rad^2]", "intervals that hold the size [%]")
    print_table(title, head, rows)


def _draw(directory: Path, plan: SweepPlan, fmus: dict[str, Path], arrays: SweepArrays) -> None:
    if not len(arrays.actual):
        return
    name = plan.experiment.name
    draw_estimates(
        directory / "estimates.png",
        arrays.actual,
        arrays.estimate,
        arrays.lower,
        arrays.upper,
        arrays.noise,
        f"Estimated half-gap with 95 % intervals ({name} experiment)",
    )
    draw_errors(
        directory / "errors.png",
        arrays.actual,
        arrays.estimate,
        arrays.noise,
        f"Error against size ({name} experiment)",
    )
    middle = float(np.sort(arrays.actual)[len(arrays.actual) // 2])
    pair = run_pair(with_settings(plan.experiment, noise=plan.noise[-1]), fmus, middle, plan.seed)
    title = f"Paired loops, half-gap {middle:.4g} rad"
    draw_pair(directory / "loops.png", pair.machine, pair.twin, plan.experiment.reference()[0], title)
