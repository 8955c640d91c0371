"""Any FMU beside one record: residuals are measured outputs minus those of its runs.

Noise of the outputs is white; unknown efforts at the ports (else at the recorded inputs) reach the outputs through the
measured pulse responses. With them the analysis whitens residuals as it does those of our plants' torque balances.
"""

from collections.abc import Hashable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import partial

import numpy as np

from orchestrator.diagnosis.fmu.effects import candidate_effects, efforts_along, find_effects, port_motions
from orchestrator.diagnosis.fmu.problem import FmuModel, FmuProblem, at_input, at_output
from orchestrator.diagnosis.fmu.response import PulseResponses, measure_responses, start_responses
from orchestrator.diagnosis.model.interface import (
    CandidateEffect,
    LawArgument,
    ModelPoint,
    NoiseSources,
    ResidualModel,
    UncertainParameter,
    Values,
    as_uncertain,
)
from orchestrator.effects.of_fmus import CUT, INPUT, OUTPUT, PARAMETER, FmuEffect
from orchestrator.shared.arrays import Array
from pyfmu_sources.laws.body import COMPLIANCE

FAILED = 1e3  # times the span of an output: residual of a run that failed, from which every fit turns back
START = "state at the start"
KEPT = 3_000_000  # rows of outputs of runs that are kept
BAND = 0.45  # of the rate of samples: highest frequency of the analysis
FADE = 0.005  # of the rows over which a record fades in and out: filters must see no step


