"""A quantum acts in steps: combs lead to it, and its interval holds what rounds the same."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.diagnosis.blackbox import scanning
from orchestrator.diagnosis.blackbox.bank import BANK, BoxEffect, Surroundings
from orchestrator.diagnosis.blackbox.estimates import errors_of
from orchestrator.diagnosis.blackbox.fitting import Fitter
from orchestrator.diagnosis.blackbox.likelihood import BoxFit
from orchestrator.diagnosis.blackbox.model import BoxModel
from orchestrator.diagnosis.blackbox.parts import parts_of
from orchestrator.diagnosis.blackbox.series import quantised
from orchestrator.diagnosis.blackbox.settings import DEFAULT
from orchestrator.diagnosis.blackbox.whole import of_alike

SIGNAL = np.linspace(-1.0, 1.0, 400)
QUANTUM, NOISE = 0.1003, 0.02


class White(list):
    """One level without noise at the ports."""

    size = 1

    def near(self, level: int) -> range:
        return range(level, level + 1)

    def share(self, level: int) -> float:
        return 0.0


def model_of(gain: float, quantum: float) -> BoxModel:
    effect = BoxEffect(BANK["input_quantisation"], "u", Surroundings(0.01, 1.0, 1.0, SIGNAL))
    return BoxModel(np.array([gain])).extended(effect, np.array([quantum]))


def fitter_of(u: np.ndarray) -> Fitter:
    """Return a fitter of a record without noise of the gain 0 and the quantum."""

    def run(model: BoxModel, rows: int | None = None) -> np.ndarray:
        return ((1.0 + model.p[0]) * quantised(u, float(model.values[0][0])))[:rows, None]

    y = run(model_of(0.0, QUANTUM))
    problem = SimpleNamespace(
        outputs=("y",),
        n=len(u),
        map=SimpleNamespace(uncertain=[SimpleNamespace(standard_deviation=1.0, minimum=-1.0, maximum=1.0)]),
        nominal=BoxModel(np.zeros(1)),
        noise=np.array([NOISE]),
        simulate=lambda models, rows=None: [run(model, rows) for model in models],
        residual=lambda found: (y[: len(found)] - found) / NOISE,
    )
    white = SimpleNamespace(whiten=lambda block: block, half_log=np.zeros(len(u)))
    return Fitter(problem, White([white]), parts_of(len(u)), DEFAULT)


def fit_of(fitter: Fitter, quantum: float) -> BoxFit:
    """Return the model with a quantum, its Jacobian that of the gain alone."""
    model = model_of(0.0, quantum)
    y = fitter.problem.simulate([model])[0]
    J = np.zeros((len(y), 1, 2))
    J[:, :, 0] = y / NOISE
    return BoxFit(model, 0, y, 0.0, 0.0, 0.0, J)


def errors_beside_a_quantum(rows: int) -> np.ndarray:
    """Return the errors of gain and quantum fitted to so many rows, over that of the gain alone."""
    fitter = fitter_of(SIGNAL[:: 400 // rows])
    fit = fit_of(fitter, QUANTUM)
    return errors_of(fitter, fit, slice(0, rows)) / (NOISE / float(np.sqrt(np.sum(fit.y * fit.y))))


def test_the_interval_of_a_quantum_holds_what_rounds_the_same() -> None:
    few, many = errors_beside_a_quantum(20), errors_beside_a_quantum(400)
    assert few[1] > 2.0 * many[1] > 0.01


def test_the_interval_beside_a_quantum_holds_where_another_that_does_as_well_leads() -> None:
    assert errors_beside_a_quantum(20)[0] > 1.1


def test_a_derivative_does_not_move_a_quantum() -> None:
    fitter = fitter_of(np.sin(40.0 * SIGNAL))
    found = fitter.fit(model_of(0.1, 1.01 * QUANTUM), 0)
    assert found is not None
    assert found.model.values[0][0] == 1.01 * QUANTUM
    assert abs(found.model.p[0]) < 0.02


def test_rows_further_on_choose_among_quanta_that_do_as_well_before() -> None:
    u = np.linspace(0.0, 1.0, 400)  # the last quarter holds the largest values
    fitter = fitter_of(u)
    off = fit_of(fitter, 1.003 * QUANTUM)
    rounded = np.rint(u / QUANTUM)
    assert np.array_equal(np.rint(u / off.model.values[0][0])[:300], rounded[:300])
    assert not np.array_equal(np.rint(u / off.model.values[0][0]), rounded)
    chosen, _ = of_alike(fitter, off, 1, DEFAULT.rest)
    assert np.array_equal(np.rint(u / chosen.model.values[0][0]), rounded)


def test_a_sifted_quantum_is_refined_between_its_own_neighbours(monkeypatch: pytest.MonkeyPatch) -> None:
    """The list that is scanned holds clusters of sifted quanta: next to the edge of one lies another, far off."""
    effect = model_of(0.0, QUANTUM).effects[0]
    grid = effect.kind.small(effect.scene)
    true = 0.7 * grid[1204] + 0.3 * grid[1205]  # the edge of its cluster is nearest

    class Sight:
        def __init__(self, *given: object) -> None:
            pass

        def sifted(self, effect: BoxEffect) -> tuple[float, ...]:
            return tuple(float(v) for k in (300, 1203, 5000) for v in grid[k - 1 : k + 2])

        def gains(self, effect: BoxEffect, values: tuple[float, ...], levels: tuple[int, ...] = ()) -> dict:
            return {k: SimpleNamespace(gain=-abs(v / true - 1.0), level=0) for k, v in enumerate(values)}

    monkeypatch.setattr(scanning, "_Sight", Sight)
    fitter = SimpleNamespace(settings=SimpleNamespace(screen=DEFAULT.screen))
    starts = scanning.scanned(fitter, [effect], None)[effect]
    assert abs(starts[0][-1] / true - 1.0) < 0.1 * (grid[1205] / grid[1204] - 1.0)
