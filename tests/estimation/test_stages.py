"""In which stage of a train the gap is: the filter's step, the fits' answers on independent records, and refusals."""

import json
import math
from dataclasses import replace

import msgspec
import numpy as np
import pytest

import orchestrator as oc
from orchestrator.building.translation.kernel_arrays import plain_array
from orchestrator.cli import main
from orchestrator.estimation.filter.held_torque import delay
from orchestrator.estimation.filter.innovations import KERNELS, _arrays
from orchestrator.estimation.filter.model import TRAIN, affine_model
from orchestrator.estimation.likelihood import Likelihood
from orchestrator.estimation.problem import OFFSET
from orchestrator.estimation.settings import DEFAULT_SETTINGS
from orchestrator.estimation.stages.fit import fit_stages, look_nearby, move_share
from orchestrator.estimation.stages.location import locate
from orchestrator.estimation.stages.problem import GAPS, SHARE, TOTAL, make_problem
from orchestrator.records.record import record_from_columns
from tests.support.independent_plant import write_csv
from tests.support.two_stage_record import FRICTION, NOMINAL, make_two_stage_record

STEP, HALVES, LAG = 1e-3, (0.01, 0.004), 5e-3
MODEL = 'fmu = "TwoStageTrain"\n[parameters.J_s]\nvalue = {}\n'


def model_of(folder, share, more=""):
    path = folder / "train.toml"
    path.write_text(MODEL.format(share * NOMINAL["J_m"]) + more, encoding="utf-8")
    return path


def train():
    """Return the arrays that ``propagate`` takes, of the nominal train with a gap in both stages."""
    halves = {f"alpha_{stage}": half for stage, half in enumerate(HALVES, start=1)}
    return _arrays(affine_model(NOMINAL | halves | {"tau": LAG}, TRAIN), STEP)


def advanced(arrays, x):
    x, total, end = x.copy(), np.empty((7, 7)), np.empty(7)
    KERNELS[2].propagate(*arrays, STEP, np.array([30.0, -1.0, -2.0]), x, total, end)
    return x, total


def state(first, second, fast, middle, slow):
    """Return a state by its twists in half-gaps and its speeds of motor, intermediate shaft and load."""
    load = 0.2
    shaft = NOMINAL["i_2"] * (load + second * HALVES[1])
    return np.array([NOMINAL["i_1"] * (shaft + first * HALVES[0]), fast, shaft, middle, load, slow, 21.0])


# Floats in both gaps; meets in stage 1; meets in stage 2; parts in stage 1; both stages change flank.
@pytest.mark.parametrize(
    "x",
    [
        state(0.0, 0.0, 2.0, 0.5, 0.1), state(0.95, 0.0, 4.0, 0.3, 0.0), state(1.02, 0.9, 2.0, 1.6, 0.0),
        state(1.02, 1.05, -6.0, 0.1, 0.1), state(-0.9, 0.8, -6.0, 2.0, 0.1),
    ],
)  # fmt: skip
def test_the_step_of_both_stages_has_its_jacobian_and_is_that_of_small_steps(x):
    arrays = train()
    after, jacobian = advanced(arrays, x)
    numeric = np.empty((7, 7))
    for n, size in enumerate((*(1e-8, 1e-6) * 3, 1e-3)):
        shift = size * np.eye(7)[n]
        numeric[:, n] = (advanced(arrays, x + shift)[0] - advanced(arrays, x - shift)[0]) / (2.0 * size)
    np.testing.assert_allclose(jacobian, numeric, rtol=1e-4, atol=1e-4 * np.abs(numeric).max())
    y, parts = x.copy(), 20_000
    p = NOMINAL
    for _ in range(parts):  # midpoint rule, flanks by signs alone

        def rates(z):
            torques = []
            for d, w, half, k, c in (
                (z[0] / p["i_1"] - z[2], z[1] / p["i_1"] - z[3], HALVES[0], p["k_1"], p["c_1"]),
                (z[2] / p["i_2"] - z[4], z[3] / p["i_2"] - z[5], HALVES[1], p["k_2"], p["c_2"]),
            ):
                torques.append(k * (d - math.copysign(half, d)) + c * w if abs(d) > half else 0.0)
            return np.array([
                z[1], (z[6] - 1.0 - torques[0] / p["i_1"] - p["b_m"] * z[1]) / p["J_m"],
                z[3], (torques[0] - torques[1] / p["i_2"] - p["b_s"] * z[3]) / p["J_s"],
                z[5], (torques[1] - 2.0 - p["b_l"] * z[5]) / p["J_l"],
                (30.0 - z[6]) / LAG,
            ])  # fmt: skip

        h = STEP / parts
        y = y + h * rates(y + 0.5 * h * rates(y))
    np.testing.assert_allclose(after, y, rtol=0, atol=2e-5 * np.abs(y - x).max() + 1e-7)


