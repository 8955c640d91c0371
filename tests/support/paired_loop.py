"""The paired loops by plain FMI calls, in the schemes that other hosts use: what their trajectories are compared with.

Instances are ``plant_gap``, ``estimator_gap``, ``controller_gap`` and the same with ``_ideal``.
"""

from pathlib import Path

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


class Loops:
    """Six instances in the state in which a host has them after initialization."""

    def __init__(self, fmus: dict[str, Path]) -> None:
        self.models = {model: RawFmu(fmus[model]) for model in MODELS.values()}
        self.instances = {name: self.models[model].instantiate() for name, model in INSTANCES.items()}
        for (instance, variable), value in START_VALUES.items():
            self._set(instance, variable, value)
        self._each("fmi2EnterInitializationMode", setup=True)
        self.pass_on()
        self._each("fmi2ExitInitializationMode")

    def _each(self, function: str, setup: bool = False) -> None:
        for name, model in INSTANCES.items():
            raw = self.models[model]
            assert not setup or raw.setup(self.instances[name]) == OK
            assert getattr(raw.library, function)(self.instances[name]) == OK

    def _set(self, instance: str, variable: str, value: float) -> None:
        assert self.models[INSTANCES[instance]].set_real(self.instances[instance], [variable], [value]) == OK

    def get(self, instance: str, variable: str) -> float:
        """Return one value."""
        status, values = self.models[INSTANCES[instance]].get_real(self.instances[instance], [variable])
        assert status == OK
        return values[0]

    def step(self, instance: str, n: int) -> None:
        """Do step number ``n``."""
        assert self.models[INSTANCES[instance]].step(self.instances[instance], n * STEP, STEP) == OK

    def pass_on(self, source: str | None = None) -> None:
        """Pass values on connection by connection, in the order of the signal flow."""
        for a, output, b, entry in CONNECTIONS:
            if source is None or a == source:
                self._set(b, entry, self.get(a, output))

    def exchange(self) -> None:
        """Read all outputs, then set all inputs."""
        values = [self.get(a, output) for a, output, _, _ in CONNECTIONS]
        for (_, _, b, entry), value in zip(CONNECTIONS, values, strict=True):
            self._set(b, entry, value)

    def record(self) -> list[float]:
        """Return the recorded values."""
        return [self.get(instance, variable) for instance, variable in RECORDED]

    def close(self) -> None:
        """Free the instances."""
        for name, model in INSTANCES.items():
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


def jacobi(fmus: dict[str, Path], steps: int, read_again: bool = False) -> list[list[float]]:
    """All side by side, then the exchange; ``read_again``: outputs are read once more after the inputs were set."""
    loops, rows = Loops(fmus), []
    if read_again:
        loops.record()
    for n in range(steps):
        for instance in INSTANCES:
            loops.step(instance, n)
        before = loops.record()
        loops.exchange()
        rows.append(loops.record() if read_again else before)
        if read_again:
            for a, output, _, _ in CONNECTIONS:
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
