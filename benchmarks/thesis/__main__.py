"""Every published number of the thesis beside the recomputed one, errata included.

python -m benchmarks.thesis
"""

from collections.abc import Sequence

from benchmarks.thesis import published
from benchmarks.thesis.errata import errata
from benchmarks.thesis.recompute import gain_comparisons, table_comparison
from benchmarks.thesis.tables import thesis_tables
from orchestrator.api.shown import Block, text_of
from orchestrator.paired.calibration import estimate_gap, load_or_calibrate
from orchestrator.paired.compiled_loop import make_loop
from orchestrator.paired.experiment import thesis_experiment
from orchestrator.paired.metric import difference_sum
from orchestrator.shared.results.fields import fields_table
from tools import refuse_arguments


def compared_numbers() -> Sequence[Block]:
    """Return the tables of gains, sizes, errata and of others' results."""
    t = table_comparison()
    gains, sizes = thesis_tables(gain_comparisons(), published.TABLE_4_1, t, our_estimates())
    note = (
        f"Quadratic map through the table: largest deviation {t.largest_deviation:.4f} rad. "
        f"Mean error {t.mean_error_percent:.2f} %, MSE {t.mse:.3e} (printed {published.MSE_TABLE:.3e})."
    )
    tests = (
        f"The thesis's 100 random tests: mean error {published.MEAN_ERROR_100_TESTS} %, "
        f"MSE {published.MSE_100_TESTS:.5e}; its simulations cannot be repeated, for its filter is told the size "
        '(erratum 6). A sweep of the experiment "thesis" runs our own on the same sizes.'
    )
    others = fields_table("Results of others, as the thesis quotes them", published.OTHERS)
    return [gains, sizes, note, tests, fields_table("Errata", errata()), others]


def our_estimates() -> tuple[float, ...]:
    """Return our estimates [rad] of the table's sizes, from runs without noise."""
    experiment = thesis_experiment()
    calibration = load_or_calibrate(experiment)
    loop = make_loop(experiment)
    errors = experiment.encoder_errors(0)
    twin = loop.run(0.0, errors)[:, 2]
    sums = [difference_sum(loop.run(row.alpha, errors)[:, 2], twin) for row in published.TABLE_4_1]
    return tuple(estimate_gap(calibration, total).alpha for total in sums)


if __name__ == "__main__":
    refuse_arguments(__doc__)
    print(text_of(compared_numbers()))