def test_a_late_torque_is_the_held_one_moved():
    u = np.array([1.0, -2.0, 4.0, 0.0, 3.0])
    np.testing.assert_allclose(delay(u, STEP, 2.0 * STEP), [1.0, 1.0, 1.0, -2.0, 4.0])
    np.testing.assert_allclose(delay(u, STEP, -STEP), [-2.0, 4.0, 0.0, 3.0, 3.0])
    times = np.arange(40) * STEP
    for late in (0.25, 3.7, -1.4):  # no lag of the drive is added: a square moves as it is
        np.testing.assert_allclose(delay(times**2, STEP, late * STEP)[6:-6], (times[6:-6] - late * STEP) ** 2)


def likelihood_of(folder, effects, seed, share, **given):
    columns, truth = make_two_stage_record(effects, seed, share=share, **given)
    model = oc.read_model(model_of(folder, share))
    return Likelihood(make_problem(record_from_columns(columns, "record"), model)), truth


def test_at_the_truth_the_innovations_are_white(tmp_path):
    """A machine without torque noise and friction: the filter predicts it up to the encoders' noise."""
    effects = {"alpha_1": 0.012, "alpha_2": 0.008}
    likelihood, truth = likelihood_of(tmp_path, effects, 3, 0.05, torque_noise=0.0, counts=None)
    problem = likelihood.problem
    theta = problem.start
    for name, value in truth["linear"].items():
        if name in problem.names:
            theta[problem.index(name)] = value
    total = 0.012 / NOMINAL["i_2"] + 0.008
    theta[problem.index(TOTAL)], theta[problem.index(SHARE)] = total, 0.008 / total
    theta[problem.index(OFFSET)] = 0.0
    found = likelihood.run(theta)
    white = (found.errors / np.sqrt(found.variances))[100:]
    assert np.all(np.abs(np.std(white, axis=0) - 1.0) < 0.1)
    for n in range(2):
        assert abs(np.corrcoef(white[1:, n], white[:-1, n])[0, 1]) < 4.0 / math.sqrt(white.shape[0])
    moved = theta.copy()
    moved[problem.index(TOTAL)] *= 1.2
    assert likelihood.at(moved).deviance > likelihood.at(theta).deviance + 100.0


def test_the_kernel_in_machine_code_has_the_bits_of_plain_python(tmp_path, monkeypatch):
    likelihood, _ = likelihood_of(tmp_path, {"alpha_1": 0.004} | FRICTION, 5, 0.2, duration=0.2)
    theta = likelihood.problem.start
    theta[likelihood.problem.index(TOTAL)] = 0.003
    fast = likelihood.run(theta)
    calls, kernels = [], KERNELS[2]

    class Recorder:
        def __getattr__(self, name):
            def call(*values):
                calls.append((name, values))
                return getattr(kernels, name)(*values)

            return call

    monkeypatch.setitem(KERNELS, 2, Recorder())
    likelihood.run(theta)
    monkeypatch.undo()
    name, values = calls[-1]
    assert name == "run_filter"
    plain = [plain_array(v) if isinstance(v, np.ndarray) else v for v in values]
    KERNELS[2].python.run_filter(*plain)
    assert plain[-5].tolist() == fast.errors.ravel().tolist()
    assert plain[-4].tolist() == fast.variances.ravel().tolist()


