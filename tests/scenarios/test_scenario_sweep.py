"""Sweeps over any scenario."""

import csv

import pytest

from orchestrator.cli import main

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
