"""The paired loops: co-simulated, compiled and monolithic, they are the same."""

import csv
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import orchestrator as oc
from orchestrator.cli import main
from orchestrator.errors import ChildError, SimulationError
from orchestrator.paired.apart import run_pair_within
from orchestrator.paired.compiled_loop import COLUMNS, make_loop
from orchestrator.paired.cosimulation import LoopSession
from orchestrator.paired.experiment import Experiment
from orchestrator.paired.pair import run_pair
from orchestrator.paired.sizes import Sizes, read_sizes
from orchestrator.shared.isolation.jail import Jail
from tests.support.monolithic_loop import monolithic_loop

RECORD = Path(__file__).parents[2] / "docs" / "examples" / "machine.csv"


@pytest.mark.parametrize("model", ["dead_zone", "nordin"])
def test_the_paired_loop_matches_a_monolithic_simulation(fmus, model):
    experiment = replace(Experiment(), backlash_model=model)
    pair = run_pair(experiment, fmus, alpha=0.03)
    for run, alpha in ((pair.machine, 0.03), (pair.twin, 0.0)):
        truth = monolithic_loop(experiment, alpha)
        got = np.column_stack([run["theta_m"], run["theta_l"], run["theta_l_hat"]])
        assert np.abs(got - truth).max() < 1e-8


def test_compiled_and_co_simulated_loop_agree(fmus):
    experiment = replace(Experiment(), encoder_noise=1e-4)
    errors = experiment.encoder_errors(3)
    fast = make_loop(experiment).run(0.03, errors)
    with LoopSession(experiment, fmus) as session:
        for _ in range(2):
            run = session.run(0.03, errors)
            for name in ("theta_m", "theta_l", "theta_l_hat", "u"):
                column = fast[:, COLUMNS.index(name)]
                assert np.abs(run[name] - column).max() <= 1e-12 * max(1.0, np.abs(column).max())


def test_a_session_forgets_the_run_before(fmus):
    experiment = Experiment()
    with LoopSession(experiment, fmus) as session:
        first = session.run(0.05)["theta_l"].copy()
        session.run(0.002)
        assert np.array_equal(session.run(0.05)["theta_l"], first)


def test_estimate_of_a_pair(fmus):
    estimate = run_pair(Experiment(), fmus, alpha=0.024).estimate
    assert estimate.alpha == pytest.approx(0.024, rel=1e-4)
    outside = run_pair(Experiment(), fmus, alpha=0.3)
    assert outside.estimate is None
    assert "outside 0.002 to 0.1 rad" in outside.no_estimate


def test_the_fmus_that_a_pair_chooses_give_the_bits_of_the_python_ones(fmus):
    chosen, python = oc.run_pair(0.024, noise=1e-4, seed=3), replace(Experiment(), encoder_noise=1e-4)
    expected = run_pair(python, fmus, 0.024, 3)
    assert chosen.run.total == expected.total
    assert all(np.array_equal(chosen.run.machine[name], expected.machine[name]) for name in chosen.run.machine.signals)


def test_a_run_within_a_time_is_the_run_or_says_why_not(fmus, monkeypatch):
    inside = run_pair_within(60.0, Experiment(), fmus, 0.024, 3, {"plant.J_l": 5.5})
    here = run_pair(Experiment(), fmus, 0.024, 3, {"plant.J_l": 5.5})
    assert (inside.total, inside.estimate) == (here.total, here.estimate)
    with pytest.raises(SimulationError, match=r"must take at most 0.05 s \(`time_limit`\), but takes longer"):
        run_pair_within(0.05, Experiment(), fmus, 0.024)

    def end(*_, **more):
        raise ChildError("it was ended by signal 9", "signal")

    monkeypatch.setattr(Jail, "call", end)
    with pytest.raises(SimulationError, match="the run must come to its end, but it was ended by signal 9"):
        run_pair_within(60.0, Experiment(), fmus, 0.024)


@pytest.mark.parametrize(
    ("text", "specification", "count"),
    [
        ("random:1", "lograndom:0.002:0.1", 1), ("random:1000000000", "lograndom:0.002:0.1", 10**9),
        ("range:0.002:0.1:1", "range:0.002:0.1:1", 0), (" 0.01,0.02 ", "0.01,0.02", 0),
    ],
)  # fmt: skip
def test_sizes_that_are_just_allowed(text, specification, count):
    assert read_sizes(text, Experiment()) == Sizes(specification, count)


def test_simulate_command(tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["simulate", "--alpha", "0.02", "--noise", "1e-4", "--out", str(out)]) == 0
    assert "estimated half-gap" in capsys.readouterr().out
    assert sorted(p.name for p in out.iterdir()) == ["report.html", "simulate.csv", "simulate.json"]
    results = json.loads((out / "simulate.json").read_text())["results"]
    assert results["estimate"]["lower"] <= 0.02 <= results["estimate"]["upper"]
    rows = (out / "simulate.csv").read_text().splitlines()
    assert len(rows) == 2002