@pytest.mark.parametrize(
    ("halves", "answer"), [
        # By day the command names stage 2, and the intervals of both are looked at.
        pytest.param((0.02, 0.0), "1", marks=pytest.mark.night),
        pytest.param((0.0, 0.012), "2", marks=pytest.mark.night),
        pytest.param((0.014, 0.008), "both", marks=pytest.mark.night),
    ],
)  # fmt: skip
def test_the_stage_is_named_and_its_gap_measured(tmp_path, halves, answer):
    """Friction that the model lacks, a torque 2 ms late and other noise: 4 % are far more than the fits err by."""
    effects = dict(zip(("alpha_1", "alpha_2"), halves, strict=True)) | FRICTION
    likelihood, _ = likelihood_of(tmp_path, effects, 11, 0.2, late=0.002, torque=25.0)
    fits = fit_stages(likelihood, DEFAULT_SETTINGS.stages, lambda what, share: None)
    found = locate(fits, DEFAULT_SETTINGS.stages)
    assert found.answers == (answer,)
    for gap, half in zip(found.stages, halves, strict=True):
        assert abs(gap.alpha - half) <= 0.04 * max(halves)
        assert gap.interval[0] <= gap.alpha <= gap.interval[1]
    for fit in (fits.first, fits.second, fits.both):
        assert fits.free.point.objective <= fit.point.objective
    assert all(found.behind[other] > 20.0 for other in ("1", "2", "both") if other != answer)


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """The fits of a record with a gap in both stages."""
    effects = {"alpha_1": 0.006, "alpha_2": 0.012} | FRICTION
    likelihood, _ = likelihood_of(tmp_path_factory.mktemp("both"), effects, 6, 0.2, torque=25.0)
    return fit_stages(likelihood, DEFAULT_SETTINGS.stages, lambda what, share: None)


def test_the_intervals_of_both_hold_every_optimum_that_is_about_as_good(both):
    # How far blocks differ depends on the optimum, and which of many is found on how the machine rounds.
    settings = msgspec.structs.replace(DEFAULT_SETTINGS.stages, most_scatter=1.0)
    own = locate(replace(both, shared=()), settings)
    assert own.answers == ("both",)
    likelihood, theta = both.free.likelihood, both.free.point.theta.copy()
    theta[likelihood.problem.index(SHARE)] += 0.2
    p = likelihood.parameters(theta)
    for behind, held in ((2.0, True), (30.0, False)):  # of the objective
        point = replace(both.free.point, theta=theta, objective=both.free.point.objective + behind)
        other = replace(both.free, point=point)
        found = locate(replace(both, shared=(other,)), settings)
        assert [gap.alpha for gap in found.stages] == [gap.alpha for gap in own.stages]
        for n, half in enumerate(p[name] for name in GAPS):
            assert (found.stages[n].interval[0] <= half <= found.stages[n].interval[1]) == held
            assert found.stages[n].interval[0] <= own.stages[n].interval[0]
            assert found.stages[n].interval[1] >= own.stages[n].interval[1]
    assert abs(own.total.alpha - (0.006 / p["i_2"] + 0.012)) < 1e-3


