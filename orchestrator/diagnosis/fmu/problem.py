"""A record, an FMU and a map, ready to be fitted: models are simulated, residuals come in units of the noise."""

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from orchestrator.diagnosis.fmu.coupled_fmus import Run
from orchestrator.diagnosis.fmu.loop import delay_input, delay_output, lag_input, lag_output, limit_rate, quantise
from orchestrator.diagnosis.fmu.mapping import Map
from orchestrator.diagnosis.fmu.record import FmuRecord, divide_samples
from orchestrator.diagnosis.fmu.runner import Runner
from orchestrator.effects.of_fmus import CUT, INPUT, OUTPUT, PARAMETER, PORT, FmuEffect
from orchestrator.errors import SlaveError
from orchestrator.master.protocol import Value
from orchestrator.shared.arrays import Array
from pyfmu_sources.laws.body import COMPLIANCE

ABSURD = 1e9  # times an output's largest value, beyond which a run has failed
RUNAWAY = 1e4  # effort of an effect over the drive's, beyond which a run is given up: it is unstable
IMPULSE = 0.5  # of the drive: the pulse that measures a response


@dataclass(frozen=True, eq=False)
class FmuModel:
    """A model: values of the uncertain parameters, effects, and their values."""

    p: Array
    effects: tuple[FmuEffect, ...] = ()
    values: tuple[Array, ...] = ()

    @property
    def key(self) -> Hashable:
        """What two models of the same run have in common."""
        effects = tuple((e.label, e.at_rest, tuple(v.tolist())) for e, v in zip(self.effects, self.values, strict=True))
        return tuple(self.p.tolist()), effects


