"""A record as a map names its columns, and a model: values of parameters, effects, and their values."""

from collections.abc import Hashable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fmu.bank import BoxEffect

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Data:
    """The columns of a record that a map names.

    Attributes:
        time: (n,) s, uniform.
        inputs: (n, inputs) in the order of the map.
        outputs: (n, outputs).
        source: file name, for messages.
        signals: (n, signals), off their references.
        factor: rows of the file for one of these.
        notes: what was detected and filled when the file was read.
        held: (n * factor, inputs) inputs in all rows of the file, where there are more; ``inputs`` are their means.
    """

    time: Array
    inputs: Array
    outputs: Array
    source: str
    signals: Array = field(default_factory=lambda: np.zeros((0, 0)))
    factor: int = 1
    held: Array | None = None
    notes: tuple[str, ...] = ()

    @property
    def driven(self) -> Array:
        """Return the inputs as the file has them, (rows of the file, inputs)."""
        return self.inputs if self.held is None else self.held

    @cached_property
    def sizes(self) -> Array:
        """Return the root mean square of each input, (inputs,): every run with an effect at a port asks for it."""
        return np.asarray(np.sqrt(np.mean(self.driven**2, axis=0)))

    @property
    def size(self) -> int:
        """Return the number of rows."""
        return len(self.time)

    def part(self, first: int, end: int) -> "Data":
        """Return some rows."""
        rows = slice(first, end)
        held = None if self.held is None else self.held[first * self.factor : end * self.factor]
        signals = self.signals[rows] if len(self.signals) else self.signals
        return replace(
            self, time=self.time[rows], inputs=self.inputs[rows], outputs=self.outputs[rows], signals=signals, held=held
        )

    @property
    def step(self) -> float:
        """Return the sample time [s]."""
        return float((self.time[-1] - self.time[0]) / (len(self.time) - 1))


@dataclass(frozen=True, eq=False)
class BoxModel:
    """A model: values of the uncertain parameters, effects, and their values."""

    p: Array
    effects: tuple[BoxEffect, ...] = ()
    values: tuple[Array, ...] = ()

    @property
    def key(self) -> Hashable:
        """What two models of the same run have in common."""
        effects = tuple((e.label, e.at_rest, tuple(v.tolist())) for e, v in zip(self.effects, self.values, strict=True))
        return tuple(self.p.tolist()), effects

    def extended(self, effect: BoxEffect, values: Array) -> "BoxModel":
        """Return this model with one more effect."""
        return BoxModel(self.p, (*self.effects, effect), (*self.values, np.asarray(values, dtype=float)))
