"""Base of the sampled-data slaves: a clock of sample instants ``start + n sample_time``.

A communication step should divide ``sample_time`` a whole number of times. The sample is then taken at the end of a
step, from the inputs as they are set; between samples the outputs hold. A step that passes over a sample instant takes
that sample too, but from the inputs held over the step, which are older or newer than the instant: the first such
step says so in a warning.

Outputs depend on inputs directly. A master that runs plant, estimator and controller one after the other sets inputs of
the step's end before the step; one that runs them side by side sets them after it and reads the outputs again.
Both see the same values: an output read after inputs have been set at a sample instant takes that sample anew.
"""

from __future__ import annotations

from typing import Any

from .slave_base import Fmi2Status, SlaveBase, StepRefusedError

SLACK = 1e-6
MOST_SAMPLES = 1_000_000


class SampledSlave(SlaveBase):
    """A slave with a sample clock; subclasses implement ``begin``, ``predict`` and ``correct``."""

    feedthrough = True
    sample_time_reference = 0
    _samples = 0
    _at_sample = _warned = False

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
        """Hold the outputs, or take every sample that is due by the end of the step, ``time + step`` [s]."""
        period = self.real[self.sample_time_reference]
        slack = SLACK * period
        end = time + step
        if step > MOST_SAMPLES * period:
            raise StepRefusedError(f"a step must hold at most {MOST_SAMPLES} samples, but is {step!r} s long")
        self._at_sample = False
        while not self._at_sample:
            due = self.start_time + (self._samples + 1) * period
            if due > end + slack:
                return
            self.predict()
            self.correct()
            self._samples += 1
            self._at_sample = due >= end - slack
            if not self._at_sample:
                self._warn(due, end, period)

    def _warn(self, due: float, end: float, period: float) -> None:
        if not self._warned:
            self._warned = True
            self.say(
                Fmi2Status.warning,
                f"a step should end at the sample at t = {due!r}, but ends at {end!r}: that sample saw the inputs held "
                f"over the step; a step that divides `sample_time` = {period!r} s a whole number of times avoids this",
            )

    def refresh(self) -> None:
        """Take the present sample anew with the inputs as they are now."""
        if self._at_sample:
            if self._samples:
                self.correct()
            else:
                self.begin()

    def saved(self) -> Any:
        """Return the clock and the hidden state."""
        return [self._samples, self._at_sample, super().saved()]

    def restore(self, saved: Any) -> None:
        """Take over a saved clock and hidden state."""
        self._samples, self._at_sample, hidden = saved
        super().restore(hidden)
