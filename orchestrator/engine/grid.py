"""Designs: which values of which parameters a sweep visits.

Every design computes its row ``i`` from ``i`` alone, so a sweep of any size needs no memory. Names are
``instance.parameter`` (``plant.alpha``) or whatever the work function understands.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import Any, ClassVar, Protocol

import numpy as np

from orchestrator.engine.cases import Case, Cases, Value
from orchestrator.errors import ScenarioError

SOBOL_BLOCK = 1024
MAX_CASES = 10**9  # a Sobol sequence has 2**30 points


class Design(Protocol):
    """Rows of parameter values, computed on demand; a dataclass, whose fields and ``kind`` determine every row."""

    kind: ClassVar[str]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, one per value of a row."""

    def __len__(self) -> int: ...

    def row(self, index: int) -> tuple[Value, ...]:
        """Return the values of row ``index``, ``0 <= index < len(self)``."""

    def definition(self) -> Mapping[str, Any]:
        """Return plain JSON data that determine every row."""
        return {"kind": self.kind, **asdict(self)}  # type: ignore[call-overload]


@dataclass(frozen=True)
class Listed(Design):
    """The given values of one parameter, in the given order."""

    kind = "list"
    name: str
    values: tuple[Value, ...]

    def __post_init__(self) -> None:
        if not self.values:
            raise ScenarioError(f"`{self.name}` must have at least one value, but has none")
        for value in self.values:
            _finite(self.name, value)

    @property
    def names(self) -> tuple[str, ...]:
        return (self.name,)

    def __len__(self) -> int:
        return len(self.values)

    def row(self, index: int) -> tuple[Value, ...]:
        return (self.values[index],)


@dataclass(frozen=True)
class Ranged(Design):
    """``count`` values of one parameter from ``first`` to ``last``, both included, evenly or log-evenly spaced."""

    kind = "range"
    name: str
    first: float
    last: float
    count: int
    logarithmic: bool = False

    def __post_init__(self) -> None:
        _finite(self.name, self.first)
        _finite(self.name, self.last)
        _positive_count(self.name, self.count)
        if self.logarithmic and not (self.first > 0.0 and self.last > 0.0):
            raise ScenarioError(
                f"`{self.name}` must be positive for a logarithmic range, but is {self.first}:{self.last}"
            )

    @property
    def names(self) -> tuple[str, ...]:
        return (self.name,)

    def __len__(self) -> int:
        return self.count

    def row(self, index: int) -> tuple[Value, ...]:
        """Return the value at ``index``; the ends are exact."""
        if index == 0:
            return (self.first,)
        if index == self.count - 1:
            return (self.last,)
        return (_between(self.first, self.last, index / (self.count - 1), self.logarithmic),)


@dataclass(frozen=True)
class Bounds:
    """Interval from which a parameter is drawn, evenly or log-evenly."""

    name: str
    low: float
    high: float
    logarithmic: bool = False

    def __post_init__(self) -> None:
        _finite(self.name, self.low)
        _finite(self.name, self.high)
        if not self.low < self.high:
            raise ScenarioError(
                f"`{self.name}` must have a lower bound below its upper one, but is {self.low}:{self.high}"
            )
        if self.logarithmic and not self.low > 0.0:
            raise ScenarioError(f"`{self.name}` must be positive for a logarithmic draw, but is {self.low}:{self.high}")

    def at(self, fraction: float) -> float:
        """Map ``fraction`` in [0, 1) into the interval."""
        return _between(self.low, self.high, fraction, self.logarithmic)


@dataclass(frozen=True)
class _Drawn(Design):
    """``count`` points over all ``bounds`` together, determined by ``seed``."""

    bounds: tuple[Bounds, ...]
    count: int
    seed: int

    def __post_init__(self) -> None:
        _positive_count("samples", self.count)

    @property
    def names(self) -> tuple[str, ...]:
        """Names in the order of the bounds."""
        return tuple(b.name for b in self.bounds)

    def __len__(self) -> int:
        return self.count

    def row(self, index: int) -> tuple[Value, ...]:
        """Return point ``index``, a function of (seed, index) only."""
        return tuple(b.at(float(f)) for b, f in zip(self.bounds, self._fractions(index), strict=True))

    def _fractions(self, index: int) -> np.ndarray:
        """Return where point ``index`` lies within the bounds, each in [0, 1)."""
        raise NotImplementedError


