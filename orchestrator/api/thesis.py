"""Every published number of the thesis beside the recomputed one."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import msgspec

from orchestrator.api.plotted import PlottedResult
from orchestrator.api.shown import Block, text_table
from orchestrator.paired.calibration import estimate_gap, load_or_calibrate
from orchestrator.paired.compiled_loop import make_loop
from orchestrator.paired.experiment import thesis_experiment
from orchestrator.paired.metric import difference_sum
from orchestrator.paired.thesis import published
from orchestrator.paired.thesis.errata import errata
from orchestrator.paired.thesis.recompute import gain_comparisons, table_comparison
from orchestrator.shared.results.thesis import (
    Comparison,
    Erratum,
    TableComparison,
    ThesisFound,
    ThesisTable,
    thesis_tables,
)


@dataclass(frozen=True, repr=False)
class ThesisResult(PlottedResult):
    """The thesis's numbers and ours.

    Attributes:
        gains: model and gains, published and recomputed.
        table: Table 4.1, recomputed with the thesis's own map.
        estimates: our estimates of the table's sizes [rad].
        errata: what the thesis prints and should.
        arguments: always empty, as `thesis` takes none.
    """

    command: ClassVar[str] = "thesis"
    gains: tuple[Comparison, ...]
    table: TableComparison
    estimates: tuple[float, ...]
    errata: tuple[Erratum, ...]
    arguments: Mapping[str, Any] = field(default_factory=dict)

    def blocks(self) -> Sequence[Block]:
        """Return the tables of gains, sizes, errata and of others' results."""
        t = self.table
        note = (
            f"Quadratic map through the table: largest deviation {t.largest_deviation:.4f} rad. "
            f"Mean error {t.mean_error_percent:.2f} %, MSE {t.mse:.3e} (printed {published.MSE_TABLE:.3e})."
        )
        tests = (
            f"The thesis's 100 random tests: mean error {published.MEAN_ERROR_100_TESTS} %, "
            f"MSE {published.MSE_100_TESTS:.5e}; its simulations cannot be repeated, for its filter is told the size "
            '(erratum 6). A sweep of the experiment "thesis" runs our own on the same sizes.'
        )
        gains, sizes, *others = map(text_table, thesis_tables(self.results()))
        return [gains, sizes, note, tests, *others]

    def results(self, place: Path | None = None) -> ThesisFound:
        """Return what ``thesis.json`` says."""
        measured = msgspec.structs.asdict(self.table)
        whole = ThesisTable(**measured, rows=published.TABLE_4_1, our_estimates=self.estimates)
        return ThesisFound(gains=self.gains, table=whole, errata=self.errata, others=published.OTHERS)


def thesis() -> ThesisResult:
    """Recompute every published number of the thesis.

    Returns:
        Gains, Table 4.1 and errata, each published value beside the recomputed one.

    Examples:
        >>> ours = oc.thesis()
        >>> len(ours.estimates)
        8
    """
    return ThesisResult(tuple(gain_comparisons()), table_comparison(), _our_estimates(), tuple(errata()))


def _our_estimates() -> tuple[float, ...]:
    experiment = thesis_experiment()
    calibration = load_or_calibrate(experiment)
    loop = make_loop(experiment)
    errors = experiment.encoder_errors(0)
    twin = loop.run(0.0, errors)[:, 2]
    sums = [difference_sum(loop.run(row.alpha, errors)[:, 2], twin) for row in published.TABLE_4_1]
    return tuple(estimate_gap(calibration, total).alpha for total in sums)
