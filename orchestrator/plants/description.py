"""A plant as a described object: what it measures, where torques act, its speeds and twist, its events, its effects.

In all functions: ``p``: the parameters of the analysis, (n,).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from orchestrator.effects.effect import Effect
from pyfmu_sources.parameter_rows import BIG, Parameter

Array = NDArray[np.float64]

STATES = 8  # places of the state, as in ``pyfmu_sources.equations``
STEP = 0.35  # of the fastest oscillation: a Runge-Kutta step, whose error then lies far below an encoder's count
FADING = 1.0  # of the fastest time constant of what only fades, where an error of a step fades too


class CompiledEquations(NamedTuple):
    """The compiled equations of a plant, as the analysis takes them.

    Attributes:
        friction: ``friction(x, p)``: levels of dry friction [N.m] of the first and the second body.
        rates: ``rates(x, signs, p, u)``: derivatives of the eight states; ``signs`` are friction's mean directions.
        presliding: places in ``p`` of the logarithm of friction's build-up distance of either body.
        rest: ``rest(p)``: the levels that these distances belong to (zero: the body has no dry friction), and whether
            each depends on more than the body's speed; None: the larger of those at rest and at a high speed.
        flanks: ``flanks(p)``: whether there are teeth or end stops that can meet and part; None: there are none.
        meets: ``meets(x, rates, p, h)``: whether any may do so within ``h`` [s]; None as well.
    """

    friction: Any
    rates: Any
    presliding: tuple[int, int]
    rest: Any = None
    flanks: Any = None
    meets: Any = None


@dataclass(frozen=True)
class Body:
    """A body at which torques act.

    Attributes:
        name: of the site, "motor" or "load".
        angle, speed: places of its states.
        inertia: name of its parameter.
        geared: True if it lies behind the gear.
        encoder: name of the encoder that measures its angle: a column of a record and an output of the FMU.
        viscous: name of its viscous friction; "": it has none.
    """

    name: str
    angle: int
    speed: int
    inertia: str
    encoder: str
    geared: bool = False
    viscous: str = ""


@dataclass(frozen=True)
class Shaft:
    """The elastic shaft and the gear between the two bodies: names of its stiffness, ratio and half-gap ("": none)."""

    stiffness: str
    ratio: str
    gap: str = ""


@dataclass(frozen=True)
class Drive:
    """What a requested torque passes: place of the delivered torque; names of lag, dead time, limit.

    Also those of a second lag's time constant and of the largest rate; "": none.
    """

    torque: int
    lag: str
    delay: str
    limit: str
    second_lag: str = ""
    rate: str = ""


@dataclass(frozen=True)
class Resonance:
    """An added inertia on a spring, which needs short steps: names of its inertia and frequency."""

    inertia: str
    frequency: str


def _accept_all(values: Mapping[str, float]) -> str:
    return ""


@dataclass(frozen=True, eq=False)
class Plant:
    """One plant that records can be compared with.

    The state of the analysis has eight places (as in ``pyfmu_sources.equations``), of which a plant may use fewer.

    Attributes:
        linear: names of the parameters of the plant with every effect off.
        states: places of the state that the plant with every effect off uses.
        bodies: the driven body first; each has an encoder.
        drive: what a requested torque passes.
        starts: place of a state -> name of its start value in the FMU.
        offsets: names of the encoder offsets, in the order of the bodies.
        bank: the effects that it may lack.
        stage: returns the compiled equations.
        runner: returns the compiled, event-located simulation
            ``run(start, p, early, late, first, h, out)``; see :mod:`orchestrator.diagnosis.report.simulation`. The
            start has the eight states and a ninth entry, the request [N.m] behind a second lag and a limited rate.
        shaft: between the two bodies; None: a single body.
        resonance: an added inertia; None: the plant has none.
        followers: (place, followed place): states that are shifted with another when that is corrected.
        nuisances: parameters of the analysis alone, appended to the table.
        enumerations: names of parameters whose FMU variable counts from one.
        spread: relative uncertainty of each linear parameter where a model file states none.
        refused: values by name -> why records cannot be diagnosed against such a plant; "": they can.
        realised: parameters of the analysis -> those of the FMU (n,), with what it alone has fitted put in.
        learned: a law that was learned is part of its equations.
        seldom: names of parameters that few models have off their defaults, and that cost time in all: where none is,
            equations run in which they are constants.
    """

    name: str
    table: tuple[Parameter, ...]
    linear: tuple[str, ...]
    states: tuple[int, ...]
    bodies: tuple[Body, ...]
    drive: Drive
    starts: Mapping[int, str]
    offsets: tuple[str, ...]
    bank: tuple[Effect, ...]
    stage: Callable[[], CompiledEquations]
    runner: Callable[[], Any]
    shaft: Shaft | None = None
    resonance: Resonance | None = None
    followers: tuple[tuple[int, int], ...] = ()
    nuisances: tuple[Parameter, ...] = ()
    enumerations: tuple[str, ...] = ()
    spread: float = 0.0
    refused: Callable[[Mapping[str, float]], str] = _accept_all
    realised: Callable[[Array], Array] | None = None
    learned: bool = False
    seldom: tuple[str, ...] = ()
    _index: dict[str, int] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        """Number the parameters."""
        self._index.update({name: n for n, name in enumerate(self.names)})

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Return the parameters' names in table order, then those of the analysis alone."""
        return tuple(entry.name for entry in (*self.table, *self.nuisances))

    @property
    def encoders(self) -> tuple[str, ...]:
        """Return the names of the encoders: columns of a record, outputs of the FMU."""
        return tuple(body.encoder for body in self.bodies)

    def entry(self, place: int) -> Parameter:
        """Return the table row of a parameter."""
        return self.table[place] if place < len(self.table) else self.nuisances[place - len(self.table)]

    def index(self, name: str) -> int:
        """Return the place of a parameter in the flat tuple, from 0."""
        if name not in self._index:
            raise ValueError(f"{name!r} is not a parameter of {self.name}")
        return self._index[name]

    def value(self, p: Array, name: str) -> float:
        """Return the value of a parameter."""
        return float(p[self.index(name)])

    def ratio(self, p: Array) -> float:
        """Return the gear ratio: angle of the motor over that of the load; 1.0 without a gear."""
        return self.value(p, self.shaft.ratio) if self.shaft else 1.0

    def extend_values(self, values: Sequence[float]) -> Array:
        """Return the plant's values followed by the analysis's own parameters at their defaults."""
        return np.array([*values, *(entry.default for entry in self.nuisances)])

    def fmu_values(self, p: Array) -> Array:
        """Return the FMU's parameters (n,) of the ``p`` of the analysis."""
        return self.realised(p) if self.realised else np.asarray(p[: len(self.table)])

    def follow_requests(self, p: Array, u: Array, h: float) -> tuple[Array, Array]:
        """Return what requests (n,) [N.m] become behind a second lag and a limited rate.

        Args:
            u: requests (n,), each held for ``h``.
            h: sample time [s].

        Returns:
            their mean over each sample (n,), and the value at its beginning (n,).
        """
        if not self.drive.rate:
            return u, u
        lag, rate = self.value(p, self.drive.second_lag), self.value(p, self.drive.rate)
        if lag == 0.0 and rate >= BIG:
            return u, u
        means, begins = np.empty_like(u), np.empty_like(u)
        request = float(u[0])
        from orchestrator.plants.compiled import compile_module  # numba takes its time to import

        follow = compile_module("laws.drive").followed_request
        for n, asked in enumerate(u.tolist()):
            begins[n] = request
            request, means[n] = follow(request, asked, lag, rate, h)
        return means, begins

    def jacobian(self, p: Array) -> Array:
        """Return the matrix of the linear plant, by differences of its own (linear) rates.

        Returns:
            Shape (states, states), in the order of ``states``.
        """
        rates, plain = self.stage().rates, self._plain(p)
        columns = []
        for place in self.states:
            x = [0.0] * STATES
            x[place] = 1.0
            rate = rates(tuple(x), (0.0, 0.0), plain, 0.0)
            columns.append([rate[s] for s in self.states])
        return np.array(columns).T

    def request_column(self, p: Array) -> Array:
        """Return (states,): what a unit request of the drive does to the rates of the linear plant."""
        rate = self.stage().rates((0.0,) * STATES, (0.0, 0.0), self._plain(p), 1.0)
        return np.array([rate[s] for s in self.states])

    def _plain(self, p: Array) -> Array:
        """Return the parameters of the analysis with every effect off."""
        plain = self.extend_values([entry.default for entry in self.table])
        for name in self.linear:
            plain[self.index(name)] = p[self.index(name)]
        return plain

    def substeps(self, p: Array, h: float) -> int:
        """Return how many Runge-Kutta steps a sample of ``h`` [s] needs."""
        # The drive's lag does not count: it is solved exactly, and moved by nothing else.
        kept = [row for row, place in enumerate(self.states) if place != self.drive.torque]
        modes = np.linalg.eigvals(self.jacobian(p)[np.ix_(kept, kept)])
        return max(1, math.ceil(h * float(np.max(np.abs(modes) / np.where(modes.imag == 0.0, FADING, STEP)))))

    def fastest(self, p: Array) -> float:
        """Return the largest rate [1/s] of the linear plant's modes."""
        return float(np.max(np.abs(np.linalg.eigvals(self.jacobian(p)))))