@dataclass
class FmuProblem:
    """Simulates models of one record: of ``n`` samples, ``h`` [s] apart."""

    data: FmuRecord
    map: Map
    runner: Runner
    m: int  # communication steps in a sample
    noise: Array  # (outputs,) standard deviations
    sign: dict[str, float] = field(default_factory=dict)  # of each port and cut, the direction in which its effort acts
    short: float = 0.0  # share by which a step is cut short, for an FMU that goes by a clock of its own
    late: float = 0.0  # by how much such an FMU takes its inputs late [s]; outputs of ``data`` are as late
    _tables: dict[tuple[int, int], Array] = field(init=False, default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        self.settings, self.units = self.runner.settings, self.runner.system.units
        self.inputs, self.outputs = tuple(self.map.inputs), tuple(self.map.outputs)
        self.n, self.h = self.data.size, self.data.step

    @property
    def step(self) -> float:
        """Return the communication step [s]."""
        return self.h / self.m * (1.0 - self.short)

    @property
    def nominal(self) -> FmuModel:
        """Return the model as the user gave it."""
        return FmuModel(np.array([u.value for u in self.map.uncertain]))

    def simulate(self, models: Sequence[FmuModel]) -> list[Array | None]:
        """Return outputs (n, outputs) of each model; None where the FMU failed, or ran away."""
        found = self._runs([self._run_of(model) for model in models])
        runs = [
            None if y is None else self._outputs_at_samples(y, model) for y, model in zip(found, models, strict=True)
        ]
        most = ABSURD * np.max(np.abs(self.data.outputs), axis=0)
        return [None if y is None or np.any(np.abs(y) > most) else y for y in runs]

    def read(self, models: Sequence[FmuModel]) -> list[Array | None]:
        """Return all that is read (n, reads) of each model, before effects at outputs."""
        found = self._runs([self._run_of(model) for model in models])
        return [None if y is None else y[:: self.m] for y in found]

    def read_driven(self, tables: Sequence[Array], step: float | None = None) -> list[Array | None]:
        """Return all that is read (steps + 1, reads) of the nominal model under other inputs (steps, inputs)."""
        starts = self.starts(self.nominal)
        runs = [Run(starts, table) for table in tables]
        return self.runner.run(runs, float(self.data.time[0]), self.step if step is None else step)

    def _run_of(self, model: FmuModel) -> Run:
        ports, laws = [], []
        reads, inputs = self.runner.reads, self.runner.inputs
        for effect, values in zip(model.effects, model.values, strict=True):
            law, most, velocity = effect.row.law, math.inf, -1
            if effect.row.site == CUT:
                place, position = inputs.index(self.map.cuts[effect.place].input), reads.index(self.beyond(effect))
            elif effect.row.site == PORT:
                port = self.map.ports[effect.place]
                place, position = inputs.index(port.input), reads.index(port.position)
                velocity = -1 if port.velocity is None else reads.index(port.velocity)
                most = RUNAWAY * float(self.drive([place])[0])
            else:
                continue
            ports.append((place, law, position, velocity))
            q = (*map(float, values), *[0.0] * (4 - len(values)))
            laws.append((*q, self.sign.get(effect.place, 1.0), most))
        return Run(self.starts(model), self.table(model), tuple(ports), tuple(laws))

    def plain_table(self, rows: int | None = None) -> Array:
        """Return the recorded inputs (steps, inputs) up to ``rows`` samples (default: all), the same array each time.

        Inputs without a column are 0.
        """
        rows = self.n if rows is None else rows
        if (rows, self.m) not in self._tables:
            table = np.zeros(((rows - 1) * self.m, len(self.runner.inputs)))
            for k, entry in enumerate(self.map.inputs.values()):
                u = self.data.file_inputs[: (rows - 1) * self.data.factor + 1, k]
                table[:, k] = divide_samples(u, self.data.factor, self.m, 1 if entry.hold == "linear" else 0)
            self._tables[rows, self.m] = table
        return self._tables[rows, self.m]

    def _runs(self, runs: Sequence[Run]) -> list[Array | None]:
        """Return what is read after every communication step; runs that are the same for the FMU are made once."""
        keys = [(tuple(run.starts.items()), id(run.table), run.ports, run.laws) for run in runs]
        wanted = dict(reversed(list(zip(keys, runs, strict=True))))
        found = self.runner.run(list(wanted.values()), float(self.data.time[0]), self.step)
        by_key = dict(zip(wanted, found, strict=True))
        return [by_key[key] for key in keys]

    def must_simulate(self, model: FmuModel) -> Array:
        """Return outputs (n, outputs) of a model."""
        return self.require(self.simulate([model])[0])

    def must_read(self, model: FmuModel) -> Array:
        """Return all that is read (n, reads) of a model, before effects at outputs."""
        return self.require(self.read([model])[0])

    def require(self, run: Array | None) -> Array:
        """Return a run; raise an error where it failed."""
        if run is None:
            raise self.does_not_run()
        return run

    def does_not_run(self) -> SlaveError:
        """Return the error that says why the last run failed."""
        return SlaveError(f"{self.runner.path}: must run over the record, but {self.runner.reason}")

    def starts(self, model: FmuModel) -> dict[str, Value]:
        """Return what is set before a run, by name."""
        values: dict[str, Value] = dict(self.map.fixed)
        values |= {u.name: float(v) for u, v in zip(self.map.uncertain, model.p, strict=True)}
        return values

    def table(self, model: FmuModel) -> Array:
        """Return what the FMU's inputs get (steps, inputs): the recorded ones behind the effects in series with them.

        It is the plain table itself where no effect acts on an input. Further columns are those of parameters that may
        change within a run, where one does.
        """
        plain = table = self.plain_table()
        if any(effect.row.site == PARAMETER for effect in model.effects):
            starts = self.starts(model)
            constant = np.tile([starts[name] for name in self.runner.tunables], (len(plain), 1))
            table = np.hstack([plain, constant])
        for effect, values in zip(model.effects, model.values, strict=True):
            if effect.row.site == PARAMETER:
                column = len(self.runner.inputs) + self.runner.tunables.index(effect.place)
                table[:, column] += float(values[0]) * self._follows(effect, len(plain))
            if effect.row.site != INPUT:
                continue
            if table is plain:
                table = plain.copy()
            column = self.runner.inputs.index(effect.place)
            table[:, column] = at_input(effect, table[:, column], self.step, float(values[0]))
        return table

    def _follows(self, effect: FmuEffect, steps: int) -> Array:
        """Return what a parameter follows in every communication step: the time [s], or a signal."""
        if not effect.signal:
            return np.asarray((np.arange(steps) + 0.5) * self.step)
        signal = self.data.signals[:, list(self.map.signals).index(effect.signal)]
        return np.repeat(signal[: steps // self.m], self.m)

    def beyond(self, effect: FmuEffect) -> str:
        """Return what an effect in a cut needs beside the position that is handed on."""
        cut = self.map.cuts[effect.place]
        name = cut.effort if effect.row.law == COMPLIANCE else cut.far
        assert name is not None
        return name

    def _outputs_at_samples(self, fine: Array, model: FmuModel) -> Array:
        """Return the outputs at the samples, from what is read after every communication step.

        Effects behind an output act between the samples too: an output need not be smooth from one to the next.
        """
        y = fine[:, : len(self.outputs)]
        for effect, values in zip(model.effects, model.values, strict=True):
            if effect.row.site != OUTPUT:
                continue
            if y.base is not None:
                y = y.copy()
            column = self.outputs.index(effect.place)
            y[:, column] = at_output(effect, y[:, column], self.step, float(values[0]), self.m)
        return y[:: self.m]

    def pulse_runs(
        self, model: FmuModel, rows: Sequence[int], places: Sequence[int], beyond: int = 0
    ) -> tuple[Array, list[list[Array | None]]]:
        """Return the run of a model, and those with a pulse one sample long at some rows of some inputs.

        Returns:
            All that is read (rows, reads) without a pulse; for each input, for each row, outputs (rows, outputs) with
            it, over the pulse's size as a share of the drive; None where the FMU failed.
        """
        plain = self._run_of(model)
        if beyond:
            plain = replace(plain, table=np.vstack([plain.table, np.repeat(plain.table[-1:], beyond * self.m, axis=0)]))
        runs = [plain]
        for place, size in zip(places, self.drive(places), strict=True):
            for row in rows:
                pulsed = plain.table.copy()
                pulsed[row * self.m : (row + 1) * self.m, place] += IMPULSE * size
                runs.append(replace(plain, table=pulsed))
        base, *found = self._runs(runs)
        if base is None:
            raise self.does_not_run()
        output, count = self._outputs_at_samples(base, model), len(rows)
        changes = [None if y is None else (self._outputs_at_samples(y, model) - output) / IMPULSE for y in found]
        return base[:: self.m], [changes[k * count : (k + 1) * count] for k in range(len(places))]

    @property
    def noise_places(self) -> list[int]:
        """Return the inputs at which unmodelled efforts may act: those of the ports, else all that are recorded."""
        names = list(dict.fromkeys(port.input for port in self.map.ports.values())) or list(self.inputs)
        return [self.runner.inputs.index(name) for name in names]

    def drive(self, places: Sequence[int]) -> Array:
        """Return the size of the effort at each place: of its own column, else of the columns of the same unit."""
        sizes, units = self.data.sizes, self.units
        largest = float(sizes.max()) or 1.0
        found = []
        for place in places:
            own = float(sizes[place]) if place < len(sizes) else 0.0
            like = (float(size) for name, size in zip(self.inputs, sizes, strict=True)
                    if units.get(name) == units.get(self.runner.inputs[place]))  # fmt: skip
            found.append(own or max(like, default=0.0) or largest)
        return np.array(found)


INPUTS: Mapping[str, Callable[[Array, float, float, float], Array]] = {
    "input_gain": lambda fine, step, value, before: fine * (1.0 + value),
    "input_offset": lambda fine, step, value, before: fine + value,
    "input_delay": delay_input,
    "input_lag": lag_input,
    "input_saturation": lambda fine, step, value, before: np.clip(fine, -value, value),
    "input_dead_zone": lambda fine, step, value, before: fine - np.clip(fine, -value, value),
    "input_rate_limit": limit_rate,
    "input_quantisation": lambda fine, step, value, before: quantise(fine, value),
}
OUTPUTS: Mapping[str, Callable[[Array, float, float, int], Array]] = {
    "output_gain": lambda rows, step, value, m: rows * (1.0 + value),
    "output_offset": lambda rows, step, value, m: rows + value,
    "output_delay": delay_output,
    "output_lag": lambda rows, step, value, m: lag_output(rows, step, value),
    "output_quantisation": lambda rows, step, value, m: quantise(rows, value),
}


def at_input(effect: FmuEffect, fine: Array, step: float, value: float) -> Array:
    """Return an input behind an effect in series with it; before the record it had its first value, or was zero."""
    return np.asarray(INPUTS[effect.row.name](fine, step, value, 0.0 if effect.at_rest else float(fine[0])))


def at_output(effect: FmuEffect, rows: Array, step: float, value: float, m: int) -> Array:
    """Return an output behind an effect in series with it; ``m``: see :func:`delay_output`."""
    return np.asarray(OUTPUTS[effect.row.name](rows, step, value, m))