def test_pictures_are_drawn_where_they_are_asked_for_and_an_older_one_does_not_stay(tmp_path, capsys):
    words, picture = ["simulate", "--alpha", "0.02", "--out", str(tmp_path)], tmp_path / "simulate.png"
    assert main([*words, "--pictures"]) == 0
    assert "simulate.png" in capsys.readouterr().out
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert main(words) == 0
    assert "simulate.png" not in capsys.readouterr().out
    assert not picture.exists()


@pytest.mark.parametrize("words", [["simulate"], ["inspect", "short.csv"]], ids=lambda words: words[0])
def test_what_no_picture_is_asked_of_loads_no_matplotlib(words, tmp_path):
    log = tmp_path / "short.csv"
    words = [str(log) if word == log.name else word for word in words]
    log.write_text("".join(RECORD.read_text().splitlines(keepends=True)[:401]))
    code = "import sys; from orchestrator.cli import main; main(sys.argv[1:]); print('matplotlib' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code, *words, "--out", str(tmp_path)], capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-1] == "False"


def test_sweep_command_is_reproducible_and_complete(tmp_path, capsys):
    words = ["sweep", "--sizes", "random:4", "--noise", "0,1e-4", "--seed", "5"]
    for name, workers in (("a", "1"), ("b", "2")):
        assert main([*words, "--workers", workers, "--out", str(tmp_path / name)]) == 0
    text = capsys.readouterr().out
    assert "MSE" in text
    assert (tmp_path / "a" / "sweep.csv").read_bytes() == (tmp_path / "b" / "sweep.csv").read_bytes()
    names = {p.name for p in (tmp_path / "a").iterdir()}
    assert {"sweep.csv", "sweep.json", "sweep.png"} <= names
    results = json.loads((tmp_path / "a" / "sweep.json").read_text())["results"]
    assert results["cases"] == 8
    assert results["failed"] == 0
    assert all(s["mean_percent"] < 0.5 for s in results["statistics"])
    rows = list(csv.DictReader((tmp_path / "a" / "sweep.csv").read_text(encoding="utf-8").splitlines()))
    sums = {level: {row["alpha"]: row["S"] for row in rows if float(row["noise"]) == level} for level in (0.0, 1e-4)}
    assert sums[0.0].keys() == sums[1e-4].keys()
    assert all(sums[0.0][alpha] != noisy for alpha, noisy in sums[1e-4].items())  # the noise reaches the loop
    for row in rows:
        off = abs(float(row["estimate"]) - float(row["alpha"]))
        assert float(row["error"]) == pytest.approx(off, abs=1e-12)
        assert float(row["error_percent"]) == pytest.approx(100.0 * off / float(row["alpha"]), abs=1e-9)


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--sizes", "0.5"], "`--sizes` must lie within the calibrated 0.002 to 0.1 rad"),
        (["--sizes", "0.01,nan"], "finite"),
        (["--sizes", "-0.01"], "finite and positive"),
        (["--sizes", "random:x"], "`--sizes` must be numbers such as"),
        (["--sizes", ""], "`--sizes` must be numbers such as"),
        (["--sizes", "0.01,,0.02"], "but is '0.01,,0.02'"),
        (["--sizes", "range:0.01:0.02"], "but is 'range:0.01:0.02'"),
        (["--sizes", "range:0.01:0.2:1000000000"], "within the calibrated 0.002 to 0.1 rad"),
        (["--sizes", "random:0"], "`--sizes` must have a count of 1 to 1,000,000,000, but is 'random:0'"),
        (["--samples", "3"], "`--samples` must be left out where `--vary` makes nothing random"),
        (["--sizes", "random:2", "--samples", "3"], "`--samples` must be left out with random `--sizes`"),
        (["--vary", "plant.J_l=random:5.4:5.8", "--samples", "0"], "`--samples` must be at least 1, but is 0"),
        (["--vary", "plant.J_l=rnage:1:2:3"], "`--vary` must be a list or of a kind among"),
        (["--noise", "-1"], "not negative"),
        (["--noise", "a"], "numbers"),
        (["--seeds", "0"], "`--seeds` must be 1 to 1,000,000,000, but is 0"),
        (["--seed", "-1"], "not be negative"),
        (["--scenario", "loop.toml"], "left out"),
        (["--experiment", "x"], "must be one of"),
        (["--backlash-model", "x"], "must be one of"),
        (["--vary", "plant.nothing=1,2"], "plant.nothing"),
        (["--workers", "0"], "workers"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(tmp_path, capsys, words, complaint):
    assert main(["sweep", "--sizes", "0.01", *words, "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert complaint in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_parquet_without_its_extra_is_refused_before_the_sweep(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("orchestrator.engine.table.find_spec", lambda name: None)
    assert main(["sweep", "--sizes", "0.01", "--noise", "0", "--parquet", "--out", str(tmp_path / "out")]) == 2
    assert "`--parquet` needs the extra [parquet]" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_word_that_is_no_number_is_one_line(capsys):
    with pytest.raises(SystemExit) as ending:
        main(["simulate", "--alpha", "abc"])
    assert ending.value.code == 2
    error = capsys.readouterr().err
    assert error.startswith("error: `--alpha` must be a number, but is 'abc'")
    assert error.count("\n") == 1


def test_unwritable_output(tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert main(["simulate", "--out", str(tmp_path / "file")]) == 2
    assert "writable directory" in capsys.readouterr().err
