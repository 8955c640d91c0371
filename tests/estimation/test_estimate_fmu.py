"""The online estimator as an FMU: one source, compiled or interpreted, and a loop that measures its own gap."""

from pathlib import Path

import numpy as np
import pytest

from orchestrator.building.build import ensure_built
from orchestrator.estimation.methods import ekf
from orchestrator.records.model_file import default_model
from orchestrator.records.record import Record, record_from_columns
from orchestrator.scenarios.scenario import load_scenario, simulate
from pyfmu_sources.estimators.backlash_estimator import FILTERS, FORGOTTEN, SIZE, WEIGHT, NoiseSettings, covariance
from pyfmu_sources.estimators.backlash_estimator_slave import (
    ALPHA_DEVIATION,
    ALPHA_HAT,
    CONTACT_HAT,
    FIRST_ESTIMATE,
    FIRST_SETTING,
    SAMPLE_TIME,
    THETA_L,
    THETA_M,
    BacklashEstimator,
    U,
)
from tests.support.independent_plant import make_record

OWN_GAP = Path(__file__).resolve().parents[2] / "docs" / "examples" / "own_gap.toml"
OUTPUTS = [ALPHA_HAT, ALPHA_DEVIATION, CONTACT_HAT]


@pytest.fixture(scope="module")
def record() -> Record:
    columns, _ = make_record({"alpha": 0.03}, 50, 2.0, excitation="levels")
    return record_from_columns(columns, "loop")


def _started(record: Record, **parameters: float) -> BacklashEstimator:
    slave = BacklashEstimator(instance_name="test")
    names = [variable.name for variable in slave.table]
    slave.set_real([names.index(name) for name in parameters], list(parameters.values()))
    slave.set_real([SAMPLE_TIME], [record.step])
    settings = ekf.default_settings(record, default_model())
    slave.set_real([FIRST_SETTING + n for n in range(len(settings))], list(settings))
    assert record.theta_l is not None
    slave.set_real([THETA_M, THETA_L], [record.theta_m[0], record.theta_l[0]])
    slave.setup_experiment(0.0, None)
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    return slave


def _steps(slave: BacklashEstimator, record: Record, first: int, last: int) -> list[list[float]]:
    assert record.theta_l is not None
    rows = []
    for n in range(first, last):
        inputs = [record.u[n], record.theta_m[n + 1], record.theta_l[n + 1]]
        slave.set_real([U, THETA_M, THETA_L], [float(value) for value in inputs])
        assert slave.do_step(n * record.step, record.step), slave.log_queue[-1].msg
        rows.append(slave.get_real(OUTPUTS))
    return rows


@pytest.mark.parametrize("share", [0.5, 2.0, *(pytest.param(share, marks=pytest.mark.night) for share in (0.7, 1.3))])
def test_a_half_gap_to_start_from_is_said_and_corrected(share: float) -> None:
    record = record_from_columns(make_record({"alpha": 0.03}, 51, 3.0, excitation="levels")[0], "loop")
    slave = _started(record, alpha_start=0.03 * share, alpha_spread=0.2)
    assert slave.get_real(OUTPUTS)[:2] == pytest.approx([0.03 * share, 0.006 * share], rel=0.1)
    rows = _steps(slave, record, 0, record.size - 1)
    assert rows[-1][0] == pytest.approx(0.03, rel=0.02)


def test_interpreted_and_compiled_agree(record: Record) -> None:
    rows = np.array(_steps(_started(record), record, 0, 150))
    run = ekf.trace(record.part(0, 200), default_model(), ekf.default_settings(record, default_model()))
    np.testing.assert_allclose(rows[:, 0], run.alpha[1:151], rtol=1e-6)
    np.testing.assert_allclose(rows[:, 1], run.deviation[1:151], rtol=1e-5)
    np.testing.assert_array_equal(rows[:, 2], run.contact[1:151])


