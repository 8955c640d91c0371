"""Sweeps over any scenario."""

import csv

import pytest

from orchestrator.cli import main
from orchestrator.master.protocol import Variable
from orchestrator.master.values import coerce_value
from tests.support.answers_fmu import build_answers_fmu
from tests.support.c_fmu import have_compiler

SCENARIO = """
name = "Torque step"
stop = 0.2
record = ["plant.theta_m", "plant.contact"]

[instances.plant]
fmu = "Drivetrain"
parameters = { alpha = 0.02 }

[[sources]]
kind = "step"
to = "plant.u"
time = 0.1
after = 50.0

[master]
step = 1e-3
"""


@pytest.fixture
def scenario(tmp_path, fmus):
    path = tmp_path / "step.toml"
    path.write_text(SCENARIO)
    return path


def test_a_grid_over_any_parameter(scenario, tmp_path, capsys):
    out = tmp_path / "out"
    words = ["--vary", "plant.alpha=0.01,0.02", "--vary", "plant.J_m=sobol:0.3:0.5", "--samples", "2"]
    assert main(["sweep", "--scenario", str(scenario), *words, "--out", str(out)]) == 0
    with (out / "sweep.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [row["plant.alpha"] for row in rows] == ["0.01", "0.01", "0.02", "0.02"]
    assert len({row["plant.J_m"] for row in rows}) == 2
    by_inertia = sorted(rows, key=lambda row: float(row["plant.J_m"]))
    assert float(by_inertia[0]["plant.theta_m.max"]) > float(by_inertia[-1]["plant.theta_m.max"])
    assert all(row["status"] == "done" for row in rows)
    assert "4 cases, 0 failed" in capsys.readouterr().out
    assert not (out / "sweep.journal").exists()


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        ([], "`--vary` must name at least one parameter"),
        (["--vary", "plant.k=-1"], "plant.k"),
        (["--vary", "plant.nothing=1"], "plant.nothing"),
        (["--vary", "engine.k=1"], "engine"),
        (["--vary", "plant.k"], "NAME=SPECIFICATION"),
        (["--vary", "plant.u=1,2"], "plant.u: must name an input that nothing feeds"),
    ],
)
def test_bad_input(scenario, tmp_path, capsys, words, complaint):
    assert main(["sweep", "--scenario", str(scenario), *words, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert complaint in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_missing_scenario(tmp_path, capsys):
    assert (
        main(["sweep", "--scenario", str(tmp_path / "none.toml"), "--vary", "a.b=1", "--out", str(tmp_path / "o")]) == 2
    )
    assert "none.toml" in capsys.readouterr().err


@pytest.mark.skipif(not have_compiler(), reason="there is no C compiler")
@pytest.mark.parametrize("words", ["true,false", "1,0"])
def test_a_boolean_is_swept_as_words_or_numbers(tmp_path, words):
    build_answers_fmu(tmp_path, parameters=True)  # whose slope is doubled while it is on
    (tmp_path / "s.toml").write_text(
        'stop = 1.0\nrecord = ["a.x"]\n[master]\nalgorithm = "gauss_seidel"\nstep = 0.1\n[instances.a]\n'
        'fmu = "Answers.fmu"\nparameters = { u = 1.0 }\n', encoding="utf-8",
    )  # fmt: skip
    given = ["--scenario", str(tmp_path / "s.toml"), "--vary", f"a.on={words}", "--out", str(tmp_path / "out")]
    assert main(["sweep", *given]) == 0
    with (tmp_path / "out" / "sweep.csv").open(encoding="utf-8") as file:
        on, off = (float(row["a.x.last"]) for row in csv.DictReader(file))
    assert on == pytest.approx(2.0 * off)
    assert off > 0.0


def test_a_number_of_no_item_is_refused_with_the_numbers_that_are():
    mode = Variable("mode", "parameter", "Enumeration", items=(("slow", 2), ("fast", 5), ("off", -1)))
    assert [coerce_value(mode, value) for value in (5, -1.0, "slow")] == [(5, None), (-1, None), (2, None)]
    for wrong in (3, 0, 2.5, 1e9):
        assert coerce_value(mode, wrong)[0] is None
    assert coerce_value(mode, 3)[1] == "must be one of 2 (slow), 5 (fast), -1 (off), but is 3"
