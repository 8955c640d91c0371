"""What diagnosis must know of a plant beside its equations: which parameters are linear, which states are measured."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.predictor import NUISANCES, stage_of
from orchestrator.errors import ScenarioError
from orchestrator.model_file import Model
from pyfmu_sources import drivetrain_parameters as dt
from pyfmu_sources import servo_axis as sa

Array = NDArray[np.float64]

PRESLIDING = dt.Parameter(
    "presliding", "1", math.log(1e-5), math.log(1e-9), 0.0, "Logarithm of friction's build-up distance"
)


@dataclass(frozen=True)
class Plant:
    """One plant that records can be diagnosed against.

    The predictor's state has eight places (as in ``pyfmu_sources.equations``); a single axis uses 0, 1 and 4.

    Attributes:
        name: of the FMU.
        table: its parameters.
        linear: names of the parameters of the plant with every effect off.
        states: places of the predictor's state that the plant with every effect off uses.
        measured: places of the two encoders' angles.
        followers: (place, followed place): states that are shifted with another when that is corrected.
        pushed: (place of a speed, name of its inertia, True if behind the gear): where unknown torques act.
        offsets: names of the encoder offsets.
    """

    name: str
    table: tuple[dt.Parameter, ...]
    linear: tuple[str, ...]
    states: tuple[int, ...]
    measured: tuple[int, ...]
    followers: tuple[tuple[int, int], ...]
    pushed: tuple[tuple[int, str, bool], ...]
    offsets: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Return the parameters' names in table order, then the predictor's nuisance parameters."""
        return (*(entry.name for entry in self.table), *NUISANCES)

    def entry(self, place: int) -> dt.Parameter:
        """Return the table row of a parameter."""
        return self.table[place] if place < len(self.table) else PRESLIDING

    def index(self, name: str) -> int:
        """Return the place of a parameter in the flat tuple."""
        return self.names.index(name)

    def extended(self, values: Sequence[float]) -> Array:
        """Return the plant's values followed by the nuisance parameters at their defaults."""
        return np.array([*values, *[PRESLIDING.default] * len(NUISANCES)])

    def transition(self, p: Array, h: float) -> Array:
        """Return the discrete transition matrix of the linear plant (every effect off) for a step ``h`` [s]."""
        A = _matrix_exponential(self.jacobian(p) * h)
        if p[self.index("tau")] == 0.0:
            # Without a lag there is no drive state; its place would stand for an integrator.
            row = self.states.index(4)
            A[row, :] = A[:, row] = 0.0
        return A

    def jacobian(self, p: Array) -> Array:
        """Return the matrix of the linear plant, by differences of its own (linear) rates."""
        _, stage, _ = stage_of(self.name)
        plain = self.extended([entry.default for entry in self.table])
        for name in self.linear:
            plain[self.index(name)] = p[self.index(name)]
        flat = tuple(plain.tolist())
        columns = []
        for place in self.states:
            x = [0.0] * 8
            x[place] = 1.0
            rate = stage(tuple(x), (0.0, 0.0), flat, 0.0)
            columns.append([rate[s] for s in self.states])
        return np.array(columns).T

    def substeps(self, p: Array, h: float) -> int:
        """Return how many Runge-Kutta steps a sample of ``h`` [s] needs."""
        fastest = float(np.max(np.abs(np.linalg.eigvals(self.jacobian(p)))))
        return max(1, math.ceil(fastest * h / 0.35))


DRIVETRAIN = Plant(
    "Drivetrain",
    dt.PARAMETERS,
    ("J_m", "J_l", "k", "c", "b_m", "b_l", "i", "tau"),
    (0, 1, 2, 3, 4),
    (0, 2),
    ((5, 2), (6, 3)),
    ((1, "J_m", False), (3, "J_l", True)),
    ("effects.sensor_offset.motor.offset", "effects.sensor_offset.load.offset"),
)

SERVO_AXIS = Plant(
    "ServoAxis",
    sa.PARAMETERS,
    ("J", "b", "tau"),
    (0, 1, 4),
    (0,),
    (),
    ((1, "J", False),),
    ("effects.sensor_offset.motor.offset",),
)

PLANTS = {plant.name: plant for plant in (DRIVETRAIN, SERVO_AXIS)}


def plant_of(model: Model) -> Plant:
    """Return the plant of a model file.

    Raises:
        ScenarioError: the model names a backlash model whose teeth are rigid; the one-step predictor is elastic.
    """
    plant = PLANTS[model.fmu]
    if plant is DRIVETRAIN:
        chosen = dt.BACKLASH_MODELS[int(model.parameters["backlash_model"].value)]
        if chosen not in ("none", "dead_zone", "nordin"):
            raise ScenarioError(
                f"{model.source}: `backlash_model` must be none, dead_zone or nordin for a diagnosis, but is {chosen}"
            )
    return plant


def _matrix_exponential(matrix: Array) -> Array:
    from scipy.linalg import expm

    result: Any = expm(matrix)
    return np.asarray(result)