def test_a_saved_state_goes_on_as_if_nothing_had_happened(record: Record) -> None:
    slave = _started(record)
    _steps(slave, record, 0, 20)
    saved = slave.saved()
    expected = _steps(slave, record, 20, 40)
    other = _started(record)
    _steps(other, record, 0, 20)
    _steps(other, record, 20, 30)
    other.restore(saved)
    again = []
    for n in range(20, 40):
        inputs = [record.u[n], record.theta_m[n + 1], record.theta_l[n + 1]]
        other.set_real([U, THETA_M, THETA_L], [float(value) for value in inputs])
        other.advance(n * record.step, record.step)
        again.append(other.get_real(OUTPUTS))
    assert again == expected


def test_the_fmu_estimates_the_gap(record: Record) -> None:
    fmpy = pytest.importorskip("fmpy")
    path = ensure_built(["BacklashEstimator"])["BacklashEstimator"]
    assert record.theta_l is not None
    signals = np.zeros(record.size, dtype=[("time", float), ("u", float), ("theta_m", float), ("theta_l", float)])
    signals["time"] = record.time
    signals["u"], signals["theta_m"], signals["theta_l"] = record.u, record.theta_m, record.theta_l
    result = fmpy.simulate_fmu(
        str(path),
        stop_time=record.duration,
        step_size=record.step,
        output_interval=record.step,
        input=signals,
        start_values={"sample_time": record.step},
        output=["alpha_hat", "alpha_deviation"],
    )
    assert result["alpha_hat"][-1] == pytest.approx(0.03, rel=0.1)
    assert 0.0 < result["alpha_deviation"][-1] < 0.006


def test_a_filter_that_diverges_is_dropped() -> None:
    from pyfmu_sources.estimators import backlash_estimator as source

    filters = [[0.0] * SIZE for _ in range(FILTERS)]
    source.begin(filters, 0.0, 1.0, 0.0, 0.0, NoiseSettings())
    filters[0][0] = float("nan")
    filters[3][covariance(0, 0)] = -1.0
    source.measure(filters, NoiseSettings(), 0.0, 0.0)
    alpha, deviation, best = source.combine(filters, FILTERS)
    assert best not in (0, 3)
    assert np.isfinite(alpha)
    assert np.isfinite(deviation)


def test_one_wild_sample_wakes_no_filter_that_was_forgotten(record: Record) -> None:
    """A host that reads outputs before it sets inputs makes such samples at every step: their angles are old."""
    slave = _started(record)
    n = 300
    _steps(slave, record, 0, n)
    kept = [f[WEIGHT] > FORGOTTEN for f in slave.__dict__["_filters"]]
    assert 0 < sum(kept) < FILTERS
    assert record.theta_l is not None
    wild = [float(record.u[n]), float(record.theta_m[n + 1]) + 0.05, float(record.theta_l[n + 1])]
    slave.set_real([U, THETA_M, THETA_L], wild)
    assert slave.do_step(n * record.step, record.step)
    assert slave.get_real([FIRST_ESTIMATE])[0] == pytest.approx(wild[1], abs=0.06)
    rows = _steps(slave, record, n + 1, n + 6)
    assert rows[-1][0] == pytest.approx(0.03, rel=0.3)
    run = [f[WEIGHT] > FORGOTTEN for f in slave.__dict__["_filters"]]
    assert all(before or not now for before, now in zip(kept, run, strict=True))


@pytest.mark.parametrize(
    ("alpha", "seed"), [(0.01, 3), *(pytest.param(*row, marks=pytest.mark.night) for row in ((0.02, 1), (0.06, 5)))]
)
def test_a_running_loop_estimates_its_own_gap(alpha: float, seed: int, tmp_path: Path) -> None:
    text = OWN_GAP.read_text(encoding="utf-8")
    changed = text.replace("alpha = 0.02", f"alpha = {alpha}").replace("seed = 1", f"seed = {seed}")
    path = tmp_path / "loop.toml"
    path.write_text(changed, encoding="utf-8")
    result = simulate(load_scenario(path))
    estimate, deviation = result["estimator.alpha_hat"][-1], result["estimator.alpha_deviation"][-1]
    assert result.time[-1] == 2.0
    assert estimate == pytest.approx(alpha, rel=0.05)
    assert abs(estimate - alpha) < 3.0 * deviation < 0.2 * alpha