class FmuResiduals(ResidualModel):
    """An FMU, or several, beside one record: a :class:`ResidualModel`."""

    def __init__(self, problem: FmuProblem) -> None:
        self.problem = problem
        self.channels = problem.outputs
        self.step, self.size = problem.h, problem.n
        self.cutoffs = tuple(BAND / problem.h for _ in self.channels)
        self.edges = FADE
        self.active = np.ones((len(self.channels), self.size))
        self._order = _order(problem)
        self._kept: dict[Hashable, Array | None] = {}
        self._responses: dict[tuple[object, ...], tuple[Array, PulseResponses]] = {}
        self._places = self._input_places()
        self.parameters = _parameters(problem, 0)
        reads, responses = measure_responses(problem, problem.nominal, self._places)
        self.is_linear = responses.is_linear(problem.settings.linear)
        self._start = start_responses(problem, problem.nominal, self._places if self.is_linear else ())
        self.parameters = _parameters(problem, len(self._start))
        self._nominal = ModelPoint.nominal(self.parameters)
        self._responses[self._nominal.parameters, ()] = reads, responses
        self.motions = port_motions(problem, reads)
        effects = find_effects(problem, reads)
        self.placed = {effect.label: effect for effect in effects}
        self.effects: Mapping[str, CandidateEffect] = candidate_effects(
            effects, self.motions, self._effort_gradient, self.is_linear
        )

    # --- residuals -----------------------------------------------------------------------------------------

    def fmu_model(self, point: ModelPoint) -> FmuModel:
        """Return parameters and effects at a point as runs of the FMU take them."""
        p = np.empty(len(self._order))
        for place, value in zip(self._order, point.parameters, strict=False):
            own = self.problem.map.uncertain[place]
            p[place] = np.clip(value, own.minimum, own.maximum)
        found = [self.placed[label].at(values) for label, values in point.effects.items()]
        return FmuModel(p, tuple(effect for effect, _ in found), tuple(values for _, values in found))

    def residuals(self, points: Sequence[ModelPoint]) -> list[Array]:
        """Return the residuals (outputs, n) at each of some points; see :class:`ResidualModel`."""
        runs = self._runs([self.fmu_model(point) for point in points])
        measured = self.problem.data.outputs
        failed = np.broadcast_to(FAILED * np.ptp(measured, axis=0)[:, None], measured.T.shape)
        starts = [self.start_change(point, self.size) for point in points]
        return [
            failed if y is None else np.ascontiguousarray((measured - y).T) - start
            for y, start in zip(runs, starts, strict=True)
        ]

    def _runs(self, models: Sequence[FmuModel]) -> list[Array | None]:
        """Return the outputs of runs, the last ones kept: fits under another whitening ask again."""
        keys = [model.key for model in models]
        missing = {key: model for key, model in zip(keys, models, strict=True) if key not in self._kept}
        found = dict(zip(missing, self.problem.simulate(list(missing.values())), strict=True))
        runs = [found[key] if key in found else self._kept[key] for key in keys]
        self._kept |= found
        for key in list(self._kept)[: max(len(self._kept) - KEPT // self.size, 0)]:
            del self._kept[key]
        return runs

    def change_by_steps(self, point: ModelPoint) -> Array:
        """Return (outputs, n) what communication steps half as long change of the residuals.

        Zero where the FMU steps by a clock of its own, or does not run so.
        """
        model, problem = self.fmu_model(point), self.problem
        finer = replace(problem, m=(1 if problem.short else 2) * problem.m)
        (plain,), (fine,) = self._runs([model]), finer.simulate([model])
        none = np.zeros((len(self.channels), self.size))
        return none if plain is None or fine is None else np.ascontiguousarray((plain - fine).T)

    def start_change(self, point: ModelPoint, rows: int) -> Array:
        """Return (outputs, rows) what the state at the start changes; a quarter more rows than the record's at most."""
        return np.asarray(np.tensordot(point.parameters[len(self._order) :], self._start[:, :, :rows], 1))

    def is_possible(self, label: str, point: ModelPoint) -> bool:
        """Tell whether a machine can have an effect as a point has it; see :class:`ResidualModel`."""
        effect, given = self.placed[label].at(point.effects[label])
        return effect.is_possible(tuple(given))

    def reference_signals(self, point: ModelPoint) -> Array:
        """Return the measured outputs (outputs, n); see :class:`ResidualModel`."""
        del point
        return np.ascontiguousarray(self.problem.data.outputs.T)

    def without_start(self) -> "FmuResiduals":
        """Return the model with the start as the FMU has it."""
        other = copy(self)
        other._start = self._start[:0]
        other.parameters = self.parameters[: len(self._order)]
        other._nominal = ModelPoint.nominal(other.parameters)
        other._responses = {(other._nominal.parameters, ()): self._responses_at(self._nominal)}
        return other

    # --- noise ---------------------------------------------------------------------------------------------

    def noise_sources(self, frequencies: Array) -> NoiseSources:
        """Return noise of the outputs, and efforts through the measured responses; see :class:`ResidualModel`."""
        count = len(self.channels)
        identity = np.broadcast_to(np.eye(count, dtype=complex), (frequencies.size, count, count))
        levels = 2.0 * self.problem.noise**2 * self.step
        _, responses = self._responses_at(self._nominal)
        own = PulseResponses(
            responses.rows, {place: responses.found[place] for place in self.problem.noise_places}, self.size
        )
        process = own.frequency_response(frequencies, self.step, self.problem.settings.noise_memory)
        return NoiseSources(identity, levels, process, np.zeros(process.shape[2]))

    # --- linear approximation ------------------------------------------------------------------------------

    def approximate_changes(self, point: ModelPoint, trials: Sequence[tuple[str, Values]]) -> list[Array | None]:
        """Return what effects change of the residuals, by the measured responses; see :class:`ResidualModel`."""
        if not self.is_linear:
            return [None] * len(trials)
        reads, responses = self._responses_at(point)
        model = self.fmu_model(point)
        pushes: dict[int, list[tuple[int, Array]]] = {}
        found: list[Array | None] = [None] * len(trials)
        table = self.problem.table(model)
        for n, (label, values) in enumerate(trials):
            effect, given = self.placed[label].at(values)
            if effect.row.site == OUTPUT:
                found[n] = self._output_change(effect, given, reads)
            elif effect.row.site != PARAMETER:
                place, push = self._push(effect, given, reads, table)
                pushes.setdefault(place, []).append((n, push))
        for place, of_place in pushes.items():
            changes = responses.change_outputs(np.array([push for _, push in of_place]), place)
            for (n, _), change in zip(of_place, changes, strict=True):
                found[n] = -change
        return found

    def _push(self, effect: FmuEffect, values: Array, reads: Array, table: Array) -> tuple[int, Array]:
        """Return the input at which an effect acts, and the effort (n,) that it adds there in each sample."""
        problem, runner = self.problem, self.problem.runner
        push = np.zeros(self.size)
        if effect.row.site == INPUT:
            place = runner.inputs.index(effect.place)
            fine = table[:, place]
            added = at_input(effect, fine, problem.step, float(values[0])) - fine
            push[:-1] = added.reshape(-1, problem.m).mean(axis=1)
            return place, push
        if effect.row.site == CUT:
            return self._push_at_cut(effect, values, reads)
        place = runner.inputs.index(problem.map.ports[effect.place].input)
        effort = efforts_along(self.motions[effect.place], effect.row.law, tuple(values), self.step)
        push[:-1] = -problem.sign.get(effect.place, 1.0) * 0.5 * (effort[:-1] + effort[1:])
        return place, push

    def _push_at_cut(self, effect: FmuEffect, values: Array, reads: Array) -> tuple[int, Array]:
        problem, runner = self.problem, self.problem.runner
        target = problem.map.cuts[effect.place].input
        wire = next(c for c in runner.system.connections if c.target == target)
        other = reads[:, runner.reads.index(problem.beyond(effect))]
        if effect.row.law == COMPLIANCE:
            return runner.inputs.index(target), -values[0] * problem.sign.get(effect.place, 1.0) * other
        between = wire.factor * reads[:, runner.reads.index(wire.source)] + wire.offset - other
        return runner.inputs.index(target), -np.clip(between, -0.5 * values[0], 0.5 * values[0])

    def _output_change(self, effect: FmuEffect, values: Array, reads: Array) -> Array:
        channel = self.problem.outputs.index(effect.place)
        y = reads[:, channel]
        change = np.zeros((len(self.channels), self.size))
        change[channel] = y - at_output(effect, y, self.step, float(values[0]), 1)
        return change

    def respond_to_effort(self, port: str, effort: Array) -> Array:
        """Return (outputs, n) what an effort (n,) against the motion at a port changes, by the nominal responses."""
        problem = self.problem
        _, responses = self._responses_at(self._nominal)
        push = np.zeros((1, self.size))
        push[0, :-1] = -problem.sign.get(port, 1.0) * 0.5 * (effort[:-1] + effort[1:])
        return -responses.change_outputs(push, problem.runner.inputs.index(problem.map.ports[port].input))[0]

    def _effort_gradient(self, port: str, by_residuals: Array) -> Array:
        _, responses = self._responses_at(self._nominal)
        return -responses.gradient(by_residuals, self.problem.runner.inputs.index(self.problem.map.ports[port].input))

    def _responses_at(self, point: ModelPoint) -> tuple[Array, PulseResponses]:
        """Return run and responses at a point, kept for the nominal one and the last."""
        key = (point.parameters, tuple(point.effects.items()))
        if key not in self._responses:
            for old in list(self._responses)[1:]:
                del self._responses[old]
            self._responses[key] = measure_responses(self.problem, self.fmu_model(point), self._places)
        return self._responses[key]

    def _input_places(self) -> list[int]:
        """Return the inputs at which effects or noise may act."""
        problem, names = self.problem, self.problem.runner.inputs
        acting = [*problem.inputs, *(port.input for port in problem.map.ports.values())]
        acting += [cut.input for cut in problem.map.cuts.values()]
        return [names.index(name) for name in dict.fromkeys(acting)]


def _order(problem: FmuProblem) -> list[int]:
    """Return the places of the uncertain values of a map in the order of the analysis: those of one record last."""
    uncertain = problem.map.uncertain
    shared = [k for k, u in enumerate(uncertain) if u.name not in problem.map.initial]
    return [*shared, *(k for k in range(len(uncertain)) if k not in shared)]


def _parameters(problem: FmuProblem, starts: int) -> tuple[UncertainParameter, ...]:
    found = []
    for k in _order(problem):
        found.append(as_uncertain(problem.map.uncertain[k], problem.map.uncertain[k].name in problem.map.initial))
    return (
        *found,
        *(UncertainParameter(f"{START} {k + 1}", 0.0, 1.0, "", True, scale=1.0, reported=False) for k in range(starts)),
    )


def port_arguments(models: Sequence[FmuResiduals]) -> list[LawArgument]:
    """Return what an effort at a port may be a function of: position and speed there (or the flow), each input, time.

    Args:
        models: one for each record.
    """
    problem = models[0].problem
    found = []
    for port, entry in problem.map.ports.items():
        unit, effort = problem.units.get(entry.position, ""), problem.units.get(entry.input, "")
        speeds = [model.motions[port].v for model in models]
        signals = [("time", "s", [model.problem.data.time - model.problem.data.time[0] for model in models])]
        if entry.flow_only:
            signals.append((f"flow at {port}", unit, speeds))
        else:
            signals.append((f"position at {port}", unit, [model.motions[port].x for model in models]))
            signals.append((f"speed at {port}", f"{unit or '1'}/s", speeds))
        for k, name in enumerate(problem.inputs):
            signals.append((name, problem.units.get(name, ""), [model.problem.data.inputs[:, k] for model in models]))
        for name, of_name, values in signals:
            responses = tuple(partial(model.respond_to_effort, port) for model in models)
            found.append(LawArgument(name, port, of_name, effort, tuple(values), responses))
    return found
