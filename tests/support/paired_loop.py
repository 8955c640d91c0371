"""Loops by plain FMI calls, in the schemes that other hosts use: what their trajectories are compared with.

The paired loops' instances are ``plant_gap``, ``estimator_gap``, ``controller_gap`` and the same with ``_ideal``. Any
scenario of FMI 2.0 with constant sources is a layout as well.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from orchestrator.fmi.instances import FmuFactory
from orchestrator.master.signals import Constant
from orchestrator.master.system import split
from orchestrator.scenarios.definition import Scenario
from tests.support.fmu_calls import OK, RawFmu

HALF_GAP = 0.02
REFERENCE = 0.5
STEP = 1e-3
ESTIMATE = tuple(f"{name}_hat" for name in ("theta_m", "omega_m", "theta_l", "omega_l", "T_l", "T_m"))
MODELS = {"plant": "Drivetrain", "estimator": "KalmanEstimator", "controller": "LqrController"}
LOOPS = ("gap", "ideal")
INSTANCES = {f"{part}_{loop}": model for loop in LOOPS for part, model in MODELS.items()}
# In the order of the signal flow: plant, estimator, controller.
CONNECTIONS = tuple(
    (f"{source}_{loop}", output, f"{sink}_{loop}", entry)
    for loop in LOOPS
    for source, output, sink, entry in (
        ("plant", "theta_m", "estimator", "theta_m"),
        ("plant", "theta_l", "estimator", "theta_l"),
        *(("estimator", name, "controller", name) for name in ESTIMATE),
        ("controller", "u", "plant", "u"),
        ("controller", "u", "estimator", "u"),
    )
)
START_VALUES = {
    ("plant_gap", "alpha"): HALF_GAP,
    ("controller_gap", "reference"): REFERENCE,
    ("controller_ideal", "reference"): REFERENCE,
}
RECORDED = tuple(
    (f"{part}_{loop}", name) for loop in LOOPS for part, name in (("plant", "theta_l"), ("controller", "u"))
)


@dataclass(frozen=True)
class Layout:
    """A loop: model of each instance, connections in the order of the signal flow, start values, what is recorded."""

    instances: Mapping[str, str]
    connections: Sequence[tuple[str, str, str, str]]
    starts: Mapping[tuple[str, str], float]
    recorded: Sequence[tuple[str, str]]
    step: float


PAIRED = Layout(INSTANCES, CONNECTIONS, START_VALUES, RECORDED, STEP)


def layout_of(scenario: Scenario) -> tuple[Layout, dict[str, Path]]:
    """Return the layout of a scenario, and its FMUs by the names of their instances."""
    system = scenario.system
    starts = {(i.name, name): float(value) for i in system.instances for name, value in i.start.items()}
    for source in system.sources:
        assert isinstance(source.signal, Constant)
        starts[split(source.target)] = source.signal.value
    fmus = {}
    for instance in system.instances:
        assert isinstance(instance.create, FmuFactory)
        fmus[instance.name] = instance.create.path
    connections = [(*split(c.source), *split(c.target)) for c in system.connections]
    recorded = [split(name) for name in scenario.record or ()]
    names = {name: name for name in fmus}
    return Layout(names, connections, starts, recorded, scenario.algorithm.step), fmus


class Loops:
    """Instances in the state in which a host has them after initialization."""

    def __init__(self, fmus: dict[str, Path], layout: Layout = PAIRED) -> None:
        self.layout = layout
        self.models = {model: RawFmu(fmus[model]) for model in set(layout.instances.values())}
        self.instances = {name: self.models[model].instantiate() for name, model in layout.instances.items()}
        for (instance, variable), value in layout.starts.items():
            self._set(instance, variable, value)
        self._each("fmi2EnterInitializationMode", setup=True)
        self.pass_on()
        self._each("fmi2ExitInitializationMode")

    def _model(self, instance: str) -> RawFmu:
        return self.models[self.layout.instances[instance]]

    def _each(self, function: str, setup: bool = False) -> None:
        for name, model in self.layout.instances.items():
            raw = self.models[model]
            assert not setup or raw.setup(self.instances[name]) == OK
            assert getattr(raw.library, function)(self.instances[name]) == OK

    def _set(self, instance: str, variable: str, value: float) -> None:
        assert self._model(instance).set_real(self.instances[instance], [variable], [value]) == OK

    def get(self, instance: str, variable: str) -> float:
        """Return one value."""
        status, values = self._model(instance).get_real(self.instances[instance], [variable])
        assert status == OK
        return values[0]

    def step(self, instance: str, n: int) -> None:
        """Do step number ``n``."""
        h = self.layout.step
        assert self._model(instance).step(self.instances[instance], n * h, h) == OK

    def pass_on(self, source: str | None = None) -> None:
        """Pass values on connection by connection, in the order of the signal flow."""
        for a, output, b, entry in self.layout.connections:
            if source is None or a == source:
                self._set(b, entry, self.get(a, output))

    def exchange(self) -> None:
        """Read all outputs, then set all inputs."""
        values = [self.get(a, output) for a, output, _, _ in self.layout.connections]
        for (_, _, b, entry), value in zip(self.layout.connections, values, strict=True):
            self._set(b, entry, value)

    def record(self) -> list[float]:
        """Return the recorded values."""
        return [self.get(instance, variable) for instance, variable in self.layout.recorded]

    def close(self) -> None:
        """Free the instances."""
        for name, model in self.layout.instances.items():
            self.models[model].library.fmi2FreeInstance(self.instances[name])


def gauss_seidel(fmus: dict[str, Path], steps: int) -> list[list[float]]:
    """Plant, estimator and controller one after the other; rows of ``RECORDED`` after each step."""
    loops, rows = Loops(fmus), []
    for n in range(steps):
        for instance in INSTANCES:
            loops.step(instance, n)
            loops.pass_on(instance)
        rows.append(loops.record())
    loops.close()
    return rows


def jacobi(fmus: dict[str, Path], steps: int, read_again: bool = False, layout: Layout = PAIRED) -> list[list[float]]:
    """All side by side, then the exchange; ``read_again``: outputs are read once more after the inputs were set."""
    loops, rows = Loops(fmus, layout), []
    if read_again:
        loops.record()
    for n in range(steps):
        for instance in layout.instances:
            loops.step(instance, n)
        before = loops.record()
        loops.exchange()
        rows.append(loops.record() if read_again else before)
        if read_again:
            for a, output, _, _ in layout.connections:
                loops.get(a, output)
    loops.close()
    return rows


def side_by_side_passed_on(fmus: dict[str, Path], steps: int) -> list[list[float]]:
    """All side by side, then values passed on in the order of the dependencies that the FMUs declare."""
    loops, rows = Loops(fmus), []
    for n in range(steps):
        for instance in INSTANCES:
            loops.step(instance, n)
        loops.pass_on()
        rows.append(loops.record())
    loops.close()
    return rows
