"""Laws of the drive's timing, judged at the rate at which a record was measured.

Where a controller answers the encoder within a row of the analysis, that row's torque holds the answer to what has
disturbed the machine in it: a later torque predicts better, whatever the drive does. At the measured rate a controller
answers from row to row, and a delay of the drive's own is still there.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Parts
from orchestrator.diagnosis.fit.rate import Analysis
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.slope import Free
from orchestrator.diagnosis.fit.together import series
from orchestrator.diagnosis.search.candidate import Candidate, annealed
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.plants.description import Plant
from orchestrator.plants.effects import Effect

Array = NDArray[np.float64]


def is_timed(plant: Plant, effect: Effect) -> bool:
    """Tell whether an effect says when torques act.

    Args:
        plant: the plant.
        effect: of its bank.

    Returns:
        True when it does.
    """
    return plant.entry(effect.places(plant)[effect.size]).unit == "s" and not effect.both_encoders


@dataclass(frozen=True)
class Finer:
    """Records as they were measured, where they are analysed at a lower rate.

    Attributes:
        plant, nominal, settings: of the diagnosis.
        analyses: of the records.
    """

    plant: Plant
    nominal: Array
    settings: DiagnosisSettings
    analyses: Sequence[Analysis]

    @cached_property
    def _likelihood(self) -> tuple[RecordLikelihood, Parts]:
        lag = self.plant.value(self.nominal, self.plant.drive.lag)
        fit = replace(self.settings.fit, most_fitted=self.settings.rate.most_measured)
        signals, parts = series([one.measured for one in self.analyses], lag, replace(self.settings, fit=fit))
        return RecordLikelihood(self.plant, signals, self.nominal, parts.validated.stop, self.settings), parts

    def refutes(self, candidate: Candidate, before: Candidate, free: tuple[Sequence[Free], Sequence[Free]]) -> bool:
        """Tell whether the last effect of a model, one of the drive's timing, does not pay at the measured rate.

        Args:
            candidate: the model.
            before: the model without that effect.
            free: what is fitted of each.

        Returns:
            True when it does not.
        """
        likelihood, parts = self._likelihood
        without, own = (
            Candidate(
                one.effects, annealed(likelihood, one.fit.p, one.fit.q, entries, parts, one.effects), one.settings
            )
            for one, entries in zip((before, candidate), reversed(free), strict=True)
        )
        return own.gain_over(without) < self.settings.search.pays

    def words(self, effect: Effect) -> str:
        """Return why an effect was refused, in words.

        Args:
            effect: that was.

        Returns:
            The words.
        """
        coarse, fine = (1.0 / record.step for record in (self.analyses[0].record, self.analyses[0].measured))
        return (
            f"{effect.name} ({effect.site}) shows at the {coarse:.4g} Hz of the analysis, not at the {fine:.4g} Hz of "
            "the record: a controller that answers within a row looks like it"
        )


def finer_of(analyses: Sequence[Analysis], plant: Plant, nominal: Array, settings: DiagnosisSettings) -> Finer | None:
    """Return the records as they were measured; None: they are analysed at that rate.

    Args:
        analyses: of the records.
        plant: the plant.
        nominal: its nominal parameters.
        settings: of the diagnosis.

    Returns:
        The records.
    """
    return Finer(plant, nominal, settings, analyses) if analyses[0].record is not analyses[0].measured else None
