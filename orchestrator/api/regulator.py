"""Gains of an LQR for a machine, and what its loop does at rest before anyone runs it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from orchestrator.api.plotted import PlottedResult
from orchestrator.api.shown import Block
from orchestrator.building.starts import SAMPLE_TIME, STATE_WEIGHTS, TORQUE_WEIGHT
from orchestrator.control.standstill import forecast_rest, loop_response
from orchestrator.errors import ScenarioError
from orchestrator.plants import design
from orchestrator.plants.design import GAIN_UNITS, REGULATOR_STATES, DrivetrainValues, five_state_model
from orchestrator.records.model_file import Model, read_model
from orchestrator.shared.numbers import within
from orchestrator.shared.output import write_columns, write_whole
from orchestrator.shared.results.fields import copy_fields
from orchestrator.shared.results.regulator import ForecastFound, RegulatorFound, gains_table

RANGES = {"torque_weight": (1e-12, 1e12), "sample_time": (1e-4, 0.05), "delay": (0, 100)}  # s, samples
LARGEST_WEIGHT = 1e12
POINTS = 400  # of the response
LOWEST = 1e-2  # frequency of the response [Hz]


@dataclass(frozen=True, repr=False)
class RegulatorResult(PlottedResult):
    """A regulator and its loop.

    Attributes:
        gains: of ``theta_m``, ``omega_m``, ``theta_l``, ``omega_l`` and ``T_m``.
        values: inertias, shaft, friction and drive that it is made for.
        sample_time: [s].
        delay: of the request [samples].
        forecast: what the loop does at rest, and its margins.
    """

    command: ClassVar[str] = "regulator"
    gains: tuple[float, ...]
    values: DrivetrainValues
    sample_time: float
    delay: int
    forecast: ForecastFound

    @property
    def gains_by_name(self) -> dict[str, float]:
        """The gains as parameters of the FMUs: ``K[1]`` to ``K[5]``."""
        return {f"K[{n}]": gain for n, gain in enumerate(self.gains, start=1)}

    @property
    def parameters(self) -> dict[str, float]:
        """Parameters of ``LqrController`` and ``BacklashCompensator`` for this machine."""
        return self.gains_by_name | {
            "i": self.values.i,
            "compliance": 1.0 / self.values.k,
            "sample_time": self.sample_time,
        }

    def blocks(self) -> Sequence[Block]:
        """Return the gains, and what the loop does."""
        found = gains_table(self.gains_by_name, REGULATOR_STATES, GAIN_UNITS)
        return [found, self.forecast.rest_text("the loop"), self.forecast.margins_text()]

    def _response(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return frequencies [Hz], size and phase [rad] of the loop without a gap, cut at the request."""
        frequencies = np.geomspace(LOWEST, 0.5 / self.sample_time, POINTS)
        angles = 2.0 * np.pi * frequencies * self.sample_time
        model = five_state_model(self.values)
        response = loop_response(model, self.gains, self.sample_time, self.delay)(angles)
        return frequencies, np.abs(response), np.unwrap(np.angle(response))

    def results(self, place: Path | None = None) -> RegulatorFound:
        frequencies, size, phases = self._response()
        curves = zip(("frequencies", "response", "phases"), (frequencies, size, phases), strict=True)
        return copy_fields(
            RegulatorFound, self, gains=self.gains_by_name, **{name: tuple(c.tolist()) for name, c in curves}
        )

    def write_data(self, folder: Path) -> None:
        """Write ``parameters.toml``, to be pasted into a scenario, and ``loop.csv``."""
        lines = [f'"{name}" = {value!r}' for name, value in self.parameters.items()]
        write_whole(folder / "parameters.toml", ("\n".join(lines) + "\n").encode("ascii"))
        frequencies, size, phases = self._response()
        write_columns(folder / "loop.csv", {"frequency [Hz]": frequencies, "gain": size, "phase [rad]": phases})


def design_regulator(
    model: Model | None = None,
    *,
    state_weights: Sequence[float] | None = None,
    torque_weight: float = TORQUE_WEIGHT,
    gains: Sequence[float] | None = None,
    sample_time: float = SAMPLE_TIME,
    delay: int = 0,
) -> RegulatorResult:
    """Design the LQR of a drivetrain, and say whether its loop will rest in spite of a gap.

    Args:
        model: of the machine (default: ``read_model()``). Its gap, friction and other effects play no part.
        state_weights: of ``theta_m``, ``omega_m``, ``theta_l``, ``omega_l`` and ``T_m`` (default: the thesis's).
        torque_weight: price of the request, in the units of the others per (N.m)2.
        gains: judge these in place of a design, in the same order.
        sample_time: of the controller [s].
        delay: of the request [samples].

    Returns:
        Gains, the motion at rest in half-gaps, margins of the sampled loop.

    Raises:
        ScenarioError: a number is out of its range, or the loop is unstable even without a gap.
        DesignError: there is no such regulator.

    Examples:
        >>> regulator = oc.design_regulator()
        >>> regulator.forecast.cycles
        True
    """
    for name, value in (("torque_weight", torque_weight), ("sample_time", sample_time), ("delay", delay)):
        within(name, value, *RANGES[name])
    model = read_model(None) if model is None else model
    if model.fmu != "Drivetrain":
        raise ScenarioError(f"{model.source}: `fmu` must be Drivetrain for a regulator, but is {model.fmu}")
    names = ("J_m", "J_l", "k", "c", "b_m", "b_l", "i", "tau")
    values = DrivetrainValues(**{name: model.parameters[name].value for name in names})
    given: dict[str, Any] = {
        "model": model.source,
        "torque_weight": torque_weight,
        "sample_time": sample_time,
        "delay": delay,
    }
    if gains is not None:
        if state_weights is not None:
            raise ScenarioError(
                "`state_weights` must be left out beside `gains`, but are given", "state_weights", "gains"
            )
        chosen = five("gains", gains, -LARGEST_WEIGHT)
        given["gains"] = chosen
    else:
        weights = five("state_weights", STATE_WEIGHTS if state_weights is None else state_weights, 0.0)
        if weights[0] + weights[2] == 0.0:
            raise ScenarioError("`state_weights` must weigh an angle, but has 0 for both", "state_weights")
        given["state_weights"] = weights
        chosen = design.design_regulator(five_state_model(values), np.diag(weights), torque_weight, sample_time).gains
    forecast = forecast_rest(values, chosen, sample_time, delay)
    return RegulatorResult(chosen, values, sample_time, delay, forecast, arguments=given)


def five(name: str, numbers: Sequence[float], least: float) -> tuple[float, ...]:
    """Return five numbers within their bounds, one for each of ``REGULATOR_STATES``."""
    if len(numbers) != len(REGULATOR_STATES):
        raise ScenarioError(f"`{name}` must be {len(REGULATOR_STATES)} numbers, but are {len(numbers)}", name)
    return tuple(within(name, float(number), least, LARGEST_WEIGHT) for number in numbers)