def test_a_fit_at_a_wrong_share_finds_a_better_one_nearby(both):
    """All else moves with the share, but for what is at its bound: of that the information says nothing."""
    likelihood, problem, theta = both.free.likelihood, both.free.likelihood.problem, both.free.point.theta.copy()
    place, quiet = problem.index(SHARE), problem.index("log_torque_middle")
    theta[quiet] = problem.unknowns[quiet].lower
    best = replace(both.free, point=likelihood.at(theta))
    column = list(best.free).index(place)
    away = 4.0 * math.sqrt(best.covariance[column, column])
    (moved,) = move_share(best, [away])
    assert math.isclose(moved.theta[place], theta[place] + away)
    assert moved.theta[quiet] == theta[quiet]
    alone = theta.copy()
    alone[place] += away
    assert moved.objective < likelihood.at(alone).objective
    assert look_nearby(replace(best, point=moved)).objective < moved.objective


def test_a_light_intermediate_shaft_leaves_a_set_that_holds_the_truth(tmp_path):
    likelihood, _ = likelihood_of(tmp_path, {"alpha_2": 0.008} | FRICTION, 23, 0.01)
    found = locate(fit_stages(likelihood, DEFAULT_SETTINGS.stages, lambda what, share: None), DEFAULT_SETTINGS.stages)
    assert "2" in found.answers
    assert len(found.answers) > 1
    assert " or " in found.answer
    assert found.stages[0].interval[0] == 0.0
    assert found.stages[1].interval[0] <= 0.008 <= found.stages[1].interval[1]
    assert abs(found.total.alpha / 0.008 - 1.0) < 0.03


