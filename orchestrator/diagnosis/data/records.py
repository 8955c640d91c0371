"""Test data: the part of the records that no fit, no score and no choice ever sees.

Only :mod:`orchestrator.diagnosis.report.open_test_data` reads what a :class:`TestData` holds; a test walks the
imports and the syntax trees of the room and fails where anything else does. What the report finds there may lower the
trust in a result. It chooses nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from orchestrator.errors import RecordError, ScenarioError
from orchestrator.plants.description import STEP, Plant
from orchestrator.records.checks import LARGEST_SHARE_MISSING
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record, quantisation_step
from orchestrator.shared.inference.noise import residual_noise


class Rows(Protocol):
    """A record of rows: one of a plant of ours, or the columns that a map names."""

    @property
    def size(self) -> int:
        """Return the number of rows."""

    def part(self: "R", first: int, end: int) -> "R":
        """Return some rows."""


R = TypeVar("R", bound=Rows)


@dataclass(frozen=True, eq=False)
class TestData(Generic[R]):
    """Records of which some rows are test data."""

    __test__ = False  # it is no test case

    _records: tuple[R, ...]  # whole records, so that what a torque was asked for before the test part is known
    _first_rows: tuple[int, ...]  # row at which the test part of each begins


def split_records(records: Sequence[R], share: float, other: R | None = None) -> tuple[tuple[R, ...], TestData[R]]:
    """Return the parts of records that are fitted, and the test data."""
    if other is not None:
        return tuple(records), TestData((other,), (0,))
    first = tuple(round((1.0 - share) * record.size) for record in records)
    fitted = tuple(record.part(0, row) for record, row in zip(records, first, strict=True))
    return fitted, TestData(tuple(records), first)


LEAST_TRAVEL = 20.0  # in deviations of the noise; a long record of noise spans eight
MOST_SUBSTEPS = 100  # integration steps in a sample; more: the model is far too fast
NOISE_WINDOW = 9  # samples of the sliding cubic whose residual is the noise


def check_model(model: Model) -> None:
    """Refuse a model whose plant has no torque balance."""
    reason = model.plant.refused({name: parameter.value for name, parameter in model.parameters.items()})
    if reason:
        raise ScenarioError(f"{model.source}: {reason}")


def check_record(record: Record) -> None:
    """Refuse records that hold nothing to compare a model with."""
    if not np.any(record.u):
        raise RecordError(
            f"{record.source}: column `u` must drive the machine, but is 0 in all {record.size} rows: "
            "a diagnosis needs an excitation"
        )
    filled = record.fill_missing()
    for name in ("theta_m", "theta_l"):
        values = getattr(filled, name)
        if values is None:
            continue
        travel = float(np.ptp(values))
        noise = residual_noise(values, quantisation_step(values), NOISE_WINDOW)
        if travel < LEAST_TRAVEL * noise:
            raise RecordError(
                f"{record.source}: column `{name}` must move by at least {LEAST_TRAVEL:g} standard deviations of its "
                f"noise, but moves by {travel / noise:.2g}: nothing moves, so there is nothing to diagnose"
            )


def check_whole(record: Record) -> None:
    """Refuse a record that holes leave too little of, though no part between them is long enough."""
    share = record.n_missing / record.size
    if share > LARGEST_SHARE_MISSING:
        raise RecordError(
            f"{record.source}: column `time` must have at most {100.0 * LARGEST_SHARE_MISSING:g} % of its rows missing "
            f"between holes, but {100.0 * share:.3g} % are: keep a part without them by `part` START:END"
        )


def check_resolved(plant: Plant, model: Model, record: Record) -> None:
    """Refuse a model that is far faster than the record."""
    p = plant.extend_values(model.values)
    if plant.substeps(p, record.step) > MOST_SUBSTEPS:
        raise ScenarioError(
            f"{model.source}: the model's time constants must be at least {record.step / (MOST_SUBSTEPS * STEP):.2g} s "
            f"for a record with a step of {record.step:g} s, but the shortest is {1.0 / plant.fastest(p):.2g} s"
        )
