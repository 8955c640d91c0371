"""What a user is told of times, starts, gains and pairs of effects."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.cli import main
from orchestrator.diagnosis.blackbox.bank import BANK, BoxEffect, Surroundings
from orchestrator.diagnosis.blackbox.estimates import ValueEstimate, as_told, errors_of
from orchestrator.diagnosis.blackbox.fitting import Fitter
from orchestrator.diagnosis.blackbox.likelihood import BoxFit
from orchestrator.diagnosis.blackbox.mapping import InputEntry, Options, OutputEntry
from orchestrator.diagnosis.blackbox.model import BoxModel
from orchestrator.diagnosis.blackbox.noise import begins_elsewhere, lone_rows
from orchestrator.diagnosis.blackbox.reading import _unevenness, read_data
from orchestrator.diagnosis.blackbox.settings import DEFAULT
from orchestrator.diagnosis.blackbox.sites import alike_at_input
from orchestrator.shared.output import staged

NONE = np.zeros((1, 1))
SCENE = Surroundings(0.01, 1.0, 1.0, np.ones(3))


def effect(name: str, place: str = "u") -> BoxEffect:
    return BoxEffect(BANK[name], place, SCENE)


def estimate(value: float, error: float = 0.1) -> ValueEstimate:
    return ValueEstimate("x", value, error, (value - 2.0 * error, value + 2.0 * error), "")


def test_a_gain_is_told_as_the_factor():
    (gain,) = as_told(effect("input_gain"), (estimate(-1.995, 0.01),))
    assert gain.value == pytest.approx(-0.995)
    assert gain.interval == pytest.approx((-1.015, -0.975))
    assert as_told(effect("input_lag"), (estimate(0.2),))[0].value == 0.2


@pytest.mark.parametrize(
    ("name", "hold", "value", "said"),
    [
        ("input_delay", "linear", 0.0051, True),
        ("input_lag", "linear", 0.0049, True),
        ("input_delay", "linear", 0.0056, False),
        ("input_delay", "zero", 0.005, False),
        ("input_gain", "linear", 0.005, False),
    ],
)
def test_a_delay_of_half_a_row_may_be_a_matter_of_the_hold(name: str, hold: str, value: float, said: bool) -> None:
    problem = SimpleNamespace(
        map=SimpleNamespace(inputs={"u": SimpleNamespace(hold=hold)}),
        data=SimpleNamespace(step=0.04, factor=4), settings=DEFAULT,
    )  # fmt: skip
    assert alike_at_input(problem, [effect(name)], [(estimate(value),)]) == (("hold@u",) if said else (),)


@pytest.mark.parametrize(
    ("offset", "width", "place", "said"),
    [(0.5, 0.51, "u", True), (-0.5, 0.49, "u", True), (0.5, 0.9, "u", False), (0.5, 0.5, "v", False)],
)
def test_an_offset_and_a_dead_zone_as_wide_are_an_input_of_one_direction(offset, width, place, said):
    inputs = {name: SimpleNamespace(hold="zero") for name in ("u", "v")}
    problem = SimpleNamespace(
        map=SimpleNamespace(inputs=inputs), data=SimpleNamespace(step=0.04, factor=1), settings=DEFAULT
    )
    pair = [effect("input_offset"), effect("input_dead_zone", place), effect("input_lag")]
    values = [(estimate(offset, 0.02),), (estimate(width, 0.02),), (estimate(offset, 0.02),)]
    each = ("one_way@u",) if said else ()
    assert alike_at_input(problem, pair, values) == (each, each, ())


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: np.concatenate([t[:50], t[49:]]), ("row 51", "there twice")),
        (lambda t: np.delete(t, 50), ("row 51", "grows by 0.02 s", "rows are missing")),
        (lambda t: t + 0.004 * np.random.default_rng(1).random(t.size), ("by 0.01", "stamps alone jitter")),
        (lambda t: t + 0.03 * np.random.default_rng(1).random(t.size), ("stamps alone jitter",)),
        (lambda t: 0.0 * t, ("most rows grow by 0 s",)),
    ],
)
def test_times_that_do_not_grow_evenly_are_told_apart(change, words):
    told = _unevenness(change(0.01 * np.arange(100.0)), DEFAULT.read)
    assert all(word in told for word in words), told


@pytest.mark.parametrize(("factor", "row", "said"), [(1, 0, True), (1, 2, True), (1, 5, False), (4, 2, False)])
def test_a_record_that_begins_elsewhere_is_told(factor, row, said):
    residual = np.zeros((50, 2))
    residual[row:, 1] = 100.0
    problem = SimpleNamespace(outputs=["x", "v"], data=SimpleNamespace(factor=factor), residual=lambda y: residual + y)
    notes = begins_elsewhere(problem, np.zeros((50, 2)), DEFAULT.probe)
    assert len(notes) == said
    assert all("`v` is 100 times" in note and "[start]" in note for note in notes)


@pytest.mark.parametrize(("rows", "said"), [([], False), ([20], True), ([20, 200], True), ([20, 21, 22], False)])
def test_a_row_that_leaves_its_neighbours_is_told(rows, said):
    residual = np.random.default_rng(1).standard_normal((400, 2)) + np.linspace(0.0, 900.0, 400)[:, None]
    residual[rows, 1] += 60.0
    if len(rows) == 3:
        residual[23:, 1] += 60.0  # a jump that stays
    problem = SimpleNamespace(
        outputs=["x", "v"], data=SimpleNamespace(time=0.1 * np.arange(400)), residual=lambda y: residual + y
    )
    notes = lone_rows(problem, np.zeros((400, 2)), DEFAULT.probe)
    assert len(notes) == said
    assert all("`v`" in note and f"(so many: {len(rows)})" in note for note in notes)
    residual[::9, 1] += 60.0
    assert not lone_rows(problem, np.zeros((400, 2)), DEFAULT.probe)  # what comes often is the motion's own


def test_a_file_of_an_earlier_run_goes_where_this_one_writes_none(tmp_path):
    for written in (True, False):
        with staged(tmp_path, replaces=("corrected.ssp",)) as folder:
            (folder / "other").write_text("")
            if written:
                (folder / "corrected.ssp").write_text("")
        assert (tmp_path / "corrected.ssp").exists() is written
    (tmp_path / "corrected.ssp").write_text("kept")
    with pytest.raises(ValueError, match="fails"), staged(tmp_path, replaces=("corrected.ssp",)):
        raise ValueError("fails")
    assert (tmp_path / "corrected.ssp").read_text() == "kept"


@pytest.mark.parametrize("words", [["--part", "1:2"], ["--resample", "linear"], ["--rate", "100"], ["--no-search"]])
def test_options_that_do_nothing_with_an_fmu_are_refused(words, tmp_path, capsys):
    given = ["diagnose", "r.csv", "--fmu", "x.fmu", "--map", "m.toml", "--out", str(tmp_path / "out"), *words]
    assert main(given) == 2
    assert f"`{words[0]}` must be left out" in capsys.readouterr().err


def test_intervals_hold_over_the_rows_that_a_jacobian_has():
    """Where the FMU failed in the held-out part, the Jacobian is that of the rows that were looked at."""
    rng = np.random.default_rng(3)
    run, J = rng.standard_normal((40, 1)), rng.standard_normal((30, 1, 2))
    filters = [SimpleNamespace(whiten=lambda block: block)]
    fitter = SimpleNamespace(covariance=lambda fit, rows: 0.01 * np.eye(2), whitened=lambda y, k: y, ladder=filters)
    short, whole = (
        errors_of(fitter, BoxFit(BoxModel(np.zeros(2)), 0, run, 0.0, 0.0, 0.0, columns), slice(0, 30), noisy=False)
        for columns in (J, np.concatenate([J, np.zeros((10, 1, 2))]))
    )
    assert np.all(short >= 0.1)
    assert short == pytest.approx(whole)


def test_a_step_that_is_no_number_is_none():
    fitter = object.__new__(Fitter)
    fitter.step = lambda *words: np.array([np.nan])
    assert fitter._moved(BoxModel(np.zeros(1)), NONE, np.ones((1, 1, 1)), 0, slice(0, 1), 0.0, 0.0, 1) is None


def test_times_in_milliseconds_are_read_as_seconds(tmp_path):
    rows = "\n".join(f"{5 * k},{k % 7},{k % 5}" for k in range(400))
    (tmp_path / "r.csv").write_text(f"ms,u,y\n{rows}\n")
    given = SimpleNamespace(
        options=Options(time="ms", time_factor=1e-3), inputs={"u": InputEntry("u")}, outputs={"y": OutputEntry("y")},
        signals={}, units={},
    )  # fmt: skip
    assert read_data(tmp_path / "r.csv", given).step == pytest.approx(5e-3)