def test_without_a_gap_none_is_seen(tmp_path):
    likelihood, _ = likelihood_of(tmp_path, {}, 2, 0.2)
    found = locate(fit_stages(likelihood, DEFAULT_SETTINGS.stages, lambda what, share: None), DEFAULT_SETTINGS.stages)
    assert found.answers == ()
    assert found.total.interval[0] == 0.0
    assert found.total.interval[1] < 1e-3


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with a record of a gap in stage 2 and its model."""
    folder = tmp_path_factory.mktemp("train")
    columns, _ = make_two_stage_record({"alpha_2": 0.015} | FRICTION, 7, share=0.2)
    write_csv(folder / "record.csv", columns)
    write_csv(folder / "motor.csv", {name: columns[name] for name in ("time", "u", "theta_m")})
    write_csv(folder / "angles.csv", {name: columns[name] for name in ("time", "theta_m", "theta_l")})
    model_of(folder, 0.2)
    return folder


def test_the_command_names_the_stage_in_table_json_and_page(place, capsys):
    out = place / "out"
    words = ["estimate", str(place / "record.csv"), "--model", str(place / "train.toml"), "--out", str(out)]
    assert main(words) == 0
    assert "The gap is in stage 2." in capsys.readouterr().out
    found = json.loads((out / "estimate.json").read_text(encoding="utf-8"))["results"]
    assert found["location"]["answers"] == ["2"]
    assert abs(found["location"]["stages"]["2"]["alpha"] / 0.015 - 1.0) < 0.03
    assert found["alpha"] == found["location"]["total"]["alpha"]
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "Twist of stage 2" in page
    assert "stage 1 alone" in page
    assert (out / "stages.csv").read_text(encoding="utf-8").count("\n") == 2001


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["motor.csv"], "column `theta_l` must be there to tell in which stage the gap is"),
        (["angles.csv"], "`u`"),
        (["record.csv", "record.csv"], "`DATA` must be one record with a TwoStageTrain, but is 2"),
        ([], "`DATA` must be given"),
        (["record.csv", "--method", "ekf"], "`--method` must be left out with a TwoStageTrain"),
        (["record.csv", "--motor-only"], "`--motor-only` must be left out with a TwoStageTrain"),
        (["record.csv", "--design"], "`--design` must be left out with a TwoStageTrain"),
        (["record.csv", "--cost"], "`--cost` must be left out with a TwoStageTrain"),
    ],
)
def test_what_a_train_cannot_take_is_refused_in_one_line(place, capsys, words, said):
    given = [str(place / word) if word.endswith(".csv") else word for word in words]
    out = ["--out", str(place / "none")]
    assert main(["estimate", *given, "--model", str(place / "train.toml"), *out]) == 2
    shown = capsys.readouterr().err
    assert said in shown
    assert len(shown.strip().splitlines()) == 1
    assert not (place / "none").exists()


def test_a_time_limit_ends_the_fit(place):
    with pytest.raises(oc.ConvergenceError, match="`time_limit` must be longer"):
        oc.locate_gap(place / "record.csv", oc.read_model(place / "train.toml"), time_limit=0.01)


def test_a_model_that_states_what_is_fitted_is_refused(place, tmp_path):
    more = '[parameters."effects.coulomb_friction.load.torque"]\nvalue = 1.0\n'
    with pytest.raises(oc.ScenarioError, match=r"`effects.coulomb_friction.load.torque` must be left out"):
        oc.locate_gap(place / "record.csv", oc.read_model(model_of(tmp_path, 0.2, more)))
    with pytest.raises(oc.ScenarioError, match="`fmu` must be TwoStageTrain to have two stages, but is Drivetrain"):
        oc.locate_gap(place / "record.csv", oc.read_model())


def test_other_workflows_point_to_the_one_for_trains(place):
    model = oc.read_model(place / "train.toml")
    with pytest.raises(oc.ScenarioError, match="`locate_gap`, or the command `estimate`"):
        oc.estimate(place / "record.csv", model)
    with pytest.raises(oc.ScenarioError, match="`estimate` with this model says in which stage"):
        oc.diagnose(place / "record.csv", model)


def test_an_inspection_foretells_nothing_of_a_train(place):
    said = oc.inspect(place / "record.csv", oc.read_model(place / "train.toml")).verdict()[0]
    assert said.startswith("What a record of a TwoStageTrain shows of gaps is not foretold")


def test_exchanged_columns_and_degrees_are_refused(place, tmp_path):
    table = np.genfromtxt(place / "record.csv", delimiter=",", names=True)
    columns = {name: table[name] for name in table.dtype.names}
    model = oc.read_model(place / "train.toml")
    assert np.ptp(columns["theta_l"]) < 2.0, "as the motor's angle it is a small travel"
    exchanged = columns | {"theta_m": columns["theta_l"], "theta_l": columns["theta_m"]}
    degrees = columns | {"theta_l": np.degrees(columns["theta_l"])}
    fast = columns | {"theta_m": np.degrees(columns["theta_m"])}
    wrong = {"to be exchanged": exchanged, "`theta_l` must be in radians": degrees, "`theta_m` must be": fast}
    for said, given in wrong.items():
        with pytest.raises(oc.RecordError, match=said):
            oc.locate_gap(record_from_columns(given, "wrong"), model)


def test_a_record_at_rest_is_refused_with_what_it_lacks(tmp_path):
    columns, _ = make_two_stage_record({"alpha_2": 0.015}, 4, share=0.2, duration=1.0, torque=1e-3)
    with pytest.raises(oc.RecordError, match=r"the motor moves by only .* log a motion that reverses"):
        oc.locate_gap(record_from_columns(columns, "rest"), oc.read_model(model_of(tmp_path, 0.2)))


@pytest.mark.night
def test_of_angles_in_degrees_no_stage_is_named(place, tmp_path):
    """Both are in degrees, so that the slope is right; what fits best is a gap of a radian."""
    columns, _ = make_two_stage_record({"alpha_2": 0.015} | FRICTION, 23, share=0.2)
    for name in ("theta_m", "theta_l"):
        columns[name] = np.degrees(columns[name])
    found = oc.locate_gap(record_from_columns(columns, "degrees"), oc.read_model(model_of(tmp_path, 0.2)))
    assert found.answers == ("1", "2", "both")
    assert not found.location.explained
    assert found.message.startswith("The model does not explain the record, so that no stage is named: check the units")
