"""A plant as a described object: what it measures, where torques act, its speeds and twist, its events, its effects.

In all functions: ``p``: the parameters of the analysis, (n,).
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from orchestrator.building.translation.kernels import Kernels
from orchestrator.effects.effect import Effect
from orchestrator.shared.arrays import Array
from pyfmu_sources.laws.parameter_rows import BIG, Parameter

STATES = 8  # places of the state, as in ``pyfmu_sources.drivetrain.equations``
STEP = 0.35  # of the fastest oscillation: a Runge-Kutta step, whose error then lies far below an encoder's count
MOTION = "orchestrator.plants.kernels.motion"
REQUESTS = Kernels("orchestrator.plants.kernels.requests")
FADING = 1.0  # of the fastest time constant of what only fades, where an error of a step fades too


@dataclass(frozen=True)
class Body:
    """A body at which torques act."""

    name: str  # of the site, "motor" or "load"
    angle: int  # place of its angle in the state
    speed: int
    inertia: str  # name of its parameter
    encoder: str  # name of the encoder that measures its angle: a column of a record and an output of the FMU
    geared: bool = False  # True if it lies behind the gear
    viscous: str = ""  # name of its viscous friction; "": it has none


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
    lag: str = "tau"
    delay: str = "effects.input_delay.delay"
    limit: str = "effects.torque_saturation.limit"
    second_lag: str = ""
    rate: str = ""


@dataclass(frozen=True)
class Resonance:
    """An added inertia on a spring, which needs short steps: names of its inertia and frequency."""

    inertia: str
    frequency: str


@dataclass(frozen=True, eq=False)
class Plant:
    """One plant that records can be compared with.

    The state of the analysis has eight places (as in ``pyfmu_sources.drivetrain.equations``), of which a plant may
    use fewer.
    """

    name: str
    table: tuple[Parameter, ...]
    linear: tuple[str, ...]  # names of the parameters of the plant with every effect off
    states: tuple[int, ...]  # places of the state that the plant with every effect off uses
    bodies: tuple[Body, ...]  # the driven body first; each has an encoder
    drive: Drive  # what a requested torque passes
    starts: Mapping[int, str]  # place of a state -> name of its start value in the FMU
    offsets: tuple[str, ...]  # names of the encoder offsets, in the order of the bodies
    bank: tuple[Effect, ...]  # the effects that it may lack
    kernel: str  # name of the module of its equations; see :mod:`orchestrator.plants.kernels`
    shaft: Shaft | None = None  # between the two bodies; None: a single body
    resonance: Resonance | None = None  # an added inertia; None: the plant has none
    # (place, followed place): states that are shifted with another when that is corrected
    followers: tuple[tuple[int, int], ...] = ()
    nuisances: tuple[Parameter, ...] = ()  # parameters of the analysis alone, appended to the table
    enumerations: tuple[str, ...] = ()  # names of parameters whose FMU variable counts from one
    spread: float = 0.0  # relative uncertainty of each linear parameter where a model file states none
    # values by name -> why records cannot be diagnosed against such a plant; "": they can
    refused: Callable[[Mapping[str, float]], str] = lambda _: ""
    # parameters of the analysis -> those of the FMU (n,), with what it alone has fitted put in
    realised: Callable[[Array], Array] | None = None
    # of each body with dry friction, name of the logarithm of the distance over which it builds up
    presliding: tuple[str, ...] = ()
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

    def effect(self, label: str) -> Effect:
        """Return the row of the bank that has this label, ``name@site``."""
        return next(row for row in self.bank if row.label == label)

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
        """Return what requests ``u`` (n,) [N.m], each held for ``h`` [s], become by a second lag and a limited rate.

        That is their mean over each sample (n,), and the value at its beginning (n,).
        """
        if not self.drive.rate:
            return u, u
        lag, rate = self.value(p, self.drive.second_lag), self.value(p, self.drive.rate)
        if lag == 0.0 and rate >= BIG:
            return u, u
        means, begins = np.empty_like(u), np.empty_like(u)
        REQUESTS.follow(u, lag, rate, h, means, begins)
        return means, begins

    @cached_property
    def motion(self) -> Kernels:
        """Return the kernels of its motion; see :mod:`orchestrator.plants.kernels.motion`."""
        return Kernels(f"{MOTION}[{self.kernel}]")

    def run_exactly(
        self, start: Array, parameters: Array, early: Array, late: Array, first: float, h: float, out: Array
    ) -> None:
        """Fill ``out`` (n, 2), the angles [rad], by the event-located simulation.

        Args:
            start: (9,) states, and the request [N.m] behind a second lag and a limited rate.
            parameters: of the FMU, (n,).
            early: torque (n,) that acts in each sample for ``first`` [s].
            late: (n,) that acts then.
            h: sample time [s].
        """
        self._exact.run(start, parameters, early, late, first, h, out)

    @cached_property
    def _exact(self) -> Kernels:
        return Kernels(self.kernel, checked=True)

    def jacobian(self, p: Array) -> Array:
        """Return the matrix (states, states) of the linear plant, by differences of its own (linear) rates."""
        plain = self._plain(p)
        columns = []
        for place in self.states:
            x = np.zeros(STATES)
            x[place] = 1.0
            columns.append(self._rates(x, plain, 0.0))
        return np.array(columns).T

    def request_column(self, p: Array) -> Array:
        """Return (states,): what a unit request of the drive does to the rates of the linear plant."""
        return self._rates(np.zeros(STATES), self._plain(p), 1.0)

    def _rates(self, x: Array, p: Array, u: float) -> Array:
        found = np.empty(STATES)
        self.motion.rate_at(x, p, u, found)
        return found[list(self.states)]

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
