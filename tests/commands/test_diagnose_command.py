"""The command: contract of its JSON, the corrected FMU, and what it refuses."""

import json
from pathlib import Path

import numpy as np
import pytest

from orchestrator.cli import main
from orchestrator.fmi.model_description import read_description
from orchestrator.shared.results import as_plain, read
from orchestrator.shared.results.diagnose import DiagnoseFound
from tests.support.independent_plant import make_record, write_csv


@pytest.fixture(scope="module")
def result(tmp_path_factory) -> tuple[Path, dict]:
    folder = tmp_path_factory.mktemp("diagnose")
    for name, seed in (("loose gear", 61), ("other", 62)):
        linear = {"k": 3400.0, "J_l": 5.4}
        columns, _ = make_record({"alpha": 0.005}, seed, 12.0, substeps=50, mismatch=0.0, linear=linear)
        write_csv(folder / f"{name}.csv", columns)
    out = folder / "out"
    arguments = ["diagnose", str(folder / "loose gear.csv"), "--validate", str(folder / "other.csv"), "--out", str(out)]
    assert main([*arguments, "--pictures"]) == 0
    return out, json.loads((out / "diagnose.json").read_text())


@pytest.mark.slow(shares="result")
def test_json_keeps_the_contract(result) -> None:
    _, document = result
    assert document["command"] == "diagnose"
    results = document["results"]
    assert json.loads(json.dumps(as_plain(read(results, DiagnoseFound)))) == results
    assert results["verdict"] == "effects"
    assert results["schema_version"] == 4
    (effect,) = (one for one in results["effects"] if one["grade"] != "possible")
    assert {"name", "site", "grade", "parameters", "gain", "t", "explains", "family", "block_values"} <= set(effect)
    assert (effect["name"], effect["site"], effect["grade"]) == ("backlash", "shaft", "certain")
    assert set(effect["parameters"]["alpha"]) == {"value", "standard_error", "interval", "unit"}
    low, high = effect["parameters"]["alpha"]["interval"]
    assert low < 0.005 < high < 1.02 * low
    assert effect["parameters"]["alpha"]["value"] == pytest.approx(0.005, rel=0.02)
    assert set(results["parameters"]["k"]) == {"nominal", "value", "standard_error", "interval", "unit"}
    assert results["parameters"]["k"]["interval"][0] < 3400.0 < results["parameters"]["k"]["interval"][1]
    assert results["parameters"]["k"]["value"] == pytest.approx(3400.0, rel=0.02)
    assert set(results["remaining"]["torque"]) == {"motor", "load"}
    for signal in ("theta_m", "theta_l"):
        misfit = results["test"][0]["misfit"][signal]
        assert misfit["final"] < 0.1 * misfit["nominal"]
        other = results["validation"]["misfit"][signal]
        assert other["final"] < 0.1 * other["nominal"]
    assert not results["test"][0]["worse"]


@pytest.mark.slow(shares="result")
def test_a_model_of_no_trust_is_not_offered_for_use(result, capsys) -> None:
    out, _ = result
    record = out.parent / "loose gear.csv"
    assert main(["diagnose", str(record), "--no-search", "--out", str(out.parent / "red")]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "Trust: red" in said
    assert "Drivetrain_loose_gear.fmu, which must not be used" in said
    assert "for any FMI 2.0 tool" not in said


@pytest.mark.slow(shares="result")
def test_corrected_fmu_has_the_corrected_start_values(result) -> None:
    out, document = result
    path = Path(document["results"]["model"])
    assert path == out / "Drivetrain_loose_gear.fmu"
    starts = {variable.name: variable.start for variable in read_description(path).model.variables.values()}
    assert starts["alpha"] == document["results"]["effects"][0]["parameters"]["alpha"]["value"]
    assert starts["k"] == document["results"]["parameters"]["k"]["value"]
    assert document["results"]["cosimulation"]["largest_difference_from_compiled"] < 1e-9
    assert (out / "diagnose.png").stat().st_size > 10_000


@pytest.fixture(scope="module")
def columns() -> dict:
    return make_record({}, 63, 4.0, substeps=25)[0]


NOISE = np.random.default_rng(0).standard_normal((800, 2)) * [3e-4, 1e-4]
SPOILED = {
    "zero": (lambda c: {name: np.zeros(800) for name in ("u", "theta_m", "theta_l")}, "`u` must drive the machine"),
    "still": (lambda c: {"theta_m": NOISE[:, 0], "theta_l": NOISE[:, 1]}, "nothing moves"),
    "constant": (lambda c: {"u": np.ones(800), "theta_m": np.ones(800), "theta_l": np.ones(800)}, "nothing moves"),
    "stuck": (lambda c: {"theta_l": np.full(800, 0.2)}, "stuck"),
    "sign": (lambda c: {"u": -c["u"]}, "sign"),
    "degrees": (lambda c: {"theta_m": np.degrees(c["theta_m"]), "theta_l": np.degrees(c["theta_l"])}, "degrees"),
    "huge": (lambda c: {"theta_m": 1e200 * c["theta_m"]}, "row 2"),
    "huge torque": (lambda c: {"u": 1e9 * c["u"]}, "times the model's inertia"),
}


@pytest.mark.parametrize("name", SPOILED)
def test_spoiled_records_are_refused_in_one_line(tmp_path, capsys, columns, name) -> None:
    write_csv(tmp_path / "good.csv", columns)
    write_csv(tmp_path / "spoiled.csv", columns | SPOILED[name][0](columns))
    good, spoiled, out = (str(tmp_path / n) for n in ("good.csv", "spoiled.csv", "out"))
    for arguments in ([spoiled], [good, "--validate", spoiled]):
        assert main(["diagnose", *arguments, "--out", out]) == 2
        error = capsys.readouterr().err
        assert error.startswith("error: spoiled.csv: ")
        assert error.count("\n") == 1
        assert SPOILED[name][1] in error
        assert not Path(out).exists()


def test_place_that_cannot_be_written_is_refused_before_the_computation(tmp_path, capsys, columns, monkeypatch) -> None:
    write_csv(tmp_path / "good.csv", columns)
    (tmp_path / "file").write_text("here\n")
    monkeypatch.setattr("orchestrator.api.diagnose.diagnose", lambda *_: pytest.fail("computed"))
    assert main(["diagnose", str(tmp_path / "good.csv"), "--out", str(tmp_path / "file")]) == 2
    assert "`--out` must be a writable directory" in capsys.readouterr().err
    assert (tmp_path / "file").read_text() == "here\n"


def test_model_that_is_too_fast_for_the_record_is_refused(tmp_path, capsys, columns) -> None:
    write_csv(tmp_path / "good.csv", columns)
    (tmp_path / "model.toml").write_text("[parameters.c]\nvalue = 1e7\n")
    arguments = [str(tmp_path / "good.csv"), "--model", str(tmp_path / "model.toml"), "--out", str(tmp_path / "out")]
    assert main(["diagnose", *arguments]) == 2
    assert "time constants" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["missing.csv", "short.csv"])
def test_what_cannot_be_read_is_refused_in_one_line(tmp_path, capsys, name) -> None:
    (tmp_path / "short.csv").write_text("time,u,theta_m\n0,1,2\n")
    assert main(["diagnose", str(tmp_path / name), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()
