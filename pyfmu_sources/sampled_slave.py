"""Base of the sampled-data slaves: a clock of sample instants ``start + n sample_time``.

A communication step ends at or before the next sample instant. The sample is taken at the end of the step, from the
inputs as they are then set; between samples the outputs hold. A step over a sample instant is refused, so that a
communication step must divide ``sample_time`` a whole number of times.

Outputs depend on inputs directly. A master that runs plant, estimator and controller one after the other sets inputs of
the step's end before the step; one that runs them side by side sets them after it and reads the outputs again.
Both see the same values: an output read after inputs have been set at a sample instant takes that sample anew.
"""

from __future__ import annotations

from typing import Any, ClassVar

from .slave_base import SlaveBase, StepRefusedError

SLACK = 1e-6


class SampledSlave(SlaveBase):
    """A slave with a sample clock; subclasses implement ``begin``, ``predict`` and ``correct``."""

    feedthrough = True
    sample_time_reference: ClassVar[int] = 0

    def begin(self) -> None:
        """Compute the outputs at the first sample instant."""
        raise NotImplementedError

    def predict(self) -> None:
        """Move the hidden state to the next sample instant, with the inputs of the step that ends there."""

    def correct(self) -> None:
        """Compute the outputs of this sample instant from the hidden state and the inputs; may be repeated."""
        raise NotImplementedError

    def take_parameters(self) -> None:
        """Collect the parameters from the values."""
        raise NotImplementedError

    def initialise(self) -> None:
        """Start the clock."""
        self.take_parameters()
        self._samples = 0
        self._at_sample = True
        self.begin()

    def advance(self, time: float, step: float) -> None:
        """Hold the outputs, or take a sample when the step ends at one."""
        period = self.real[self.sample_time_reference]
        due = self.start_time + (self._samples + 1) * period
        early = due - time - step
        if early < -SLACK * period:
            raise StepRefusedError(
                f"a step must not pass the sample at t = {due!r}, but ends at {time + step!r}; "
                f"take a step that divides `sample_time` = {period!r} s a whole number of times"
            )
        self._at_sample = early <= SLACK * period
        if self._at_sample:
            self.predict()
            self.correct()
            self._samples += 1

    def refresh(self) -> None:
        """Take the present sample anew with the inputs as they are now."""
        if self._at_sample:
            if self._samples:
                self.correct()
            else:
                self.begin()

    def saved(self) -> Any:
        """Return the clock; subclasses add to it."""
        return [self._samples, self._at_sample]

    def restore(self, saved: Any) -> None:
        """Take over a saved clock."""
        self.take_parameters()
        self._samples, self._at_sample = saved
