"""``thesis``: every published number beside the recomputed one, errata included."""

import argparse
from dataclasses import asdict
from typing import Any

from orchestrator.commands._console import print_table
from orchestrator.output import staged, write_result
from orchestrator.paired.calibration import estimate_gap, load_or_calibrate
from orchestrator.paired.compiled_loop import compiled_loop
from orchestrator.paired.experiment import thesis_experiment
from orchestrator.paired.metric import difference_sum
from orchestrator.reporting import write_report
from orchestrator.thesis import published
from orchestrator.thesis.errata import Erratum, errata
from orchestrator.thesis.recompute import Comparison, gain_comparisons, table_comparison


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Nothing to add: the thesis is what it is."""
    del parser


def run(arguments: argparse.Namespace) -> int:
    """Recompute, print and write."""
    with staged(arguments.out) as directory:
        gains = gain_comparisons()
        table = table_comparison()
        ours = _our_estimates()
        mistakes = errata()
        _print_gains(gains)
        _print_table(table.estimates, table.errors_percent, ours)
        print(
            f"Quadratic map through the table: largest deviation {table.largest_deviation:.4f} rad. "
            f"Mean error {table.mean_error_percent:.2f} %, MSE {table.mse:.3e} (printed {published.MSE_TABLE:.3e}).\n"
            f"The thesis's 100 random tests: mean error {published.MEAN_ERROR_100_TESTS} %, "
            f"MSE {published.MSE_100_TESTS:.5e}; its simulations cannot be repeated, for its filter is told the size "
            "(erratum 6). `sweep --experiment thesis` runs our own on the same sizes.\n"
        )
        _print_errata(mistakes)
        rows = [(o.who, o.method, o.figure) for o in published.OTHERS]
        print_table("Results of others that the thesis compares itself with (as it quotes them)", OTHERS_HEAD, rows)
        results: dict[str, Any] = {
            "gains": [asdict(c) for c in gains],
            "table": asdict(table) | {"rows": [asdict(r) for r in published.TABLE_4_1], "our_estimates": ours},
            "errata": [asdict(e) for e in mistakes],
            "others": [asdict(o) for o in published.OTHERS],
        }
        write_result(directory, "thesis", {}, None, results)
        write_report(directory, "thesis")
    print(f"Written to {arguments.out}: report.html, thesis.json")
    return 0


OTHERS_HEAD = ("who", "method", "figure")


def _our_estimates() -> list[float]:
    experiment = thesis_experiment()
    calibration = load_or_calibrate(experiment)
    loop = compiled_loop(experiment)
    errors = experiment.encoder_errors(0)
    twin = loop.run(0.0, errors)[:, 2]
    sums = [difference_sum(loop.run(row.alpha, errors)[:, 2], twin) for row in published.TABLE_4_1]
    return [estimate_gap(calibration, total).alpha for total in sums]


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(f"{v:.5g}" for v in values)


def _print_gains(gains: list[Comparison]) -> None:
    rows = [
        (
            f"{c.what} ({c.where})",
            _numbers(c.published),
            _numbers(c.recomputed),
            f"{c.deviation:.1e}",
            "agrees" if c.agrees else c.note,
        )
        for c in gains
    ]
    head = ("what", "published", "recomputed", "largest deviation", "")
    print_table("Model and gains, recomputed with the A that the thesis used", head, rows)


def _print_table(mapped: tuple[float, ...], errors: tuple[float, ...], ours: list[float]) -> None:
    rows = [
        (
            f"{row.alpha:.4f}",
            f"{row.S:.3e}",
            f"{row.estimate:.3f}",
            f"{again:.3f}",
            f"{row.error_percent:.2f}",
            f"{error:.2f}",
            f"{own:.4f}",
            f"{100.0 * abs(own - row.alpha) / row.alpha:.4f}",
        )
        for row, again, error, own in zip(published.TABLE_4_1, mapped, errors, ours, strict=True)
    ]
    head = (
        "alpha [rad]",
        "S",
        "estimate",
        "by the quadratic",
        "error [%]",
        "recomputed [%]",
        "our estimate",
        "our error [%]",
    )
    print_table("Table 4.1", head, rows)


def _print_errata(mistakes: list[Erratum]) -> None:
    rows = [(str(e.number), e.where, e.printed, e.right, e.shown_by) for e in mistakes]
    print_table("Errata", ("", "where", "printed", "right", "shown by"), rows)
