"""A record, an FMU and a map, ready to be fitted: models are simulated, residuals come in units of the noise."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fmu import series
from orchestrator.diagnosis.fmu.bank import CUT, INPUT, OUTPUT, PARAMETER, PORT, BoxEffect
from orchestrator.diagnosis.fmu.mapping import Map
from orchestrator.diagnosis.fmu.model import BoxModel, Data
from orchestrator.diagnosis.fmu.passed import at_input, at_output
from orchestrator.diagnosis.fmu.runner import Plan, Runner
from orchestrator.diagnosis.fmu.wire import Feedback
from orchestrator.diagnosis.fmu_settings import DEFAULT, FmuSettings
from orchestrator.errors import SlaveError
from orchestrator.master.protocol import Value
from pyfmu_sources.port_laws import COMPLIANCE

Array = NDArray[np.float64]


@dataclass
class BoxProblem:
    """Simulates models of one record.

    Attributes:
        m: communication steps in a sample.
        noise: (outputs,) standard deviations.
        sign: of each port and cut, the direction in which its effort acts.
        units: of the variables that have one.
        short: share by which a communication step is cut short, for an FMU that goes by a clock of its own.
        late: by how much such an FMU takes its inputs late [s]; outputs of ``data`` are as late.
    """

    data: Data
    map: Map
    runner: Runner
    m: int
    noise: Array
    sign: dict[str, float] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    settings: FmuSettings = DEFAULT
    short: float = 0.0
    late: float = 0.0
    _tables: dict[tuple[int, int], Array] = field(init=False, default_factory=dict, repr=False)

    @property
    def n(self) -> int:
        """Return the number of samples."""
        return len(self.data.time)

    @property
    def h(self) -> float:
        """Return the sample time [s]."""
        return self.data.step

    @property
    def step(self) -> float:
        """Return the communication step [s]."""
        return self.h / self.m * (1.0 - self.short)

    @property
    def nominal(self) -> BoxModel:
        """Return the model as the user gave it."""
        return BoxModel(np.array([u.value for u in self.map.uncertain]))

    @property
    def inputs(self) -> tuple[str, ...]:
        """Return the names of the recorded inputs."""
        return tuple(self.map.inputs)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Return the names of the measured outputs."""
        return tuple(self.map.outputs)

    def simulate(self, models: Sequence[BoxModel], rows: int | None = None) -> list[Array | None]:
        """Return outputs (rows, outputs) of each model; None where the FMU failed, or ran away.

        Args:
            rows: samples to simulate (default: all).
        """
        found = self._runs([self._plan(model, rows) for model in models])
        runs = [None if y is None else self._measured(y, model) for y, model in zip(found, models, strict=True)]
        most = self.settings.process.absurd * np.max(np.abs(self.data.outputs), axis=0)
        return [None if y is None or np.any(np.abs(y) > most) else y for y in runs]

    def read(self, models: Sequence[BoxModel], rows: int | None = None) -> list[Array | None]:
        """Return all that is read (rows, reads) of each model, before effects at outputs.

        Args:
            rows: samples to simulate (default: all).
        """
        found = self._runs([self._plan(model, rows) for model in models])
        return [None if y is None else y[:: self.m] for y in found]

    def _plan(self, model: BoxModel, rows: int | None) -> Plan:
        plain = self._plain(self.n if rows is None else rows)
        return Plan(self.starts(model), self.table(model, plain), self._feedback(model))

    @property
    def plain_table(self) -> Array:
        """Return the recorded inputs over every communication step (steps, inputs)."""
        return self._plain(self.n)

    def _plain(self, rows: int) -> Array:
        """Return the recorded inputs up to ``rows`` samples, the same array each time."""
        key = (rows, self.m)
        if key not in self._tables:
            self._tables[key] = series_of(self, rows)
        return self._tables[key]

    def _runs(self, plans: Sequence[Plan]) -> list[Array | None]:
        """Return what is read after every communication step; plans that are the same for the FMU are run once."""
        keys = [(tuple(p.starts.items()), id(p.table), repr(p.effects)) for p in plans]
        places = {key: k for k, key in reversed(list(enumerate(keys)))}
        order = list(places)
        wanted, start = [plans[places[key]] for key in order], float(self.data.time[0])
        found = self.runner.run(wanted, start, self.step, 1)
        by_key = dict(zip(order, found, strict=True))
        return [by_key[key] for key in keys]

    def must_simulate(self, model: BoxModel) -> Array:
        """Return outputs (rows, outputs) of a model."""
        return self._required(self.simulate([model])[0])

    def must_read(self, model: BoxModel) -> Array:
        """Return all that is read (rows, reads) of a model, before effects at outputs."""
        return self._required(self.read([model])[0])

    def _required(self, run: Array | None) -> Array:
        if run is None:
            raise self.does_not_run()
        return run

    def does_not_run(self) -> SlaveError:
        """Return the error that says why the last run failed."""
        return SlaveError(f"{self.runner.path}: must run over the record, but {self.runner.reason}")

    def residual(self, y: Array) -> Array:
        """Return measured minus simulated, in units of the noise.

        Args:
            y: (rows, outputs) simulated.

        Returns:
            Shape (rows, outputs).
        """
        return np.asarray((self.data.outputs[: len(y)] - y) / self.noise)

    def starts(self, model: BoxModel) -> dict[str, Value]:
        """Return what is set before a run, by name."""
        values: dict[str, Value] = dict(self.map.fixed)
        values |= {u.name: float(v) for u, v in zip(self.map.uncertain, model.p, strict=True)}
        return values

    def table(self, model: BoxModel, plain: Array) -> Array:
        """Return what the FMU's inputs get: the recorded ones behind the effects in series with them.

        Args:
            plain: (steps, inputs) recorded inputs over every communication step.

        Returns:
            Shape (steps, inputs); ``plain`` itself where no effect acts on an input. Further columns are those of
            parameters that may change within a run, where one does.
        """
        table = plain
        if any(effect.kind.where == PARAMETER for effect in model.effects):
            starts = self.starts(model)
            constant = np.tile([starts[name] for name in self.runner.tunables], (len(plain), 1))
            table = np.hstack([plain, constant])
        for effect, values in zip(model.effects, model.values, strict=True):
            if effect.kind.where == PARAMETER:
                column = len(self.runner.inputs) + self.runner.tunables.index(effect.place)
                table[:, column] += float(values[0]) * self._follows(effect, len(plain))
            if effect.kind.where != INPUT:
                continue
            if table is plain:
                table = plain.copy()
            column = self.runner.inputs.index(effect.place)
            table[:, column] = at_input(effect, table[:, column], self.step, float(values[0]))
        return table

    def _follows(self, effect: BoxEffect, steps: int) -> Array:
        """Return what a parameter follows in every communication step: the time [s], or a signal."""
        if not effect.signal:
            return np.asarray((np.arange(steps) + 0.5) * self.step)
        signal = self.data.signals[:, list(self.map.signals).index(effect.signal)]
        return np.repeat(signal[: steps // self.m], self.m)

    def _feedback(self, model: BoxModel) -> tuple[Feedback, ...]:
        found = []
        for effect, values in zip(model.effects, model.values, strict=True):
            reads = self.runner.reads
            q = [float(v) for v in values] + [0.0] * (4 - len(values))
            if effect.kind.where == CUT:
                place = self.runner.inputs.index(self.map.cuts[effect.place].input)
                other = reads.index(self.beyond(effect))
                found.append(Feedback(place, effect.kind.law, other, -1, self.sign.get(effect.place, 1.0), q))
            if effect.kind.where != PORT:
                continue
            port = self.map.ports[effect.place]
            velocity = -1 if port.velocity is None else reads.index(port.velocity)
            place = self.runner.inputs.index(port.input)
            sign = self.sign.get(effect.place, 1.0)
            most = self.settings.process.runaway * float(self.drive([place])[0])
            found.append(Feedback(place, effect.kind.law, reads.index(port.position), velocity, sign, q, most))
        return tuple(found)

    def beyond(self, effect: BoxEffect) -> str:
        """Return what an effect in a cut needs beside the position that is handed on."""
        cut = self.map.cuts[effect.place]
        name = cut.effort if effect.kind.law == COMPLIANCE else cut.far
        assert name is not None
        return name

    def _measured(self, fine: Array, model: BoxModel) -> Array:
        """Return the outputs at the samples, from what is read after every communication step.

        Effects behind an output act between the samples too: an output need not be smooth from one to the next.
        """
        y = fine[:, : len(self.outputs)]
        for effect, values in zip(model.effects, model.values, strict=True):
            if effect.kind.where != OUTPUT:
                continue
            if y.base is not None:
                y = y.copy()
            column = self.outputs.index(effect.place)
            y[:, column] = at_output(effect, y[:, column], self.step, float(values[0]), self.m)
        return y[:: self.m]

    def pulse_runs(
        self, model: BoxModel, rows: Sequence[int], places: Sequence[int], beyond: int = 0
    ) -> tuple[Array, list[list[Array | None]]]:
        """Return the run of a model, and those with a pulse one sample long at some rows of some inputs.

        Returns:
            All that is read (rows, reads) without a pulse; for each input, for each row, outputs (rows, outputs) with
            it, over the pulse's size as a share of the drive; None where the FMU failed.
        """
        plain, feedback, starts = self._plain(self.n), self._feedback(model), self.starts(model)
        table = self.table(model, plain)
        table = np.vstack([table, np.repeat(table[-1:], beyond * self.m, axis=0)]) if beyond else table
        plans = [Plan(starts, table, feedback)]
        for place, size in zip(places, self.drive(places), strict=True):
            for row in rows:
                pulsed = table.copy()
                pulsed[row * self.m : (row + 1) * self.m, place] += self.settings.probe.impulse * size
                plans.append(Plan(starts, pulsed, feedback))
        base, *found = self._runs(plans)
        if base is None:
            raise self.does_not_run()
        output = self._measured(base, model)
        share = self.settings.probe.impulse
        changes = [None if y is None else (self._measured(y, model) - output) / share for y in found]
        count = len(rows)
        return base[:: self.m], [changes[k * count : (k + 1) * count] for k in range(len(places))]

    @property
    def noise_places(self) -> list[int]:
        """Return the inputs at which unmodelled efforts may act: those of the ports, else all that are recorded."""
        names = list(dict.fromkeys(port.input for port in self.map.ports.values())) or list(self.inputs)
        return [self.runner.inputs.index(name) for name in names]

    def drive(self, places: Sequence[int]) -> Array:
        """Return the size of the effort at each place: of its own column, else of the columns of the same unit."""
        sizes = self.data.sizes
        largest = float(sizes.max()) or 1.0
        found = []
        for place in places:
            own = float(sizes[place]) if place < len(sizes) else 0.0
            found.append(own or self._like(place, sizes) or largest)
        return np.array(found)

    def _like(self, place: int, sizes: Array) -> float:
        same = [float(s) for name, s in zip(self.inputs, sizes, strict=True)
                if self.units.get(name) == self.units.get(self.runner.inputs[place])]  # fmt: skip
        return max(same, default=0.0)


def series_of(problem: BoxProblem, rows: int) -> Array:
    """Return the recorded inputs over every communication step up to ``rows`` samples; other inputs are 0.

    Args:
        rows: samples.

    Returns:
        Shape (steps, inputs).
    """
    table = np.zeros(((rows - 1) * problem.m, len(problem.runner.inputs)))
    for k, entry in enumerate(problem.map.inputs.values()):
        order = 1 if entry.hold == "linear" else 0
        u = problem.data.driven[: (rows - 1) * problem.data.factor + 1, k]
        table[:, k] = series.divided(u, problem.data.factor, problem.m, order)
    return table