class Randomised(_Drawn):
    """Independent uniform draws."""

    kind = "random"

    def _fractions(self, index: int) -> np.ndarray:
        generator = np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(1, index)))
        return generator.random(len(self.bounds))


class Sobol(_Drawn):
    """Points of a Sobol sequence with Owen scrambling."""

    kind = "sobol"

    def _fractions(self, index: int) -> np.ndarray:
        block, offset = divmod(index, SOBOL_BLOCK)
        return np.asarray(_sobol_block(len(self.bounds), self.seed, block)[offset])


@dataclass(frozen=True)
class Product(Design):
    """Every combination of the rows of several designs; the last design varies fastest."""

    kind = "product"
    designs: tuple[Design, ...]

    def __post_init__(self) -> None:
        names = self.names
        for name in names:
            if names.count(name) > 1:
                raise ScenarioError(f"`{name}` must be varied once, but is varied {names.count(name)} times")
        count = math.prod(len(d) for d in self.designs)
        if count > MAX_CASES:
            raise ScenarioError(f"a sweep must have at most {MAX_CASES:,} cases, but has {count:,}")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all designs in order."""
        return tuple(name for d in self.designs for name in d.names)

    def __len__(self) -> int:
        return math.prod(len(d) for d in self.designs)

    def row(self, index: int) -> tuple[Value, ...]:
        """Return combination ``index``."""
        parts: list[tuple[Value, ...]] = []
        for design in reversed(self.designs):
            index, within = divmod(index, len(design))
            parts.append(design.row(within))
        return tuple(value for part in reversed(parts) for value in part)

    def definition(self) -> Mapping[str, Any]:
        """Return kind and the parts' definitions."""
        return {"kind": self.kind, "designs": [d.definition() for d in self.designs]}


@dataclass(frozen=True)
class DesignCases(Cases):
    """A design seen as the engine's cases."""

    design: Design
    seed: int

    @property
    def names(self) -> tuple[str, ...]:
        return self.design.names

    def __len__(self) -> int:
        return len(self.design)

    def __getitem__(self, index: int) -> Case:
        if not 0 <= index < len(self):
            raise IndexError(index)
        return Case(index, dict(zip(self.names, self.design.row(index), strict=True)), self.seed)

    def definition(self) -> Mapping[str, Any]:
        """Return the design's definition, the number of cases and the seed."""
        return {"design": self.design.definition(), "cases": len(self), "seed": self.seed}


@lru_cache(maxsize=4)
def _sobol_block(dimension: int, seed: int, block: int) -> np.ndarray:
    """Points ``block * SOBOL_BLOCK ...`` of the scrambled sequence, shape (SOBOL_BLOCK, dimension)."""
    from scipy.stats import qmc  # takes a second to import, which every worker process would pay

    generator = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(2,)))
    engine = qmc.Sobol(dimension, scramble=True, seed=generator)
    if block:
        engine.fast_forward(block * SOBOL_BLOCK)
    return np.asarray(engine.random(SOBOL_BLOCK))


def _between(low: float, high: float, fraction: float, logarithmic: bool) -> float:
    if logarithmic:
        return low * math.exp(fraction * math.log(high / low))
    return low + fraction * (high - low)


def _finite(name: str, value: Value) -> None:
    if isinstance(value, float) and not math.isfinite(value):
        raise ScenarioError(f"`{name}` must be finite, but is {value}")


def _positive_count(name: str, count: int) -> None:
    if not 1 <= count <= MAX_CASES:
        raise ScenarioError(f"the count of `{name}` must be 1 to {MAX_CASES:,}, but is {count:g}", name)
