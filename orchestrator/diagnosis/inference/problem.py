"""Records of one machine beside one model: whitened residuals, their derivatives, the prior, blocks."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.inference.whitening import Whitening, band_only, estimate_whitening
from orchestrator.diagnosis.model.interface import (
    CandidateEffect,
    ModelPoint,
    ResidualModel,
    UncertainParameter,
    Values,
)
from orchestrator.diagnosis.settings import FitSettings
from orchestrator.shared.arrays import Array

Coordinate = int | tuple[str, int]
"""Place of an uncertain parameter, or label of an effect and place of one of its values."""

SMALL_SHARE = 1e-3  # of a parameter, for its derivative
FARTHEST = 1e-3  # of its nominal value, below which no parameter falls


@dataclass(frozen=True, eq=False)
class FitProblem:
    """Records beside a model that they share."""

    models: tuple[ResidualModel, ...]  # one for each record; they share effects and all parameters but local ones
    whitenings: tuple[Whitening, ...]  # one for each record
    settings: FitSettings
    # by how much blocks differ more than white residuals do, as a factor on variances: the prior counts for as much
    # more
    overdispersion: float = 1.0
    first: ModelPoint | None = None  # values from which a fit without effects begins too, beside the nominal ones

    @cached_property
    def shared(self) -> tuple[UncertainParameter, ...]:
        """Parameters that all records share."""
        return tuple(entry for entry in self.models[0].parameters if not entry.local)

    @cached_property
    def parameters(self) -> tuple[UncertainParameter, ...]:
        """All parameters: shared ones, then the local ones of each record."""
        return (*self.shared, *(entry for model in self.models for entry in model.parameters if entry.local))

    @property
    def reported(self) -> dict[str, int]:
        """Return the places of the parameters to report by name; a value of one record has its number behind it."""
        found = {entry.name: n for n, entry in enumerate(self.shared)}
        place = len(self.shared)
        for number, model in enumerate(self.models, 1):
            for entry in (entry for entry in model.parameters if entry.local):
                if entry.reported:
                    found[entry.name if len(self.models) == 1 else f"{entry.name} of record {number}"] = place
                place += 1
        return found

    @cached_property
    def effects(self) -> dict[str, CandidateEffect]:
        """Return the effects by label that a record shows at least, as the first one that does has them."""
        return {label: one for model in reversed(self.models) for label, one in model.effects.items()}

    @property
    def start(self) -> ModelPoint:
        """Return the nominal point: no effect."""
        return ModelPoint.nominal(self.parameters)

    @cached_property
    def blocks(self) -> NDArray[np.int64]:
        """(rows,) block of each whitened residual: contiguous in time, none reaches over two records."""
        return self.blocks_after([0.0] * len(self.models))[0]

    def blocks_after(self, shares: Sequence[float]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the blocks of the whitened residuals after a share of each record, and their places (rows,) among all.

        Blocks are contiguous in time and within one record. All have about as many rows that say something: by rows
        alone a block of a machine at rest would be empty.
        """
        late = [
            whitening.rows >= share * model.size
            for whitening, share, model in zip(self.whitenings, shares, self.models, strict=True)
        ]
        active = [whitening.active.max(axis=0) > 0.0 for whitening in self.whitenings]
        total = sum(int(rows.sum()) for rows in late)
        wanted = min(self.settings.blocks, max(total // self.settings.rows_per_block, 4))
        blocks, places, first, offset = [], [], 0, 0
        for whitening, rows, says in zip(self.whitenings, late, active, strict=True):
            channels = len(whitening.active)
            number = max(round(wanted * int(rows.sum()) / total), 1) if rows.any() else 0
            before = np.maximum(np.cumsum(says[rows]) - 1, 0)
            blocks.append(np.tile(first + before * number // max(int(says[rows].sum()), 1), channels))
            places.append(offset + np.flatnonzero(np.tile(rows, channels)))
            first, offset = first + number, offset + whitening.size
        return np.concatenate(blocks), np.concatenate(places)

    @property
    def block_count(self) -> int:
        """Return the number of blocks."""
        return int(self.blocks[-1]) + 1

    def record_points(self, point: ModelPoint) -> list[ModelPoint]:
        """Return what each record's model sees of a point."""
        place, found = len(self.shared), []
        for model in self.models:
            count = sum(entry.local for entry in model.parameters)
            local = point.parameters[place : place + count]
            found.append(ModelPoint((*point.parameters[: len(self.shared)], *local), point.effects))
            place += count
        return found

    def whiten_residuals(self, points: Sequence[ModelPoint]) -> list[Array]:
        """Return the whitened residuals (rows,) of all records at each of some points."""
        seen = [self.record_points(point) for point in points]
        parts = [
            [whitening.apply(found) for found in model.residuals([of_records[n] for of_records in seen])]
            for n, (model, whitening) in enumerate(zip(self.models, self.whitenings, strict=True))
        ]
        return [np.concatenate(of_records) for of_records in zip(*parts, strict=True)]

    def changes(self, point: ModelPoint, residual: Array, trials: Sequence[tuple[str, Values]]) -> list[Array]:
        """Return what each effect changes (rows,) of the whitened residuals, approximately where a model can tell."""
        found = [np.empty(residual.size) for _ in trials]
        first = 0
        for model, whitening, seen in zip(self.models, self.whitenings, self.record_points(point), strict=True):
            rows = slice(first, first + whitening.size)
            first += whitening.size
            changes = model.approximate_changes(seen, trials)
            exact = [n for n, change in enumerate(changes) if change is None]
            for n, left in zip(exact, model.residuals([seen.with_effect(*trials[n]) for n in exact]), strict=True):
                found[n][rows] = whitening.apply(left) - residual[rows]
            for n, change in enumerate(changes):
                if change is not None:
                    found[n][rows] = whitening.apply(change)
        return found

    def reweight(self, point: ModelPoint, quiet: bool = False) -> "FitProblem":
        """Return the problem with the whitening that the residuals at a point ask for."""
        seen = self.record_points(point)
        found = tuple(
            estimate_whitening(model, model.residuals([one])[0], self.settings, quiet)
            for model, one in zip(self.models, seen, strict=True)
        )
        return replace(self, whitenings=found)

    # --- coordinates ---------------------------------------------------------------------------------------

    def coordinates(self, point: ModelPoint) -> list[Coordinate]:
        """Return what a fit moves: every parameter, and the values of effects that are not scanned."""
        fitted = ((label, n) for label in point.effects for n in self.effects[label].fitted)
        return [*range(len(self.parameters)), *fitted]

    def move_point(self, point: ModelPoint, coordinates: Sequence[Coordinate], steps: Array) -> ModelPoint:
        """Return a point moved by steps (coordinates,): shares of parameters, scales of values; bounds are kept."""
        parameters = list(point.parameters)
        effects = {label: list(values) for label, values in point.effects.items()}
        for coordinate, step in zip(coordinates, steps, strict=True):
            if isinstance(coordinate, int):
                entry = self.parameters[coordinate]
                moved, least = parameters[coordinate] + float(step) * entry.unit_step, FARTHEST * entry.nominal
                if entry.scale is None:
                    moved = max(moved, least) if least > 0 else min(moved, least)
                parameters[coordinate] = entry.limit(moved)
            else:
                label, place = coordinate
                effect = self.effects[label]
                value = effects[label][place] + float(step) * effect.scales[place]
                effects[label][place] = effect.clip_value(place, value)
        return ModelPoint(tuple(parameters), {label: tuple(values) for label, values in effects.items()})

    def jacobian(self, point: ModelPoint, coordinates: Sequence[Coordinate], residual: Array) -> Array:
        """Return the derivatives (rows, coordinates) of the whitened residuals by differences.

        Raises:
            LinAlgError: there are none, since the machine runs away.
        """
        steps = [self._small_step(point, one) if isinstance(one, int) else 1.0 for one in coordinates]
        points = [self.move_point(point, [one], np.array([s])) for one, s in zip(coordinates, steps, strict=True)]
        columns = self.whiten_residuals(points)
        if not columns:  # nothing is uncertain
            return np.zeros((residual.size, 0))
        slopes = np.column_stack([(found - residual) / s for found, s in zip(columns, steps, strict=True)])
        if not np.isfinite(np.linalg.norm(slopes)):  # LAPACK would print a line before it says so
            raise np.linalg.LinAlgError("the machine runs away")
        return slopes

    def _small_step(self, point: ModelPoint, number: int) -> float:
        """Return a small share of what a parameter moves in, away from a limit that is near."""
        entry, value = self.parameters[number], point.parameters[number]
        step = SMALL_SHARE * entry.unit_step
        return -SMALL_SHARE if entry.limit(value + step) != value + step else SMALL_SHARE

    def held(self, point: ModelPoint, coordinates: Sequence[Coordinate], gradient: Array) -> NDArray[np.bool_]:
        """Return which coordinates (coordinates,) a limit of a parameter keeps from where the cost falls.

        Args:
            gradient: (coordinates,) of half the cost, by shares of the parameters.
        """
        return np.array(
            [
                isinstance(one, int)
                and self.parameters[one].stops(point.parameters[one], -slope * self.parameters[one].unit_step)
                for one, slope in zip(coordinates, gradient.tolist(), strict=True)
            ],
            dtype=bool,
        )

    def prior(self, point: ModelPoint, coordinates: Sequence[Coordinate]) -> tuple[Array, Array]:
        """Return the prior's residuals (coordinates,) and their derivatives, each by its own coordinate."""
        values, slopes = np.zeros(len(coordinates)), np.zeros(len(coordinates))
        for n, coordinate in enumerate(coordinates):
            if isinstance(coordinate, int):
                values[n], slopes[n] = prior_of(self.parameters[coordinate], point.parameters[coordinate])
            else:
                label, place = coordinate
                effect = self.effects[label]
                if place in effect.prior:
                    mean, deviation = effect.prior[place]
                    values[n] = (point.effects[label][place] - mean) / deviation
                    slopes[n] = effect.scales[place] / deviation
        weight = np.sqrt(self.overdispersion)
        return values * weight, slopes * weight

    def is_possible(self, label: str, point: ModelPoint) -> bool:
        """Tell whether a machine can have an effect as a point has it, and one of the records can show it."""
        pairs = zip(self.models, self.record_points(point), strict=True)
        return any(model.is_possible(label, seen) for model, seen in pairs)


def prior_of(entry: UncertainParameter, value: float) -> tuple[float, float]:
    """Return a parameter's distance from its nominal value in standard deviations, and its slope by a unit step."""
    if entry.scale is not None:
        return (value - entry.nominal) / entry.scale / entry.deviation, 1.0 / entry.deviation
    ratio = value / entry.nominal
    return float(np.log(ratio)) / entry.deviation, 1.0 / ratio / entry.deviation


def fit_problem(models: Sequence[ResidualModel], settings: FitSettings, first: ModelPoint | None = None) -> FitProblem:
    """Return the problem of some records, whitened by what the first model leaves."""
    problem = FitProblem(tuple(models), tuple(band_only(model, settings) for model in models), settings, first=first)
    return problem.reweight(first or problem.start)
