"""Estimators against the independent simulator."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from benchmarks import paired_sum
from benchmarks.simulated import model_of
from orchestrator.cli import main
from orchestrator.errors import DesignError
from orchestrator.estimation import cramer_rao
from orchestrator.estimation.design import SEARCHED, MachineLimits, design, plant_of
from orchestrator.estimation.filter.innovations import innovations, simulate
from orchestrator.estimation.filter.model import NoiseLevels, affine_model
from orchestrator.estimation.likelihood import Likelihood, maximise
from orchestrator.estimation.methods import ekf
from orchestrator.estimation.methods.maximum_likelihood import fit_record
from orchestrator.estimation.problem import make_problem
from orchestrator.estimation.protocol import METHODS, NotApplicableError, estimator
from orchestrator.records.model_file import default_model, read_model
from orchestrator.records.record import Record, record_from_columns
from orchestrator.shared.results import as_plain, read
from orchestrator.shared.results.estimate import EstimateFound
from pyfmu_sources.drivetrain.equations import DEFAULTS
from tests.support.hidden_effects import one_encoder_case
from tests.support.independent_plant import make_record, write_csv
from tests.support.online_loop import run_case

MODEL = default_model()


def _record(alpha: float, seed: int, duration: float = 6.0, **options) -> tuple[Record, dict]:
    columns, truth = make_record({"alpha": alpha}, seed, duration, **options)
    return record_from_columns(columns, "test"), truth


@pytest.fixture(scope="module")
def exact() -> tuple[Record, dict]:
    """An exact twin: sharp contact, known noise, no rounding."""
    return _record(0.02, 21, excitation="closed_loop", contact="dead_zone", noise=(1e-4, 1e-4), counts=None)


@pytest.fixture(scope="module")
def fitted(exact: tuple[Record, dict]):
    return estimator("maximum_likelihood")(exact[0], MODEL)


def test_the_filter_without_noise_is_the_plant() -> None:
    record, truth = _record(0.01, 4, contact="dead_zone", noise=(0.0, 0.0), counts=None)
    assert record.theta_l is not None
    plant = affine_model({**DEFAULTS._asdict(), **truth["linear"], "alpha": 0.01})
    states = simulate(plant, record.u, record.step, np.zeros(5))
    np.testing.assert_allclose(states, truth["states"][:, :5], atol=1e-8)
    outputs = np.column_stack([record.theta_m, record.theta_l])
    run = innovations(plant, record.u, outputs, record.step, np.zeros(5), NoiseLevels((1e-4, 1e-4), (1e-9, 1e-9)))
    assert np.abs(run.errors).max() < 1e-9


def test_the_error_is_the_cramer_rao_bound(exact: tuple[Record, dict], fitted) -> None:
    record, truth = exact
    values = cramer_rao.truth_values(truth["linear"], 0.02, truth["states"][0, :5])
    bound = cramer_rao.error_bound(make_problem(record, MODEL), values, (1e-4, 1e-4))
    assert fitted.diagnostics["converged"]
    assert fitted.standard_error == pytest.approx(bound, rel=0.15)
    assert abs(fitted.alpha - 0.02) < 4.0 * bound
    assert bound < 1e-4 * 0.02 * 10


def test_interval_and_parameters_of_the_fit(exact: tuple[Record, dict], fitted) -> None:
    low, high = fitted.interval
    assert low < fitted.alpha < high
    assert high - low == pytest.approx(2.0 * 1.96 * fitted.standard_error, rel=0.2)
    for name, true in exact[1]["linear"].items():
        entry = fitted.diagnostics["parameters"][name]
        assert abs(entry["value"] - true) < 4.5 * entry["standard_error"]
    assert fitted.diagnostics["traversals"] > 3
    assert fitted.visible
    assert fitted.message == ""


def test_score_and_information_agree_with_differences_of_the_objective(exact: tuple[Record, dict], fitted) -> None:
    likelihood = Likelihood(make_problem(exact[0], MODEL))
    theta = likelihood.problem.start
    for name, entry in fitted.diagnostics["parameters"].items():
        theta[likelihood.problem.index(name)] = entry["value"]
    place = likelihood.problem.index("alpha")
    step = 2e-7
    values = []
    for sign in (-1.0, 1.0):
        moved = theta.copy()
        moved[place] += sign * step
        values.append(likelihood.at(moved).objective)
    point = likelihood.at(theta)
    for _ in range(3):
        gradient, information, likelihood = likelihood.derivatives(point, np.array([place]))
    assert (values[1] - values[0]) / (4.0 * step) == pytest.approx(gradient[0], abs=0.02 * math.sqrt(information[0, 0]))
    curvature = (values[0] + values[1] - 2.0 * point.objective) / (2.0 * step**2)
    assert curvature == pytest.approx(information[0, 0], rel=0.1)


def test_a_fit_leaves_the_likelihood_as_it_was(exact: tuple[Record, dict]) -> None:
    likelihood = Likelihood(make_problem(exact[0], MODEL))
    before, start = likelihood.information.copy(), likelihood.problem.start
    fit = maximise(likelihood, start, [likelihood.problem.index("alpha")], iterations=1)
    assert np.array_equal(likelihood.information, before)
    assert not np.array_equal(fit.likelihood.information, before)
    assert fit.likelihood.with_options(soft=True).soft
    assert not fit.likelihood.soft


@pytest.mark.slow
@pytest.mark.parametrize(("alpha", "seed"), [(0.005, 31), pytest.param(0.035, 32, marks=pytest.mark.night)])
def test_a_machine_that_is_five_per_cent_off(alpha: float, seed: int) -> None:
    record, _ = _record(alpha, seed, 8.0, excitation="levels")
    result = estimator("maximum_likelihood")(record, MODEL)
    assert result.alpha == pytest.approx(alpha, rel=0.01)
    assert abs(result.alpha - alpha) < 4.5 * result.standard_error


@pytest.mark.slow
def test_the_motor_encoder_alone_is_enough() -> None:
    record, _ = _record(0.03, 33, 8.0, excitation="levels")
    result = estimator("maximum_likelihood")(record.without_load_encoder(), MODEL)
    assert result.alpha == pytest.approx(0.03, rel=0.02)
    assert "i" not in result.diagnostics["parameters"]


@pytest.mark.parametrize("whole", [False, pytest.param(True, marks=[pytest.mark.night, pytest.mark.slow])])
def test_the_motor_encoder_of_a_weak_drive_is_enough(whole: bool) -> None:
    """A loop that asks for 0.3 N.m: torque noise that a strong drive hardly feels would hide all of the motion."""
    case = one_encoder_case(715003, 8.0)
    problem = make_problem(case.record, model_of(case))
    assert problem.units[0] == pytest.approx(0.1, rel=0.5)
    if not whole:
        return
    fit = fit_record(Likelihood(problem))
    assert fit.point.theta[problem.index("alpha")] == pytest.approx(case.truth["effects"]["alpha"], rel=0.02)


def test_no_gap_is_called_no_gap() -> None:
    record, _ = _record(0.0, 34, 4.0)
    result = estimator("maximum_likelihood")(record, MODEL)
    assert result.interval[0] == 0.0
    assert result.interval[1] < 1e-4
    assert not result.visible
    assert "no gap is seen" in result.message


@pytest.mark.parametrize("torque", [0.0, 1e-3])
def test_a_gap_below_the_noise_is_not_measured(torque: float) -> None:
    record, _ = _record(0.02, 3, 5.0, torque=torque)
    result = estimator("maximum_likelihood")(record, MODEL)
    assert not result.visible
    assert result.interval == (0.0, math.inf)
    assert "cannot be seen" in result.message


def test_a_gap_that_is_never_traversed_is_not_measured() -> None:
    time = np.arange(800) * 0.005
    torque = 40.0 + 20.0 * np.sin(9.0 * time)
    start = {"theta_m": (0.02 + 40.0 / 3300.0) * 3.984, "T_m": 40.0}
    columns, _ = make_record({"alpha": 0.02}, 35, u=torque, x0=start)
    result = estimator("maximum_likelihood")(record_from_columns(columns, "one flank"), MODEL)
    assert not result.visible
    assert "`design`" in result.message
    assert result.interval[1] > 0.02


@pytest.mark.parametrize("method", [name for name in METHODS if name not in ("maximum_likelihood", "two_encoders")])
def test_the_other_methods_come_near(method: str) -> None:
    record, _ = _record(0.03, 36, 20.0)
    result = estimator(method)(record, MODEL)
    assert result.alpha == pytest.approx(0.03, rel=0.2)
    assert result.standard_error < 0.006
    assert result.interval[0] < 0.03 < result.interval[1]


def test_the_paired_sum_needs_an_exact_twin() -> None:
    exact, _ = _record(0.05, 37, 3.0, mismatch=0.0, contact="dead_zone", noise=(0.0, 0.0), counts=None)
    assert paired_sum.estimate(exact, MODEL).alpha == pytest.approx(0.05, rel=0.05)
    real, _ = _record(0.005, 37, 20.0)
    assert abs(paired_sum.estimate(real, MODEL).alpha / 0.005 - 1.0) > 0.5


def test_the_twin_is_the_fmu(tmp_path: Path) -> None:
    record, _ = _record(0.02, 41, 4.0)
    file = tmp_path / "model.toml"
    file.write_text('[parameters]\nJ_l.value = 5.0\nalpha.value = 0.01\n"effects.load_torque.torque".value = 3.0\n')
    model = read_model(file)
    angle = paired_sum.twin(record, model, {"theta_m_start": 0.04, "theta_l_start": 0.01})
    plant = plant_of(model, 0.0)
    expected = simulate(plant, record.u, record.step, np.array([0.04, 0.0, 0.01, 0.0, 0.0]))
    np.testing.assert_allclose(angle, expected[:, 2], atol=1e-9)


@pytest.mark.parametrize("method", ["speed_difference", "torque_pulse", "operating_data"])
def test_methods_that_need_the_load_encoder_say_so(method: str) -> None:
    record, _ = _record(0.03, 38, 4.0)
    with pytest.raises(NotApplicableError, match="theta_l"):
        estimator(method)(record.without_load_encoder(), MODEL)


def test_the_online_estimator_settles_and_is_honest() -> None:
    cases = [run_case(800_000 + n, alpha) for n, alpha in enumerate((0.006, 0.012, 0.025, 0.05, 0.09))]
    assert all("failed" not in case for case in cases)
    for case in cases:
        assert case["estimate"] == pytest.approx(case["alpha"], rel=0.05)
        assert case["nees"] < 15.0
    assert np.mean([case["nees"] for case in cases]) < 4.0


def test_the_online_estimator_follows_the_motor_encoder_alone() -> None:
    record, _ = _record(0.03, 39, 10.0, excitation="levels")
    run = ekf.trace(record.without_load_encoder(), MODEL)
    assert abs(run.alpha[-1] - 0.03) < 0.1 * 0.03


def test_design_keeps_the_limits_and_beats_a_bad_excitation() -> None:
    time, candidates = design(MODEL, 0.01, MachineLimits(150.0, 20.0), duration=2.0)
    assert time.size == 400
    for candidate in candidates:
        assert candidate.torque <= 150.0
        assert candidate.speed <= 20.0
    assert candidates[0].name == SEARCHED
    assert candidates[0].bound < 0.9 * candidates[1].bound
    assert candidates[0].bound < 0.5 * candidates[-1].bound
    with pytest.raises(DesignError, match="`torque` must be a positive finite number"):
        design(MODEL, 0.01, MachineLimits(-1.0, 20.0))


@pytest.mark.night
@pytest.mark.slow
@pytest.mark.parametrize("seed", [43, 44])
def test_a_designed_record_measures_better_on_other_machines(seed: int) -> None:
    _, candidates = design(MODEL, 0.01, MachineLimits(250.0, 50.0), duration=3.0)
    errors = []
    for u in (candidates[0].u, None):
        record, truth = _record(0.01, seed, 3.0, u=u)
        result = estimator("maximum_likelihood")(record, MODEL)
        assert abs(result.alpha - 0.01) < 4.0 * result.standard_error
        errors.append(result.standard_error)
        assert np.abs(record.u).max() < 260.0
        assert np.abs(truth["states"][:, 1]).max() < 50.0
    designed, default = errors
    assert designed < 0.7 * default


def test_limits_that_show_nothing_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = tmp_path / "machine.toml"
    model.write_text('[columns.u]\nname = "Iq_ref [A]"\ntorque_constant = 0.42\nfactor = -1\n')
    words = ["--torque-limit", "0.001", "--duration", "1", "--motor-only", "--model", str(model)]
    assert main(["estimate", "--design", *words, "--out", str(tmp_path / "out")]) == 0
    shown = capsys.readouterr().out
    assert "–" in shown
    assert "No excitation within these limits shows a half-gap of 0.005 rad: raise `--torque-limit`" in shown
    results = json.loads((tmp_path / "out" / "estimate.json").read_text())["results"]
    assert results == {"schema_version": 1, "design": []}
    head, *rows = (tmp_path / "out" / "design.csv").read_text().splitlines()
    assert head == "time,u,Iq_ref [A]"
    asked = np.array([row.split(",")[1:] for row in rows], dtype=float)
    assert np.ptp(asked[:, 0]) > 0.0
    assert np.allclose(asked[:, 1], -asked[:, 0] / 0.42, rtol=1e-4)
    assert "design.csv has the request in `Iq_ref [A]` too" in shown


@pytest.fixture(scope="module")
def csv_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("records") / "record.csv"
    write_csv(path, make_record({"alpha": 0.02}, 40, 4.0)[0])
    return path


def test_the_command_writes_everything(csv_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["estimate", str(csv_file), "--method", "all", "--pictures", "--out", str(tmp_path / "out")]
    assert main(words) == 0
    document = json.loads((tmp_path / "out" / "estimate.json").read_text())
    results = document["results"]
    assert json.loads(json.dumps(as_plain(read(results, EstimateFound)))) == results
    assert document["command"] == "estimate"
    assert results["method"] == "maximum_likelihood"
    assert results["alpha"] == pytest.approx(0.02, rel=0.02)
    assert results["interval"][0] < 0.02 * 1.01
    assert set(results["estimates"]) == set(METHODS)
    assert {p.name for p in (tmp_path / "out").iterdir()} == {
        "estimate.csv",
        "estimate.json",
        "profile.csv",
        "corrected.toml",
        "online.csv",
        "estimate.png",
        "flanks.csv",
        "report.html",
    }
    shown = capsys.readouterr().out
    assert "Cramer-Rao" in "".join(shown.split())
    assert all(method.replace("_", " ") in shown.replace("_", " ") for method in METHODS)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["absent.csv"], "cannot be read"),
        ([], "`DATA` must be given, unless `--design` is"),
        (["--design", "--method", "ekf"], "`--method` must come with a record, but none is given"),
        (["absent.csv", "--size", "0.01"], "`--size` must come with `--design`, but that is not given"),
        (["absent.csv", "--duration", "5"], "`--duration` must come with `--design`, but that is not given"),
        (["--design", "--size", "1e300"], "`--size` must be between 1e-05 and 0.5, but is 1e+300"),
        (["--design", "--size", "0"], "`--size` must be between 1e-05 and 0.5, but is 0"),
        (["--design", "--torque-limit", "-3"], "`--torque-limit` must be between 0.001 and 1000000, but is -3"),
        (["--design", "--speed-limit", "1e9"], "`--speed-limit` must be between 0.001 and 100000, but is 1e+09"),
        (["--design", "--duration", "0.1"], "`--duration` must be between 1 and 10000, but is 0.1"),
        (["--design", "--duration", "1", "--rate", "50"], "`--duration` times `--rate` must be 200 to 200000 samples"),
        (["--design", "--rate", "5", "--duration", "100"], "`--rate` must be at least 23 to show a shaft"),
        (["--design", "--model", "absent.toml"], "cannot be read"),
    ],
)
def test_bad_input_ends_with_one_line(
    words: list[str], expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["estimate", *words, "--out", str(out)]) == 2
    error = capsys.readouterr().err
    assert expected in error
    assert error.count("\n") == 1
    assert not out.exists()


def test_a_place_that_cannot_be_written_is_refused_before_anything_is_computed(
    csv_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    out.write_text("a file")
    monkeypatch.setattr("orchestrator.estimation.apply.estimator", lambda name: pytest.fail("computed"))
    assert main(["estimate", str(csv_file), "--out", str(out)]) == 2
    assert "`--out` must be a writable directory" in capsys.readouterr().err
    assert out.read_text() == "a file"


def test_help_says_every_default(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["estimate", "--help"])
    shown = " ".join(capsys.readouterr().out.split())
    assert "(default: maximum_likelihood; two_encoders without a torque)" in shown
    for default in ("250", "50", "10", "200", "results/estimate"):
        assert f"(default: {default})" in shown


def test_nonlinear_models_are_sent_to_diagnose(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = tmp_path / "model.toml"
    model.write_text('[parameters."effects.quadratic_drag.coefficient"]\nvalue = 1.0\n')
    assert main(["estimate", "--design", "--model", str(model), "--out", str(tmp_path / "out")]) == 2
    assert "diagnose" in capsys.readouterr().err


@pytest.mark.slow
def test_a_large_gap_that_is_traversed_rarely_is_found() -> None:
    seed = 1_000_085
    columns, _ = make_record(
        {"alpha": 0.0941}, 100_000 + seed, 10.0, contact="dead_zone", noise=(1e-4, 1e-4), counts=None,
        excitation="closed_loop",
    )  # fmt: skip
    result = estimator("maximum_likelihood")(record_from_columns(columns, "rare"), MODEL)
    assert result.alpha == pytest.approx(0.0941, rel=1e-3)
    assert result.visible


def test_the_depth_of_a_soft_contact_is_estimated() -> None:
    record, _ = _record(0.02, 42, 6.0, excitation="levels")
    result = estimator("maximum_likelihood")(record, MODEL)
    entry = result.diagnostics["parameters"]["contact_depth"]
    # The simulator's damping sets in over 2 mrad, so that a damper from half of that on does as much.
    assert entry["value"] == pytest.approx(1e-3, rel=0.3)
    assert max(result.diagnostics["torque_noise"]) < 3e-3
